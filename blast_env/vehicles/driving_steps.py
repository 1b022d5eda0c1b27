"""The steps of a driving vehicle on a grid of places.

Lengths are in steps along an axis, and speeds are labels: the run-up from standstill to the speed,
v^2 / 2 a. See `blast_env.vehicles.driving`.
"""

from collections.abc import Iterator
from functools import cache, lru_cache
from itertools import product
from math import acos, ceil, hypot, tan
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray

_EIGHTH: Final = ((1, 0), (2, 1), (1, 1), (1, 2))
DIRECTIONS: Final = np.array(
    [
        (x * cos - y * sin, x * sin + y * cos)
        for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1))
        for x, y in _EIGHTH
    ],
    dtype=np.int32,
)
"""Steps in each direction, counterclockwise from the x axis (directions, 2)."""

LENGTHS: Final = np.hypot(*DIRECTIONS.T).astype(np.float32)
"""Lengths of these steps, in steps along an axis."""

_TURNS: Final = ((1, 7.0, 250.0), (2, 6.0, 20.0))
"""Turns of arcs in directions, with their least and largest radius in steps."""

SPOT: Final = 7.0
"""Radius, in steps, below which a turn is one on the spot."""

_RATIO: Final = 1.2
"""Least ratio of successive radii of arcs."""

NEVER: Final = np.float32(-1e9)
"""The label of an unreachable state."""

IntArray32 = NDArray[np.int32]
Labels = NDArray[np.float32]


class Arcs(NamedTuple):
    """The arcs from each direction to others; lengths in steps.

    Attributes:
        of: First and last direction of each arc (arcs, 2), sorted by the first.
        first: Index of each arc's first point in `points`, and the number of points (arcs + 1,).
        points: Points near the arcs, relative to their starts (points, 2).
        ends: Ends relative to their starts (arcs, 2).
        lengths: Lengths (arcs,).
        radii: Largest radius that each represents (arcs,).
    """

    of: IntArray32
    first: IntArray32
    points: IntArray32
    ends: IntArray32
    lengths: Labels
    radii: Labels

    def up_to(self, radius: float) -> "Arcs":
        """Return the arcs without those wider than any speed up to that of a radius needs."""
        kept = np.ones(len(self.of), dtype=bool)
        same = (self.of[1:] == self.of[:-1]).all(axis=1)
        # Arcs of a pair rise by radius: once one is wide enough for the speed, wider ones add
        # nothing.
        kept[1:] = ~same | (self.radii[:-1] < radius)
        return self._only(kept)

    def every(self, step: int) -> "Arcs":
        """Return one arc in `step` for each pair of directions, by falling radius."""
        number = np.arange(len(self.of))
        ends = np.append((self.of[1:] != self.of[:-1]).any(axis=1), True)
        # The index of the widest arc of each pair, counted down from.
        last = np.minimum.accumulate(np.where(ends, number, len(number))[::-1])[::-1]
        return self._only((last - number) % step == 0)

    def _only(self, kept: BoolArray) -> "Arcs":
        points = [self.points[self.first[arc] : self.first[arc + 1]] for arc in kept.nonzero()[0]]
        first = np.concatenate(([0], np.cumsum([len(point) for point in points])))
        return Arcs(
            self.of[kept],
            first.astype(np.int32),
            np.concatenate(points),
            self.ends[kept],
            self.lengths[kept],
            self.radii[kept],
        )


def wide_places(is_open: BoolArray) -> BoolArray:
    """Return the places with room for a turn on the spot: 1 m of open ground along x and y."""
    found = []
    for axis in range(2):
        padded = np.pad(is_open, 2)
        ahead = np.roll(padded, -1, axis) & np.roll(padded, -2, axis)
        behind = np.roll(padded, 1, axis) & np.roll(padded, 2, axis)
        found.append((ahead | behind)[2:-2, 2:-2])
    wide: BoolArray = is_open & found[0] & found[1]
    return wide


