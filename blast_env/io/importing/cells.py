"""Conversion of outlines to cells of the module grid, and of cells to few rectangles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import Rectangle, stacked_runs
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

LEAST_SHARE: Final = 0.5
"""Least covered share of a cell that becomes a module."""

COARSER: Final = (1, 2, 3, 4, 6, 8)
"""Candidate sides of the blocks of an area, in modules; the first within the limits is used."""

MOST_CROSSED: Final = 2_000_000
"""Most cells along all outlines together: 1,000 km of walls."""

MOST_COVERED: Final = 64_000_000
"""Most cells in the bounding boxes of all outlines together: four sites of the largest size."""

MOST_CROSSINGS: Final = 1000
"""Most self-intersections of an outline that can be repaired."""

_SHARE_STEPS: Final = 2.0**20  # so that equal shares are equal, and 32 bits hold them
_ROUNDING: Final = 1e-9
_BAND_CELLS: Final = 2**20
_PAIRS: Final = 2**21
_LINE_STEP_M: Final = 0.1  # sampling step for distances between outlines
_LINE_POINTS: Final = 50_000
Shares = NDArray[np.float32]


@dataclass(frozen=True)
class CellRectangle:
    """A rectangle of cells.

    Attributes:
        row: Lowest row.
        column: Leftmost column.
        rows: Number of rows.
        columns: Number of columns.
    """

    row: int
    column: int
    rows: int
    columns: int

    @classmethod
    def each(cls, table: IntArray) -> "tuple[CellRectangle, ...]":
        """Return the rectangles of a table (n, 4), whose columns are the attributes."""
        return tuple(cls(*row) for row in table.tolist())

    @property
    def cells(self) -> tuple[slice, slice]:
        """Slices of rows and columns of the rectangle in a grid."""
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


def check_outlines(outlines: Sequence[BaseGeometry], what: str) -> None:
    """Refuse outlines that would take too long to convert to cells.

    Args:
        outlines: Valid outlines on the site, m.
        what: Description of the outlines, for the error.

    Raises:
        BlastEnvError: If they are too long, or their bounding boxes have too many cells.
    """
    starts, ends = _edges(outlines)
    crossed = float(np.abs(ends - starts).sum()) / MODULE_SIDE_M
    if crossed > MOST_CROSSED:
        raise BlastEnvError(
            f"{what} run through {crossed:,.0f} cells of {MODULE_SIDE_M:g} m together, must run "
            f"through at most {MOST_CROSSED:,}: their outlines are too long"
        )
    left, bottom, right, top = shapely.bounds(list(outlines)).reshape(-1, 4).T
    covered = float(np.nansum((right - left) * (top - bottom))) / MODULE_SIDE_M**2
    if covered > MOST_COVERED:
        raise BlastEnvError(
            f"{what} take {covered:,.0f} cells of {MODULE_SIDE_M:g} m together, each with the "
            f"rectangle around it, must take at most {MOST_COVERED:,}: do they overlap?"
        )


def mended(outline: BaseGeometry, what: str) -> BaseGeometry:
    """Return an outline without self-intersections, possibly in several parts.

    Args:
        outline: Any outline.
        what: Description of the outline, for the error.

    Raises:
        BlastEnvError: If it crosses itself more than `MOST_CROSSINGS` times.
    """
    if shapely.is_valid(outline):
        return outline
    if _crosses_often(outline):
        raise BlastEnvError(
            f"{what} crosses itself more than {MOST_CROSSINGS:,} times, must cross itself at most "
            "that often for --repair"
        )
    return shapely.buffer(shapely.make_valid(outline), 0.0)


def _crosses_often(outline: BaseGeometry) -> bool:
    """Return whether an outline crosses itself too often, without finding all crossings."""
    walls = _walls(outline)
    tree = shapely.STRtree(walls)
    step = max(_PAIRS // max(len(walls), 1), 1)
    pairs = 0
    for first in range(0, len(walls), step):
        some = walls[first : first + step]
        # Each wall intersects itself and its neighbours at both ends.
        pairs += tree.query(some, "intersects").shape[1] - 3 * len(some)
        if pairs > 2 * MOST_CROSSINGS:
            return True
    return False


def _walls(outline: BaseGeometry) -> NDArray[np.object_]:
    """Return the edges of an outline as lines."""
    return np.asarray(shapely.linestrings(np.stack(_edges([outline]), axis=1)))


def _edges(outlines: Sequence[BaseGeometry]) -> tuple[FloatArray, FloatArray]:
    """Return both ends of all edges of outlines (n, 2)."""
    rings = shapely.get_rings(shapely.get_parts(list(outlines)))
    places, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    return places[:-1][same], places[1:][same]


def covered_shares(
    outline: BaseGeometry, shape: tuple[int, int]
) -> tuple[tuple[slice, slice], Shares]:
    """Return the share of each cell that an outline covers.

    Every edge adds, in each row, its rise to all cells on its right; the signed sum over both
    sides of an outline is the area between them.

    Args:
        outline: Outline without self-intersections, m from the grid's lower left corner.
        shape: Rows and columns of the grid.

    Returns:
        The window of rows and columns around the outline, and the shares in it.
    """
    left, bottom, right, top = outline.bounds
    rows = _window(bottom, top, shape[0])
    columns = _window(left, right, shape[1])
    count, width = rows.stop - rows.start, columns.stop - columns.start
    shares = np.zeros((count, width), dtype=np.float32)
    if count == 0 or width == 0:
        return (rows, columns), shares
    row, column, climb, aside = _pieces(outline, rows, columns)
    order = np.argsort(row, kind="stable")
    row, column, climb, aside = row[order], column[order], climb[order], aside[order]
    step = max(_BAND_CELLS // width, 1)
    for first in range(0, count, step):
        band = slice(first, min(first + step, count))
        own = slice(*np.searchsorted(row, [band.start, band.stop]))
        place = (row[own] - first) * (width + 2) + column[own]
        size = (band.stop - first) * (width + 2)
        added = np.bincount(place, climb[own] * (1.0 - aside[own]), size)
        added += np.bincount(place + 1, climb[own] * aside[own], size)
        covered = np.abs(added.reshape(-1, width + 2).cumsum(axis=1)[:, :width])
        shares[band] = np.round(np.minimum(covered, 1.0) * _SHARE_STEPS) / _SHARE_STEPS
    return (rows, columns), shares


def _pieces(
    outline: BaseGeometry, rows: slice, columns: slice
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return the edges of an outline in pieces, each in one cell of a window.

    Returns:
        Row and column of each piece in the window, its rise, and the distance of its middle from
        the left side of its cell, in cells. A piece left of the window moves to the window's left
        side, one to the right moves to its right side.
    """
    parts = shapely.get_parts(outline)
    turned = shapely.normalize(parts[shapely.get_type_id(parts) == 3])  # holes the other way
    corner = np.array([columns.start, rows.start])
    starts, ends = (each / MODULE_SIDE_M - corner for each in _edges(turned))
    steps = ends - starts
    height, width = rows.stop - rows.start, columns.stop - columns.start
    edges, shares = [np.arange(len(steps))] * 2, [np.zeros(len(steps)), np.ones(len(steps))]
    for axis, most in ((0, width), (1, height)):
        edge, line = _lines_between(starts[:, axis], ends[:, axis], most)
        edges.append(edge)
        shares.append((line - starts[edge, axis]) / steps[edge, axis])
    edge, share = np.concatenate(edges), np.concatenate(shares)
    order = np.lexsort((share, edge))
    edge, share = edge[order], share[order]
    same = edge[1:] == edge[:-1]
    own, middle = edge[:-1][same], 0.5 * (share[:-1] + share[1:])[same]
    climb = (share[1:] - share[:-1])[same] * steps[own, 1]
    x, y = (starts[own, axis] + middle * steps[own, axis] for axis in (0, 1))
    inside = (y > 0.0) & (y < height) & (climb != 0.0)
    x, y, climb = np.clip(x[inside], 0.0, width), y[inside], climb[inside]
    column = np.floor(x).astype(np.int64)
    return np.floor(y).astype(np.int64), column, climb, x - column


