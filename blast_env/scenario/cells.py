"""Cells of the build zone as people and other libraries write them."""

from collections.abc import Sequence
from operator import index
from typing import Any, Final

import numpy as np

from blast_env.errors import LayoutError
from blast_env.scenario.sections import Cell
from blast_env.scenario.wording import type_word, value_text

_PAIR: Final = "must be a pair of integers (row, column)"


def cells_from(layout: Any) -> tuple[Cell, ...]:
    """Return the cells of a layout as plain integers, in their order.

    Args:
        layout: A list of (row, column). NumPy integers and arrays are welcome.

    Raises:
        LayoutError: If it is anything else: a set has no order, and floats and truth values are
            no integers.
    """
    is_array = isinstance(layout, np.ndarray) and layout.ndim > 0
    if is_array or (isinstance(layout, Sequence) and not isinstance(layout, str | bytes)):
        return tuple(cell_from(item, f"layout[{i}]") for i, item in enumerate(layout))
    raise LayoutError(f"layout is {type_word(layout)}, must be a list of (row, column) pairs")


def cell_from(item: Any, place: str) -> Cell:
    """Return a pair of integers as a cell.

    Args:
        item: (row, column), as for `cells_from`.
        place: Where it comes from, for the error.

    Raises:
        LayoutError: If it is anything else.
    """
    listed = item.tolist() if isinstance(item, np.ndarray | np.generic) else item
    if not isinstance(listed, list | tuple):
        raise LayoutError(f"{place}: is {type_word(listed)}, {_PAIR}")
    if len(listed) != 2:
        raise LayoutError(f"{place}: has {len(listed)} values, {_PAIR}")
    if not all(_is_integer(number) for number in listed):
        raise LayoutError(f"{place}: is ({', '.join(map(type_word, listed))}), {_PAIR}")
    return index(listed[0]), index(listed[1])


def cell_text(cell: Cell) -> str:
    """Return a cell for a message: `cell (3, 4)`."""
    return f"cell ({value_text(cell[0])}, {value_text(cell[1])})"


def _is_integer(value: Any) -> bool:
    """Whether the value is an integer; `True` and 1.0 are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
