"""Compiled search over the steps of a driving vehicle, imported on first use.

Lengths and labels are those of `blast_env.scenario.driving_steps`. Sets of places are bits, 64 of a
row in a word: the first place of a row is the lowest bit of its first word.
"""

from typing import Final

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.scenario.driving_steps import NEVER, IntArray32, Labels

Bits = NDArray[np.uint64]

_WORD: Final = 64
_ONE: Final = np.uint64(1)

_DE_BRUIJN: Final = 0x03F79D71B4CB0A89
"""De Bruijn sequence: its windows of six bits are distinct, and so identify a single bit."""

_PLACE: Final = np.argsort(
    [((_DE_BRUIJN << bit) & (2**_WORD - 1)) >> (_WORD - 6) for bit in range(_WORD)]
)


def packed(places: BoolArray, padding: int = 0) -> Bits:
    """Return places as bits (rows, words), with `padding` empty words at both ends of each row."""
    rows, columns = places.shape
    words = -(-columns // _WORD)
    whole = np.zeros((rows, _WORD * (words + 2 * padding)), dtype=bool)
    whole[:, _WORD * padding : _WORD * padding + columns] = places
    bits: Bits = np.packbits(whole, axis=1, bitorder="little").view(np.uint64)
    return bits


def all_open(places: BoolArray, first: IntArray32, points: IntArray32) -> Bits:
    """Return the starts from which all points of each arc are in `places` (arcs, rows, words).

    Args:
        places: The places (rows, columns).
        first: As in `Arcs`.
        points: As in `Arcs`.
    """
    padding = _padding(points)
    bits = packed(places, padding)
    found = np.empty((len(first) - 1, len(bits), bits.shape[1] - 2 * padding), dtype=np.uint64)
    _all_open(bits, padding, first, points, found)
    return found


def any_slow(places: BoolArray, first: IntArray32, points: IntArray32, passable: Bits) -> Bits:
    """Return the starts from which any point of each arc is in `places` (arcs, rows, words).

    Args:
        places: As for `all_open`.
        first: As for `all_open`.
        points: As for `all_open`.
        passable: Starts to examine (arcs, rows, words); the points of their arcs are all inside.
    """
    padding = _padding(points)
    found = np.zeros_like(passable)
    _any_slow(packed(places, padding), padding, first, points, passable, found)
    return found


def _padding(points: IntArray32) -> int:
    """Return the number of words that points may reach beyond the ends of a row."""
    return int(np.abs(points[:, 0]).max()) // _WORD + 2


@njit(cache=True, inline="always")
def _from(row: Bits, word: int, by: int) -> np.uint64:
    """Return a word of a row shifted by `by` places."""
    at, part = word + (by >> 6), by & 63
    seen: np.uint64 = row[at] >> uint64(part)
    if part:
        seen |= row[at + 1] << uint64(_WORD - part)
    return seen


@njit(cache=True)
def _all_open(bits: Bits, padding: int, first: IntArray32, points: IntArray32, found: Bits) -> None:
    """Fill `found` with the result of `all_open`."""
    arcs, rows, words = found.shape
    for arc in range(arcs):
        begin, end = first[arc], first[arc + 1]
        y = points[begin:end, 1]
        low, high = -min(y.min(), 0), rows - max(y.max(), 0)
        found[arc] = 0
        for row in range(low, high):
            for word in range(words):
                left = bits[row, padding + word]
                at = begin
                while left and at < end:
                    left &= _from(bits[row + points[at, 1]], padding + word, points[at, 0])
                    at += 1
                found[arc, row, word] = left


@njit(cache=True)
def _any_slow(
    bits: Bits,
    padding: int,
    first: IntArray32,
    points: IntArray32,
    passable: Bits,
    found: Bits,
) -> None:
    """Fill `found` with the result of `any_slow`."""
    arcs, rows, words = found.shape
    for arc in range(arcs):
        for row in range(rows):
            for word in range(words):
                if passable[arc, row, word]:
                    for at in range(first[arc], first[arc + 1]):
                        found[arc, row, word] |= _from(
                            bits[row + points[at, 1]], padding + word, points[at, 0]
                        )


@njit(cache=True, inline="always")
def _lowest(bits: np.uint64) -> int:
    """Return the position of the lowest set bit."""
    place: int = _PLACE[((bits & (~bits + _ONE)) * uint64(_DE_BRUIJN)) >> uint64(_WORD - 6)]
    return place


@njit(cache=True)
def _highest(bits: np.uint64) -> int:
    """Return the position of the highest set bit."""
    for by in (1, 2, 4, 8, 16, 32):
        bits |= bits >> uint64(by)
    return _lowest(bits ^ (bits >> _ONE))


@njit(cache=True, inline="always")
def _raise(
    labels: Labels,
    changed: Bits,
    waiting: BoolArray,
    number: int,
    row: int,
    column: int,
    value: float,
) -> None:
    """Set a label, and mark its state for further steps."""
    labels[number, row, column] = value
    changed[number, row, column >> 6] |= _ONE << uint64(column & 63)
    waiting[number, row] = True


@njit(cache=True)
def _straight_and_spot(
    number: int,
    is_open: BoolArray,
    is_wide: BoolArray,
    most: Labels,
    labels: Labels,
    changed: Bits,
    waiting: BoolArray,
    spots: Labels,
    step: IntArray32,
    length: float,
    spot_limit: np.float32,
) -> None:
    """Propagate changed labels of one direction straight on, and by turns on the spot.

    Places are visited in the direction of travel, so that one pass propagates a label to the end.

    Args:
        number: The direction.
        is_open: As in `spread`.
        is_wide: As in `spread`.
        most: As in `spread`.
        labels: As in `spread`.
        changed: States whose steps are to be tried (directions, rows, words).
        waiting: Whether each row has any of them (directions, rows).
        spots: The largest label of a turn on the spot so far (rows, columns).
        step: The step of the direction.
        length: Its length.
        spot_limit: The largest label of a turn on the spot.
    """
    count, rows, columns = labels.shape
    words = changed.shape[2]
    x, y = step
    for i in range(rows):
        row = i if y >= 0 else rows - 1 - i
        if not waiting[number, row]:
            continue
        up = row + y
        for j in range(words):
            word = j if x >= 0 else words - 1 - j
            done = uint64(0)
            while True:
                bits = changed[number, row, word] & ~done
                if not bits:
                    break
                bit = _lowest(bits) if x >= 0 else _highest(bits)
                done |= _ONE << uint64(bit)
                column = _WORD * word + bit
                label = labels[number, row, column]
                if is_wide[row, column] and min(label, spot_limit) > spots[row, column]:
                    spots[row, column] = spot = min(label, spot_limit)
                    for other in range(count):
                        if spot > labels[other, row, column]:
                            _raise(labels, changed, waiting, other, row, column, spot)
                right = column + x
                if not (0 <= up < rows and 0 <= right < columns and is_open[up, right]):
                    continue
                value = min(label + length, most[up, right])
                if value <= labels[number, up, right]:
                    continue
                if abs(x) == 2:
                    middle = column + x // 2
                    if not (is_open[row, middle] or is_open[up, middle]):
                        continue
                elif abs(y) == 2:
                    middle = row + y // 2
                    if not (is_open[middle, column] or is_open[middle, right]):
                        continue
                _raise(labels, changed, waiting, number, up, right, value)


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
    passable: Bits,
    slowed: Bits,
    slow_most: float,
    spot_most: float,
) -> None:
    """Raise labels until no step raises one any further.

    A label is the run-up from standstill to a speed, v^2 / 2 a, in steps; below 0 for unreachable
    states. Labels only rise, and their final values do not depend on the order of steps, which
    matters for run time alone. Steps are tried only from changed labels.

    Args:
        is_open: Whether each place is open (rows, columns).
        is_wide: Whether each place has room for a turn on the spot (rows, columns).
        most: The largest label at each place (rows, columns).
        labels: Labels, at first those of the entries (directions, rows, columns); changed in place.
        directions: The steps (directions, 2).
        lengths: Their lengths (directions,).
        of: As in `Arcs`.
        ends: As in `Arcs`.
        arc_lengths: Lengths of the arcs.
        arc_most: The largest label on each arc.
        passable: Starts from which each arc is open (arcs, rows, words).
        slowed: Starts from which it touches slow ground (arcs, rows, words); empty if none do.
        slow_most: The largest label on such ground.
        spot_most: The largest label of a turn on the spot.
    """
    count, rows, columns = labels.shape
    words = passable.shape[2]
    changed = np.zeros((count, rows, words), dtype=np.uint64)
    waiting = np.zeros((count, rows), dtype=np.bool_)
    spots = np.full((rows, columns), NEVER)
    spot_limit = np.float32(spot_most)  # in the precision of labels, else the loop would not end
    for number in range(count):
        for row in range(rows):
            for column in range(columns):
                if labels[number, row, column] >= 0.0:
                    label = labels[number, row, column]
                    _raise(labels, changed, waiting, number, row, column, label)
    first = np.searchsorted(of[:, 0], np.arange(count + 1))
    while waiting.any():
        for number in range(count):
            if not waiting[number].any():
                continue
            _straight_and_spot(
                number,
                is_open,
                is_wide,
                most,
                labels,
                changed,
                waiting,
                spots,
                directions[number],
                lengths[number],
                spot_limit,
            )
            for arc in range(first[number], first[number + 1]):
                other, (x, y) = of[arc, 1], ends[arc]
                length, limit = arc_lengths[arc], arc_most[arc]
                slow_limit = np.float32(min(limit, slow_most))
                for row in range(rows):
                    if not waiting[number, row]:
                        continue
                    for word in range(words):
                        bits = changed[number, row, word] & passable[arc, row, word]
                        slow = slowed[arc, row, word] if slowed.size else uint64(0)
                        while bits:
                            bit = _lowest(bits)
                            bits &= bits - _ONE
                            column = _WORD * word + bit
                            most_here = slow_limit if (slow >> uint64(bit)) & _ONE else limit
                            value = min(labels[number, row, column] + length, most_here)
                            if value > labels[other, row + y, column + x]:
                                _raise(labels, changed, waiting, other, row + y, column + x, value)
            changed[number] = 0
            waiting[number] = False


