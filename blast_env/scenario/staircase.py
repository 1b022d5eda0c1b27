"""Oblique walls: buildings of several parts of which a wall is a staircase of modules."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import Rectangle
from blast_env.scenario.sections import AnyStructure
from blast_env.units import MODULE_SIDE_M

LEAST_STEPS: Final = 3
"""So many steps to one side, none back between them, are a staircase."""

STEPPED: Final = "an oblique wall is a staircase of modules, whose peaks are too high"
"""Note on a building with one; impulses are hardly wrong (`python -m studies.gas oblique`)."""

_MOST_MODULES: Final = 4
"""Depth of a step: a deeper one is a wing of the building."""


def stepped_buildings(structures: Iterable[AnyStructure]) -> frozenset[str]:
    """Return the names of the buildings with a wall that is a staircase, as an oblique one is.

    Args:
        structures: The structures; those of one building are looked at together, in plan.
    """
    together: dict[str, list[Rectangle]] = {}
    for each in structures:
        together.setdefault(each.building_name, []).append(each.rectangle_m)
    return frozenset(
        name
        for name, parts in together.items()
        if len(parts) >= LEAST_STEPS and _is_stepped(_modules(parts))
    )


def _modules(parts: list[Rectangle]) -> BoolArray:
    """Return which modules the parts of a building fill (rows, columns)."""
    around = Rectangle.around(parts)

    def modules(length_m: float) -> int:
        return round(length_m / MODULE_SIDE_M)

    shape = modules(around.top - around.bottom), modules(around.right - around.left)
    filled = np.zeros(shape, dtype=bool)
    for left, bottom, right, top in parts:
        rows = slice(modules(bottom - around.bottom), modules(top - around.bottom))
        filled[rows, modules(left - around.left) : modules(right - around.left)] = True
    return filled


def _is_stepped(filled: BoolArray) -> bool:
    """Return whether any side of a plan is a staircase."""
    for turned in (filled, filled[:, ::-1], filled.T, filled.T[:, ::-1]):
        first = turned.argmax(axis=1)[turned.any(axis=1)]
        run, steps = 0, np.diff(first)
        for step in steps[steps != 0].tolist():
            side = 1 if step > 0 else -1
            is_deep = abs(step) > _MOST_MODULES
            run = 0 if is_deep else side + (run if run * side > 0 else 0)
            if abs(run) >= LEAST_STEPS:
                return True
    return False
