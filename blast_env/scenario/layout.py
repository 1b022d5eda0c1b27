"""Layouts: which cells of the build zone hold a barrier module."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blast_env.scenario.models import Cell, Scenario
from blast_env.scenario.placement import Placement


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
