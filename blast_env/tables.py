"""Columns of tables: name, unit and meaning in one place."""

from typing import NamedTuple


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
