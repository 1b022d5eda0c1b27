"""Which parts of a site have cells of which size: levels of bricks.

Level 0 covers everything. A unit of it, 8 cells along each edge, may be refined: it then has a
brick of 16 cells of half the side, and so on. Cells that meet differ by one level at most.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.gas.bricks import SIDE, UNIT, Table, Whole, boxes_of, fill_codes
from blast_env.physics.gas.faces import Faces
from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.state import Reals

LEAD: Final = UNIT
"""Cells of level 0 before the gas begins, along each axis: room for what is beyond its border."""

AROUND: Final = 2 * UNIT
"""Cells of level 0 around the grid of a site, to open borders; above it half as many."""

GHOSTS: Final = (2, 4, 4)
"""Cells around a box that a step of it needs, along z, y and x: two a pass."""

_CLOSE: Final = 4
"""Cells from a solid that a level cannot show, within which it is not used."""

_MOST_UNITS: Final = np.array([4, 4, 16])
"""Of a box; with its ghosts a row of 16 units is a tile of the kernels."""

Bools = NDArray[np.bool_]


def halved(marked: Bools) -> Bools:
    """Return which of twice the size hold something marked, along all axes of even length."""
    nz, ny, nx = (n // 2 for n in marked.shape)
    return np.asarray(marked.reshape(nz, 2, ny, 2, nx, 2).any(axis=(1, 3, 5)))


def doubled(marked: Bools) -> Bools:
    """Return what is marked in half the size."""
    return marked.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)


def grown(marked: Bools, by: int = 1) -> Bools:
    """Return what is marked and what is around it, corners included."""
    for axis in range(3):
        out = marked.copy()
        for shift in range(1, by + 1):
            head = [slice(None)] * 3
            tail = [slice(None)] * 3
            head[axis], tail[axis] = slice(None, -shift), slice(shift, None)
            out[tuple(head)] |= marked[tuple(tail)]
            out[tuple(tail)] |= marked[tuple(head)]
        marked = out
    return marked


@dataclass(eq=False)
class Box:
    """Cells of a level that are moved on together.

    Attributes:
        start: Index of the first cell, its ghosts included (3,).
        shape: Cells along z, y and x, ghosts included.
        codes: What they are to the kernels (z, y, x), with room for a row's end.
        coarse_codes: The same of the coarser cells below, from one before to one after.
        faces: How many faces of the level have their air in the box.
        upright: Which of them are of walls (faces,).
        members: Faces of the run that those are (n,).
        of: Which of `faces` each of them is (n,).
        walls: The faces for the kernels, see `Faces.kernel_table`.
        first: First entry of each line among them.
        rim: Its inner cells in the box (6,).
        coarser_ends: Axis and end of the sides where finer cells are beside it.
        finer_ends: The same where coarser ones are.
    """

    start: Whole
    shape: tuple[int, int, int]
    codes: NDArray[np.int8]
    coarse_codes: NDArray[np.int8]
    members: NDArray[np.int64]
    of: NDArray[np.int64]
    faces: int
    upright: Bools
    walls: NDArray[np.int32]
    first: NDArray[np.int32]
    rim: Whole
    coarser_ends: list[tuple[int, int]]
    finer_ends: list[tuple[int, int]]

    @property
    def coarse_start(self) -> Whole:
        """Index of the first of the coarser cells below (3,)."""
        return self.start // 2 - 1

    @property
    def cells(self) -> int:
        """Inner cells."""
        z0, z1, y0, y1, x0, x1 = self.rim.tolist()
        return int((z1 - z0) * (y1 - y0) * (x1 - x0))


class Level:
    """Cells of one size.

    Attributes:
        depth: How often they are halved.
        table: Where each brick lies in the pools (z, y, x), -1 for none.
        bricks: Places of the bricks (n, 3).
        slots: Where they lie (n,).
        old: States at the beginning of the step (slots, components, z, y, x).
        new: States at its end.
        solid: Which cells around the site are solid (z, y, x).
        corner: Index of the first of those (3,).
        bounds: First and last + 1 index of the gas along z, y and x (6,).
        inexact: Units in which these cells cannot show what is solid (z, y, x).
        refinable: Units that may be refined.
        boxes: What is moved on together.
        seams: Faces of units beside which finer cells are, by axis: unit on the high side, and
            whether that is the coarser one (n, 4).
        registers: What those are put right by.
    """

    def __init__(
        self, depth: int, units: tuple[int, int, int], solid: Bools, corner: Whole, bounds: Whole
    ) -> None:
        self.depth = depth
        self.units = units
        self.solid = np.ascontiguousarray(solid)
        self.corner, self.bounds = corner, bounds
        self.inexact = np.zeros(units, dtype=bool)
        self.refinable = np.zeros(units, dtype=bool)
        self.table: Table = np.full([n * UNIT // SIDE for n in units], -1, dtype=np.int32)
        self.bricks: Whole = np.empty((0, 3), dtype=np.int64)
        self.slots: Whole = np.empty(0, dtype=np.int64)
        self.old: Reals = np.empty(0)
        self.new: Reals = np.empty(0)
        self.boxes: list[Box] = []
        self.seams: list[Whole] = []
        self.ids: list[Table] = []
        self.registers: list[Reals] = []
        self._known: dict[tuple[int, ...], Box] = {}
        self._free: list[int] = []

    def allocate(self, components: int, dtype: type) -> None:
        """Make pools without a brick."""
        self.old = np.empty((0, components, SIDE, SIDE, SIDE), dtype=dtype)
        self.new = self.old.copy()

    def set_bricks(self, wanted: Bools) -> Whole:
        """Give the level these bricks, and return the places of those that are new (n, 3)."""
        there = self.table >= 0
        gone, added = np.argwhere(there & ~wanted), np.argwhere(wanted & ~there)
        self._free += self.table[tuple(gone.T)].tolist()
        self.table[tuple(gone.T)] = -1
        if len(added) > len(self._free):
            self._enlarge(len(added) - len(self._free))
        self._free.sort(reverse=True)
        for place in added:
            self.table[tuple(place)] = self._free.pop()
        self.bricks = np.argwhere(wanted)
        self.slots = self.table[tuple(self.bricks.T)].astype(np.int64)
        return added

    def _enlarge(self, by: int) -> None:
        have = len(self.old)
        more = max(by, have // 4)
        for name in ("old", "new"):
            pool = getattr(self, name)
            larger = np.empty((have + more, *pool.shape[1:]), dtype=pool.dtype)
            larger[:have] = pool
            setattr(self, name, larger)
        self._free += range(have, have + more)

    def set_faces(self, faces: Faces, lead: Whole, size: int) -> None:
        """Take over the faces of a run: its air cells begin at `lead`, `size` to a cell's edge."""
        air = (faces.air[:, ::-1] + lead) // size
        key = np.column_stack((air, faces.axis, faces.side))
        own, of = np.unique(key, axis=0, return_inverse=True)
        self._air, self._axis, self._side = own[:, :3], own[:, 3], own[:, 4]
        self._order = np.argsort(of.ravel(), kind="stable")
        self._ends = np.searchsorted(of.ravel()[self._order], np.arange(len(own) + 1))

    def divide(self, refined: Bools, coarser: "Level | None") -> None:
        """Cut what has no finer cells into boxes, and find the seams to those that have."""
        leaves = doubled(self.table >= 0) & ~refined
        low, high = self.bounds[::2] // UNIT, self.bounds[1::2] // UNIT
        inside = np.zeros_like(leaves)
        inside[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = True
        leaves &= inside
        self._find_seams(leaves, refined)
        known, self._known, self.boxes = self._known, {}, []
        for found in boxes_of(leaves, _MOST_UNITS):
            key = tuple(found.tolist())
            box = known.get(key) or self._box(found, coarser)
            self._find_ends(box, coarser)
            self._known[key] = box
            self.boxes.append(box)

    def _find_seams(self, leaves: Bools, refined: Bools) -> None:
        self.seams, self.ids = [], []
        for axis in range(3):
            leaf, fine = np.moveaxis(leaves, axis, 0), np.moveaxis(refined, axis, 0)
            ids = np.full(leaf.shape, -1, dtype=np.int32)
            up, down = leaf[:-1] & fine[1:], fine[:-1] & leaf[1:]
            at = np.argwhere(up | down)
            is_high = down[tuple(at.T)].astype(np.int64)
            at[:, 0] += 1
            ids[tuple(at.T)] = np.arange(len(at))
            order = {0: (0, 1, 2), 1: (1, 0, 2), 2: (1, 2, 0)}[axis]
            self.seams.append(np.ascontiguousarray(np.column_stack((at[:, order], is_high))))
            self.ids.append(ids)

    def _find_ends(self, box: Box, coarser: "Level | None") -> None:
        """Find the sides of a box at which there are seams, as the coarser or the finer cells."""
        box.coarser_ends, box.finer_ends = [], []
        inner = box.start + GHOSTS
        shape = box.rim[1::2] - box.rim[::2]
        for axis in range(3):
            others = [k for k in range(3) if k != axis]
            for end in range(2):
                at = int(inner[axis] + end * shape[axis])
                if at % SIDE == 0 and coarser is not None:
                    plane = coarser.ids[axis][at // SIDE]
                    if (plane[_units(inner, shape, others, SIDE)] >= 0).any():
                        box.finer_ends.append((axis, end))
                plane = self.ids[axis][at // UNIT] if at // UNIT < len(self.ids[axis]) else None
                if plane is not None and (plane[_units(inner, shape, others, UNIT)] >= 0).any():
                    box.coarser_ends.append((axis, end))

    def _box(self, units: Whole, coarser: "Level | None") -> Box:
        low, high = UNIT * units[::2], UNIT * units[1::2]
        start = low - GHOSTS
        nz, ny, nx = (int(n) for n in high - low + 2 * np.array(GHOSTS))
        # Kernels look at rows in whole lanes, hence beyond the last one's end.
        codes = np.zeros(nz * ny * nx + SIDE, dtype=np.int8)[: nz * ny * nx].reshape(nz, ny, nx)
        fill_codes(codes, start, self.solid, self.corner, self.bounds)
        coarse_codes = np.zeros((nz // 2 + 2, ny // 2 + 2, nx // 2 + 2), dtype=np.int8)
        if coarser is not None:
            fill_codes(coarse_codes, start // 2 - 1, coarser.solid, coarser.corner, coarser.bounds)
        inside = ((self._air >= low) & (self._air < high)).all(axis=1)
        own = np.flatnonzero(inside)
        counts = self._ends[own + 1] - self._ends[own]
        of = np.repeat(np.arange(len(own)), counts)
        offsets = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
        members = self._order[np.repeat(self._ends[own], counts) + offsets]
        axis, side = self._axis[own], self._side[own]
        cell = self._air[own] - start
        cell[np.arange(len(own)), 2 - axis] += side < 0  # the cell on the high side
        line = (axis * nz + cell[:, 0]) * ny + cell[:, 1]
        order = np.argsort(line * nx + cell[:, 2], kind="stable")
        walls = np.stack((cell[order, 2], order), axis=1).astype(np.int32)
        first = np.searchsorted(line[order], np.arange(3 * nz * ny + 1)).astype(np.int32)
        inner = np.array([GHOSTS[0], nz - GHOSTS[0], 4, ny - 4, 4, nx - 4])
        return Box(
            start,
            (nz, ny, nx),
            codes,
            coarse_codes,
            members,
            of,
            len(own),
            axis < 2,
            np.ascontiguousarray(walls),
            first,
            inner,
            [],
            [],
        )


def _units(inner: Whole, shape: Whole, axes: list[int], side: int) -> tuple[slice, slice]:
    one, two = (slice(int(inner[k]) // side, -(-int(inner[k] + shape[k]) // side)) for k in axes)
    return one, two


def levels_of(grid: GasGrid, finest: int) -> list[Level]:
    """Return the levels for a grid of finest cells, whose sides are halved so often from level 0.

    The grid is somewhere inside; around it and above it the air goes on.
    """
    scale = 2**finest
    cells = np.array(grid.shape[::-1])
    around = np.array([0, AROUND, AROUND])
    above = np.array([UNIT, AROUND, AROUND])
    inner = -(-cells // scale)
    whole = UNIT * -(-(around + inner + above) // UNIT)
    units = SIDE * -(-(whole + 2 * LEAD) // SIDE) // UNIT
    # What is solid, in whole units of level 0.
    padded = np.zeros(UNIT * scale * -(-cells // (UNIT * scale)), dtype=bool)
    padded[tuple(slice(n) for n in cells)] = grid.solid.transpose(2, 1, 0)
    corner = (LEAD + around) * scale
    levels: list[Level] = []
    some = every = padded
    for depth in range(finest, -1, -1):
        size = 2**depth
        bounds = np.column_stack((np.full(3, LEAD), LEAD + whole)).ravel() * size
        nz, ny, nx = (int(n) for n in units * size)
        level = Level(depth, (nz, ny, nx), every, corner * size // scale, bounds)
        if depth < finest:
            level.inexact = _close_units(level, some & ~every)
        levels.insert(0, level)
        some, every = halved(some), ~halved(~every)
    _limit(levels)
    return levels


def _close_units(level: Level, cells: Bools) -> Bools:
    """Return the units that have one of these cells in them or close by."""
    out = np.zeros(level.units, dtype=bool)
    for z, y, x in np.unique(np.argwhere(cells) // _CLOSE, axis=0) * _CLOSE + level.corner:
        low = [max(int(at) - _CLOSE, 0) // UNIT for at in (z, y, x)]
        high = [(int(at) + 2 * _CLOSE - 1) // UNIT + 1 for at in (z, y, x)]
        out[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = True
    return out


def _limit(levels: list[Level]) -> None:
    """Say what may be refined: not at the border, nor what finer cells would be beside it."""
    for level in levels[:-1]:
        low, high = level.bounds[::2] // UNIT, level.bounds[1::2] // UNIT
        if level.depth == 0:
            there = np.zeros(level.units, dtype=bool)
            there[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = True
        else:
            there = doubled(levels[level.depth - 1].refinable)
        out = ~there
        out[: low[0]] = False  # the ground is no border
        level.refinable = there & ~grown(out)
