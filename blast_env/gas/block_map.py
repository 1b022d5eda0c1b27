"""Where blocks of cells of each level may be and must be, and what lies in them.

Level 0 covers the grid and its skirt. Each further level has cells of half the side, in blocks of 8
x 8 x 8 that lie within the grid. The last level has the cells of the grid. Solids are as in the
grid: cells of a level that are solid in part are always divided.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.gas.block_borders import (
    OUTSIDE_ONLY,
    SOLID_ONLY,
    WHOLE,
    WITH_AIR,
    hold_around,
)
from blast_env.gas.block_kernels import BEYOND, MIRRORED, OPENED, SIDE
from blast_env.gas.faces import Faces
from blast_env.gas.grid import BUFFER_GROWTH, FACE_NAMES, FaceKind, GasGrid, layers_to
from blast_env.gas.state import AIR, MARGIN, OPEN

EVEN_LAYERS: Final = 4
"""Layers of the skirt of level 0 that are no thicker than its cells; without them, the borders
would be coarser than those of uniform cells, close to the site."""

WALL_CELL_M: Final = 0.5
"""Largest side of the cells before a wall."""

_HALF: Final = SIDE // 2
_CHUNKS: Final = SIDE // 2
_ROWS: Final = 2 * SIDE


@dataclass(frozen=True, eq=False)
class WallFaces:
    """Recorded faces of a level.

    Attributes:
        entries: Layer and row of each face in its block, and its index in the pressures (k, 3).
        first: First entry of each position of a block, axis and chunk of rows, and the end.
        own: Index in the pressures of the face of this level that holds each face (n,).
    """

    entries: NDArray[np.int32]
    first: NDArray[np.int32]
    own: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BlockLevel:
    """Places of blocks of one level.

    Attributes:
        cell_m: Side of the cells.
        factor: Cells along the edge of a cell of level 0.
        shape: Places of blocks along z, y and x.
        lead: Cells before the grid along x, y and z (3,).
        solid: Cells that are wholly solid (nx, ny, nz).
        kinds: Kinds of places; see `WITH_AIR` (z, y, x).
        always: Places of blocks that must exist (z, y, x).
        narrow: Ratio of cell side to the width of cells along x, y and z, from two before the
            first on.
    """

    cell_m: float
    factor: int
    shape: tuple[int, int, int]
    lead: NDArray[np.int64]
    solid: NDArray[np.bool_]
    kinds: NDArray[np.int8]
    always: NDArray[np.uint8]
    narrow: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]

    def near(
        self, grid: GasGrid, centre_m: NDArray[np.float64], radius_m: float
    ) -> NDArray[np.uint8]:
        """Return the places of blocks within a radius of a point (z, y, x)."""
        side_m = SIDE * self.cell_m
        outside = []
        for axis in range(3):
            first_m = grid.origin_m[axis] - self.lead[axis] * self.cell_m
            low_m = first_m + side_m * np.arange(self.shape[2 - axis])
            away = np.maximum(low_m - centre_m[axis], centre_m[axis] - low_m - side_m)
            outside.append(np.maximum(away, 0.0) ** 2)
        x, y, z = outside
        return (z[:, None, None] + y[:, None] + x < radius_m**2).astype(np.uint8)

    def middles_m(self, grid: GasGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return x and y of the middles of places of blocks (1, x) and (y, 1)."""
        side_m = SIDE * self.cell_m
        x_m, y_m = (
            grid.origin_m[axis]
            - self.lead[axis] * self.cell_m
            + side_m * (np.arange(self.shape[2 - axis]) + 0.5)
            for axis in (0, 1)
        )
        return x_m[None], y_m[:, None]

    def wall_faces(self, faces: Faces, first_index: int, ratio: int) -> tuple[WallFaces, int]:
        """Return the recorded faces of this level, and their number.

        Args:
            faces: The faces of the cells of the grid.
            first_index: Index in the pressures of the first of them.
            ratio: Cells of the grid along the edge of a cell of this level.
        """
        cell = faces.air // ratio + self.lead
        high_side = (faces.side < 0).astype(np.int64)
        _, ny, nx = (n * SIDE for n in self.shape)
        key = ((cell[:, 2] * ny + cell[:, 1]) * nx + cell[:, 0]) * 6 + 2 * faces.axis + high_side
        known, one, own = np.unique(key, return_index=True, return_inverse=True)
        cell, axis, high_side = cell[one], faces.axis[one], high_side[one]
        block, inner = cell // SIDE, cell % SIDE
        layer = np.take_along_axis(inner, axis[:, None], axis=1)[:, 0] + high_side
        up, right = np.array([2, 2, 1])[axis], np.array([1, 0, 0])[axis]
        at = np.arange(len(known))
        row = inner[at, up] * SIDE + inner[at, right]
        _, blocks_y, blocks_x = self.shape
        position = (block[:, 2] * blocks_y + block[:, 1]) * blocks_x + block[:, 0]
        place = (position * 3 + axis) * _CHUNKS + row // _ROWS
        order = np.argsort(place, kind="stable")
        entries = np.stack((layer, row % _ROWS, first_index + at), axis=1)[order]
        places = np.arange(int(np.prod(self.shape)) * 3 * _CHUNKS + 1)
        first = np.searchsorted(place[order], places)
        result = WallFaces(
            np.ascontiguousarray(entries, dtype=np.int32), first.astype(np.int32), first_index + own
        )
        return result, len(known)


