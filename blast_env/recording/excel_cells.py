"""How the columns of a table look in Excel: headings, widths and number formats."""

import textwrap
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import pandas as pd
from pandas.api import types

from blast_env.recording.tables import Column

LONGEST_VALUE: Final = 400
"""The most characters of the run record in one cell; the rest goes on in the next row."""

_EXACT_INTEGER: Final = 10**15  # Excel rounds greater ones
_BUTTON: Final = 4  # characters that the button of the filter takes
_NUMBER_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "s": "0.000000",
        "m": "0.000",
        "rad": "0.0000",
        "deg": "0.0",
        "sim": "#,##0.00",
        "sim mass": "0.0000",
        "sim units/s": "#,##0.0",
    }
)
_LABELS: Final[Mapping[str, str]] = MappingProxyType({"impulse_sim": "impulse, m|v|"})


def header(column: Column) -> str:
    """Return the heading of a column, with its unit: `first hit (s)`."""
    label = _LABELS.get(column.name)
    if label is None:
        label = column.name.removesuffix(f"_{column.unit}").replace("_", " ")
    return f"{label} ({column.unit})" if column.unit else label


class Heading(NamedTuple):
    """The heading of a column of a sheet.

    Attributes:
        text: The text.
        width: Width of the column, characters.
        lines: Lines that the text takes in that width.
        of_numbers: Whether there are numbers below.
    """

    text: str
    width: int
    lines: int = 1
    of_numbers: bool = False


class CellStyle(NamedTuple):
    """How the values of a column are written.

    Attributes:
        method: Name of the method of XlsxWriter's worksheet.
        number_format: The number format, in Excel's notation.
    """

    method: str
    number_format: str

    @classmethod
    def of(cls, values: "pd.Series[Any]", unit: str) -> "CellStyle":
        """Return the style for `readable` values of a unit."""
        if types.is_float_dtype(values):
            return cls("write_number", _NUMBER_FORMATS.get(unit, "0.000"))
        if types.is_integer_dtype(values):
            return cls("write_number", "0")
        return cls("write_string", "@")

    def heading(self, text: str, values: "pd.Series[Any]") -> Heading:
        """Return the heading of a column with these values."""
        text_width = _heading_width(text)
        width = max(text_width, self._values_width(values)) + _BUTTON
        lines = len(textwrap.wrap(text, width - _BUTTON))
        return Heading(text, width, lines, of_numbers=self.method == "write_number")

    def _values_width(self, values: "pd.Series[Any]") -> int:
        """Return the characters that the longest value takes."""
        present = values.dropna()
        if present.empty:
            return 0
        if self.method == "write_string":
            return int(present.str.len().max())
        decimals = len(self.number_format.partition(".")[2])
        return len(f"{present.abs().max():,.0f}") + len("-.") + decimals


def readable(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return the values with words for booleans; programs differ in how they show those."""
    if types.is_bool_dtype(values):
        return values.map({True: "yes", False: "no"}).astype("str")
    return values


def cells(values: "pd.Series[Any]") -> list[Any]:
    """Return the values as Python objects, None where there is none."""
    return list(values.astype(object).where(values.notna(), None))


def record_cells(value: str | int | float) -> list[str | int | float]:
    """Return a value of the run record as it can stand in cells, one below the other.

    Nothing is cut or rounded: long texts take several cells, great integers become texts.
    """
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, int) and abs(value) > _EXACT_INTEGER:
        return [str(value)]
    if isinstance(value, str):
        return list(textwrap.wrap(value, LONGEST_VALUE)) or [""]
    return [value]


def _heading_width(text: str) -> int:
    """Return the fewest characters in which a heading takes two lines and no unit is broken."""
    unit = text[text.find("(") :] if "(" in text else ""
    width = max(len(word) for word in text.split())
    while True:
        lines = textwrap.wrap(text, width)
        if len(lines) <= 2 and any(unit in line for line in lines):
            return width
        width += 1
