"""Answers to questions about a site, as lines and tables of text for the terminal and the page."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import TYPE_CHECKING, Final, Self, TypeAlias

from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.blast_site import Charge
from blast_env.statistics import Estimate

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

_SHOWN: Final = 0.0005  # the least share that is not printed as 0.0 %


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


def standing_lines(scenario: Scenario, buildings: "pd.DataFrame", column: str) -> Iterator[str]:
    """Yield the standing of the load on each building, with its reason.

    Args:
        scenario: It has the titles of the buildings.
        buildings: A table with `STANDING_COLUMNS`.
        column: The column with the name of the building.
    """
    for each in buildings.to_dict("records"):
        name = building_words(scenario, str(each[column]))
        yield f"standing of the load, {name}: {each['standing']} ({each['reason']})"


def with_errors(value: str, cells: str = "", sampled: str = "") -> str:
    """Return a number in words: `48.5 % +- 1.4 (cells), +- 2.1 (95 %, charges)`."""
    errors = [f"+- {cells} (cells)"] if cells else []
    errors += [f"+- {sampled}"] if sampled else []
    return " ".join([value, ", ".join(errors)]) if errors else value


def percent(share: float) -> str:
    """Return a share in per cent; a dash for NaN."""
    return "-" if isnan(share) else f"{100.0 * share:z.1f} %"


def points(error: float) -> str:
    """Return an error of a share in percentage points; empty for NaN."""
    return "" if isnan(error) else f"{100.0 * error:.1f}"


def worse(reduction: float) -> str:
    """Return words on a negative reduction, in brackets; empty for any other."""
    return " (the barrier makes it worse)" if reduction <= -_SHOWN else ""


def interval(estimate: Estimate) -> str:
    """Return an interval of shares in words; a dash for a single threat."""
    if isnan(estimate.low):
        return "-"
    return f"{percent(estimate.low)} to {percent(estimate.high)}"


def share_text(estimate: Estimate, error: float = nan, sampled: str = "charges") -> str:
    """Return a share with its errors: `48.5 % +- 1.4 (cells), +- 2.1 (95 %, charges)`.

    `sampled` names the samples of its interval.
    """
    half = points(estimate.value - estimate.low)
    return with_errors(percent(estimate.value), points(error), half and f"{half} (95 %, {sampled})")


def load_text(
    objective: ObjectiveSection, estimate: Estimate, error: float = nan, sampled: str = "charges"
) -> str:
    """Return a load with its unit and its errors; see `share_text`."""

    def number(load: float) -> str:
        return objective.text(load).removesuffix(f" {objective.unit}")

    half = "" if isnan(estimate.low) else number(estimate.value - estimate.low)
    cells = "" if isnan(error) else number(error)
    return with_errors(objective.text(estimate.value), cells, half and f"{half} (95 %, {sampled})")