@dataclass(frozen=True, eq=False)
class BlockMap:
    """Places of blocks of all levels of a grid.

    Attributes:
        grid: The grid, of the smallest cells.
        outside: Codes of the cells of level 0 (z, y, x).
        borders: `MIRRORED` or `OPENED` at the low and the high end of x, y and z (6,).
        levels: The levels, from the largest cells on.
    """

    grid: GasGrid
    outside: NDArray[np.int8]
    borders: NDArray[np.int64]
    levels: tuple[BlockLevel, ...]

    @classmethod
    def of(cls, grid: GasGrid, count: int) -> "BlockMap":
        """Return the map of a grid whose cells are those of the last of `count` levels.

        Raises:
            BlastEnvError: If the grid does not consist of whole blocks of the second level.
        """
        whole = whole_cells(count)
        if any(n % whole for n in grid.shape):
            raise BlastEnvError(
                f"the grid has {grid.shape} cells, must be multiples of {whole} for {count} levels"
            )
        large = _on_larger_cells(grid, 2 ** (count - 1))
        codes = large.codes()
        pads, lead = [], []
        for low, _ in large.buffer_layers_by_axis:
            lead.append(-(-low // _HALF) * _HALF)
        for axis in range(3):
            n = codes.shape[2 - axis] - 2 * MARGIN
            before = lead[axis] - large.buffer_layers_by_axis[axis][0]
            pads.append((before, -(n + before) % SIDE))
        outside = _padded(codes, pads)
        shape = tuple(n // SIDE for n in outside.shape)
        narrow = [
            _padded_row(_narrowness(large, axis), pads[axis], BEYOND - MARGIN) for axis in range(3)
        ]
        borders = np.array(
            [MIRRORED if getattr(grid, name) == FaceKind.MIRROR else OPENED for name in FACE_NAMES]
        )
        levels: list[BlockLevel] = []
        always = np.zeros(shape, dtype=np.uint8)
        for k in range(count):
            solid, mixed = _solid_on(grid.solid, 2 ** (count - 1 - k))
            factor = 2**k
            at = np.array(lead) * factor
            kinds = _kinds(outside, solid, at, factor)
            if k > 0:
                _keep_whole(kinds, levels[0].narrow)
                narrow = [np.ones(n * SIDE + 2 * BEYOND) for n in reversed(shape)]
            x, y, z = narrow
            cell_m = grid.cell_m * 2 ** (count - 1 - k)
            levels.append(BlockLevel(cell_m, factor, shape, at, solid, kinds, always, (x, y, z)))
            if k + 1 < count:
                shape = tuple(2 * n for n in shape)
                divided = _divided(solid, mixed, at, shape, walls=cell_m > WALL_CELL_M * 1.001)
                always = divided
        for k in range(count - 1, 0, -1):
            level = levels[k]
            level.always[level.kinds != WITH_AIR] = 0
            if k > 1:
                hold_around(level.always, levels[k - 1].always, levels[k - 1].kinds)
        levels[0].always[:] = levels[0].kinds == WITH_AIR
        return cls(grid, outside, borders, tuple(levels))


def shape_of_blocks(shape: tuple[int, int, int], count: int) -> tuple[int, int, int]:
    """Extend a shape at its high ends to that of a grid of so many levels."""
    whole = whole_cells(count)
    nx, ny, nz = (-(-n // whole) * whole for n in shape)
    return nx, ny, nz


def layers_around(cells: float) -> int:
    """Return the number of layers of a skirt at least as thick as a number of cells of level 0."""
    return EVEN_LAYERS + layers_to(max(cells - EVEN_LAYERS, 0.0))


def whole_cells(count: int) -> int:
    """Return the number of cells of which the sides of a grid of so many levels are multiples."""
    return _HALF * 2 ** (count - 1)


def _on_larger_cells(grid: GasGrid, ratio: int) -> GasGrid:
    solid, _ = _solid_on(grid.solid, ratio)
    return replace(grid, cell_m=grid.cell_m * ratio, solid=solid)


def _keep_whole(kinds: NDArray[np.int8], narrow: Sequence[NDArray[np.float64]]) -> None:
    """Mark places of blocks in those layers of the skirt that are thicker than a cell."""
    for axis, row in enumerate(narrow):
        cells = row[BEYOND:-BEYOND] < 1.0
        places = kinds.shape[2 - axis]
        fine = np.repeat(cells, places * SIDE // len(cells)).reshape(places, SIDE)
        wide = np.moveaxis(kinds, 2 - axis, 0)
        outer = np.asarray(fine.any(axis=1))[:, None, None] & (wide == WITH_AIR)
        wide[outer] = WHOLE


def _narrowness(grid: GasGrid, axis: int) -> NDArray[np.float64]:
    """Return the ratios of cell side to the width of cells, as `GasGrid.narrowness`.

    The first layers of the skirt have the width of a cell.
    """
    row = grid.narrowness(axis)
    thin = np.minimum(row * BUFFER_GROWTH**EVEN_LAYERS, 1.0)
    return np.where(row < 1.0, thin, row)


def _solid_on(solid: NDArray[np.bool_], ratio: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the larger cells that are wholly solid, and those that are in part."""
    if ratio == 1:
        return solid, np.zeros_like(solid)
    some = _any_in(solid, ratio)
    every = ~_any_in(~solid, ratio)
    return every, some & ~every


def _padded(codes: NDArray[np.int8], pads: list[tuple[int, int]]) -> NDArray[np.int8]:
    """Return codes (z, y, x) without their margin, with layers of it before and after x, y, z."""
    wide = np.pad(codes, SIDE, mode="edge")
    part = []
    for axis in (2, 1, 0):
        before, after = pads[axis]
        n = codes.shape[2 - axis]
        part.append(slice(SIDE + MARGIN - before, SIDE + n - MARGIN + after))
    return np.ascontiguousarray(wide[tuple(part)])


def _padded_row(row: NDArray[np.float64], pads: tuple[int, int], more: int) -> NDArray[np.float64]:
    """Return the narrowness of cells with the layers of `_padded`, and `BEYOND` at either end."""
    wide = np.pad(row, SIDE, mode="edge")
    before, after = pads
    return np.ascontiguousarray(wide[SIDE - before - more : SIDE + len(row) + after + more])


def _kinds(
    outside: NDArray[np.int8],
    solid: NDArray[np.bool_],
    lead: NDArray[np.int64],
    factor: int,
) -> NDArray[np.int8]:
    """Return the kinds of places of blocks of a level."""
    if factor == 1:
        codes = outside.copy()
    else:
        codes = np.repeat(np.repeat(np.repeat(outside, factor, 0), factor, 1), factor, 2)
    part = tuple(slice(lead[2 - k], lead[2 - k] + solid.shape[2 - k]) for k in range(3))
    codes[part] = np.where(solid.T, -1, AIR)
    air = _any_in(codes == AIR, SIDE)
    closed = _any_in(codes != OPEN, SIDE)
    return np.where(air, WITH_AIR, np.where(closed, SOLID_ONLY, OUTSIDE_ONLY)).astype(np.int8)


def _any_in(cells: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Return whether a cell of each cube of `size` along an edge is true; one axis at a time."""
    for axis in (2, 1, 0):
        shape = cells.shape
        parts = cells.reshape(*shape[:axis], shape[axis] // size, size, *shape[axis + 1 :])
        cells = np.asarray(parts.any(axis=axis + 1))
    return cells


def _divided(
    solid: NDArray[np.bool_],
    mixed: NDArray[np.bool_],
    lead: NDArray[np.int64],
    shape: tuple[int, ...],
    *,
    walls: bool,
) -> NDArray[np.uint8]:
    """Return the places of smaller blocks (z, y, x) in cells that must be divided.

    They are the cells that are solid in part, with `walls` those beside a solid, and all around
    them.
    """
    from scipy.ndimage import binary_dilation  # takes a while to import

    near = mixed
    if walls:
        near = near | (binary_dilation(solid) & ~solid)
    near = binary_dilation(near, np.ones((3, 3, 3), dtype=bool))
    blocks = _any_in(near, _HALF)
    nx, ny, nz = blocks.shape
    result = np.zeros(shape, dtype=np.uint8)
    x, y, z = (int(n) // _HALF for n in lead)
    result[z : z + nz, y : y + ny, x : x + nx] = blocks.T
    return result
