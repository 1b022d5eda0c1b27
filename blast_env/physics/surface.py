"""Which modules and which of their corners a ball can reach.

Modules that stand flush form one wall. A ball on that wall near a seam overlaps two squares, and
a solver that knows only squares gives it a push from the corner of the second one (a "ghost"
hit). A corner where the wall goes on is not a corner of the wall: contacts with it do not count.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.units import MODULE_SIDE_UNITS

_HALF: Final = MODULE_SIDE_UNITS / 2.0
_BEYOND: Final = 1e-6  # how far past an edge we look, units

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WallSurface:
    """What of a set of modules can be reached.

    Attributes:
        free_faces: Whether nothing stands flush on the face (m, 4); the faces are left, right,
            lower, upper.
        covered_corners: Whether the wall goes on past the corner (m, 4); the corners are lower
            left, lower right, upper left, upper right.
    """

    free_faces: BoolArray
    covered_corners: BoolArray

    @property
    def exposed(self) -> BoolArray:
        """Whether any face of the module is free (m,)."""
        return np.asarray(self.free_faces.any(axis=1))


def wall_surface(centres: FloatArray) -> WallSurface:
    """Find the exposed modules and the covered corners.

    Args:
        centres: Centres of the modules that stand, units (m, 2).
    """
    lattices = tuple(_lattices(centres))
    free = np.ones((len(centres), 4), dtype=np.bool_)
    for lattice in lattices:
        own = centres[lattice.members]
        for face, step in enumerate(((-1, 0), (1, 0), (0, -1), (0, 1))):
            beside = own + np.array(step) * MODULE_SIDE_UNITS
            free[lattice.members, face] = ~lattice.is_solid(beside)
    covered = np.zeros((len(centres), 4), dtype=np.bool_)
    for corner, (x_sign, y_sign) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1))):
        past_in_x = centres + (x_sign * (_HALF + _BEYOND), y_sign * (_HALF - _BEYOND))
        past_in_y = centres + (x_sign * (_HALF - _BEYOND), y_sign * (_HALF + _BEYOND))
        for lattice in lattices:
            covered[:, corner] |= lattice.is_solid(past_in_x) | lattice.is_solid(past_in_y)
    return WallSurface(free_faces=free, covered_corners=covered)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Modules whose centres differ by whole modules.

    Attributes:
        members: Indices of the modules (k,).
        origin: Lower left corner of the occupancy's first cell, units (2,).
        occupied: Occupancy (columns, rows).
    """

    members: NDArray[np.int64]
    origin: FloatArray
    occupied: BoolArray

    def is_solid(self, points: FloatArray) -> BoolArray:
        """Return whether a module of this lattice covers each point (n, 2)."""
        cell = np.floor((points - self.origin) / MODULE_SIDE_UNITS).astype(np.int64)
        inside: BoolArray = np.all((cell >= 0) & (cell < self.occupied.shape), axis=1)
        cell = np.where(inside[:, None], cell, 0)
        solid: BoolArray = inside & self.occupied[cell[:, 0], cell[:, 1]]
        return solid


def _lattices(centres: FloatArray) -> Iterator[_Lattice]:
    """Group the modules by the lattice that they stand on."""
    if not len(centres):
        return
    # The digits below a billionth of a unit are rounding of the metres in a scenario file.
    offsets = np.round(np.mod(centres, MODULE_SIDE_UNITS), 9) % MODULE_SIDE_UNITS
    _, group = np.unique(offsets, axis=0, return_inverse=True)
    for index in range(int(group.max()) + 1):
        members = np.flatnonzero(group.ravel() == index)
        own = centres[members]
        origin = own.min(axis=0) - _HALF
        cell = np.floor((own - origin) / MODULE_SIDE_UNITS).astype(np.int64)
        occupied = np.zeros(cell.max(axis=0) + 1, dtype=np.bool_)
        occupied[cell[:, 0], cell[:, 1]] = True
        yield _Lattice(members=members, origin=origin, occupied=occupied)
