"""Tables: columns with unit and meaning; output as Markdown and as CSV files."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from blast_env.files import write_atomically
from blast_env.values import is_plain_number, path_of

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


_FORMULA_MARKS: Final = ("=", "+", "-", "@", "\t", "\r")
"""First characters of texts in a CSV file that spreadsheets read as formulas."""


RunRecord = dict[str, str | int | float]
"""The scenario, parameters, versions and end of a run, as names and plain values."""


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        name: Name in the data frame.
        unit: Unit; empty for counts, names and pure numbers. "sim" stands for the units of the
            simulation: mass units, and 4 length units per metre.
        meaning: Its meaning, in words.
        is_text: Whether it holds texts; otherwise numbers or truth values.
    """

    name: str
    unit: str
    meaning: str
    is_text: bool = False


OF_MODULES: Final = (
    Column("module_id", "", "name of the module, made from its centre in metres"),
    Column("structure", "", "structure that the module is part of"),
    Column("row", "", "row in the structure's grid, upwards from 0"),
    Column("column", "", "column in the structure's grid, to the right from 0"),
    Column("x_m", "m", "centre, from the left border"),
    Column("y_m", "m", "centre, from the lower border"),
)
"""The first columns of a table by modules: which module a row is about."""


def table_of(rows: Sequence[Mapping[str, object]], columns: Sequence[Column]) -> "pd.DataFrame":
    """Return a data frame of rows, given by the names of the columns, in the columns' order.

    Raises:
        KeyError: If a row lacks a column.
    """
    import pandas as pd

    names = [column.name for column in columns]
    return pd.DataFrame([[row[name] for name in names] for row in rows], columns=names)


def table_records(table: "pd.DataFrame") -> list[dict[str, Any]]:
    """Return the rows of a table as dictionaries for JSON; NaN becomes `None`."""
    return [
        {str(name): number_or_none(value) for name, value in row.items()}
        for row in table.to_dict("records")
    ]


def number_or_none(value: Any) -> Any:
    """Return the value, or `None` for NaN."""
    return None if isinstance(value, float) and math.isnan(value) else value


def texts(values: Any) -> Any:
    """Return values as a column of text; a separate function keeps mypy fast with pandas' stubs."""
    import pandas as pd

    return pd.array(values, dtype="str")


def as_types(table: "pd.DataFrame", types: Mapping[str, str]) -> "pd.DataFrame":
    """Return a table with the types of some columns changed, by their names."""
    wanted: Any = types  # with the stubs of pandas, mypy takes seconds for each literal dict
    converted: pd.DataFrame = table.astype(wanted)
    return converted


def markdown_table(headers: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table of headers and cells; vertical bars in cells are escaped."""
    lines = [headers, *rows]
    cells = [[str(cell).replace("|", r"\|") for cell in line] for line in lines]
    text = [f"| {' | '.join(line)} |" for line in cells]
    rule = "|---" * len(headers) + "|"
    return "\n".join([text[0], rule, *text[1:]])


def cell_text(value: Any) -> Any:
    """Return the value of a CSV cell; a text that spreadsheets read as a formula gets a leading '.

    Numbers stay unchanged, also as texts.
    """
    is_formula = isinstance(value, str) and value.startswith(_FORMULA_MARKS)
    return f"'{value}" if is_formula and not is_plain_number(value) else value


def write_csv(table: "pd.DataFrame", path: str | Path, float_format: str | None = None) -> Path:
    """Write a table without its index as CSV, complete or not at all; see `cell_text`.

    Args:
        float_format: Format of numbers, such as "%.6g"; None for all digits.

    Returns:
        The path.
    """
    texts = table.select_dtypes(exclude=["number", "bool"])
    safe = table.assign(**{str(name): texts[name].map(cell_text) for name in texts})
    with write_atomically(path) as temporary:
        safe.to_csv(temporary, index=False, float_format=float_format, lineterminator="\n")
    return path_of(path)
