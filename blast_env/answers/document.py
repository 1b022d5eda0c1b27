"""Documents: sections, lines, tables and pictures, with numbers that carry unit, error and flag.

A number has one format everywhere (`Number`). Renderers choose only its signs: plain letters for
the terminal, typographic ones for pages.
"""

from base64 import b64encode
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor, isfinite, isnan, log10, nan
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, Self, TypeAlias

from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.structures import without_facade
from blast_env.statistics import Estimate
from blast_env.units import MS_PER_S, PA_PER_KPA

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

_FIGURES: Final = 3  # of a number
_ERROR_FIGURES: Final = 2
_ROUNDING: Final = 1e-9
_PERCENT: Final = 100.0
_SHOWN: Final = 0.0005  # the least share that is not printed as 0.0 %


class Signs(NamedTuple):
    """The signs of numbers.

    Attributes:
        plus_minus: Before an error.
        minus: Before a negative number.
        none: In the place of a number that is not known.
    """

    plus_minus: str
    minus: str
    none: str


PLAIN: Final = Signs("+-", "-", "-")
"""The signs of the terminal."""

TYPOGRAPHIC: Final = Signs("\N{PLUS-MINUS SIGN}", "\N{MINUS SIGN}", "\N{EN DASH}")
"""The signs of pages."""


@dataclass(frozen=True)
class Number:
    """A number as readers see it: `1,245 Pa s +- 12 (cells), +- 80 (95 %, charges)`.

    It has three significant digits and all those before the point, or the given decimals; its error
    two significant digits, or the same decimals.

    Attributes:
        value: The value; NaN for one that is not known.
        unit: Its unit; empty where a header or a line has it.
        error: Its grid error, in its unit; NaN without.
        digits: Decimals of both; `None` for significant digits.
        spread: Half of its 95 % interval over samples; NaN without.
        sampled: What was sampled for that; with it, each error has its name beside it.
        flag: Words after it.
    """

    value: float
    unit: str = ""
    error: float = nan
    digits: int | None = None
    spread: float = nan
    sampled: str = ""
    flag: str = ""

    def text(self, signs: Signs = PLAIN) -> str:
        """Return the number with its errors, its unit and its flag."""
        if not isfinite(self.value):
            return signs.none
        errors = []
        if isfinite(self.error):
            named = " (cells)" if self.sampled else ""
            errors.append(self._error(self.error, signs) + named)
        if isfinite(self.spread):
            errors.append(f"{self._error(self.spread, signs)} (95 %, {self.sampled})")
        value = _digits(self.value, self.digits, _FIGURES).replace("-", signs.minus)
        words = [f"{value} {self.unit}" if self.unit else value, ", ".join(errors)]
        return " ".join(words).rstrip() + self.flag

    def _error(self, error: float, signs: Signs) -> str:
        return f"{signs.plus_minus} {_digits(error, self.digits, _ERROR_FIGURES)}"

    @classmethod
    def stated(cls, value: float) -> Self:
        """Return a number that a user gave, with all of its digits."""
        digits = len(f"{value:.10f}".rstrip("0").partition(".")[2]) if isfinite(value) else None
        return cls(value, digits=digits)

    @classmethod
    def share(cls, share: float, error: float = nan, *, flag: str = "") -> Self:
        """Return a share in per cent, with its error in percentage points."""
        return cls(_PERCENT * share, "%", _PERCENT * error, 1, flag=flag)

    @classmethod
    def reduction(cls, share: float, error: float = nan) -> Self:
        """Return a reduction in per cent; a negative one with words."""
        return cls.share(share, error, flag=worse(share))

    @classmethod
    def kpa(cls, pressure_pa: float, error_pa: float = nan) -> Self:
        """Return a pressure in kPa, as under a header with that unit."""
        return cls(pressure_pa / PA_PER_KPA, error=error_pa / PA_PER_KPA)

    @classmethod
    def ms(cls, time_s: float) -> Self:
        """Return a time in ms, as under a header with that unit."""
        return cls(MS_PER_S * time_s)

    @classmethod
    def load(cls, objective: ObjectiveSection, load: float, error: float = nan) -> Self:
        """Return a load in the unit of an objective."""
        return cls(load, objective.unit, error)

    def sampled_by(self, estimate: Estimate, samples: str, unit: float = 1.0) -> Self:
        """Return the number with the interval of an estimate, and what it was sampled over.

        `unit` is the unit of the number in that of the estimate.
        """
        return replace(self, spread=(estimate.value - estimate.low) / unit, sampled=samples)


def rounded_down(value: float) -> float:
    """Return a value above 0 with three significant digits that is not above it."""
    unit = 10.0 ** (floor(log10(value)) + 1 - _FIGURES)
    return floor(value / unit + _ROUNDING) * unit


def _digits(value: float, digits: int | None, figures: int) -> str:
    if digits is None:
        digits = max(0, figures - 1 - floor(log10(abs(value)))) if value else 0
    return f"{value:z,.{digits}f}"


AnyText: TypeAlias = str | Number
"""What stands in a line."""


Kind: TypeAlias = Literal["", "answer", "passes", "fails", "flag", "quiet", "item", "head", "code"]
"""What a line is for: the answer, or a verdict; a flag that qualifies it, something quiet, an item
of a list, a heading below that of the section, text to be copied."""


@dataclass(frozen=True)
class Line:
    """A line of text.

    Attributes:
        cells: Its texts and numbers, one after the other.
        kind: What it is for.
    """

    cells: tuple[AnyText, ...]
    kind: Kind = ""

    @classmethod
    def of(cls, *cells: AnyText, kind: Kind = "") -> Self:
        """Return the line of some texts and numbers."""
        return cls(cells, kind)

    def text(self, signs: Signs = PLAIN) -> str:
        """Return its text."""
        return "".join(cell_text(cell, signs) for cell in self.cells)


