"""The steps of a driving vehicle on a grid of places, and the search over them; compiled.

Lengths are in steps along an axis, and speeds are labels: the run-up that a speed takes from
standstill, v^2 / 2 a. `blast_env.scenario.driving` says what it is for.
"""

from collections.abc import Iterator
from functools import cache
from itertools import product
from math import acos, ceil, hypot, tan
from typing import Final, NamedTuple

import numpy as np
from numba import njit
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
"""By how many directions arcs turn, and from which radius to which one, in steps."""

SPOT: Final = 7.0
"""Radius, in steps, below which a turn is one on the spot."""

_RATIO: Final = 1.2
"""Radii of arcs grow by about this factor."""

NEVER: Final = np.float32(-1e9)
"""The label of a state in which the vehicle never is."""

IntArray32 = NDArray[np.int32]
Labels = NDArray[np.float32]


class Arcs(NamedTuple):
    """The arcs from each direction to others; lengths in steps.

    Attributes:
        of: The direction from which each leads, and the one to which (arcs, 2); sorted.
        first: Where the points of each begin in `points`, and where the last ones end (arcs + 1,).
        points: Points near the arcs, from their starts (points, 2).
        ends: Their ends (arcs, 2).
        lengths: Their lengths (arcs,).
        radii: Up to which radius each stands for (arcs,).
    """

    of: IntArray32
    first: IntArray32
    points: IntArray32
    ends: IntArray32
    lengths: Labels
    radii: Labels

    def up_to(self, radius: float) -> "Arcs":
        """Return them without those that are wider than need be for any speed up to a radius."""
        kept = np.ones(len(self.of), dtype=bool)
        same = (self.of[1:] == self.of[:-1]).all(axis=1)
        kept[1:] = ~same | (self.radii[:-1] < radius)
        points = [self.points[self.first[arc] : self.first[arc + 1]] for arc in kept.nonzero()[0]]
        first = np.concatenate(([0], np.cumsum([len(each) for each in points])))
        return Arcs(
            self.of[kept],
            first.astype(np.int32),
            np.concatenate(points),
            self.ends[kept],
            self.lengths[kept],
            self.radii[kept],
        )


def wide_places(is_open: BoolArray) -> BoolArray:
    """Return at which places a turn on the spot leads anywhere: with a metre along x and y."""
    found = []
    for axis in range(2):
        padded = np.pad(is_open, 2)
        ahead = np.roll(padded, -1, axis) & np.roll(padded, -2, axis)
        behind = np.roll(padded, 1, axis) & np.roll(padded, 2, axis)
        found.append((ahead | behind)[2:-2, 2:-2])
    wide: BoolArray = is_open & found[0] & found[1]
    return wide


@cache
def all_arcs() -> Arcs:
    """Return the arcs from every direction, those of one pair of directions by rising radius."""
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
                # What is wider than this arc, but less so than the next, needs more room than it.
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
    """Yield the tangents of arcs from one direction to another one, and their radii, rising."""
    lengths = hypot(*one), hypot(*other)
    cosine = float(one @ other) / (lengths[0] * lengths[1])
    per_tangent = 1.0 / tan(acos(cosine) / 2.0)
    tangents = {each * length for each in range(1, 200) for length in lengths}
    last = 0.0
    for tangent in sorted(tangents):
        radius = tangent * per_tangent
        if radius >= max(least, _RATIO * last) and last < most:
            last = radius
            counts = [ceil(tangent / length - 1e-9) for length in lengths]
            yield counts[0] * one, counts[1] * other, radius


def _arc(before: IntArray32, after: IntArray32, radius: float) -> tuple[IntArray32, float]:
    """Return the points near an arc between two tangents, and its length."""
    one, other = before / hypot(*before), after / hypot(*after)
    cross = float(one[0] * other[1] - one[1] * other[0])
    side, angle = np.sign(cross), acos(float(one @ other))
    tangent = radius * tan(angle / 2.0)
    start = before - tangent * one
    centre = start + radius * side * np.array([-one[1], one[0]])
    turned = np.linspace(0.0, side * angle, 4 * ceil(radius * angle) + 2)
    (x, y), cos, sin = start - centre, np.cos(turned), np.sin(turned)
    arc = centre + np.column_stack((x * cos - y * sin, x * sin + y * cos))
    parts = [arc]
    for begin, end in ((np.zeros(2), arc[0]), (arc[-1], before + after)):
        parts.append(np.linspace(begin, end, 4 * ceil(np.hypot(*(end - begin))) + 2))
    points = np.unique(np.rint(np.concatenate(parts)).astype(np.int32), axis=0)
    length = hypot(*before) + hypot(*after) - 2.0 * tangent + radius * angle
    return points, float(length)


@njit(cache=True)
def passable_places(
    places: BoolArray, every: bool, first: IntArray32, points: IntArray32, found: BoolArray
) -> None:
    """Work out from which places every point of an arc, or any, is one of some places.

    Args:
        places: The places (rows, columns).
        every: Whether every point must be, or any.
        first: As in `Arcs`.
        points: As in `Arcs`.
        found: The result (arcs, rows, columns); of arcs that leave the plane, false.
    """
    rows, columns = places.shape
    for arc in range(len(first) - 1):
        own = points[first[arc] : first[arc + 1]]
        low, high = max(0, -own[:, 1].min()), rows - max(0, own[:, 1].max())
        left, right = max(0, -own[:, 0].min()), columns - max(0, own[:, 0].max())
        found[arc] = False
        if low >= high or left >= right:
            continue
        found[arc, low:high, left:right] = every
        for at in range(len(own)):
            x, y = own[at]
            for row in range(low, high):
                into, seen = found[arc, row, left:right], places[row + y, left + x : right + x]
                if every:
                    into &= seen
                else:
                    into |= seen


