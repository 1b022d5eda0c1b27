"""The direction that most walls of a site have, and where the grid's lines best lie."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import import_extra
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

_RIGHT_ANGLE_DEG: Final = 90.0
_NEAR_DEG: Final = 4.0
_NEAR_M: Final = 0.1
_STRAIGHT_DEG: Final = 2.0
_SHORTEST_M: Final = 1e-6


def dominant_direction_deg(outlines: Sequence[BaseGeometry]) -> float:
    """Return the direction of most walls, by their length, from the x axis: -45 to 45.

    Walls at right angles count together. It is the median of the walls near the direction that most
    metres of wall have, so that a few houses of another direction do not pull it away.
    """
    starts, ends = _walls(outlines)
    step = ends - starts
    angles = np.degrees(np.arctan2(step[:, 1], step[:, 0]))
    angle = _densest(angles, np.hypot(*step.T), _RIGHT_ANGLE_DEG, _NEAR_DEG)
    return angle - _RIGHT_ANGLE_DEG if angle > _RIGHT_ANGLE_DEG / 2.0 else angle


def grid_offset_m(outlines: Sequence[BaseGeometry]) -> tuple[float, float]:
    """Return where grid lines best lie, x and y from 0 to a module's side.

    There most metres of wall along the grid lie on them.
    """
    starts, ends = _walls(outlines)
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


def _walls(outlines: Sequence[BaseGeometry]) -> tuple[FloatArray, FloatArray]:
    """Return both ends of every wall of every outline (n, 2)."""
    rings = shapely.get_rings(shapely.get_parts(list(outlines)))
    places, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    starts, ends = places[:-1][same], places[1:][same]
    long = np.hypot(*(ends - starts).T) > _SHORTEST_M
    return starts[long], ends[long]


def _densest(values: FloatArray, weights: FloatArray, period: float, near: float) -> float:
    """Return where on a circle most weight lies, 0 to `period`; 0 without any weight."""
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
