"""The places at which pieces close the access way, in compiled code."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, IntArray
from blast_env.compilation import compiled

_BELOW = np.uint8(1)
_ABOVE = np.uint8(2)


@compiled(nogil=True)
def has_way(passable: BoolArray, width: int) -> bool:
    """Return whether a vehicle can cross a zone along its columns.

    Args:
        passable: Cells that the vehicle may cover (rows, columns).
        width: Side of the vehicle in cells, at most that of the zone.
    """
    return bool(_chains(passable, width)[-1, 0] & _BELOW == 0)


@compiled(nogil=True)
def closing_cells(passable: BoolArray, sizes: IntArray, width: int) -> BoolArray:
    """Return the lower left cells at which pieces close the way (sizes, rows, columns).

    Args:
        passable: See `has_way`.
        sizes: Rows and columns of each piece (sizes, 2); 0 and 0 of a measure, which closes none.
        width: See `has_way`.
    """
    rows, columns = passable.shape
    closing = np.zeros((len(sizes), rows, columns), dtype=np.bool_)
    _find_closing(passable, sizes, width, closing)
    return closing


@compiled(nogil=True)
def keep_open(
    indices: IntArray,
    passable: BoolArray,
    occupancy: NDArray[np.uint8],
    sizes: IntArray,
    width: int,
    is_upwards: bool,  # Numba has no keywords only
    legal: BoolArray,
) -> None:
    """Take away the places of some layouts that would close the way.

    Args:
        passable: Cells that are free of structures (rows, columns).
        occupancy: See `LayoutBatch`.
        sizes: Rows and columns of each variant (variants, 2); 0 and 0 of a measure.
        width: See `has_way`.
        is_upwards: Whether the way runs along the rows.
        legal: See `LayoutBatch`; updated in place.
    """
    rows, columns = passable.shape
    along = (columns, rows) if is_upwards else (rows, columns)
    open_cells, closing = np.empty(along, dtype=np.bool_), np.empty((len(sizes), *along), np.bool_)
    own_sizes = sizes[:, ::-1].copy() if is_upwards else sizes
    for index in indices:
        for row in range(rows):
            for column in range(columns):
                is_open = passable[row, column] and occupancy[index, row, column] == 0
                if is_upwards:
                    open_cells[column, row] = is_open
                else:
                    open_cells[row, column] = is_open
        closing[:] = False
        _find_closing(open_cells, own_sizes, width, closing)
        for size in range(len(sizes)):
            for row in range(rows):
                for column in range(columns):
                    closes = (
                        closing[size, column, row] if is_upwards else closing[size, row, column]
                    )
                    legal[index, size, row, column] &= not closes


@njit(error_model="numpy")
def _chains(passable: BoolArray, width: int) -> NDArray[np.uint8]:
    """Return the positions of the vehicle blocked by chains of obstacles from either border.

    Discrete duality: a way of the vehicle's squares exists if no chain of blocked positions,
    neighbours by side or corner, joins the two borders along the way. At position (i, j) the
    vehicle's lower left cell has row i - 1 and column j; the first and the last row are the
    borders, where the vehicle would leave the zone.

    Args:
        passable: See `has_way`.
        width: See `has_way`.

    Returns:
        Whether each is connected to the lower border, 1, and the upper one, 2 (rows - width + 3,
        columns - width + 1).
    """
    up, right = passable.shape[0] - width + 3, passable.shape[1] - width + 1
    # 1. Positions that a closed cell blocks, and a blocked row beyond either border.
    closed = _counts(~passable)
    blocked = np.ones((up, right), dtype=np.bool_)
    for row in range(up - 2):
        for column in range(right):
            blocked[1 + row, column] = _number(closed, row, row + width, column, column + width) > 0
    # 2. What is connected with each border.
    chains = np.zeros((up, right), dtype=np.uint8)
    waiting = np.empty((up * right, 2), dtype=np.int64)
    for mark, first in ((_BELOW, 0), (_ABOVE, up - 1)):
        count = right
        for column in range(right):
            chains[first, column] |= mark
            waiting[column, 0], waiting[column, 1] = first, column
        while count:
            count -= 1
            row, column = waiting[count]
            for other in range(max(row - 1, 0), min(row + 2, up)):
                for beside in range(max(column - 1, 0), min(column + 2, right)):
                    if blocked[other, beside] and not chains[other, beside] & mark:
                        chains[other, beside] |= mark
                        waiting[count, 0], waiting[count, 1] = other, beside
                        count += 1
    return chains


@njit(error_model="numpy")
def _find_closing(passable: BoolArray, sizes: IntArray, width: int, closing: BoolArray) -> None:
    """Mark where pieces close the way, if it is open, else all places; see `closing_cells`."""
    rows, columns = passable.shape
    chains = _chains(passable, width)
    up, right = chains.shape
    is_closed = chains[-1, 0] & _BELOW != 0
    below, above = _counts((chains & _BELOW) != 0), _counts((chains & _ABOVE) != 0)
    for size in range(len(sizes)):
        high, wide = sizes[size]
        if high == 0 or wide == 0:
            continue
        # A piece with lower left cell (i, j) blocks the positions (i - width + 2, j - width + 1) to
        # (i + high, j + wide - 1), as far as they exist. It closes the way where these are in or
        # next to both chains.
        for row in range(rows):
            bottom, top = max(row - width + 1, 0), min(row + high + 2, up)
            for column in range(columns):
                left, end = max(column - width, 0), min(column + wide + 1, right)
                closing[size, row, column] = is_closed or (
                    _number(below, bottom, top, left, end) > 0
                    and _number(above, bottom, top, left, end) > 0
                )


@njit(error_model="numpy")
def _counts(mask: BoolArray) -> NDArray[np.int32]:
    """Return the number of true cells below and left of each corner (rows + 1, columns + 1)."""
    rows, columns = mask.shape
    counts = np.zeros((rows + 1, columns + 1), dtype=np.int32)
    for row in range(rows):
        of_row = 0
        for column in range(columns):
            of_row += mask[row, column]
            counts[row + 1, column + 1] = counts[row, column + 1] + of_row
    return counts


@njit(error_model="numpy", inline="always")
def _number(counts: NDArray[np.int32], bottom: int, top: int, left: int, right: int) -> int:
    """Return the number of true cells in a window."""
    if bottom >= top or left >= right:
        return 0
    inside: int = (
        counts[top, right] - counts[bottom, right] - counts[top, left] + counts[bottom, left]
    )
    return inside