@njit(cache=True)
def _straight(
    labels: Labels, is_open: BoolArray, most: Labels, x: int, y: int, length: float
) -> None:
    """Lead the labels of one direction straight on as far as the ground is open.

    Args:
        labels: Of the direction (rows, columns).
        is_open: As in `spread`.
        most: As in `spread`.
        x: Columns of its step.
        y: Rows of it.
        length: Length of it.
    """
    rows, columns = labels.shape
    for i in range(rows - abs(y)):
        row = i if y >= 0 else rows - 1 - i
        for j in range(columns - abs(x)):
            column = j if x >= 0 else columns - 1 - j
            up, right = row + y, column + x
            value = min(labels[row, column] + length, most[up, right])
            if labels[row, column] < 0.0 or not is_open[up, right] or value <= labels[up, right]:
                continue
            if abs(x) == 2:
                middle = column + x // 2
                if not (is_open[row, middle] or is_open[up, middle]):
                    continue
            elif abs(y) == 2:
                middle = row + y // 2
                if not (is_open[middle, column] or is_open[middle, right]):
                    continue
            labels[up, right] = value


@njit(cache=True)
def _turn(
    one: Labels,
    other: Labels,
    passable: BoolArray,
    slowed: BoolArray,
    end: IntArray32,
    length: float,
    limit: float,
    slow_limit: float,
) -> bool:
    """Lead the labels of one direction along an arc; return whether that raised any.

    Args:
        one: Labels of the direction at its start (rows, columns).
        other: Labels of the direction at its end.
        passable: From where the arc is open.
        slowed: From where it touches ground that slows the vehicle; empty if nothing does.
        end: From its start to its end.
        length: Its length.
        limit: The largest label on it.
        slow_limit: The largest label on it where it is slowed.
    """
    rows, columns = one.shape
    x, y = end
    low, high = max(0, -y), rows - max(0, y)
    left, right = max(0, -x), columns - max(0, x)
    along, most, never = np.float32(length), np.float32(limit), NEVER
    raised = np.float32(0.0)
    for row in range(low, high):
        starts, targets = one[row, left:right], other[row + y, left + x : right + x]
        ways = passable[row, left:right]
        if slowed.size == 0:  # no branch within: this loop takes most of the time
            for column in range(len(starts)):
                value = min(starts[column] + along, most)
                value = value if ways[column] and starts[column] >= 0.0 else never
                old = targets[column]
                raised = max(raised, value - old)
                targets[column] = max(value, old)
            continue
        slow = slowed[row, left:right]
        for column in range(len(starts)):
            value = min(starts[column] + along, np.float32(slow_limit) if slow[column] else most)
            if ways[column] and starts[column] >= 0.0 and value > targets[column]:
                raised = np.float32(1.0)
                targets[column] = value
    return bool(raised > 0.0)


@njit(cache=True)
def spread(
    is_open: BoolArray,
    is_wide: BoolArray,
    most: Labels,
    labels: Labels,
    directions: IntArray32,
    lengths: Labels,
    of: IntArray32,
    ends: IntArray32,
    arc_lengths: Labels,
    arc_most: Labels,
    passable: BoolArray,
    slowed: BoolArray,
    slow_most: float,
    spot_most: float,
) -> int:
    """Raise labels until no step raises one any further; return in how many rounds.

    A label is the run-up that a speed takes from standstill, v^2 / 2 a, in steps; below 0 where the
    vehicle never is.

    Args:
        is_open: Which places are open (rows, columns).
        is_wide: At which there is room to turn on the spot.
        most: The largest label at each place (rows, columns).
        labels: By direction and place, at first where the vehicle enters (directions, rows,
            columns).
        directions: The steps.
        lengths: Their lengths.
        of: As in `Arcs`.
        ends: As in `Arcs`.
        arc_lengths: Lengths of the arcs.
        arc_most: The largest label on each arc.
        passable: From where each arc is open (arcs, rows, columns).
        slowed: From where it touches ground that slows the vehicle; (1, rows, 0) if none is.
        slow_most: The largest label on such ground.
        spot_most: The largest label of a turn on the spot.
    """
    count, rows, columns = labels.shape
    changed = np.ones(count, dtype=np.bool_)
    spot_limit = np.float32(spot_most)  # as labels are: else it would be above them for ever
    rounds = 0
    while changed.any():
        rounds += 1
        for number in range(count):
            if changed[number]:
                x, y = directions[number]
                _straight(labels[number], is_open, most, x, y, lengths[number])
        going, changed = changed, np.zeros(count, dtype=np.bool_)
        for arc in range(len(of)):
            one, other = of[arc]
            if going[one] and _turn(
                labels[one],
                labels[other],
                passable[arc],
                slowed[min(arc, len(slowed) - 1)],
                ends[arc],
                arc_lengths[arc],
                arc_most[arc],
                min(arc_most[arc], slow_most),
            ):
                changed[other] = True
        for row in range(rows):
            for column in range(columns):
                if is_wide[row, column]:
                    spot = min(labels[:, row, column].max(), spot_limit)
                    for number in range(count):
                        if spot > labels[number, row, column]:
                            labels[number, row, column] = spot
                            changed[number] = True
    return rounds
