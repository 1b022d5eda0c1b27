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
        free[lattice.members] = lattice.free_faces()
    left, right, lower, upper = ~free.T
    covered = np.stack((left | lower, right | lower, left | upper, right | upper), axis=1)
    if len(lattices) > 1:
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
        cells: Column and row of each of them in the occupancy (2, k).
        occupied: Occupancy (columns, rows), with empty cells all around.
    """

    members: NDArray[np.int64]
    origin: FloatArray
    cells: NDArray[np.int64]
    occupied: BoolArray

    def free_faces(self) -> BoolArray:
        """Return whether no module of this lattice stands flush on the faces (k, 4)."""
        column, row = self.cells
        solid = self.occupied
        beside = solid[column - 1, row], solid[column + 1, row]
        return ~np.stack((*beside, solid[column, row - 1], solid[column, row + 1]), axis=1)

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
    for offset in np.unique(offsets @ (1.0, 1.0j)):  # much faster than unique rows
        members = np.flatnonzero((offsets == (offset.real, offset.imag)).all(axis=1))
        own = centres[members]
        origin = own.min(axis=0) - (_HALF + MODULE_SIDE_UNITS)
        cells = np.floor((own - origin) / MODULE_SIDE_UNITS).astype(np.int64).T
        occupied = np.zeros(cells.max(axis=1) + 2, dtype=np.bool_)
        occupied[*cells] = True
        yield _Lattice(members, origin, cells, occupied)
