"""Reading workbooks back."""

from pathlib import Path
from typing import Any

import openpyxl
import pandas as pd


def load(path: Path) -> Any:
    """Return the workbook in a file."""
    return openpyxl.load_workbook(path)


def rows(sheet: Any) -> list[list[Any]]:
    """Return the values of all rows of a sheet."""
    return [list(row) for row in sheet.iter_rows(values_only=True)]


def table(sheet: Any) -> list[dict[str, Any]]:
    """Return the rows of a sheet below its headings, by heading."""
    headings, *values = rows(sheet)
    return [dict(zip(headings, row, strict=True)) for row in values]


def expected(table: pd.DataFrame) -> list[list[Any]]:
    """Return what the rows of a table must look like in a workbook."""
    return [[_expected_cell(value) for value in row] for row in table.itertuples(index=False)]


def _expected_cell(value: Any) -> Any:
    """Return what a value of a table must look like in a workbook."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        # Excel's files hold 16 digits, a double has up to 17.
        return None if value != value else float(f"{value:.16G}")
    return value if value != "" else None
