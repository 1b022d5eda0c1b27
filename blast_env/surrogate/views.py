"""The view from a point: what stands where, as shares of cells around the way from the charge.

Relations tell of a solid by a few numbers, of which networks make a short message. A sum of such
messages does not tell where exactly a gap is, or which piece stands before which. The view does: a
raster in plan around the straight way, in which solids cover shares of cells. A share adds up over
solids. So the first layer of a network, which is linear, hears of each solid by itself, as it does
by messages.
"""

from math import ceil, floor
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.gas.simd import fill, get, lanes_at, load, own_frame, place, store
from blast_env.gas.state import FUSED
from blast_env.surrogate.layers import ROWS_AT_ONCE, SingleArray
from blast_env.surrogate.points import WallPoints
from blast_env.surrogate.relations import axes_of, is_above
from blast_env.surrogate.rooms import FLOAT, INTEGER, SINGLE, Numbers, Room
from blast_env.surrogate.ways import REFERENCE_KG

VIEW_BEHIND_M: Final = np.array((-12.0, -8.0, -5.0, -3.0, -1.5, 0.0))
"""Borders of the cells behind the charge, along the way, m for 100 kg."""

VIEW_STRETCHES: Final = 16
"""Cells between charge and point, of equal length."""

VIEW_BEYOND_M: Final = np.array((0.0, 2.0, 5.0))
"""Borders of the cells beyond the point, along the way, m for 100 kg."""

VIEW_ASIDE_M: Final = np.array(
    (-12.0, -9.0, -6.5, -4.5, -3.0, -2.0, -1.25, -0.75, -0.25)
    + (0.25, 0.75, 1.25, 2.0, 3.0, 4.5, 6.5, 9.0, 12.0)
)
"""Borders of the cells to the sides, m for 100 kg; the wall of the point faces the positive one."""

ROWS: Final = len(VIEW_BEHIND_M) - 1 + VIEW_STRETCHES + len(VIEW_BEYOND_M) - 1
COLUMNS: Final = len(VIEW_ASIDE_M) - 1
_FIRST_STRETCH: Final = len(VIEW_BEHIND_M) - 1
CELLS: Final = ROWS * COLUMNS
"""Cells of a view."""

VIEW: Final = 2 * CELLS
"""Numbers of a view: the covered share of each cell, then that share times the scaled height."""

HUNDREDTHS: Final = 100.0
VIEW_MOST: Final = 2.55
"""Bound on the numbers of a view, which a fit keeps in bytes, as hundredths.

Parts of solids are larger than cells where a charge is close to a wall.
"""

_PART_M: Final = 0.25
"""Largest side of the parts of a small solid, each of which lies in one cell."""

_MOST_PARTS: Final = 24
"""Most parts of a solid along a side."""

_MOST_HEIGHT_M: Final = 12.0
"""Higher solids are all alike."""

_REFERENCE_SCALE: Final = float(np.cbrt(REFERENCE_KG))

_STEP_M: Final = 0.25
"""All borders are multiples of it, so that a table tells the cell of a position."""


