"""Answers to questions about a site, as lines and tables of text for the terminal and the page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

from blast_env.site import Scenario
from blast_env.site.scene import Charge


@dataclass(frozen=True)
class AnswerTable:
    """A table of an answer.

    Attributes:
        title: Its title.
        headers: The headers.
        rows: The rows.
        text_columns: Number of leading text columns; the others are aligned to the right.
    """

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: int = 1

    @classmethod
    def of(
        cls, title: str, headers: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 1
    ) -> Self:
        """Return the table of some rows, of which `texts` columns are text."""
        return cls(title, (*headers,), tuple(map(tuple, rows)), texts)


AnswerPart: TypeAlias = str | AnswerTable
"""A line or a table."""


def building_words(scenario: Scenario, name: str) -> str:
    """Return the name of a building, with its title if that says more."""
    return titled(name, scenario.title_of(name))


def titled(name: str, title: str) -> str:
    """Return a name, with its title if that says more."""
    return name if "_".join(title.split()) in ("", name) else f"{name}: {title}"


def charge_text(charge: Charge) -> str:
    """Return a charge in words: `100 kg at (2, 4) m`."""
    x_m, y_m = charge.position_m
    return f"{charge.tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m"


def counted(charges: int) -> str:
    """Return a number of charges in words."""
    return "1 charge" if charges == 1 else f"{charges} charges"