def _lines_between(starts: FloatArray, ends: FloatArray, most: int) -> tuple[IntArray, FloatArray]:
    """Return pairs of an edge and a grid line that it crosses, 0 to `most`, along an axis."""
    low = np.clip(np.floor(np.minimum(starts, ends)) + 1.0, 0, most + 1).astype(np.int64)
    high = np.clip(np.ceil(np.maximum(starts, ends)), 0, most + 1).astype(np.int64)
    counts = np.maximum(high - low, 0)
    edge = np.repeat(np.arange(len(starts)), counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    return edge, (low[edge] + np.arange(len(edge)) - first).astype(np.float64)


def in_blocks(cells: BoolArray, side: int, least: float = LEAST_SHARE) -> BoolArray:
    """Return cells in whole blocks of side x side: those of which a share `least` is set."""
    if side == 1:
        return cells
    rows, columns = (-(-count // side) * side for count in cells.shape)
    padded = np.zeros((rows, columns), dtype=bool)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(rows // side, side, columns // side, side).mean(axis=(1, 3))
    whole = np.repeat(np.repeat(blocks >= least, side, axis=0), side, axis=1)
    return whole[: cells.shape[0], : cells.shape[1]]


def rectangles_of(cells: BoolArray) -> IntArray:
    """Return few disjoint rectangles that cover exactly the cells.

    Rows are split into runs, and equal runs above each other form one rectangle; columns instead,
    if that gives fewer. So two walls of every rectangle are hidden by no other.

    Returns:
        A table (rectangles, 4); see `CellRectangle.each`.
    """
    by_rows, by_columns = stacked_runs(cells), stacked_runs(cells.T)
    return by_rows if len(by_rows) <= len(by_columns) else by_columns[:, [1, 0, 3, 2]]


@dataclass(frozen=True)
class Deviation:
    """Deviation of modules from an outline.

    Attributes:
        area_share: Area of the symmetric difference, as a share of the outline's area.
        outline_m: Hausdorff distance of the two boundaries: the largest distance of a point of
            one to the nearest point of the other.
    """

    area_share: float
    outline_m: float

    @classmethod
    def between(cls, outline: BaseGeometry, modules: BaseGeometry) -> "Deviation":
        """Return the deviation of modules from an outline."""
        area = shapely.area(shapely.symmetric_difference(outline, modules))
        outline_m = max(_farthest_m(outline, modules), _farthest_m(modules, outline))
        return cls(float(area / outline.area), outline_m)


def _farthest_m(outline: BaseGeometry, other: BaseGeometry) -> float:
    """Return the largest distance of a point of an outline from another outline."""
    step_m = max(_LINE_STEP_M, outline.length / _LINE_POINTS)
    line = shapely.segmentize(outline.boundary, step_m)
    tree = shapely.STRtree(_walls(other))
    points = shapely.points(shapely.get_coordinates(line))
    _, distances_m = tree.query_nearest(points, return_distance=True, all_matches=False)
    return float(distances_m.max())


def _window(low_m: float, high_m: float, count: int) -> slice:
    first = int(np.floor(low_m / MODULE_SIDE_M + _ROUNDING))
    last = int(np.ceil(high_m / MODULE_SIDE_M - _ROUNDING))
    first = min(max(first, 0), count)
    return slice(first, min(max(last, first), count))