def _table(borders_m: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the number of the cell of each step from the first border on, and all lengths, m."""
    lengths_m = np.diff(borders_m)
    return np.repeat(np.arange(len(lengths_m)), np.rint(lengths_m / _STEP_M).astype(int)), lengths_m


_ASIDE_CELLS, _ASIDE_LENGTHS_M = _table(VIEW_ASIDE_M)
_BEHIND_CELLS, _BEHIND_LENGTHS_M = _table(VIEW_BEHIND_M)
_BEYOND_CELLS, _BEYOND_LENGTHS_M = _table(VIEW_BEYOND_M)


class ViewRoom(NamedTuple):
    """Room for a view in compiled code.

    Attributes:
        raster: The view of solids from a point, else 0 (VIEW,).
        cells: Its cells that are not empty (VIEW,).
        shares: What they have (VIEW,).
    """

    raster: FloatArray
    cells: Numbers
    shares: SingleArray

    @classmethod
    def in_room(cls, room: Room) -> "ViewRoom":
        """Return arrays with any content."""
        return cls(
            room("raster", (VIEW,), FLOAT),
            room("cells of a view", (VIEW,), INTEGER),
            room("shares of a view", (VIEW,), SINGLE),
        )


def solid_views(
    start_m: FloatArray,
    points_m: FloatArray,
    outward: FloatArray,
    scale_m: float,
    solids: FloatArray,
) -> FloatArray:
    """Return the view of solids from each column of points (columns, VIEW).

    Args:
        start_m: Position of the charge (3,).
        points_m: The points; those above each other are consecutive: a column (points, 3).
        outward: Outward normals of their walls, in plan (points, 2).
        scale_m: Scaling length: the cube root of the charge's mass in kg.
        solids: Left, bottom, right, top and height of each solid, m (solids, 5).
    """
    found = np.zeros((len(points_m), VIEW))
    columns = put_views(start_m, points_m, outward, scale_m, np.ascontiguousarray(solids), found)
    return np.minimum(found[:columns], VIEW_MOST)


@compiled(nogil=True, error_model="numpy")
def put_views(
    start_m: FloatArray,
    points_m: FloatArray,
    outward: FloatArray,
    scale_m: float,
    solids: FloatArray,
    found: FloatArray,
) -> int:
    """Add solids to the views from columns of points; return the number of columns."""
    columns = 0
    for point in range(len(points_m)):
        if is_above(points_m, outward, point):
            continue
        for solid in range(len(solids)):
            put_view(
                start_m, points_m[point], outward[point], scale_m, solids[solid], found[columns]
            )
        columns += 1
    return columns


@njit(error_model="numpy")
def put_view(
    start_m: FloatArray,
    point_m: FloatArray,
    outward: FloatArray,
    scale_m: float,
    solid: FloatArray,
    found: FloatArray,
) -> None:
    """Add a solid to the view from a point (VIEW,); see `solid_views`."""
    # 1. The axes: ahead along the way in plan, aside to where the wall faces, as of relations.
    way_m, (ahead_x, ahead_y), (aside_x, aside_y) = axes_of(start_m, point_m, outward)
    # 2. The solid in parts, each in the cell of its centre.
    by = _REFERENCE_SCALE / scale_m
    wide_m, deep_m = solid[2] - solid[0], solid[3] - solid[1]
    wide = min(max(ceil(wide_m / _PART_M - 1e-6), 1), _MOST_PARTS)
    deep = min(max(ceil(deep_m / _PART_M - 1e-6), 1), _MOST_PARTS)
    area = wide_m / wide * deep_m / deep * by * by
    height = 2.0 * min(solid[4], _MOST_HEIGHT_M) / scale_m
    stretch = way_m * by / VIEW_STRETCHES
    for i in range(wide):
        from_x = solid[0] + (i + 0.5) / wide * wide_m - start_m[0]
        for j in range(deep):
            from_y = solid[1] + (j + 0.5) / deep * deep_m - start_m[1]
            aside_m = by * (aside_x * from_x + aside_y * from_y)
            step = floor((aside_m - VIEW_ASIDE_M[0]) / _STEP_M)
            if not 0 <= step < len(_ASIDE_CELLS):
                continue
            column = _ASIDE_CELLS[step]
            width = _ASIDE_LENGTHS_M[column]
            ahead_m = by * (ahead_x * from_x + ahead_y * from_y)
            if 0.0 <= ahead_m < VIEW_STRETCHES * stretch:
                # Rounding may take what lies just before a border beyond it.
                row = _FIRST_STRETCH + min(int(ahead_m / stretch), VIEW_STRETCHES - 1)
                length = stretch
            elif ahead_m < 0.0:
                step = floor((ahead_m - VIEW_BEHIND_M[0]) / _STEP_M)
                if step < 0:
                    continue
                row = _BEHIND_CELLS[min(step, len(_BEHIND_CELLS) - 1)]
                length = _BEHIND_LENGTHS_M[row]
            else:
                step = int((ahead_m - VIEW_STRETCHES * stretch) / _STEP_M)
                if step >= len(_BEYOND_CELLS):
                    continue
                length = _BEYOND_LENGTHS_M[_BEYOND_CELLS[step]]
                row = _FIRST_STRETCH + VIEW_STRETCHES + _BEYOND_CELLS[step]
            cell, share = row * COLUMNS + column, area / (width * length)
            found[cell] += share
            found[CELLS + cell] += share * height


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def put_seen(
    start_m: FloatArray,
    points: WallPoints,
    scale_m: float,
    solids: FloatArray,
    weights: Any,
    room: ViewRoom,
    found: Any,
    which: int,
) -> None:
    """Put what the view of solids says to each point; the last point fills up rows.

    Args:
        start_m: Position of the charge (3,).
        points: The points.
        scale_m: Scaling length.
        solids: Left, bottom, right, top and height of each, m (solids, 5).
        weights: Weights of views (members, VIEW, sight).
        room: Room for a view, whose raster is 0 before and after.
        found: What views say (members, views, rows, sight).
        which: Index of this one.
    """
    own_frame()
    members, views, rows, sight = found.shape
    raster, cells, to = room.raster, room.cells, place(found)
    shares, at, lanes = place(room.shares), place(weights), lanes_at(place(found))
    count, first = len(points.points_m), 0
    while first < count:
        # 1. All points of a column see the same, and most cells are empty.
        point_m, outward = points.points_m[first], points.outward[first]
        for solid in range(len(solids)):
            put_view(start_m, point_m, outward, scale_m, solids[solid], raster)
        seen = 0
        for cell in range(VIEW):
            if raster[cell] != 0.0:
                room.shares[seen], cells[seen] = np.float32(min(raster[cell], VIEW_MOST)), cell
                raster[cell] = 0.0
                seen += 1
        after = first + 1
        while after < count and is_above(points.points_m, points.outward, after):
            after += 1
        end = after if after < count else rows
        # 2. The sum over the others, by each network.
        for member in range(members):
            for index in range(0, sight, lanes):
                total = fill(to, np.float32(0.0))
                for number in range(seen):
                    entry = (member * VIEW + cells[number]) * sight + index
                    total = fill(to, get(shares, number)) * load(at, entry) + total
                for row in range(first, end):
                    store(to, ((member * views + which) * rows + row) * sight + index, total)
        first = after


@njit(error_model="numpy", fastmath=FUSED)
def put_seen_of(
    points: WallPoints,
    own: Any,
    member: int,
    first_row: int,
    inputs: int,
    kept: Any,
    new: Any,
    given: Any,
) -> None:
    """Put what the views of the pieces of a layout say to a few points, added up.

    Args:
        points: The points; the last one fills up rows.
        own: The layout; see `put_loads`.
        member: Number of the network.
        first_row: The first point.
        inputs: Numbers before a point's are over and the next one's begin.
        kept: What the views of the pieces say that are kept (members, pieces, rows, sight).
        new: The same of the new ones.
        given: The inputs of all rows, of which these are the last.
    """
    _, of_kept, rows, sight = kept.shape
    of_new = new.shape[1]
    at, seen, now_seen = place(given), place(kept), place(new)
    lanes = lanes_at(at)
    for number in range(first_row, first_row + ROWS_AT_ONCE):
        end = number * inputs + inputs - sight
        # All points of a column see the same.
        if number >= len(points.points_m) or is_above(points.points_m, points.outward, number):
            for index in range(0, sight, lanes):
                store(at, end + index, load(at, end - inputs + index))
            continue
        for index in range(0, sight, lanes):
            total = fill(at, np.float32(0.0))
            for piece in own:
                if piece == 0:
                    break
                if piece > 0:
                    entry = ((member * of_kept + piece - 1) * rows + number) * sight
                    total = load(seen, entry + index) + total
                else:
                    entry = ((member * of_new - piece - 1) * rows + number) * sight
                    total = load(now_seen, entry + index) + total
            store(at, end + index, total)
