"""The parts of a plane that a vehicle's centre can reach, in compiled code.

The plane is cut at all edges of obstacles, grown by half of the vehicle's width. Its parts are the
cuts and the spaces between, in turn, along both axes. All lengths are whole micrometres.
"""

from typing import Any

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, IntArray
from blast_env.compilation import compiled


@compiled(nogil=True)
def plane_of(boxes: IntArray, level: IntArray, half: int, end: int, step: int, axis: int) -> Any:
    """Return the cuts along an axis, and the places of the charge, rising.

    Args:
        boxes: Grown obstacles and shrunk entries (boxes, 4).
        level: Structures (structures, 4).
        half: Half of the width of the vehicle.
        end: Length of the site along the axis.
        step: Spacing of regular places.
        axis: 0 for x, 1 for y.
    """
    last = max(end - half, half)
    cuts = _with_ends(boxes, axis, half, last)
    regular = np.arange(half, last + 1, step)
    beside = _with_ends(level, axis, half, last)
    return cuts, np.unique(np.concatenate((cuts, regular, beside)))


@njit(error_model="numpy")
def with_edges(values: IntArray, boxes: IntArray, axis: int) -> IntArray:
    """Return rising, distinct values with the edges of boxes between the ends of the plane, rising.

    Args:
        values: The values, which include both ends.
        boxes: The boxes (boxes, 4), few of them.
        axis: 0 for x, 1 for y.
    """
    edges = np.empty(2 * len(boxes), dtype=np.int64)
    count = 0
    for box in range(len(boxes)):
        for side in (axis, axis + 2):
            edge, at = boxes[box, side], count
            if not values[0] < edge < values[-1]:
                continue
            while at and edges[at - 1] > edge:
                edges[at] = edges[at - 1]
                at -= 1
            edges[at] = edge
            count += 1
    found = np.empty(len(values) + count, dtype=np.int64)
    size = at = 0
    for number in range(len(values)):
        while at < count and edges[at] <= values[number]:
            if edges[at] < values[number] and (not size or found[size - 1] < edges[at]):
                found[size] = edges[at]
                size += 1
            at += 1
        found[size] = values[number]
        size += 1
    return found[:size]


@njit(error_model="numpy")
def _with_ends(boxes: IntArray, axis: int, first: int, last: int) -> IntArray:
    """Return the distinct edges of boxes between two ends, and the ends, rising."""
    found = np.empty(2 * len(boxes) + 2, dtype=np.int64)
    found[0], found[1], count = first, last, 2
    for box in range(len(boxes)):
        for edge in (boxes[box, axis], boxes[box, axis + 2]):
            if first < edge < last:
                found[count] = edge
                count += 1
    return np.unique(found[:count])


@compiled(nogil=True)
def reached_parts(
    x: IntArray, y: IntArray, closed: IntArray, solid: IntArray, starts: IntArray
) -> Any:
    """Return where the vehicle's centre starts, what it reaches, and where nothing is below it.

    Corners connect along edges, and edges along rectangles, so parts connect side by side and
    never diagonally.

    Args:
        x: Cuts along x.
        y: Cuts along y.
        closed: Grown obstacles that stop it (boxes, 4).
        solid: Grown obstacles that it drives over (boxes, 4).
        starts: The places of its centre behind each entry (entries, 4).

    Returns:
        Three masks of the parts (2 y - 1, 2 x - 1).
    """
    # 1. What is closed, and where it starts.
    is_closed = _covered(x, y, closed)
    start = np.zeros_like(is_closed)
    for strip in range(len(starts)):
        low, high = _from_to(y, starts[strip, 1], starts[strip, 3])
        first, after = _from_to(x, starts[strip, 0], starts[strip, 2])
        start[low:high, first:after] = True
    start &= ~is_closed
    # 2. From there to all parts beside that are not closed.
    reached = _filled(is_closed, start)
    return start, reached, ~_covered(x, y, solid)


@njit(error_model="numpy")
def _filled(is_closed: BoolArray, start: BoolArray) -> BoolArray:
    """Return the parts that are connected with some to start from, side by side."""
    rows, columns = is_closed.shape
    # One closed part more on all sides, so that no part is at the border.
    wide = columns + 2
    is_over = np.ones((rows + 2) * wide, dtype=np.uint8)
    waiting = np.empty(rows * columns, dtype=np.int64)
    count = 0
    for row in range(rows):
        for column in range(columns):
            part = (row + 1) * wide + column + 1
            is_over[part] = is_closed[row, column] | start[row, column]
            if start[row, column]:
                waiting[count] = part
                count += 1
    reached = start.copy()
    while count:
        count -= 1
        part = waiting[count]
        for beside in (part - wide, part - 1, part + 1, part + wide):
            if is_over[beside] == 0:
                is_over[beside] = 1
                reached[beside // wide - 1, beside % wide - 1] = True
                waiting[count] = beside
                count += 1
    return reached


@njit(error_model="numpy")
def _covered(x: IntArray, y: IntArray, boxes: IntArray) -> BoolArray:
    """Return whether the vehicle overlaps a box at each part; touching does not count."""
    covered = np.zeros((2 * len(y) - 1, 2 * len(x) - 1), dtype=np.bool_)
    for box in range(len(boxes)):
        left, bottom, right, top = boxes[box]
        # The parts strictly between; a value that is not a cut lies beyond all of them.
        low = max(2 * np.searchsorted(y, bottom, side="right") - 1, 0)
        high = 2 * np.searchsorted(y, top, side="left")
        first = max(2 * np.searchsorted(x, left, side="right") - 1, 0)
        after = 2 * np.searchsorted(x, right, side="left")
        if low < high and first < after:
            covered[low:high, first:after] = True
    return covered


@njit(error_model="numpy")
def _from_to(cuts: IntArray, low: int, high: int) -> Any:
    """Return the parts of an axis from one cut to another, both within the site."""
    first = np.searchsorted(cuts, min(max(low, cuts[0]), cuts[-1]))
    last = np.searchsorted(cuts, min(max(high, cuts[0]), cuts[-1]))
    return 2 * first, 2 * last + 1
