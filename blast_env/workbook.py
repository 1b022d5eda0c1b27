"""The workbook of a blast, by pandas' writer."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import pandas as pd
from pandas.api import types
from xlsxwriter.exceptions import XlsxFileError

from blast_env.errors import BlastEnvError
from blast_env.files import scratch_folder, write_atomically
from blast_env.tables import Column, RunRecord
from blast_env.values import path_of

SUFFIX: Final = ".xlsx"

EXCEL_ROWS: Final = 1_048_576
"""The most rows on a sheet that Excel's format allows."""

LONGEST_VALUE: Final = 400
"""The most characters of the run record in one cell; the rest follows in the next row."""

MOST_PRINTED_ROWS: Final = 400
"""The most rows in the print area of a sheet, some ten pages; it can be removed."""


_OPTIONS: Final[Mapping[str, bool]] = MappingProxyType(
    {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
)
"""Keeps a user's name that begins with = a text, not a formula."""

_CREATED: Final = datetime(2000, 1, 1)
_EXACT_INTEGER: Final = 10**15  # Excel rounds greater ones
_BUTTON: Final = 4  # width of the button of the filter, in characters
_RECORD_WIDTH: Final = 44  # characters of a column of the run record
_ROW_HEIGHT: Final = 15  # points

_NUMBER_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "s": "0.000000",
        "m": "0.000",
        "rad": "0.0000",
        "deg": "0.0",
        "sim": "#,##0.00",
        "sim mass": "0.0000",
        "sim units/s": "#,##0.0",
        "Pa s": "#,##0.0",
        "Pa": "#,##0",
        "m2": "#,##0.00",
    }
)
_LABELS: Final[Mapping[str, str]] = MappingProxyType({"impulse_sim": "impulse, m|v|"})
_EXPLANATION_COLUMNS: Final = tuple(
    Column(name, "", "") for name in ("sheet", "column", "unit", "meaning")
)


class SheetTable(NamedTuple):
    """A table for one sheet, with the meanings of its columns."""

    name: str
    table: pd.DataFrame
    columns: Sequence[Column]


def write_workbook(
    record: RunRecord,
    tables: Sequence[SheetTable],
    path: str | Path,
    *,
    units: Sequence[tuple[str, str]] = (),
    max_rows_per_sheet: int = EXCEL_ROWS,
) -> Path:
    """Write a workbook with a run record and tables, and a sheet that explains their columns.

    A table too long for one sheet continues in `Collisions 2` and so on. The file is written whole
    or not at all, and is identical to the last byte for the same content.

    Args:
        record: The run record, with the version of the package.
        path: The file, with the suffix `.xlsx`; an existing one is replaced.
        units: Units with their meanings, for the sheet that explains the columns.
        max_rows_per_sheet: The most rows of a table on one sheet, its header included.

    Returns:
        The path.
    """
    if not 2 <= max_rows_per_sheet <= EXCEL_ROWS:
        raise ValueError(
            f"max_rows_per_sheet is {max_rows_per_sheet}, must be between 2 and {EXCEL_ROWS}"
        )
    run = f"seed {record['seed']}" if "seed" in record else f"engine {record['engine']}"
    with _workbook(path, record, f"Blast {record['scenario']}, {run}") as writer:
        sheets = _Sheets(writer, max_rows_per_sheet)
        sheets.add_record(record)
        for table in (*tables, _explanations(tables, units)):
            sheets.add(table)
    return path_of(path)


@contextmanager
def _workbook(path: str | Path, record: RunRecord, title: str) -> Iterator[Any]:
    """Yield a writer of an empty workbook, which becomes the file if the block succeeds."""
    path = path_of(path)
    if path.suffix.lower() != SUFFIX:
        raise BlastEnvError(f"{path}: has the suffix {path.suffix!r}, must have {SUFFIX!r}")
    digest = f", digest {record['digest']}" if "digest" in record else ""
    # XlsxWriter would leave its scratch files after a failure.
    with write_atomically(path) as temporary, scratch_folder() as scratch:
        options = {**_OPTIONS, "tmpdir": str(scratch), "use_zip64": True}
        # In memory first: on a full device, the archive would try again at garbage collection.
        content = BytesIO()
        try:
            with pd.ExcelWriter(
                content, engine="xlsxwriter", engine_kwargs={"options": options}
            ) as writer:
                writer.book.set_properties(
                    {
                        "title": title,
                        "comments": f"blast-env {record['blast-env version']}{digest}",
                        "created": _CREATED,
                    }
                )
                yield writer
            temporary.write_bytes(content.getbuffer())
        except (OSError, XlsxFileError) as error:
            raise BlastEnvError(f"{path}: cannot be written: {error}") from error


