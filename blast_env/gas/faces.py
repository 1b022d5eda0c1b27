"""Faces between air and solid, on which loads are recorded."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.gas.grid import GasGrid


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of solid cells that touch air.

    Attributes:
        air: The air cell before each face (n, 3).
        axis: Axis that the face is normal to (n,).
        side: Direction along the axis from the solid to the air: -1 or 1 (n,).
    """

    air: NDArray[np.int64]
    axis: NDArray[np.int64]
    side: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.axis)

    @property
    def solid(self) -> NDArray[np.int64]:
        """The solid cell behind each face (n, 3), outside the grid for the ground."""
        solid = self.air.copy()
        solid[np.arange(len(self)), self.axis] -= self.side
        return solid

    def followed_by(self, others: "Faces") -> "Faces":
        """Return these faces and then others."""
        pairs = zip(
            (self.air, self.axis, self.side), (others.air, others.axis, others.side), strict=True
        )
        air, axis, side = (np.concatenate(pair) for pair in pairs)
        return Faces(air, axis, side)

    def chosen(self, chosen: NDArray[np.bool_]) -> "Faces":
        """Return those of a mask (n,)."""
        return Faces(self.air[chosen], self.axis[chosen], self.side[chosen])

    def of_cells(self, cells: NDArray[np.int64]) -> "Faces":
        """Return faces of other cells (n, 3), turned as these."""
        beside = cells.copy()
        beside[np.arange(len(self)), self.axis] += self.side
        return Faces(beside, self.axis, self.side)

    def centres_m(self, grid: GasGrid) -> NDArray[np.float64]:
        """Return the centres of the faces (n, 3)."""
        middle = 0.5 * (self.air + self.solid) + 0.5
        return np.asarray(grid.origin_m) + grid.cell_m * middle

    def kernel_table(
        self, grid: GasGrid, shape: tuple[int, int, int], lanes: int
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the faces in the order of the kernels, vector by vector of cells along x.

        A face is indexed by the cell on its high side. Vectors of faces normal to x come first,
        then those normal to y and z.

        Args:
            shape: Cells of the kernels' arrays along z, y and x.

        Returns:
            Lane of the cell and index of the face (n, 2); first entry of each vector, and the end.
        """
        # 1. The place of each face in the arrays of the kernels, axis by axis.
        nz, ny, nx = shape
        high = np.maximum(self.air, self.solid) + grid.lead
        place = ((self.axis * nz + high[:, 2]) * ny + high[:, 1]) * nx + high[:, 0]
        # 2. The faces in that order, so that a sweep meets them vector by vector.
        order = np.argsort(place, kind="stable")
        table = np.stack((place[order] % lanes, order), axis=1).astype(np.int32)
        # 3. The first entry of each vector; one without faces begins where the next one does.
        vectors = np.arange(3 * nz * ny * nx // lanes + 1)
        first = np.searchsorted(place[order] // lanes, vectors).astype(np.int32)
        return np.ascontiguousarray(table), first


NO_FACES: Final = Faces(
    np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
)


def exposed_faces(grid: GasGrid, cells: NDArray[np.bool_]) -> Faces:
    """Return the faces of chosen solid cells that touch air inside the grid.

    Args:
        cells: Mask of the chosen cells (nx, ny, nz), all solid.

    Raises:
        BlastEnvError: If `cells` has another shape than the grid, or holds cells of air.
    """
    if cells.shape != grid.shape:
        raise BlastEnvError(f"cells has shape {cells.shape}, but the grid {grid.shape}")
    if (cells & ~grid.solid).any():
        raise BlastEnvError("cells holds cells of air, but only solid cells have faces")
    # In each of six directions: the chosen cells before air in the grid, and that air.
    air: list[NDArray[np.int64]] = []
    axes: list[NDArray[np.int64]] = []
    sides: list[NDArray[np.int64]] = []
    empty = ~grid.solid
    for axis in range(3):
        for side in (-1, 1):
            low, high = [slice(None)] * 3, [slice(None)] * 3
            low[axis], high[axis] = slice(None, -1), slice(1, None)
            solid, beside = (low, high) if side > 0 else (high, low)
            neighbour = np.argwhere(cells[tuple(solid)] & empty[tuple(beside)])
            neighbour[:, axis] += side > 0
            air.append(neighbour)
            axes.append(np.full(len(neighbour), axis))
            sides.append(np.full(len(neighbour), side))
    return Faces(np.concatenate(air), np.concatenate(axes), np.concatenate(sides))


class LeaningFaces(NamedTuple):
    """The faces of upright walls that pieces lean on.

    Attributes:
        outer: The outer faces of the pieces before them.
        cells: The cell of the wall behind each of these (n, 3).
        unloaded: The faces of walls without air before all pieces, as between two buildings.
    """

    outer: Faces
    cells: NDArray[np.int64]
    unloaded: Faces


def leaning_faces(grid: GasGrid, pieces: NDArray[np.bool_]) -> LeaningFaces:
    """Return the faces of upright walls that pieces lean on.

    Args:
        grid: The grid.
        pieces: Mask of the cells of pieces (nx, ny, nz); other solid cells are walls.
    """
    # Nothing stands outside the grid, and no load is known there.
    piece, wall, air = (np.pad(mask, 1) for mask in (pieces, grid.solid & ~pieces, ~grid.solid))
    outer, cells, unloaded = NO_FACES, NO_FACES.air, NO_FACES
    for axis in range(2):
        for side in (-1, 1):
            # 1. Cells of walls before which a piece stands.
            behind = np.argwhere(wall & np.roll(piece, -side, axis))
            # 2. From there outwards, through pieces, to the first other cell.
            beyond = behind.copy()
            is_before = np.ones(len(beyond), dtype=bool)
            while is_before.any():
                beyond[is_before, axis] += side
                is_before &= piece[tuple(beyond.T)]
            # 3. If that is air, the piece before it hands its load on.
            is_loaded = air[tuple(beyond.T)]
            axes, sides = np.full(len(behind), axis), np.full(len(behind), side)
            faces = Faces(beyond - 1, axes, sides)
            outer = outer.followed_by(faces.chosen(is_loaded))
            cells = np.vstack((cells, behind[is_loaded] - 1))
            # 4. Else it has none.
            unloaded = unloaded.followed_by(faces.of_cells(behind - 1).chosen(~is_loaded))
    return LeaningFaces(outer, cells, unloaded)


def ground_faces(grid: GasGrid) -> Faces:
    """Return the faces of the ground below air, for a grid with a mirror at the low end of z."""
    columns = np.argwhere(~grid.solid[:, :, 0])
    air = np.concatenate((columns, np.zeros((len(columns), 1), dtype=np.int64)), axis=1)
    return Faces(air, np.full(len(air), 2), np.ones(len(air), dtype=np.int64))
