"""Outlines as cells of the grid of modules, and cells as few rectangles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import import_extra
from blast_env.geometry import Rectangle
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

LEAST_SHARE: Final = 0.5
"""Share of a cell that must be covered for it to be a module."""

COARSER: Final = (1, 2, 3, 4, 6, 8)
"""Sides of the blocks that an outline is cut into, in modules; the first that will do is taken."""

_ROUNDING: Final = 1e-9
_LINE_STEP: Final = 0.02  # of an outline: how densely its distances are measured


@dataclass(frozen=True)
class CellRectangle:
    """A rectangle of cells.

    Attributes:
        row: Lowest row.
        column: Leftmost column.
        rows: How many rows.
        columns: How many columns.
    """

    row: int
    column: int
    rows: int
    columns: int

    @property
    def cells(self) -> tuple[slice, slice]:
        """What of a grid it covers."""
        return (
            slice(self.row, self.row + self.rows),
            slice(self.column, self.column + self.columns),
        )

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle in metres."""
        return Rectangle(
            self.column, self.row, self.column + self.columns, self.row + self.rows
        ).scaled(MODULE_SIDE_M)


def covered_shares(
    outline: BaseGeometry, shape: tuple[int, int]
) -> tuple[tuple[slice, slice], FloatArray]:
    """Return which part of each cell an outline covers.

    Args:
        outline: In metres from the grid's lower left corner.
        shape: Rows and columns of the grid.

    Returns:
        The window of rows and columns around the outline, and the shares in it.
    """
    left, bottom, right, top = outline.bounds
    columns = _window(left, right, shape[1])
    rows = _window(bottom, top, shape[0])
    x = np.arange(columns.start, columns.stop) * MODULE_SIDE_M
    y = np.arange(rows.start, rows.stop)[:, np.newaxis] * MODULE_SIDE_M
    cells = shapely.box(x, y, x + MODULE_SIDE_M, y + MODULE_SIDE_M)
    shapely.prepare(outline)
    shares = shapely.contains_properly(outline, cells).astype(np.float64)
    partly = shapely.intersects(outline, cells) & (shares == 0.0)
    shares[partly] = shapely.area(shapely.intersection(outline, cells[partly])) / MODULE_SIDE_M**2
    return (rows, columns), shares


def owners(outlines: Sequence[BaseGeometry], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Return which outline each cell belongs to, -1 where there is none (rows, columns).

    A cell is built on if outlines together cover half of it, and belongs to the one that covers
    most, so that houses wall to wall leave no gap; of equal ones, to the first.
    """
    owner = np.full(shape, -1, dtype=np.int32)
    most = np.zeros(shape, dtype=np.float32)
    together = np.zeros(shape, dtype=np.float32)
    for index, outline in enumerate(outlines):
        window, shares = covered_shares(outline, shape)
        more = shares > most[window] + _ROUNDING
        owner[window][more] = index
        most[window] = np.maximum(most[window], shares)
        together[window] += shares
    owner[together < LEAST_SHARE - _ROUNDING] = -1
    return owner


def in_blocks(cells: BoolArray, side: int) -> BoolArray:
    """Return cells cut into blocks of side x side cells: whole ones, where half is covered."""
    if side == 1:
        return cells
    rows, columns = (-(-count // side) * side for count in cells.shape)
    padded = np.zeros((rows, columns), dtype=bool)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(rows // side, side, columns // side, side).mean(axis=(1, 3))
    whole = np.repeat(np.repeat(blocks >= LEAST_SHARE, side, axis=0), side, axis=1)
    return whole[: cells.shape[0], : cells.shape[1]]


def rectangles_of(cells: BoolArray) -> tuple[CellRectangle, ...]:
    """Return few rectangles that together are the cells, none over another.

    Rows are cut into runs, and equal runs above each other are one rectangle; or columns, where
    that gives fewer. So every rectangle has two walls that no other one hides.
    """
    by_rows = _stacked_runs(cells)
    by_columns = [
        CellRectangle(each.column, each.row, each.columns, each.rows)
        for each in _stacked_runs(cells.T)
    ]
    return tuple(by_rows if len(by_rows) <= len(by_columns) else by_columns)


def outline_of(rectangles: Sequence[CellRectangle]) -> BaseGeometry:
    """Return the outline of rectangles of cells, in metres from the grid's lower left corner."""
    return shapely.union_all([shapely.box(*each.rectangle_m) for each in rectangles])


@dataclass(frozen=True)
class Deviation:
    """How far modules are from an outline.

    Attributes:
        area_share: Area that only one of the two covers, as a share of the outline's.
        outline_m: Hausdorff distance of the two boundaries: the largest distance of a point of
            one to the nearest point of the other.
    """

    area_share: float
    outline_m: float

    @classmethod
    def between(cls, outline: BaseGeometry, modules: BaseGeometry) -> "Deviation":
        """Return how far modules are from an outline."""
        area = shapely.area(shapely.symmetric_difference(outline, modules))
        return cls(
            float(area / outline.area),
            float(shapely.hausdorff_distance(outline.boundary, modules.boundary, _LINE_STEP)),
        )


def _window(low_m: float, high_m: float, count: int) -> slice:
    first = int(np.floor(low_m / MODULE_SIDE_M + _ROUNDING))
    last = int(np.ceil(high_m / MODULE_SIDE_M - _ROUNDING))
    return slice(min(max(first, 0), count), min(max(last, 0), count))


def _stacked_runs(cells: BoolArray) -> list[CellRectangle]:
    """Return the runs of rows, equal ones above each other made one."""
    finished: list[CellRectangle] = []
    growing: dict[tuple[int, int], int] = {}  # first and last column to the first row
    for row in range(cells.shape[0] + 1):
        runs = _runs(cells[row]) if row < cells.shape[0] else []
        for run in [each for each in growing if each not in runs]:
            first = growing.pop(run)
            finished.append(CellRectangle(first, run[0], row - first, run[1] - run[0]))
        for run in runs:
            growing.setdefault(run, row)
    return sorted(finished, key=lambda each: (each.row, each.column))


def _runs(line: BoolArray) -> list[tuple[int, int]]:
    """Return the runs of true values as first and last index, the last one not included."""
    steps = np.flatnonzero(np.diff(np.concatenate(([0], line.astype(np.int8), [0]))))
    return [(int(first), int(last)) for first, last in steps.reshape(-1, 2)]
