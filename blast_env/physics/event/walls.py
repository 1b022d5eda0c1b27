"""The walls as the event engine sees them: faces of flush modules joined, and free corners.

A wall without seams cannot give a ball a ghost hit at one.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.event.arrays import CORNER, FACE_X, FACE_Y, SURFACE, RecordArray
from blast_env.physics.surface import wall_surface
from blast_env.units import MODULE_SIDE_UNITS

_HALF: Final = MODULE_SIDE_UNITS / 2.0
_TOLERANCE: Final = 1e-9  # units; faces overlap by it, so that rounding opens no gap
_CORNERS: Final = _HALF * np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
"""From the centre of a module, in the order of `WallSurface.covered_corners`."""


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
    faces, along_faces = _joined_faces(own, surface.free_faces)
    corners, at_corners = _free_corners(own, surface.covered_corners)
    corners["modules_from"] += len(along_faces)
    corners["modules_to"] += len(along_faces)
    modules = standing[np.concatenate((along_faces, at_corners))]
    return Walls(np.concatenate((faces, corners)), modules.astype(np.int32))


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


def _joined_faces(
    centres: NDArray[np.float64], free_faces: NDArray[np.bool_]
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Join the free faces of modules (m, 4) that go on in each other.

    Returns:
        The faces, whose modules are numbered from 0, and the modules, face by face, along it.
    """
    face, member = np.nonzero(free_faces.T)
    is_x = face < 2
    across, along = np.where(is_x, centres[member].T, centres[member, ::-1].T)
    # Rounding of the metres in a scenario file must not decide which faces lie in one line.
    line, place = np.round((across, along), 9)
    order = np.lexsort((place, line, face))
    face, line, place = face[order], line[order], place[order]
    begins = np.ones(len(order), dtype=np.bool_)
    begins[1:] = np.abs(np.diff(place) - MODULE_SIDE_UNITS) > _TOLERANCE
    begins[1:] |= (np.diff(line) != 0.0) | (np.diff(face) != 0)
    starts = np.flatnonzero(begins)
    ends = np.flatnonzero(np.roll(begins, -1)) + 1
    faces = np.zeros(len(starts), dtype=SURFACE)
    faces["kind"] = np.where(face[starts] < 2, FACE_X, FACE_Y)
    sign = faces["a"] = np.where(face[starts] % 2 == 0, -1.0, 1.0)
    faces["b"] = across[order[starts]] + sign * _HALF
    faces["low"] = along[order[starts]] - _HALF - _TOLERANCE
    faces["high"] = along[order[ends - 1]] + _HALF + _TOLERANCE
    faces["modules_from"], faces["modules_to"] = starts, ends
    return faces, member[order]


def _free_corners(
    centres: NDArray[np.float64], covered_corners: NDArray[np.bool_]
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Return the corners of modules where no wall goes on, and the modules that they belong to."""
    corner, member = np.nonzero(~covered_corners.T)
    corners = np.zeros(len(member), dtype=SURFACE)
    corners["kind"] = CORNER
    corners["a"], corners["b"] = (centres[member] + _CORNERS[corner]).T
    corners["modules_from"] = np.arange(len(member))
    corners["modules_to"] = corners["modules_from"] + 1
    return corners, member


def _boxes(surfaces: RecordArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower left and the upper right ends of the surfaces (k, 2)."""
    kind, a, b = surfaces["kind"], surfaces["a"], surfaces["b"]
    low, high = surfaces["low"], surfaces["high"]
    corner, face_x = kind == CORNER, kind == FACE_X
    lower = np.where(corner, (a, b), np.where(face_x, (b, low), (low, b)))
    upper = np.where(corner, (a, b), np.where(face_x, (b, high), (high, b)))
    return lower.T, upper.T
