"""The walls as the event engine sees them: faces of flush modules joined, and free corners.

A wall without seams cannot give a ball a ghost hit at one.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.event.arrays import CORNER, FACE_X, FACE_Y, SURFACE, RecordArray
from blast_env.physics.surface import wall_surface
from blast_env.units import MODULE_SIDE_UNITS

_HALF: Final = MODULE_SIDE_UNITS / 2.0
_TOLERANCE: Final = 1e-9  # units; faces overlap by it, so that rounding opens no gap


class Walls(NamedTuple):
    """The surfaces of all walls.

    Attributes:
        surfaces: Of `SURFACE` (k,).
        modules: The modules of the surfaces, face by face, along it.
    """

    surfaces: RecordArray
    modules: NDArray[np.int32]


def walls_of(centres: NDArray[np.float64], standing: NDArray[np.int64]) -> Walls:
    """Return the surfaces of the modules that stand.

    Args:
        centres: Centres of all modules, units (m, 2).
        standing: Indices of those that stand.
    """
    own = centres[standing]
    surface = wall_surface(own)
    parts: list[RecordArray] = []
    modules: list[NDArray[np.int64]] = []
    used = 0
    faces = ((FACE_X, -1.0), (FACE_X, 1.0), (FACE_Y, -1.0), (FACE_Y, 1.0))
    for face, (kind, sign) in enumerate(faces):
        free = np.flatnonzero(surface.free_faces[:, face])
        order, starts = _runs(own[free], kind)
        members = free[order]
        joined = _faces(own[members], starts, kind, sign)
        joined["modules_from"] += used
        joined["modules_to"] += used
        used += len(members)
        parts.append(joined)
        modules.append(standing[members])
    for corner, at in enumerate(_corner_offsets()):
        free = np.flatnonzero(~surface.covered_corners[:, corner])
        points = np.zeros(len(free), dtype=SURFACE)
        points["kind"] = CORNER
        points["a"], points["b"] = (own[free] + at).T
        points["modules_from"] = used + np.arange(len(free))
        points["modules_to"] = points["modules_from"] + 1
        used += len(free)
        parts.append(points)
        modules.append(standing[free])
    return Walls(np.concatenate(parts), np.concatenate(modules).astype(np.int32))


def spread_over_cells(
    surfaces: RecordArray,
    reach: float,
    corner: tuple[float, float],
    cell_units: float,
    shape: tuple[int, int],
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Copy each surface to all cells from which a ball can touch it.

    Args:
        surfaces: The surfaces (k,).
        reach: Largest radius of a ball.
        corner: Lower left corner of the site.
        cell_units: Side of a cell.
        shape: Rows and columns of cells, the ring around the site included.

    Returns:
        The copies, cell by cell, and the number of the first copy of each cell (cells + 1,).
    """
    rows, columns = shape
    low, high = _boxes(surfaces)
    first = np.floor((low - reach - _TOLERANCE - corner) / cell_units).astype(np.int64) + 1
    last = np.floor((high + reach + _TOLERANCE - corner) / cell_units).astype(np.int64) + 1
    limit = np.array([columns - 1, rows - 1])
    first, last = np.clip(first, 0, limit), np.clip(last, 0, limit)
    width, height = (last - first + 1).T
    which = np.repeat(np.arange(len(surfaces)), width * height)
    place = np.arange(len(which)) - np.repeat(
        np.cumsum(width * height) - width * height, width * height
    )
    row, column = np.divmod(place, width[which])
    cell = (first[which, 1] + row) * columns + first[which, 0] + column
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    return surfaces[which[order]], start


def _runs(centres: NDArray[np.float64], kind: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order of modules along their faces, and where a new wall begins in it."""
    across, along = np.round(centres.T if kind == FACE_X else centres.T[::-1], 9)
    order = np.lexsort((along, across))
    across, along = across[order], along[order]
    gap = np.abs(np.diff(along) - MODULE_SIDE_UNITS) > _TOLERANCE
    begins = np.concatenate(([True], (np.diff(across) != 0.0) | gap))
    return order, np.flatnonzero(begins[: len(order)])


def _faces(
    centres: NDArray[np.float64], starts: NDArray[np.int64], kind: int, sign: float
) -> RecordArray:
    """Return the joined faces of modules that are in the order of `_runs`."""
    ends = np.append(starts[1:], len(centres))
    across, along = centres.T if kind == FACE_X else centres.T[::-1]
    faces = np.zeros(len(starts), dtype=SURFACE)
    faces["kind"], faces["a"] = kind, sign
    faces["b"] = across[starts] + sign * _HALF
    faces["low"] = along[starts] - _HALF - _TOLERANCE
    faces["high"] = along[ends - 1] + _HALF + _TOLERANCE
    faces["modules_from"], faces["modules_to"] = starts, ends
    return faces


def _corner_offsets() -> Iterator[tuple[float, float]]:
    """Yield the corners from the centre, in the order of `WallSurface.covered_corners`."""
    return ((x * _HALF, y * _HALF) for y in (-1, 1) for x in (-1, 1))


def _boxes(surfaces: RecordArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower left and the upper right ends of the surfaces (k, 2)."""
    kind, a, b = surfaces["kind"], surfaces["a"], surfaces["b"]
    low, high = surfaces["low"], surfaces["high"]
    corner, face_x = kind == CORNER, kind == FACE_X
    lower = np.where(corner, (a, b), np.where(face_x, (b, low), (low, b)))
    upper = np.where(corner, (a, b), np.where(face_x, (b, high), (high, b)))
    return lower.T, upper.T
