"""Tables whose columns say their unit and meaning in one place."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        name: Name in the data frame.
        unit: Unit; empty for counts, names and pure numbers. "sim" stands for the simulation's
            own units: mass units, and 4 length units to the metre.
        meaning: What it is.
    """

    name: str
    unit: str
    meaning: str


def table_of(rows: Sequence[Mapping[str, object]], columns: Sequence[Column]) -> pd.DataFrame:
    """Return rows, each by the names of the columns, as a data frame in the columns' order.

    Raises:
        KeyError: If a row lacks a column.
    """
    names = [column.name for column in columns]
    return pd.DataFrame([[row[name] for name in names] for row in rows], columns=names)