AnyCell: TypeAlias = AnyText | Line
"""What stands in a cell of a table."""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        rows: The rows: texts and numbers.
        texts: Number of leading text columns; the others are aligned to the right.
        after: Number of text columns at the end.
        main: Indices of the rows that decide, which stand out.
    """

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[AnyCell, ...], ...]
    texts: int = 1
    after: int = 0
    main: tuple[int, ...] = ()

    @classmethod
    def of(
        cls,
        title: str,
        headers: Sequence[str],
        rows: Iterable[Sequence[AnyCell]],
        texts: int = 1,
        after: int = 0,
        main: Iterable[int] = (),
    ) -> Self:
        """Return the table of some rows."""
        return cls(title, (*headers,), tuple(map(tuple, rows)), texts, after, tuple(main))

    def cells(self, signs: Signs = PLAIN) -> list[tuple[str, ...]]:
        """Return the rows as texts."""
        return [tuple(cell_text(cell, signs) for cell in row) for row in self.rows]

    def is_number(self, column: int) -> bool:
        """Return whether a column has numbers, which align to the right."""
        return self.texts <= column < len(self.headers) - self.after


@dataclass(frozen=True)
class Picture:
    """A picture.

    Attributes:
        is_large: Whether it is larger than others on paper.
    """

    caption: str
    png: bytes
    is_large: bool = False

    @property
    def address(self) -> str:
        """The picture as an address that holds it."""
        return address_of(self.png)


AnyPart: TypeAlias = Line | Table | Picture


@dataclass(frozen=True)
class Section:
    """A section: a title and parts.

    Attributes:
        title: Its title; empty for parts that need none.
        parts: Lines, tables and pictures.
        is_summary: Whether it is the summary of the document, in a box.
    """

    title: str
    parts: tuple[AnyPart, ...]
    is_summary: bool = False

    @classmethod
    def of(cls, title: str, *parts: Iterable[AnyPart], is_summary: bool = False) -> Self:
        """Return the section of some groups of parts."""
        return cls(title, tuple(part for group in parts for part in group), is_summary)


@dataclass(frozen=True)
class Document:
    """A document."""

    sections: tuple[Section, ...]

    @classmethod
    def of(cls, parts: Iterable[AnyPart], title: str = "") -> Self:
        """Return a document of one section."""
        return cls((Section(title, tuple(parts)),))

    @property
    def parts(self) -> Iterator[AnyPart]:
        """All parts in their order."""
        for section in self.sections:
            yield from section.parts

    @property
    def first(self) -> str:
        """The text of the first line."""
        return next(part.text() for part in self.parts if isinstance(part, Line))


def cell_text(cell: AnyCell, signs: Signs = PLAIN) -> str:
    """Return the text of a cell."""
    return cell if isinstance(cell, str) else cell.text(signs)


def lines(texts: Iterable[str], kind: Kind = "") -> Iterator[Line]:
    """Yield lines of texts."""
    yield from (Line((text,), kind) for text in texts)


def address_of(png: bytes) -> str:
    """Return a picture as an address that holds it."""
    return f"data:image/png;base64,{b64encode(png).decode()}"


# Words that several answers share.


def building_words(scenario: Scenario, name: str) -> str:
    """Return the name of a building, with its title if that says more."""
    return titled(name, scenario.title_of(name))


def titled(name: str, title: str) -> str:
    """Return a name, with its title if that says more."""
    return name if "_".join(title.split()) in ("", name) else f"{name}: {title}"


def charge_text(charge: Charge) -> str:
    """Return a charge in words: `100 kg at (2, 4) m`, `20 kg at (2, 4) m, 1.5 m high`."""
    x_m, y_m = charge.position_m
    return f"{charge.tnt_kg:g} kg at ({x_m:g}, {y_m:g}) m{height_words(charge.height_m)}"


def height_words(height_m: float) -> str:
    """Return the height of a charge in words, `, 1.5 m high`; empty for one on the ground."""
    return f", {height_m:g} m high" if height_m else ""


def without_facade_words(scenario: Scenario, limited: Collection[str] = ()) -> Iterator[str]:
    """Yield which protected buildings have no facade, so that no level of protection covers them.

    Args:
        limited: Buildings that a verdict covers by limits of their loads.
    """
    for name in without_facade(scenario.structures):
        if name not in limited:
            yield f"{name}: protected, but without a facade: no level of protection covers it"


def validation_lines(scenario: Scenario, buildings: "pd.DataFrame", column: str) -> Iterator[str]:
    """Yield the validation status of the load on each building, with its reason.

    Args:
        scenario: It has the titles of the buildings.
        buildings: A table with columns `validation` and `reason`.
        column: The column with the name of the building.
    """
    for row in buildings.to_dict("records"):
        name = building_words(scenario, str(row[column]))
        yield f"validation of the load, {name}: {row['validation']} ({row['reason']})"


def worse(reduction: float) -> str:
    """Return words on a negative reduction, in brackets; empty for any other."""
    return " (the barrier makes it worse)" if reduction <= -_SHOWN else ""


def interval(estimate: Estimate) -> str:
    """Return an interval of shares in words; a dash for a single threat."""
    if isnan(estimate.low):
        return PLAIN.none
    return f"{percent(estimate.low)} to {percent(estimate.high)}"


def percent(share: float) -> str:
    """Return a share in per cent, for lines of plain text; a dash for NaN."""
    return Number.share(share).text()
