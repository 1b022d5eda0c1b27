"""Layouts: which cells of the build zone hold a barrier module."""

import json
from collections.abc import Iterable, Sequence
from operator import index
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import LayoutError
from blast_env.scenario.models import BuildZone, Cell, Scenario
from blast_env.scenario.reading import read_text
from blast_env.scenario.usability import reason_against, usable_mask
from blast_env.scenario.wording import shortened, type_word, value_text

MAX_DIGITS: Final = 1000
"""Digits of an integer in a layout file."""

_PAIR: Final = "must be a pair of integers (row, column)"


def usable_cells(scenario: Scenario) -> NDArray[np.bool_]:
    """Return which cells may hold a module, shape (rows, columns); (0, 0) without a build zone.

    The same answer as `blocked_reason` for every cell, but all at once.
    """
    zone = scenario.build_zone
    if zone is None:
        return np.zeros((0, 0), dtype=bool)
    return usable_mask(zone, scenario.structures, scenario.charge, scenario.charge_radius_m)


def blocked_reason(scenario: Scenario, cell: Cell) -> str | None:
    """Return why a cell may not hold a module, or `None` if it may.

    Args:
        scenario: The scenario.
        cell: (row, column).
    """
    zone = scenario.build_zone
    if zone is None:
        return "is not usable: the scenario has no build zone"
    if not _is_on_grid(zone, cell):
        return f"is outside the build zone of {zone.rows} rows and {zone.columns} columns"
    radius_m = scenario.charge_radius_m
    return reason_against(zone, cell, scenario.structures, scenario.charge, radius_m)


def check_layout(scenario: Scenario, layout: Sequence[Cell]) -> tuple[Cell, ...]:
    """Return the cells of a layout as plain integers, in their order.

    Args:
        scenario: The scenario that the layout is for.
        layout: (row, column) of each module. NumPy integers and arrays are welcome.

    Raises:
        LayoutError: If a cell is not a pair of integers, lies outside the build zone, is blocked
            or repeated, or if there are more cells than modules in stock.
    """
    cells = tuple(_cell(item, f"layout[{i}]") for i, item in enumerate(_listed(layout)))
    seen: set[Cell] = set()
    for cell in cells:
        reason = "is repeated" if cell in seen else blocked_reason(scenario, cell)
        if reason is not None:
            raise LayoutError(f"cell {_cell_text(cell)} {reason}")
        seen.add(cell)
        stock = 0 if scenario.build_zone is None else scenario.build_zone.stock
        if len(seen) > stock:
            raise LayoutError(
                f"cell {_cell_text(cell)} is beyond the stock:"
                f" the layout has {len(cells)} modules, must have at most {stock}"
            )
    return cells


def load_layout(path: str | Path) -> tuple[Cell, ...]:
    """Read a layout from a JSON file.

    The file is `[[row, column], ...]` or `{"cells": [[row, column], ...]}`. Whether the cells
    fit a scenario is for `check_layout` to say.

    Raises:
        LayoutError: If the file cannot be read or is anything else.
    """
    try:
        text = read_text(Path(path))
        content = json.loads(text, object_pairs_hook=_unique_keys, parse_int=_integer)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise LayoutError(f"{path}: {where}: {error.msg}") from error
    except RecursionError as error:
        raise LayoutError(f"{path}: is nested too deeply") from error
    except ValueError as error:
        raise LayoutError(f"{path}: {error}") from error
    place = ""
    if isinstance(content, dict):
        place = "cells"
        if set(content) != {place}:
            raise LayoutError(f"{path}: must have the key 'cells' and no other")
        content = content[place]
    if not isinstance(content, list):
        what = f"{place}: " if place else ""
        message = f"is {type_word(content)}, must be a list of [row, column] pairs"
        raise LayoutError(f"{path}: {what}{message}")
    return tuple(_cell(item, f"{path}: {place}[{i}]") for i, item in enumerate(content))


def _is_on_grid(zone: BuildZone, cell: Cell) -> bool:
    """Whether the grid has the cell."""
    return 0 <= cell[0] < zone.rows and 0 <= cell[1] < zone.columns


def _listed(layout: Any) -> Iterable[Any]:
    """Return the items of a layout, refusing what has no order or is no list at all."""
    if isinstance(layout, np.ndarray) and layout.ndim > 0:
        return layout
    if isinstance(layout, Sequence) and not isinstance(layout, str | bytes):
        return layout
    raise LayoutError(f"layout is {type_word(layout)}, must be a list of (row, column) pairs")


def _cell(item: Any, place: str) -> Cell:
    """Return a pair of integers as a cell, or raise the error that names its place."""
    listed = item.tolist() if isinstance(item, np.ndarray | np.generic) else item
    if not isinstance(listed, list | tuple):
        raise LayoutError(f"{place}: is {type_word(listed)}, {_PAIR}")
    if len(listed) != 2:
        raise LayoutError(f"{place}: has {len(listed)} values, {_PAIR}")
    if not all(_is_integer(number) for number in listed):
        raise LayoutError(f"{place}: is ({', '.join(map(type_word, listed))}), {_PAIR}")
    return index(listed[0]), index(listed[1])


def _cell_text(cell: Cell) -> str:
    """Return a cell for a message."""
    return f"({value_text(cell[0])}, {value_text(cell[1])})"


def _is_integer(value: Any) -> bool:
    """Whether the value is an integer; `True` and 1.0 are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _integer(digits: str) -> int:
    """Read an integer, refusing one so long that Python would refuse it without saying where."""
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"{shortened(digits)} has {len(digits)} digits, which is too large")
    return int(digits)


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object, refusing keys that occur twice: one of them would be lost."""
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key occurs twice")
    return content
