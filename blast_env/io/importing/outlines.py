"""Outlines of a map: their walls, the directions of these, repair, and limits on length."""

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
_RIGHT_ANGLE_DEG: Final = 90.0
_NEAR_DEG: Final = 4.0
_NEAR_M: Final = 0.1
_STRAIGHT_DEG: Final = 2.0


def check_outlines(outlines: Sequence[BaseGeometry], what: str) -> None:
    """Refuse outlines that would take too long to convert to cells.

    Args:
        outlines: Valid outlines on the site, m.
        what: Description of the outlines, for the error.
    """
    starts, ends = _edges_of(outlines)
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

    What lies in several of its outlines, or is gone round twice, is inside; what lies in any of its
    courtyards is not, nor is the rest of a courtyard that sticks out.

    Args:
        what: Description of the outline, for the error.
    """
    if shapely.is_valid(outline):
        return outline
    if _crosses_often(outline):
        raise BlastEnvError(
            f"{what} crosses itself more than {MOST_CROSSINGS:,} times, must cross itself at most "
            "that often for --repair"
        )
    # The usual method, "linework", takes what lies in an even number of rings for outside.
    sound = shapely.make_valid(outline, method="structure", keep_collapsed=False)
    return shapely.buffer(sound, 0.0)


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
    return np.asarray(shapely.linestrings(np.stack(_edges_of([outline]), axis=1)))


def _edges_of(outlines: Sequence[BaseGeometry]) -> tuple[FloatArray, FloatArray]:
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


def dominant_direction_deg(outlines: Sequence[BaseGeometry]) -> float:
    """Return the direction of most walls, weighted by length, from the x axis: -45 to 45.

    Walls at right angles count together. The result is the median over the walls near the most
    frequent direction, so that a few houses in another direction have no influence.
    """
    starts, ends = _edges_of(outlines)
    step = ends - starts
    angles = np.degrees(np.arctan2(step[:, 1], step[:, 0]))
    angle = _densest(angles, np.hypot(*step.T), _RIGHT_ANGLE_DEG, _NEAR_DEG)
    return angle - _RIGHT_ANGLE_DEG if angle > _RIGHT_ANGLE_DEG / 2.0 else angle


def grid_offset_m(outlines: Sequence[BaseGeometry]) -> tuple[float, float]:
    """Return the offset in x and y, 0 to a module's side, at which most walls lie on grid lines.

    Walls along the grid count, by their length.
    """
    starts, ends = _edges_of(outlines)
    step = ends - starts
    slope = np.tan(np.radians(_STRAIGHT_DEG))
    offsets = []
    for across in (0, 1):
        along = 1 - across
        straight = np.abs(step[:, across]) <= slope * np.abs(step[:, along])
        places = 0.5 * (starts + ends)[straight, across]
        lengths = np.abs(step[straight, along])
        offsets.append(_densest(places, lengths, MODULE_SIDE_M, _NEAR_M))
    return offsets[0], offsets[1]


def _densest(values: FloatArray, weights: FloatArray, period: float, near: float) -> float:
    """Return the position of most weight on a circle, 0 to `period`; 0 without values."""
    if len(values) == 0:
        return 0.0
    values = values % period
    kinds, where = np.unique(np.round(values / (0.1 * near)), return_inverse=True)
    heaps = np.bincount(where, weights)
    centres = kinds * 0.1 * near
    gaps = np.abs((centres[:, np.newaxis] - centres + period / 2.0) % period - period / 2.0)
    closeness = np.maximum(0.0, 1.0 - gaps / near)
    best = centres[int(np.argmax(closeness @ heaps))]
    offset = (values - best + period / 2.0) % period - period / 2.0
    nearby = np.abs(offset) <= near
    order = np.argsort(offset[nearby])
    heap = np.cumsum(weights[nearby][order])
    median = offset[nearby][order][np.searchsorted(heap, 0.5 * heap[-1])]
    return float((best + median) % period)
