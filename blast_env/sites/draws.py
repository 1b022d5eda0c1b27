"""Drawing values and places on the grid of the modules."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor
from typing import NamedTuple

import numpy as np

from blast_env.geometry import Rectangle
from blast_env.scenario.zone import box_distances_m
from blast_env.sites.ranges import Span, WholeSpan, modules_within
from blast_env.units import MODULE_SIDE_M


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws values; each method takes one number from the stream.

    Attributes:
        rng: The stream.
    """

    rng: np.random.Generator

    def length_m(self, span_m: Span) -> float:
        """Return a multiple of 0.5 m; the lowest one where the range has none."""
        first, last = modules_within(span_m)
        return int(self.rng.integers(first, max(first, last), endpoint=True)) * MODULE_SIDE_M

    def amount(self, span: Span, digits: int) -> float:
        """Return a number, rounded to so many decimal places where the range allows it."""
        low, high = span
        drawn = round(low + (high - low) * float(self.rng.random()), digits)
        return min(max(drawn, low), high)

    def count(self, span: WholeSpan) -> int:
        """Return a whole number."""
        return int(self.rng.integers(*span, endpoint=True))

    def happens(self, probability: float) -> bool:
        """Return true with this probability."""
        return bool(self.rng.random() < probability)


def on_grid(value_m: float) -> float:
    """Return the largest multiple of 0.5 m that is not above a length."""
    return floor(value_m / MODULE_SIDE_M + 1e-9) * MODULE_SIDE_M


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
