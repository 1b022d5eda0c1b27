"""The tables of a blast as an Excel workbook."""

import textwrap
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import pandas as pd
import xlsxwriter
from xlsxwriter.exceptions import XlsxFileError

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.recording.excel_cells import (
    CellStyle,
    Heading,
    cells,
    header,
    readable,
    record_cells,
)
from blast_env.recording.excel_charts import add_charts, chart_data
from blast_env.recording.tables import (
    COLLISION_COLUMNS,
    MODULE_COLUMNS,
    STRUCTURE_COLUMNS,
    Column,
)

if TYPE_CHECKING:
    from blast_env.simulation import BlastResult

SUFFIX: Final = ".xlsx"
EXCEL_ROWS: Final = 1_048_576
"""The most rows that Excel's format allows on a sheet."""

_CREATED: Final = datetime(2000, 1, 1)
_RECORD_WIDTH: Final = 44  # characters of a column of the run record
_ROW_HEIGHT: Final = 15  # points
_CHART_SHEET: Final = "Most loaded"
_CHART_COLUMN: Final = 2  # of the sheet `Run`
_EXPLANATION_COLUMNS: Final = (
    Column("sheet", "", ""),
    Column("column", "", ""),
    Column("unit", "", ""),
    Column("meaning", "", ""),
)
_UNITS: Final = (
    ("sim", "simulation unit of impulse: sim mass x sim unit / s"),
    ("sim mass", "simulation unit of mass"),
    ("sim units/s", "simulation units of length per second; 4 units are 1 m"),
)


def write_workbook(
    result: "BlastResult", path: str | Path, max_rows_per_sheet: int = EXCEL_ROWS
) -> Path:
    """Write a workbook with the run record, the tables and charts of the impulse per module.

    Its sheets are `Run` (with the charts), `Structures`, `Modules`, `Collisions`, `Most loaded`
    (what the charts show) and `Columns`, which explains every column. A table that is too long
    for one sheet goes on in `Collisions 2` and so on. The file is written whole or not at all,
    and two workbooks of the same result are the same to the last byte.

    Args:
        result: The blast.
        path: The file, with the suffix `.xlsx`; an existing one is replaced.
        max_rows_per_sheet: The most rows that a table has on one sheet, its header included.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is another one or the file cannot be written there.
        ValueError: If `max_rows_per_sheet` is less than 2 or more than Excel allows.
    """
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise BlastEnvError(f"{path}: has the suffix {path.suffix!r}, must have {SUFFIX!r}")
    if not 2 <= max_rows_per_sheet <= EXCEL_ROWS:
        raise ValueError(
            f"max_rows_per_sheet is {max_rows_per_sheet}, must be between 2 and {EXCEL_ROWS}"
        )
    with write_atomically(path) as temporary:
        try:
            with (
                # XlsxWriter's own scratch files would stay if it failed.
                TemporaryDirectory() as scratch,
                xlsxwriter.Workbook(
                    str(temporary), {"constant_memory": True, "tmpdir": scratch}
                ) as workbook,
            ):
                workbook.use_zip64()
                _WorkbookWriter(workbook, max_rows_per_sheet).write(result)
        except (OSError, XlsxFileError) as error:
            raise BlastEnvError(f"{path}: cannot be written: {error}") from error
    return path


