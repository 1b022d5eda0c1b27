"""Conversion of outlines to cells of the module grid."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError, import_extra
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

LEAST_SHARE: Final = 0.5
"""Least covered share of a cell that becomes a module."""

COARSER: Final = (1, 2, 3, 4, 6, 8)
"""Candidate sides of the blocks of an area, in modules; the first within the limits is used."""

MOST_CROSSED: Final = 400_000
"""Most cells along all outlines together: 200 km of walls."""

MOST_COVERED: Final = 64_000_000
"""Most cells in the bounding boxes of all outlines together: four sites of the largest size."""

MOST_CROSSINGS: Final = 1000
"""Most self-intersections of an outline that can be repaired."""

_SHARE_STEPS: Final = 2.0**20  # so that equal shares are equal, and 32 bits hold them
_ROUNDING: Final = 1e-9
_BLOCK_CELLS: Final = 64
_PAIRS: Final = 2**21
_LINE_STEP_M: Final = 0.1  # sampling step for distances between outlines
_LINE_POINTS: Final = 50_000
Shares = NDArray[np.float32]


def check_outlines(outlines: Sequence[BaseGeometry], what: str) -> None:
    """Refuse outlines that would take too long to convert to cells.

    Args:
        outlines: Valid outlines on the site, m.
        what: Description of the outlines, for the error.

    Raises:
        BlastEnvError: If they are too long, or their bounding boxes have too many cells.
    """
    starts, ends = edges_of(outlines)
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
    return np.asarray(shapely.linestrings(np.stack(edges_of([outline]), axis=1)))


def edges_of(outlines: Sequence[BaseGeometry]) -> tuple[FloatArray, FloatArray]:
    """Return both ends of all edges of outlines (n, 2)."""
    rings = shapely.get_rings(shapely.get_parts(list(outlines)))
    places, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    return places[:-1][same], places[1:][same]


def covered_shares(
    outline: BaseGeometry, shape: tuple[int, int]
) -> tuple[tuple[slice, slice], Shares]:
    """Return the share of each cell that an outline covers.

    Args:
        outline: Outline without self-intersections, m from the grid's lower left corner.
        shape: Rows and columns of the grid.

    Returns:
        The window of rows and columns around the outline, and the shares in it.
    """
    left, bottom, right, top = outline.bounds
    rows = _window(bottom, top, shape[0])
    columns = _window(left, right, shape[1])
    shares = np.zeros((rows.stop - rows.start, columns.stop - columns.start), dtype=np.float32)
    shapely.prepare(outline)
    if shares.size:
        _cover(shares, outline, rows.start, columns.start)
    return (rows, columns), shares


def _cover(shares: Shares, outline: BaseGeometry, row: int, column: int) -> None:
    """Set the shares of a block of cells: at once if it is inside or outside, else by halves."""
    rows, columns = shares.shape
    x_m, y_m = MODULE_SIDE_M * column, MODULE_SIDE_M * row
    block = shapely.box(x_m, y_m, x_m + MODULE_SIDE_M * columns, y_m + MODULE_SIDE_M * rows)
    if not shapely.intersects(outline, block):
        return
    if shapely.covers(outline, block):
        shares[...] = 1.0
    elif shares.size > _BLOCK_CELLS and rows >= columns:
        _cover(shares[: rows // 2], outline, row, column)
        _cover(shares[rows // 2 :], outline, row + rows // 2, column)
    elif shares.size > _BLOCK_CELLS:
        _cover(shares[:, : columns // 2], outline, row, column)
        _cover(shares[:, columns // 2 :], outline, row, column + columns // 2)
    else:
        low_m = y_m + MODULE_SIDE_M * np.arange(rows)[:, np.newaxis]
        left_m = x_m + MODULE_SIDE_M * np.arange(columns)
        cells = shapely.box(left_m, low_m, left_m + MODULE_SIDE_M, low_m + MODULE_SIDE_M)
        part = shapely.intersection(shapely.intersection(outline, block), cells)
        covered = np.minimum(shapely.area(part) / MODULE_SIDE_M**2, 1.0)
        shares[...] = np.round(covered * _SHARE_STEPS) / _SHARE_STEPS


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
