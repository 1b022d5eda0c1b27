"""Drawing a place for a thing among others."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from blast_env.geometry import Rectangle
from blast_env.scenario.clearance import box_distances_m
from blast_env.sites.draws import Draws
from blast_env.units import MODULE_SIDE_M

_TOLERANCE_M = 1e-9


class Apart(NamedTuple):
    """Something that a thing must not come near to.

    Attributes:
        rectangle: Where it is, m.
        distance_m: How far away the thing must be; at 0 they may touch, but not overlap.
    """

    rectangle: Rectangle
    distance_m: float


def draw_place(
    draws: Draws, area: Rectangle, size_m: tuple[float, float], others: Sequence[Apart]
) -> Rectangle | None:
    """Draw where a thing stands, all places on the 0.5 m grid as likely.

    Args:
        draws: Draws.
        area: Where it must lie, m; its corner is on the grid.
        size_m: Width and height.
        others: What it must keep away from.

    Returns:
        `None` if there is no such place.
    """
    width_m, height_m = size_m
    left = np.arange(area.left, area.right - width_m + _TOLERANCE_M, MODULE_SIDE_M)
    bottom = np.arange(area.bottom, area.top - height_m + _TOLERANCE_M, MODULE_SIDE_M)
    bottom = bottom[:, np.newaxis]
    boxes = (left, bottom, left + width_m, bottom + height_m)
    has_room = np.ones((len(bottom), len(left)), dtype=bool)
    for rectangle, distance_m in others:
        if distance_m > 0.0:
            has_room &= box_distances_m(rectangle, boxes) >= distance_m - _TOLERANCE_M
        else:
            # Smaller by a little, so that what only touches is at a distance.
            has_room &= box_distances_m(rectangle.grown(-_TOLERANCE_M), boxes) > 0.0
    places = np.argwhere(has_room)
    if not len(places):
        return None
    row, column = places[draws.count((0, len(places) - 1))].tolist()
    corner_m = (float(left[column]), float(bottom[row, 0]))
    return Rectangle.from_corner(corner_m, size_m)
