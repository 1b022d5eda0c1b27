"""A run of the gas on cells of several sizes, each with steps of its own.

The scheme, the faces and what looks at the gas are those of `GasSolver`. Cells are small where the
pressure changes from cell to cell and around what matters, and grow where it does not any more.
Cells of half the side take two steps for one (Berger and Oliger, J. Comput. Phys. 53 (1984) 484).
A box of cells takes a whole step at once, from ghosts around it that are cells of its own size, or
made of larger ones.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import expm1, inf, prod, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.gas import bricks, kernels, state
from blast_env.physics.gas.bricks import SIDE, UNIT
from blast_env.physics.gas.faces import NO_FACES, Faces
from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.levels import (
    GHOSTS,
    Box,
    Level,
    grown,
    halved,
    levels_of,
)
from blast_env.physics.gas.solver import (
    AIR_DENSITY_KG_M3,
    AIR_PRESSURE_PA,
    COURANT,
    Burning,
    Recorder,
    Settling,
    Totals,
    ramp,
)
from blast_env.physics.gas.state import ENERGY, GAMMA, Reals

_AHEAD: Final = 4
"""Cells around steep pressure that are refined with it; a front runs less between two looks."""

_NO_MARGIN: Final = (0, 0, 0)

_Flows = tuple[Reals, ...]


@dataclass(frozen=True)
class Refinement:
    """Where cells are halved.

    Attributes:
        steep: For each level, from the coarsest on: change of pressure from one cell to the next
            from which it is, in units of the largest overpressure there so far. As many levels have
            finer ones below.
        loud: Overpressure, in the same units, from which that is done around what matters.
        least: Change of pressure that never counts, in units of still air's.
    """

    steep: tuple[float, ...]
    loud: float = inf
    least: float = 0.002

    @property
    def levels(self) -> int:
        """How often cells can be halved."""
        return len(self.steep)


class _Worker:
    """What a thread works with."""

    def __init__(self, dtype: type) -> None:
        self.dtype = dtype
        self.work: Reals = np.zeros(kernels.WORK_SIZE, dtype=dtype)
        self.notes = np.zeros(2)
        self.cell_updates = 0
        self._room: Reals = np.zeros(0, dtype=dtype)
        self._coarse: Reals = np.zeros(0, dtype=dtype)
        self.edges: Reals = np.zeros((0, kernels.EDGE_SIZE), dtype=dtype)
        self.even: Reals = np.ones(kernels.TILE + 8 * kernels.LANES, dtype=dtype)

    def rooms(self, box: Box, components: int) -> tuple[Reals, Reals]:
        """Return arrays for the states of a box and of the coarser cells below."""
        shape = (components, *box.shape)
        if len(self._room) < prod(shape) + kernels.LANES:
            self._room = np.ones(2 * prod(shape) + kernels.LANES, dtype=self.dtype)
        if len(self.edges) < box.shape[1]:
            self.edges = np.zeros((box.shape[1], kernels.EDGE_SIZE), dtype=self.dtype)
        coarse = (components, *box.coarse_codes.shape)
        if len(self._coarse) < prod(coarse):
            self._coarse = np.zeros(2 * prod(coarse), dtype=self.dtype)
        return (
            self._room[: prod(shape)].reshape(shape),
            self._coarse[: prod(coarse)].reshape(coarse),
        )


class RefinedSolver:
    """A gas around a grid of finest cells, at rest until `set_state` says otherwise.

    Times, states, faces and recorders are as in `GasSolver`. Recorders look after every step of the
    finest cells that there are; on faces before larger ones they see the mean over the step of
    those.

    Attributes:
        grid: The grid of the finest cells.
        faces: Faces on which the pressure is known.
        levels: The levels, the coarsest first.
        time_s: Simulated time so far.
        steps: Steps so far, of the finest cells that there were.
        cell_updates: Cells moved on so far, as `GasSolver` counts them.
        wall_pressure: Mean pressures on `faces` during the last step, in units of still air's.
    """

    def __init__(
        self,
        grid: GasGrid,
        refinement: Refinement,
        *,
        matters: NDArray[np.bool_] | None = None,
        faces: Faces = NO_FACES,
        recorders: Sequence[Recorder] = (),
        burning: Burning | None = None,
        settling: Settling | None = None,
        threads: int = 1,
        dtype: type = np.float32,
    ) -> None:
        self.grid, self.faces = grid, faces
        self.recorders = tuple(recorders)
        self.time_s, self.steps = 0.0, 0
        self.pressure_pa, self.density_kg_m3 = AIR_PRESSURE_PA, AIR_DENSITY_KG_M3
        self.velocity_m_s = sqrt(self.pressure_pa / self.density_kg_m3)
        self._burning, self._settling = burning, settling
        self._still: Reals = np.zeros(6, dtype=dtype)
        self._still[state.DENSITY] = 1.0
        self._still[ENERGY] = 1.0 / (GAMMA - 1.0)
        self.wall_pressure: Reals = np.ones(len(faces), dtype=dtype)
        self.levels = levels_of(grid, refinement.levels)
        self._scale = 2**refinement.levels
        self._lead = self.levels[-1].corner
        for level in self.levels:
            level.allocate(6, dtype)
            level.set_faces(faces, self._lead, self._scale // 2**level.depth)
        self.levels[0].set_bricks(np.ones(self.levels[0].table.shape, dtype=bool))
        self._refinement = refinement
        self._loud = self._thresholds(refinement, matters)
        self._loudest: list[Reals] = [np.zeros(level.units, dtype=dtype) for level in self.levels]
        self._workers = [_Worker(dtype) for _ in range(threads)]
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._signal = 0.0
        self._whole_steps = 0
        self.lifted = 0

    def _thresholds(self, refinement: Refinement, matters: NDArray[np.bool_] | None) -> list[Reals]:
        """Return from which share of the largest overpressure units are refined at any rate."""
        thresholds = []
        for level in self.levels[:-1]:
            loud = np.full(level.units, np.inf, dtype=self._still.dtype)
            if matters is not None:
                size = self._scale // 2**level.depth * UNIT
                cells = np.argwhere(matters)[:, ::-1] + self._lead
                near = np.zeros(level.units, dtype=bool)
                near[tuple(np.unique(cells // size, axis=0).T)] = True
                loud[grown(near)] = refinement.loud
            thresholds.append(loud)
        return thresholds

    def set_state(
        self,
        *,
        density_kg_m3: NDArray[np.float64],
        velocity_m_s: Sequence[NDArray[np.float64]],
        pressure_pa: NDArray[np.float64],
        fuel_kg_m3: NDArray[np.float64],
        start: tuple[int, int, int] = (0, 0, 0),
    ) -> None:
        """Set the gas in a part of the grid, from arrays over x, y and z; the rest is still.

        Args:
            density_kg_m3: Density.
            velocity_m_s: Velocities along x, y and z.
            pressure_pa: Pressure.
            fuel_kg_m3: Density of the passive scalar.
            start: The first cell of the arrays.
        """
        density = density_kg_m3 / self.density_kg_m3
        pressure = pressure_pa / self.pressure_pa
        values = np.zeros((6, *density.shape))
        values[state.DENSITY] = density
        values[ENERGY] = pressure / (GAMMA - 1.0)
        for k, component in enumerate(velocity_m_s):
            velocity = component / self.velocity_m_s
            values[state.X_MOMENTUM + k] = density * velocity
            values[ENERGY] += 0.5 * density * velocity * velocity
        values[state.FUEL] = fuel_kg_m3 / self.density_kg_m3
        end = tuple(at + n for at, n in zip(start, density.shape, strict=True))
        part = tuple(slice(a, b) for a, b in zip(start, end, strict=True))
        solid = self.grid.solid[part]
        values = np.where(solid, self._still[:, None, None, None].astype(np.float64), values)
        first, last = np.array(start)[::-1] + self._lead, np.array(end)[::-1] + self._lead
        wanted = []
        for level in self.levels[:-1]:
            size = self._scale // 2**level.depth * UNIT
            marked = np.zeros(level.units, dtype=bool)
            low, high = first // size, (last - 1) // size + 1
            marked[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = True
            wanted.append(marked)
        for level in self.levels:
            for pool in (level.old, level.new):
                pool[:] = self._still[:, None, None, None]
        self._refine(wanted)
        finest = self.levels[-1]
        cells = np.ascontiguousarray(values.transpose(0, 3, 2, 1).astype(self._still.dtype))
        bricks.scatter(cells, first, np.array(_NO_MARGIN), finest.old, finest.table)
        for level in self.levels[:0:-1]:
            self._restrict(level, self.levels[level.depth - 1].old)
        self._signal = max(
            float(state.fastest_signal(level.old[slot]))
            for level in self.levels
            for slot in level.slots
        )

    def advance(self, until_s: float) -> None:
        """Go on until the simulated time is at least `until_s`, in whole steps."""
        while self.time_s < until_s:
            self.step()

    def step(self) -> None:
        """Make a step of the coarsest cells, and all of the finer ones in it."""
        self._look()
        reduced = 2.0 * ramp(self._whole_steps) * COURANT / self._signal
        cell_m = self.grid.cell_m * self._scale
        step_s = reduced * cell_m / self.velocity_m_s
        settled = self._settling is not None and self.time_s >= self._settling.time_s
        if settled and self._burning is not None:
            self._burn_out(self._burning)
        for worker in self._workers:
            worker.notes[:] = 0.0
        self._advance(0, step_s, self._still.dtype.type(reduced), 0.0)
        self._signal = max(sqrt(GAMMA), *(float(each.notes[0]) for each in self._workers))
        self.lifted += int(sum(each.notes[1] for each in self._workers))
        self._whole_steps += 1

    def _advance(self, depth: int, step_s: float, ratio: Any, share: float) -> None:
        """Move a level on by a step, and the finer ones by two of half of it.

        Args:
            depth: Which level.
            step_s: The step.
            ratio: The same over the cell side, in units of still air.
            share: How far in the step of the level before it begins.
        """
        level = self.levels[depth]
        finer = self.levels[depth + 1] if depth + 1 < len(self.levels) else None
        for register in level.registers:
            register[:] = 0.0
        flows = self._share_out(depth, step_s, ratio, share)
        for box, through in zip(level.boxes, flows, strict=True):
            self._add_flows(level, box, through)
        if finer is None or not len(finer.slots):
            level.old, level.new = level.new, level.old
            self._record(step_s)
            return
        for half in (0.0, 0.5):
            self._advance(depth + 1, 0.5 * step_s, ratio, half)
            self._restrict(finer, level.new)
        for axis, register in enumerate(level.registers):
            bricks.put_right(
                register,
                axis,
                level.seams[axis],
                level.new,
                level.table,
                level.solid,
                level.corner,
            )
        level.old, level.new = level.new, level.old

    def _record(self, step_s: float) -> None:
        self.steps += 1
        self.time_s += step_s
        for recorder in self.recorders:
            recorder.record(self, step_s)

    def _share_out(self, depth: int, step_s: float, ratio: Any, share: float) -> list[_Flows]:
        """Give each thread its part of the boxes of a level; return what went through each."""
        boxes, count = self.levels[depth].boxes, len(self._workers)
        flows: list[_Flows] = [()] * len(boxes)

        def move(k: int) -> None:
            for n in range(k, len(boxes), count):
                flows[n] = self._move(boxes[n], depth, self._workers[k], step_s, ratio, share)

        others = [self._pool.submit(move, k) for k in range(1, count) if self._pool is not None]
        move(0)
        for other in others:
            other.result()
        return flows

    def _move(
        self, box: Box, depth: int, worker: _Worker, step_s: float, ratio: Any, share: float
    ) -> _Flows:
        """Move a box on by a step; return what went through its ends along z, y and x."""
        level, real = self.levels[depth], self._still.dtype.type
        cells, coarse = worker.rooms(box, len(self._still))
        missing = bricks.gather(
            cells, box.start, level.old, level.old, real(0.0), level.table, self._still
        )
        if missing and depth > 0:
            below = self.levels[depth - 1]
            start, pools = box.coarse_start, (below.old, below.new)
            bricks.gather(coarse, start, *pools, real(share), below.table, self._still)
            bricks.prolong(cells, box.start, level.table, coarse, box.coarse_codes, box.codes)
        flows = self._flows(box)
        if bricks.is_still(cells, self._still):
            for axis, flow in enumerate(flows):
                flow[:, state.Z_MOMENTUM - axis] = ratio  # pressure, and nothing else
        else:
            self._pass(box, worker, cells, ratio, flows)
            if self._burning is not None:
                gone = real(-expm1(-step_s / self._burning.time_s))
                state.burn(cells, box.rim, gone, self._heat(self._burning))
            elif self._settling is not None and self.time_s >= self._settling.time_s:
                state.cool(cells, box.rim, real(self._settling.hottest))
            worker.cell_updates += 2 * box.cells
        bricks.scatter(cells, box.start, np.array(GHOSTS), level.new, level.table)
        return flows

    def _pass(self, box: Box, worker: _Worker, cells: Reals, ratio: Any, flows: _Flows) -> None:
        """Make the three passes of a step over a box; the ghosts are used up in them."""
        nz, ny, nx = box.shape
        half = self._still.dtype.type(0.5) * ratio
        pressure = np.ones(box.faces, dtype=cells.dtype)
        rim = box.rim if flows else np.full(6, -1)
        flow_z, flow_y, flow_x = flows or 3 * (np.zeros((2, len(cells), 1, 1), dtype=cells.dtype),)
        walls = (pressure, box.walls, box.first, worker.notes, rim)

        planes_of: Any = kernels.advance_planes  # star arguments are beyond the type checker
        columns_of: Any = kernels.advance_columns

        def planes(deep: int, around: int) -> None:
            extent = np.array([deep, nz - deep, around, ny - around, around, nx - around])
            rooms = (cells, box.codes, worker.work, worker.edges)
            even = (worker.even, worker.even)
            planes_of(*rooms, extent, deep, nz - deep, half, *even, *walls, flow_x, flow_y)

        planes(0, 2)
        before = pressure.copy()
        extent = np.array([2, nz - 2, 2, ny - 2, 2, nx - 2])
        rooms = (cells, box.codes, worker.work, extent)
        columns_of(*rooms, 2, ny - 2, ratio, worker.even, *walls, flow_z)
        planes(2, 4)
        if box.faces:
            pressure[box.upright] = 0.5 * (before[box.upright] + pressure[box.upright])
            self.wall_pressure[box.members] = pressure[box.of]

    def _flows(self, box: Box) -> _Flows:
        """Return room for the flows through the ends of a box, none where it has no seams."""
        if not (box.coarser_ends or box.finer_ends):
            return ()
        nz, ny, nx = (box.rim[1::2] - box.rim[::2]).tolist()
        return tuple(
            np.zeros((2, len(self._still), *shape), dtype=self._still.dtype)
            for shape in ((ny, nx), (nz, nx), (nz, ny))
        )

    def _add_flows(self, level: Level, box: Box, flows: _Flows) -> None:
        """Add what went through the ends of a box to what seams are put right by."""
        inner = box.start + GHOSTS
        for ends, owner, side in (
            (box.coarser_ends, level, UNIT),
            (box.finer_ends, self.levels[max(level.depth - 1, 0)], SIDE),
        ):
            for axis, end in ends:
                one, two = (int(inner[k]) for k in range(3) if k != axis)
                at = int(inner[axis]) + end * int(box.rim[2 * axis + 1] - box.rim[2 * axis])
                register, ids = owner.registers[axis], owner.ids[axis][at // side]
                bricks.add_flow(register, ids, flows[axis][end], one, two, side == SIDE)

    def _restrict(self, level: Level, pool: Reals) -> None:
        """Give the coarser cells below a level the means of its own."""
        table = self.levels[level.depth - 1].table
        bricks.restrict(level.old, level.bricks, level.slots, pool, table)

    def _look(self) -> None:
        """Refine where it is worth it now, and nowhere else."""
        wanted, real = [], self._still.dtype.type
        for level, steep, loud in zip(
            self.levels, self._refinement.steep, self._loud, strict=False
        ):
            strong, kept = np.zeros(level.units, dtype=bool), np.zeros(level.units, dtype=bool)
            solid = (level.solid, level.corner)
            limits = (real(self._refinement.least), real(steep), loud, self._loudest[level.depth])
            bricks.look(level.old, level.bricks, level.slots, *solid, *limits, _AHEAD, strong, kept)
            finer = self.levels[level.depth + 1]
            wanted.append(strong | (kept & (finer.table >= 0)))
        self._refine(wanted)

    def _refine(self, wanted: list[NDArray[np.bool_]]) -> None:
        """Give finer cells to units, and to those that they need around them, and no others."""
        for level, marked in zip(self.levels, wanted, strict=False):
            marked |= level.inexact
            marked &= level.refinable
        for depth in range(len(wanted) - 1, 0, -1):
            wanted[depth - 1] |= halved(grown(wanted[depth]))
            wanted[depth - 1] &= self.levels[depth - 1].refinable
        changed = not self.levels[0].boxes
        for level, finer, marked in zip(self.levels, self.levels[1:], wanted, strict=False):
            if ((finer.table >= 0) == marked).all():
                continue
            changed = True
            for place in finer.set_bricks(marked):
                self._make(finer, level, place)
        if changed:
            nothing = np.zeros(self.levels[-1].units, dtype=bool)
            for depth, refined in enumerate([*wanted, nothing]):
                level = self.levels[depth]
                level.divide(refined, self.levels[depth - 1] if depth else None)
                size = (len(self._still), UNIT, UNIT)
                level.registers = [
                    np.zeros((len(seams), *size), dtype=self._still.dtype) for seams in level.seams
                ]

    def _make(self, level: Level, below: Level, place: NDArray[np.int64]) -> None:
        """Fill a new brick from the coarser cells."""
        components = len(self._still)
        cells = np.empty((components, SIDE, SIDE, SIDE), dtype=self._still.dtype)
        cells[:] = self._still[:, None, None, None]
        coarse = np.empty((components, UNIT + 2, UNIT + 2, UNIT + 2), dtype=cells.dtype)
        start, coarse_start = SIDE * place, UNIT * place - 1
        pools = (below.old, below.old, cells.dtype.type(0.0))
        bricks.gather(coarse, coarse_start, *pools, below.table, self._still)
        slot = level.table[tuple(place)]
        if bricks.is_still(coarse, self._still):
            level.old[slot, :components] = cells
            return
        codes = np.empty(cells.shape[1:], dtype=np.int8)
        coarse_codes = np.empty(coarse.shape[1:], dtype=np.int8)
        bricks.fill_codes(codes, start, level.solid, level.corner, level.bounds)
        bricks.fill_codes(coarse_codes, coarse_start, below.solid, below.corner, below.bounds)
        nothing = np.full_like(level.table, -1)
        bricks.prolong(cells, start, nothing, coarse, coarse_codes, codes)
        level.old[slot, :components] = cells

    def _burn_out(self, burning: Burning) -> None:
        """Burn the rest of the fuel at once, and forget about it."""
        real = self._still.dtype.type
        inside = np.array([0, SIDE] * 3)
        for level in self.levels:
            for slot in level.slots:
                state.burn(level.old[slot], inside, real(1.0), self._heat(burning))
        self._burning, self._still = None, self._still[: state.FUEL]
        for level in self.levels:
            level.registers = [np.ascontiguousarray(r[:, : state.FUEL]) for r in level.registers]

    def _heat(self, burning: Burning) -> Any:
        return self._still.dtype.type(burning.heat_j_kg / self.velocity_m_s**2)

    @property
    def cell_updates(self) -> int:
        """Cells moved on so far, as `GasSolver` counts them."""
        return sum(worker.cell_updates for worker in self._workers)

    def wall_overpressure_pa(self) -> NDArray[np.float64]:
        """Return the mean overpressures on `faces` during the last step (n,)."""
        return self.pressure_pa * (self.wall_pressure - 1.0).astype(np.float64)

    def overpressure_at(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the overpressures in some cells of the grid, x, y and z (n, 3)."""
        found = np.zeros(len(cells))
        for n, cell in enumerate(cells[:, ::-1] + self._lead):
            for level in self.levels[::-1]:
                at = cell // (self._scale // 2**level.depth)
                slot = level.table[tuple(at // SIDE)]
                if slot >= 0:
                    z, y, x = at % SIDE
                    values = level.old[slot, :ENERGY, z, y, x].astype(np.float64)
                    energy = float(level.old[slot, ENERGY, z, y, x])
                    inner = energy - 0.5 * float((values[1:] ** 2).sum()) / values[0]
                    found[n] = self.pressure_pa * ((GAMMA - 1.0) * inner - 1.0)
                    break
        return found

    def overpressure_in(self, axis: int, layer: int) -> NDArray[np.float64]:
        """Return the overpressures in a layer of the grid's cells, along the two other axes."""
        mine = 2 - axis
        one, two = (k for k in range(3) if k != mine)
        shape = self.grid.shape[::-1]
        plane = np.zeros((shape[one], shape[two]), dtype=self._still.dtype)
        for level in self.levels:
            size = self._scale // 2**level.depth
            index = (int(self._lead[mine]) + layer) // size
            first, second = int(self._lead[one]), int(self._lead[two])
            places = (level.bricks, level.slots, mine, index)
            bricks.paint(plane, level.old, *places, first, second, size)
        return self.pressure_pa * plane.T.astype(np.float64)

    def totals(self) -> Totals:
        """Return mass, momentum and energy of all the gas, what is still around it included."""
        level = self.levels[0]
        z0, z1, y0, y1, x0, x1 = level.bounds.tolist()
        shape = (z1 - z0, y1 - y0, x1 - x0)
        cells = np.empty((len(self._still), *shape), dtype=self._still.dtype)
        pools = (level.old, level.old, self._still.dtype.type(0.0))
        bricks.gather(cells, level.bounds[::2], *pools, level.table, self._still)
        volume = (self.grid.cell_m * self._scale) ** 3
        sums = [volume * float(each.sum(dtype=np.float64)) for each in cells]
        along = self.density_kg_m3 * self.velocity_m_s
        return Totals(
            mass_kg=self.density_kg_m3 * sums[state.DENSITY],
            momentum_kg_m_s=(along * sums[1], along * sums[2], along * sums[3]),
            energy_j=self.pressure_pa * sums[ENERGY],
            fuel_kg=self.density_kg_m3 * sums[state.FUEL] if len(sums) > state.FUEL else 0.0,
        )