@njit(cache=True)
def fastest_into(
    run_up_m: Labels,
    among: BoolArray,
    box: IntArray,
    steps_m: FloatArray,
    lengths_m: Labels,
    sides_m: FloatArray,
    place_m: float,
    slack_m: float,
    epsilon_m: float,
) -> int:
    """Return the state with the fastest next step into a rectangle; -1 if there is none.

    Args:
        run_up_m: As in `SpeedField`.
        among: Places to examine (rows, columns).
        box: First row and the one after the last, then the same for columns, of the search.
        steps_m: Steps of the directions (directions, 2).
        lengths_m: Their lengths.
        sides_m: Left, bottom, right and top of the rectangle, grown by half of the vehicle's width.
        place_m: Spacing of places.
        slack_m: Largest depth inside the rectangle at which a place counts as outside.
        epsilon_m: Least depth inside the rectangle at which a step must end.
    """
    left, bottom, right, top = sides_m
    _, rows, columns = run_up_m.shape
    best, found = np.float32(-1.0), -1
    for number in range(len(steps_m)):
        step_x, step_y = steps_m[number]
        for row in range(box[0], box[1]):
            y = place_m * row
            if not bottom + epsilon_m < y + step_y < top - epsilon_m:
                continue
            inwards_y = (step_y > 0.0 and y <= bottom + slack_m) or (
                step_y < 0.0 and y >= top - slack_m
            )
            for column in range(box[2], box[3]):
                own, x = run_up_m[number, row, column], place_m * column
                if own < 0.0 or not among[row, column]:
                    continue
                if not left + epsilon_m < x + step_x < right - epsilon_m:
                    continue
                inwards = (
                    inwards_y
                    or (step_x > 0.0 and x <= left + slack_m)
                    or (step_x < 0.0 and x >= right - slack_m)
                )
                value = own + lengths_m[number]
                if inwards and value > best:
                    best, found = value, (number * rows + row) * columns + column
    return found