class _Sheets:
    """Adds sheets with frozen headings to a workbook.

    Args:
        writer: Writer of an empty workbook.
        max_rows: The most rows of a table on one sheet, its header included.
    """

    def __init__(self, writer: Any, max_rows: int) -> None:
        self._writer, self._max_rows = writer, max_rows
        wrapped = {"valign": "top", "align": "left", "indent": 1, "text_wrap": True}
        heading = wrapped | {"bold": True, "bg_color": "#ECE2C6", "bottom": 1}
        self._wrapped = writer.book.add_format(wrapped)
        self._text_heading = writer.book.add_format(heading)
        self._number_heading = writer.book.add_format(heading | {"align": "right", "indent": 0})

    def add(self, part: SheetTable) -> None:
        """Add a table, on several sheets if it is too long for one."""
        per_sheet = self._max_rows - 1
        for number, start in enumerate(range(0, max(len(part.table), 1), per_sheet), start=1):
            name = part.name if number == 1 else f"{part.name} {number}"
            self.add_whole(name, part.table.iloc[start : start + per_sheet], part.columns)

    def add_whole(self, name: str, table: pd.DataFrame, columns: Sequence[Column]) -> None:
        """Add a table on one sheet: headings with units and notes, formats, widths, a filter."""
        shown = pd.DataFrame({column.name: readable(table[column.name]) for column in columns})
        sheet = self._write(name, shown)
        lines = 1
        for index, column in enumerate(columns):
            values, heading = shown[column.name], header(column)
            number_format = _number_format(values, column.unit)
            width = max(_heading_width(heading), _values_width(values, number_format))
            lines = max(lines, len(textwrap.wrap(heading, width)))
            sheet.set_column(index, index, width + _BUTTON, self._format(number_format))
            is_text = number_format == "@"
            sheet.write_string(
                0, index, heading, self._text_heading if is_text else self._number_heading
            )
            if column.meaning:
                sheet.write_comment(0, index, column.meaning, {"y_scale": 0.6})
        sheet.set_row(0, _ROW_HEIGHT * (1 + lines))  # the button of the filter covers the last
        sheet.autofilter(0, 0, len(table), len(columns) - 1)
        if len(table) > MOST_PRINTED_ROWS:
            sheet.print_area(0, 0, MOST_PRINTED_ROWS, len(columns) - 1)
            sheet.set_header(f"&RPrinted: the first {MOST_PRINTED_ROWS} of {len(table):,} rows")

    def add_record(self, record: Mapping[str, str | int | float]) -> None:
        """Add the run record as pairs on the sheet `Run`."""
        pairs = [
            (f"{name}, continued" if number else name, line)
            for name, value in record.items()
            for number, line in enumerate(record_cells(value))
        ]
        sheet = self._write("Run", pd.DataFrame(pairs, columns=["quantity", "value"]))
        sheet.set_column(0, 1, _RECORD_WIDTH, self._wrapped)
        for index, heading in enumerate(("quantity", "value")):
            sheet.write_string(0, index, heading, self._text_heading)
        for row, (_, line) in enumerate(pairs, start=1):
            lines = textwrap.wrap(str(line), _RECORD_WIDTH - 2)
            sheet.set_row(row, _ROW_HEIGHT * max(1, len(lines)))

    def _write(self, name: str, table: pd.DataFrame) -> Any:
        """Write the values of a table below the row of headings, and return the sheet."""
        table.to_excel(self._writer, sheet_name=name, index=False, header=False, startrow=1)
        sheet = self._writer.sheets[name]
        sheet.freeze_panes(1, 0)
        sheet.set_landscape()
        sheet.set_paper(9)  # A4
        sheet.fit_to_pages(1, 0)
        sheet.repeat_rows(0)
        sheet.set_footer("&L&F&C&A&R&P / &N")
        return sheet

    def _format(self, number_format: str) -> Any:
        # The indent separates a text from the number on its left.
        indent = {"align": "left", "indent": 1} if number_format == "@" else {}
        style = {"num_format": number_format, "valign": "top"} | indent
        return self._writer.book.add_format(style)


def header(column: Column) -> str:
    """Return the heading of a column, with its unit: `first hit (s)`."""
    label = _LABELS.get(column.name)
    if label is None:
        suffix = "_" + column.unit.replace(" ", "_").lower()
        label = column.name.removesuffix(suffix).replace("_", " ")
    return f"{label} ({column.unit})" if column.unit else label


def readable(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return the values with words for booleans, which programs show in different ways."""
    if types.is_bool_dtype(values):
        return values.map({True: "yes", False: "no"}).astype("str")
    return values


def record_cells(value: str | int | float) -> list[str | int | float]:
    """Return the contents of the cells, one below the other, for a value of the run record.

    Nothing is cut or rounded: long texts take several cells, large integers become texts.
    """
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, int) and abs(value) > _EXACT_INTEGER:
        return [str(value)]
    if isinstance(value, str):
        return list(textwrap.wrap(value, LONGEST_VALUE)) or [""]
    return [value]


def _number_format(values: "pd.Series[Any]", unit: str) -> str:
    """Return the number format for values of a unit, in Excel's notation; "@" for texts."""
    if types.is_float_dtype(values):
        return _NUMBER_FORMATS.get(unit, "0.000")
    return "0" if types.is_integer_dtype(values) else "@"


def _values_width(values: "pd.Series[Any]", number_format: str) -> int:
    """Return the number of characters of the longest value."""
    present = values.dropna()
    if present.empty:
        return 0
    if number_format == "@":
        return int(present.str.len().max())
    decimals = len(number_format.partition(".")[2])
    return len(f"{present.abs().max():,.0f}") + len("-.") + decimals


def _heading_width(text: str) -> int:
    """Return the fewest characters for a heading of at most two lines with its unit unbroken."""
    unit = text[text.find("(") :] if "(" in text else ""
    width = max(len(word) for word in text.split())
    while True:
        lines = textwrap.wrap(text, width)
        if len(lines) <= 2 and any(unit in line for line in lines):
            return width
        width += 1


def _explanations(tables: Sequence[SheetTable], units: Sequence[tuple[str, str]]) -> SheetTable:
    """Return a table of the meanings of every column and every unit."""
    rows = [
        (table.name, header(column), column.unit, column.meaning)
        for table in tables
        for column in table.columns
    ]
    rows += [("", "", unit, meaning) for unit, meaning in units]
    names = [column.name for column in _EXPLANATION_COLUMNS]
    return SheetTable("Columns", pd.DataFrame(rows, columns=names), _EXPLANATION_COLUMNS)
