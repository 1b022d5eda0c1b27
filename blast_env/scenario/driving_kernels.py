"""The search over the steps of a driving vehicle; compiled, and imported when a vehicle drives.

Lengths and labels are those of `blast_env.scenario.driving_steps`.
"""

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray
from blast_env.scenario.driving_steps import NEVER, IntArray32, Labels


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
    if left >= right:  # an end below 0 would count from the other side
        return False
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
