"""Layouts: which cells of the build zone hold a barrier module."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import LayoutError
from blast_env.scenario.cells import cell_from
from blast_env.scenario.models import Cell, Scenario
from blast_env.scenario.placement import Placement
from blast_env.scenario.reading import read_text
from blast_env.scenario.wording import shortened, type_word

MAX_DIGITS: Final = 1000
"""Digits of an integer in a layout file."""


def usable_cells(scenario: Scenario) -> NDArray[np.bool_]:
    """Return which cells may hold a module as far as the site is concerned.

    That leaves out keep-outs, structures, their clearance and the charge; what depends on the
    modules already placed (stock, budget, access way) is for `Placement` to say.

    Returns:
        An array of shape (rows, columns), read-only; (0, 0) without a build zone.
    """
    return Placement.empty(scenario).usable


def check_layout(scenario: Scenario, layout: Sequence[Cell]) -> tuple[Cell, ...]:
    """Return the cells of a layout as plain integers, in their order.

    Args:
        scenario: The scenario that the layout is for.
        layout: (row, column) of each module. NumPy integers and arrays are welcome.

    Raises:
        LayoutError: As `Placement.of` does, if a cell is not available.
    """
    return Placement.of(scenario, layout).cells


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
    return tuple(cell_from(item, f"{path}: {place}[{i}]") for i, item in enumerate(content))


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