class _WorkbookWriter:
    """Writes the sheets of one workbook.

    Args:
        workbook: An empty workbook with constant memory: every sheet is written row by row.
        max_rows: The most rows that a table has on one sheet, its header included.
    """

    def __init__(self, workbook: Any, max_rows: int) -> None:
        self._workbook = workbook
        self._max_rows = max_rows
        self._number_formats: dict[str, Any] = {}
        wrapped = {"valign": "top", "align": "left", "indent": 1, "text_wrap": True}
        heading = wrapped | {"bold": True, "bg_color": "#ECE2C6", "bottom": 1}
        self._wrapped = workbook.add_format(wrapped)
        self._text_heading = workbook.add_format(heading)
        self._number_heading = workbook.add_format(heading | {"align": "right", "indent": 0})

    def write(self, result: "BlastResult") -> None:
        """Write all sheets and the properties."""
        record = result.run_record
        self._workbook.set_properties(
            {
                "title": f"Blast {record['scenario']}, seed {record['seed']}",
                "comments": f"blast-env {record['blast-env version']}, digest {record['digest']}",
                "created": _CREATED,
            }
        )
        run = self._write_run(record)
        self._write_table("Structures", result.structures, STRUCTURE_COLUMNS)
        self._write_table("Modules", result.modules, MODULE_COLUMNS)
        self._write_table("Collisions", result.collisions, COLLISION_COLUMNS)
        data = chart_data(result)
        self._write_sheet(_CHART_SHEET, data.table, data.columns)
        add_charts(self._workbook, run, _CHART_COLUMN, _CHART_SHEET, data)
        self._write_columns()

    def _add_sheet(self, name: str, headings: Sequence[Heading]) -> Any:
        """Add a sheet with a frozen row of headings, and return it."""
        sheet = self._workbook.add_worksheet(name)
        sheet.freeze_panes(1, 0)
        sheet.set_landscape()
        sheet.set_paper(9)  # A4
        sheet.fit_to_pages(1, 0)
        sheet.repeat_rows(0)
        sheet.set_footer("&L&F&C&A&R&P / &N")
        for index, heading in enumerate(headings):
            cell_format = self._number_heading if heading.of_numbers else self._text_heading
            sheet.set_column(index, index, heading.width)
            sheet.write_string(0, index, heading.text, cell_format)
        return sheet

    def _write_run(self, record: Mapping[str, str | int | float]) -> Any:
        """Write the run record as pairs, and return the sheet."""
        sheet = self._add_sheet(
            "Run", [Heading(text, _RECORD_WIDTH) for text in ("quantity", "value")]
        )
        row = 1
        for name, value in record.items():
            for number, line in enumerate(record_cells(value)):
                # Set, not left to the program: the charts beside are placed by it.
                lines = textwrap.wrap(str(line), _RECORD_WIDTH - 2)
                sheet.set_row(row, _ROW_HEIGHT * max(1, len(lines)))
                sheet.write_string(row, 0, f"{name}, continued" if number else name, self._wrapped)
                write = sheet.write_string if isinstance(line, str) else sheet.write
                write(row, 1, line, self._wrapped)
                row += 1
        return sheet

    def _write_table(self, name: str, table: pd.DataFrame, columns: Sequence[Column]) -> None:
        """Write a table, to several sheets where it is too long for one."""
        per_sheet = self._max_rows - 1
        for number, start in enumerate(range(0, max(len(table), 1), per_sheet), start=1):
            sheet_name = name if number == 1 else f"{name} {number}"
            self._write_sheet(sheet_name, table.iloc[start : start + per_sheet], columns)

    def _write_sheet(self, name: str, table: pd.DataFrame, columns: Sequence[Column]) -> None:
        """Write a table to one sheet."""
        values = [readable(table[column.name]) for column in columns]
        styles = [CellStyle.of(v, c.unit) for v, c in zip(values, columns, strict=True)]
        headings = [
            style.heading(header(column), column_values)
            for style, column, column_values in zip(styles, columns, values, strict=True)
        ]
        sheet = self._add_sheet(name, headings)
        # The button of the filter covers the last line.
        sheet.set_row(0, _ROW_HEIGHT * (1 + max(heading.lines for heading in headings)))
        for index, column in enumerate(columns):
            if column.meaning:
                sheet.write_comment(0, index, column.meaning, {"y_scale": 0.6})
        sheet.autofilter(0, 0, len(table), len(columns) - 1)
        writers = [
            (index, getattr(sheet, style.method), self._format(style.number_format))
            for index, style in enumerate(styles)
        ]
        for row, row_cells in enumerate(zip(*map(cells, values), strict=True), start=1):
            for (index, write, cell_format), cell in zip(writers, row_cells, strict=True):
                if cell is not None:
                    write(row, index, cell, cell_format)

    def _write_columns(self) -> None:
        """Write what every column and every unit means."""
        tables = {
            "Structures": STRUCTURE_COLUMNS,
            "Modules": MODULE_COLUMNS,
            "Collisions": COLLISION_COLUMNS,
        }
        rows = [
            (sheet, header(column), column.unit, column.meaning)
            for sheet, columns in tables.items()
            for column in columns
        ]
        rows += [("", "", unit, meaning) for unit, meaning in _UNITS]
        names = [column.name for column in _EXPLANATION_COLUMNS]
        self._write_sheet("Columns", pd.DataFrame(rows, columns=names), _EXPLANATION_COLUMNS)

    def _format(self, number_format: str) -> Any:
        """Return the cell format with a number format; each is made once."""
        if number_format not in self._number_formats:
            # The indent keeps a text off the number on its left.
            indent = {"align": "left", "indent": 1} if number_format == "@" else {}
            self._number_formats[number_format] = self._workbook.add_format(
                {"num_format": number_format, "valign": "top"} | indent
            )
        return self._number_formats[number_format]
