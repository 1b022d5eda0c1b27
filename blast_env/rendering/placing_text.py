"""A site on which barrier modules are being placed, as a map of characters."""

from collections.abc import Sequence
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.scenario import AnySource, Placement, PointSource, Scenario
from blast_env.scenario.clearance import distances_m
from blast_env.units import MODULE_SIDE_M

_LEGEND: Final = {
    "P": "protected structure",
    "S": "other structure",
    "M": "barrier module",
    ".": "free cell",
    "x": "cell not available",
    "*": "charge",
    "~": "charge may be here",
}


def placing_text(
    placement: Placement, sources: Sequence[AnySource], lines: Sequence[str] = ()
) -> str:
    """Return the site as text: a character a module of 0.5 m, a frame, a legend.

    Args:
        placement: The modules placed so far.
        sources: Where the charge is, when it is a single point, or may be.
        lines: Text above the map, after the scenario's name.
    """
    characters = _map(placement.scenario, placement, sources)
    rule = f"+{'-' * characters.shape[1]}+"
    rows = [f"|{''.join(row)}|" for row in characters[::-1]]
    used = set(np.unique(characters).tolist())
    legend = ", ".join(f"{sign} {text}" for sign, text in _LEGEND.items() if sign in used)
    heading = "; ".join((placement.scenario.name, *lines))
    return "\n".join([heading, rule, *rows, rule, legend])


def _map(
    scenario: Scenario, placement: Placement, sources: Sequence[AnySource]
) -> NDArray[np.str_]:
    """Return the characters, (rows, columns), the lower edge of the site first."""
    rows, columns = (
        ceil(length_m / MODULE_SIDE_M - 1e-9)
        for length_m in (scenario.site.height_m, scenario.site.width_m)
    )
    y, x = _centres_m(rows)[:, np.newaxis], _centres_m(columns)[np.newaxis, :]
    characters = np.full((rows, columns), " ")
    zone = scenario.build_zone
    if zone is not None:
        free = placement.free
        for cell in zone.cells():
            sign = "M" if cell in placement.cells else "." if free[cell] else "x"
            characters[_inside(zone.cell_rectangle_m(cell), x, y)] = sign
    known = len(sources) == 1 and isinstance(sources[0], PointSource)
    for source in sources:
        near = distances_m(source, (x, y, x, y)) <= scenario.charge_radius_m
        characters[near] = "*" if known else "~"
    for structure in scenario.structures:
        sign = "P" if structure.protected else "S"
        characters[_inside(structure.rectangle_m, x, y)] = sign
    return characters


def _centres_m(count: int) -> NDArray[np.float64]:
    """Return the centres of so many squares in a row."""
    return np.asarray((np.arange(count) + 0.5) * MODULE_SIDE_M, dtype=np.float64)


def _inside(
    rectangle_m: Rectangle, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which squares have their centre in a rectangle."""
    left, bottom, right, top = rectangle_m
    inside: NDArray[np.bool_] = (x >= left) & (x < right) & (y >= bottom) & (y < top)
    return inside