@lru_cache(maxsize=16)
def arcs_up_to(radius: float, step: int = 1) -> Arcs:
    """Return `all_arcs().up_to(radius).every(step)`, cached."""
    return all_arcs().up_to(radius).every(step)


@cache
def all_arcs() -> Arcs:
    """Return all arcs, by rising radius for each pair of directions."""
    of, first, points, ends = [], [0], [], []
    lengths, radii = [], []
    for number, (by, least, most) in product(range(len(DIRECTIONS)), _TURNS):
        for other in ((number + by) % len(DIRECTIONS), (number - by) % len(DIRECTIONS)):
            found = [*_between(DIRECTIONS[number], DIRECTIONS[other], least, most)]
            for index, (before, after, radius) in enumerate(found):
                on_arc, length = _arc(before, after, radius)
                of.append((number, other))
                points.append(on_arc)
                first.append(first[-1] + len(on_arc))
                ends.append(before + after)
                lengths.append(length)
                # Radii up to that of the next arc need at least the room of this arc.
                wider = found[index + 1][2] if index + 1 < len(found) else _RATIO * radius
                radii.append(wider)
    return Arcs(
        np.array(of, dtype=np.int32),
        np.array(first, dtype=np.int32),
        np.concatenate(points),
        np.array(ends, dtype=np.int32),
        np.array(lengths, dtype=np.float32),
        np.array(radii, dtype=np.float32),
    )


def _between(
    one: IntArray32, other: IntArray32, least: float, most: float
) -> Iterator[tuple[IntArray32, IntArray32, float]]:
    """Yield the tangents and radii of arcs between two directions, by rising radius."""
    lengths = hypot(*one), hypot(*other)
    # An arc between two tangents of length t with the angle a between directions has the radius t /
    # tan(a / 2); tangents are whole numbers of either step, so that ends are places.
    cosine = float(one @ other) / (lengths[0] * lengths[1])
    per_tangent = 1.0 / tan(acos(cosine) / 2.0)
    tangents = {index * length for index in range(1, 200) for length in lengths}
    last = 0.0
    for tangent in sorted(tangents):
        radius = tangent * per_tangent
        if radius >= max(least, _RATIO * last) and last < most:
            last = radius
            counts = [ceil(tangent / length - 1e-9) for length in lengths]
            yield counts[0] * one, counts[1] * other, radius


def _arc(before: IntArray32, after: IntArray32, radius: float) -> tuple[IntArray32, float]:
    """Return the points near an arc with its two tangents, and its length."""
    one, other = before / hypot(*before), after / hypot(*after)
    cross = float(one[0] * other[1] - one[1] * other[0])
    side, angle = np.sign(cross), acos(float(one @ other))
    tangent = radius * tan(angle / 2.0)
    # (1) Where the arc leaves its first tangent; (2) the centre, beside it; (3) points on the arc,
    # four per place; (4) points on what is left of the tangents; (5) each place once.
    start = before - tangent * one
    centre = start + radius * side * np.array([-one[1], one[0]])
    turned = np.linspace(0.0, side * angle, 4 * ceil(radius * angle) + 2)
    (x, y), cos, sin = start - centre, np.cos(turned), np.sin(turned)
    arc = centre + np.column_stack((x * cos - y * sin, x * sin + y * cos))
    parts = [arc]
    for begin, end in ((np.zeros(2), arc[0]), (arc[-1], before + after)):
        parts.append(np.linspace(begin, end, 4 * ceil(np.hypot(*(end - begin))) + 2))
    points = np.unique(np.rint(np.concatenate(parts)).astype(np.int32), axis=0)
    # Points farthest from the middle come first: they are the most likely not to be open.
    off = np.hypot(*(points - points.mean(axis=0)).T)
    points = points[np.argsort(-off, kind="stable")]
    length = hypot(*before) + hypot(*after) - 2.0 * tangent + radius * angle
    return points, float(length)
