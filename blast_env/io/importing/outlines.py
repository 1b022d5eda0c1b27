"""Outlines of a map: their edges, their repair, and limits on their length."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.units import MODULE_SIDE_M

MOST_CROSSED: Final = 400_000
"""Most cells along all outlines together: 200 km of walls."""

MOST_COVERED: Final = 64_000_000
"""Most cells in the bounding boxes of all outlines together: four sites of the largest size."""

MOST_CROSSINGS: Final = 1000
"""Most self-intersections of an outline that can be repaired."""

_PAIRS: Final = 2**21


def check_outlines(outlines: Sequence[BaseGeometry], what: str) -> None:
    """Refuse outlines that would take too long to convert to cells.

    Args:
        outlines: Valid outlines on the site, m.
        what: Description of the outlines, for the error.

    Raises:
        BlastEnvError: If they are too long, or their bounding boxes have too many cells.
    """
    starts, ends = edges_of(outlines)
    crossed = float(np.abs(ends - starts).sum()) / MODULE_SIDE_M
    if crossed > MOST_CROSSED:
        raise BlastEnvError(
            f"{what} run through {crossed:,.0f} cells of {MODULE_SIDE_M:g} m together, must run "
            f"through at most {MOST_CROSSED:,}: their outlines are too long"
        )
    left, bottom, right, top = shapely.bounds(list(outlines)).reshape(-1, 4).T
    covered = float(np.nansum((right - left) * (top - bottom))) / MODULE_SIDE_M**2
    if covered > MOST_COVERED:
        raise BlastEnvError(
            f"{what} take {covered:,.0f} cells of {MODULE_SIDE_M:g} m together, each with the "
            f"rectangle around it, must take at most {MOST_COVERED:,}: do they overlap?"
        )


def mended(outline: BaseGeometry, what: str) -> BaseGeometry:
    """Return an outline without self-intersections, possibly in several parts.

    Args:
        outline: Any outline.
        what: Description of the outline, for the error.

    Raises:
        BlastEnvError: If it crosses itself more than `MOST_CROSSINGS` times.
    """
    if shapely.is_valid(outline):
        return outline
    if _crosses_often(outline):
        raise BlastEnvError(
            f"{what} crosses itself more than {MOST_CROSSINGS:,} times, must cross itself at most "
            "that often for --repair"
        )
    return shapely.buffer(shapely.make_valid(outline), 0.0)


def _crosses_often(outline: BaseGeometry) -> bool:
    """Return whether an outline crosses itself too often, without finding all crossings."""
    walls = walls_of(outline)
    tree = shapely.STRtree(walls)
    step = max(_PAIRS // max(len(walls), 1), 1)
    pairs = 0
    for first in range(0, len(walls), step):
        some = walls[first : first + step]
        # Each wall intersects itself and its neighbours at both ends.
        pairs += tree.query(some, "intersects").shape[1] - 3 * len(some)
        if pairs > 2 * MOST_CROSSINGS:
            return True
    return False


def walls_of(outline: BaseGeometry) -> NDArray[np.object_]:
    """Return the edges of an outline as lines."""
    return np.asarray(shapely.linestrings(np.stack(edges_of([outline]), axis=1)))


def edges_of(outlines: Sequence[BaseGeometry]) -> tuple[FloatArray, FloatArray]:
    """Return both ends of all edges of outlines (n, 2)."""
    rings = shapely.get_rings(shapely.get_parts(list(outlines)))
    places, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    return places[:-1][same], places[1:][same]


def areas_of(shape: BaseGeometry) -> BaseGeometry:
    """Return the areas of a geometry, without its lines and points."""
    parts = shapely.get_parts(shape)
    areas = parts[shapely.get_dimensions(parts) == 2]
    return areas[0] if len(areas) == 1 else shapely.MultiPolygon(list(np.asarray(areas)))
