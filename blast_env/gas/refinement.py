"""A gas solver whose cells are small where pressures differ, and large elsewhere.

Cells lie in blocks of 8 x 8 x 8. Blocks of one level have cells of one side; each further level has
half of it, and half of the time step. A step of a level (Berger and Colella, J. Comput. Phys. 82
(1989) 64) has five parts:

1. blocks of smaller cells begin where the pressures of neighbours differ, and end elsewhere;
2. the gas moves along the axes in turn, over borders with larger cells by values interpolated in
   space, and in time by what each sweep of the larger cells changed;
3. the smaller cells within make two steps of half the length;
4. at borders, the fluxes of larger cells are replaced by the sums of those of the smaller ones, so
   that mass, momentum and energy are conserved;
5. larger cells get the means of the smaller ones within them.

The algebra is that of the uniform cells (`blast_env.gas.kernels`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import expm1, sqrt
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.gas import block_borders as borders
from blast_env.gas.block_kernels import BEYOND, BLOCK, CORNERS, FIRST_BORDER, SIDE, sweep_blocks
from blast_env.gas.block_map import BlockLevel, BlockMap, WallFaces
from blast_env.gas.faces import NO_FACES, Faces
from blast_env.gas.grid import GasGrid
from blast_env.gas.simd import lanes_of
from blast_env.gas.solver import (
    AIR_DENSITY_KG_M3,
    AIR_PRESSURE_PA,
    COURANT,
    Burning,
    Recorder,
    Settling,
    Totals,
)
from blast_env.gas.state import DENSITY, ENERGY, FUEL, GAMMA, X_MOMENTUM, Reals

JUMP: Final = 0.3
"""Least difference of the pressures of neighbours, relative to the lower one, for smaller cells."""

_REACH: Final = 1
"""Larger cells around such a difference that are divided, too."""

_FIRST_STEPS: Final = 10
_FIRST_SHARE: Final = 0.2
_COOL_EVERY: Final = 4
_ORDERS: Final = ((0, 2, 1), (1, 2, 0))
_COMPONENTS: Final = 6
_ROWS: Final = 2 * SIDE
_DTYPES: Final = {"single": np.float32, "double": np.float64}


@dataclass(eq=False)
class _Level:
    """The blocks of one level.

    Attributes:
        places: Where they may be and must be.
        walls: Recorded faces.
        table: Slots by place (z, y, x).
        slots: Slots in order of places (n,).
        stencils: Cells for the interpolation at borders with larger cells (borders, 16, 7).
        ways: Directions of the borders (borders,).
        facing: Blocks of larger cells beyond them (borders,).
        border: State beyond them before and after each sweep (borders, 4, 6, 128).
        border_code: Codes there (borders, 128).
        register: Fluxes of this level less those of the larger cells there (borders, 6, 16).
        narrow: Narrowness of cells along x, y and z.
        highest: Highest overpressure so far at each place, in units of still air's (z, y, x).
        followed: Places where fronts have cells of this level (1, y, x).
        steps: Number of steps.
    """

    places: BlockLevel
    walls: WallFaces
    table: NDArray[np.int32]
    slots: NDArray[np.int32]
    stencils: NDArray[np.int32]
    ways: NDArray[np.int32]
    facing: NDArray[np.int32]
    border: Reals
    border_code: NDArray[np.int8]
    register: Reals
    narrow: tuple[Reals, Reals, Reals]
    highest: NDArray[np.float32]
    followed: NDArray[np.uint8]
    steps: int = 0

    @property
    def order(self) -> tuple[int, int, int]:
        """Axes of the sweeps of the present step."""
        return _ORDERS[self.steps % len(_ORDERS)]


Followed = Callable[[FloatArray, FloatArray], BoolArray]
"""Returns whether fronts have smaller cells at places, from x and y of their middles, m."""


def everywhere(x_m: FloatArray, y_m: FloatArray) -> BoolArray:
    """Follow fronts everywhere."""
    return np.ones(np.broadcast_shapes(x_m.shape, y_m.shape), dtype=bool)


class RefinedSolver:
    """A gas in a grid, at rest until its state is set, on cells of several sizes.

    `jump` is the least difference of the pressures of neighbours that is a front, relative to the
    lower one; `followed` says where, in plan, fronts have smaller cells.

    Attributes:
        grid: The grid, of the smallest cells.
        faces: Faces on which the pressure is known after every step of the smallest cells.
        recorders: They read the gas after every such step.
        time_s: Simulated time.
        steps: Number of such steps.
        cell_updates: Number of cell updates, on all levels.
        wall_pressure: Mean pressures on `faces` during the last step, in units of still air's. On
            larger cells, they are means over their steps.

    Raises:
        BlastEnvError: If the grid does not consist of whole blocks.
    """

    def __init__(
        self,
        grid: GasGrid,
        levels: int,
        *,
        faces: Faces = NO_FACES,
        recorders: Sequence[Recorder] = (),
        precision: Literal["single", "double"] = "single",
        with_fuel: bool = False,
        burning: Burning | None = None,
        settling: Settling | None = None,
        threads: int = 1,
        courant: float = COURANT,
        jump: float = JUMP,
        followed: Followed = everywhere,
    ) -> None:
        self.grid, self.faces = grid, faces
        self.recorders: tuple[Recorder, ...] = tuple(recorders)
        self.time_s, self.steps, self.cell_updates = 0.0, 0, 0
        self.pressure_pa, self.density_kg_m3 = AIR_PRESSURE_PA, AIR_DENSITY_KG_M3
        self.velocity_m_s = sqrt(self.pressure_pa / self.density_kg_m3)
        self._map = BlockMap.of(grid, levels)
        self._burning, self._settling, self._courant = burning, settling, courant
        self._jump, self._threads, self._followed = jump, threads, followed
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._real: Any = _DTYPES[precision]
        self._fuel = with_fuel
        self._still = np.zeros(_COMPONENTS, dtype=self._real)
        self._still[DENSITY], self._still[ENERGY] = 1.0, 1.0 / (GAMMA - 1.0)
        self._reserve(0)
        self._free: list[int] = []
        self._levels = self._begin_levels()
        self._pressures = np.ones(
            sum(len(level.walls.entries) for level in self._levels), dtype=self._real
        )
        longest = max(max(level.table.shape) for level in self._levels) * SIDE + 2 * BEYOND
        lanes = lanes_of(np.dtype(self._real).itemsize)
        self._work = [
            (
                np.ones((_COMPONENTS, longest, _ROWS), dtype=self._real),
                np.zeros((longest, _ROWS), dtype=np.int8),
                np.zeros((_COMPONENTS, longest, _ROWS), dtype=self._real),
                np.zeros((2, lanes), dtype=self._real),
            )
            for _ in range(threads)
        ]
        self._notes = np.zeros((threads, 2))
        self._signal = 0.0
        self._floored_cells = 0
        self._add(0, self._levels[0].places.always)
        for k in range(1, levels):
            self._add(k, self._levels[k].places.always)
        self._connect(0)

    @property
    def floored_cells(self) -> int:
        """Number of cells raised to the floor of density or pressure."""
        return self._floored_cells

    @property
    def wall_pressure(self) -> Reals:
        """Mean pressures on `faces` during the last step, in units of still air's (n,)."""
        return self._pressures[self._source]

    def blocks(self) -> list[int]:
        """Return the number of blocks of each level."""
        return [len(level.slots) for level in self._levels]

    # Reading

    def wall_overpressure_pa(self) -> NDArray[np.float64]:
        """Return the mean overpressures on `faces` during the last step (n,)."""
        return self.pressure_pa * (self.wall_pressure - 1.0).astype(np.float64)

    def overpressure_at(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the overpressures in some of the smallest cells, given as x, y and z (n, 3)."""
        excess = np.empty(len(cells))
        borders.excess_at(self._state, self._tables, self._lead, cells, excess)
        return self.pressure_pa * excess

    def overpressure_in(self, axis: int, layer: int) -> NDArray[np.float64]:
        """Return the overpressures in a layer of the smallest cells, along the other axes."""
        others = [k for k in range(3) if k != axis]
        sides = [self.grid.shape[k] for k in others]
        cells = np.empty((sides[0] * sides[1], 3), dtype=np.int64)
        cells[:, axis] = layer
        cells[:, others[0]] = np.repeat(np.arange(sides[0]), sides[1])
        cells[:, others[1]] = np.tile(np.arange(sides[1]), sides[0])
        return self.overpressure_at(cells).reshape(sides[0], sides[1])

    def totals(self) -> Totals:
        """Return mass, momentum and energy of the gas, in the blocks without smaller ones."""
        sums = np.zeros(_COMPONENTS)
        for level in self._levels:
            volume = level.places.cell_m**3
            for slot in level.slots:
                air = self._code[slot].reshape(SIDE, SIDE, SIDE) == 0
                for child, kid in enumerate(self._children[slot]):
                    if kid >= 0:
                        z, y, x = (
                            slice(CORNERS * bit, CORNERS * bit + CORNERS)
                            for bit in (child // 4, child // 2 % 2, child % 2)
                        )
                        air[z, y, x] = False
                state = self._state[slot].astype(np.float64)
                sums += volume * state[:, air.ravel()].sum(axis=1)
        along = self.density_kg_m3 * self.velocity_m_s
        return Totals(
            mass_kg=self.density_kg_m3 * sums[DENSITY],
            momentum_kg_m_s=(along * sums[1], along * sums[2], along * sums[3]),
            energy_j=self.pressure_pa * sums[ENERGY],
            fuel_kg=self.density_kg_m3 * sums[FUEL] if self._fuel else 0.0,
        )

    # Beginning

    def set_state(
        self,
        *,
        density_kg_m3: ArrayLike,
        velocity_m_s: Sequence[ArrayLike] = (0.0, 0.0, 0.0),
        pressure_pa: ArrayLike,
        fuel_kg_m3: ArrayLike = 0.0,
    ) -> None:
        """Set the gas in the air of the grid, from arrays over x, y and z or scalars."""
        shape = self.grid.shape
        density = np.broadcast_to(np.asarray(density_kg_m3, dtype=np.float64), shape)
        pressure = np.broadcast_to(np.asarray(pressure_pa, dtype=np.float64), shape)
        values = np.zeros((_COMPONENTS, *shape))
        values[DENSITY] = density / self.density_kg_m3
        values[ENERGY] = pressure / self.pressure_pa / (GAMMA - 1.0)
        for k, component in enumerate(velocity_m_s):
            velocity = np.broadcast_to(np.asarray(component, dtype=np.float64), shape)
            values[X_MOMENTUM + k] = values[DENSITY] * velocity / self.velocity_m_s
            values[ENERGY] += 0.5 * values[DENSITY] * (velocity / self.velocity_m_s) ** 2
        values[FUEL] = np.broadcast_to(np.asarray(fuel_kg_m3), shape) / self.density_kg_m3

        def fill(level: BlockLevel, block: tuple[int, int, int]) -> NDArray[np.float64]:
            return self._block_of(values, level, block)

        self.set_blocks(fill)

    def set_blocks(
        self,
        fill: Callable[[BlockLevel, tuple[int, int, int]], NDArray[np.float64] | None],
        near: Callable[[BlockLevel], NDArray[np.uint8]] | None = None,
    ) -> None:
        """Set the gas block by block, and divide blocks until the smallest cells are where due.

        Args:
            fill: Returns the state of a block of a level, given the place of its first cell among
                the cells of the level in the grid along x, y and z, in the solver's units (6, 8,
                8, 8, along z, y and x); `None` for still air.
            near: Returns places of blocks of a level (z, y, x) that must be there at first.
        """
        for k, level in enumerate(self._levels):
            if k > 0:
                wanted = self._wanted(k)
                if near is not None:
                    wanted |= near(level.places)
                borders.drop_unheld(
                    wanted,
                    level.places.kinds,
                    self._exists(k - 1),
                    self._levels[k - 1].places.kinds,
                )
                self._add(k, wanted & ~self._exists(k))
                self._connect(k)
            for slot in level.slots:
                z, y, x = (int(n) * SIDE for n in self._coordinates[slot])
                at = (
                    x - int(level.places.lead[0]),
                    y - int(level.places.lead[1]),
                    z - int(level.places.lead[2]),
                )
                values = fill(level.places, at)
                if values is not None:
                    air = self._code[slot] == 0
                    self._state[slot][:, air] = values.reshape(_COMPONENTS, BLOCK)[:, air]
            borders.note_motion(
                self._state, self._still, self._moving, level.slots, self._components
            )
        self._active[:] = 1
        for k in range(len(self._levels) - 1, 0, -1):
            self._average(k)
        self._signal = max(borders.fastest_in(self._state, each.slots) for each in self._levels)

    # Steps

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`."""
        while self.time_s < until_s:
            self.step()

    def step(self) -> None:
        """Make a time step of the largest cells, and those of the smaller ones within it."""
        share = min(1.0, _FIRST_SHARE + (1.0 - _FIRST_SHARE) * self.steps / _FIRST_STEPS)
        reduced = share * self._courant * self._levels[0].places.cell_m
        step_s = reduced / (max(self._signal, sqrt(GAMMA)) * self.velocity_m_s)
        if self._settling is not None and self.time_s >= self._settling.time_s:
            self._settle()
        self._notes[:] = 0.0
        self._advance(0, step_s, np.zeros(3, dtype=self._real), first=True)
        self._signal = float(self._notes[:, 0].max())
        self._floored_cells += int(self._notes[:, 1].sum())

    def _advance(self, k: int, step_s: float, weights: Reals, *, first: bool) -> None:
        """Make a step of a level and the levels within it.

        Args:
            k: The level.
            step_s: The step.
            weights: Shares of the changes beyond the borders that count at its beginning (3,).
            first: Whether the larger cells have just begun their step, and have looked for fronts.
        """
        level = self._levels[k]
        last = k + 1 == len(self._levels)
        if not last and (k == 0 or not first):
            self._refine(k)
        active = self._active
        count = borders.find_active(
            level.table,
            self._levels[k - 1].table if k else _NO_TABLE,
            self._moving,
            level.slots,
            self._coordinates,
            active,
        )
        if not last:
            self._see(k + 1, 0)
        order = level.order
        larger_order = self._levels[k - 1].order if k else order
        for number, axis in enumerate(order):
            self._sweep(k, axis, step_s, weights, measure=axis == order[-1])
            weights[larger_order.index(axis)] += 0.5
            if axis == order[-1]:
                self._react(k, step_s)
            if not last:
                self._see(k + 1, number + 1)
        self.cell_updates += count * BLOCK
        borders.note_motion(self._state, self._still, self._moving, level.slots, self._components)
        if last:
            level.steps += 1
            self._record(step_s)
            return
        inner = self._levels[k + 1]
        within = np.zeros(3, dtype=self._real)
        for part in range(2):
            self._advance(k + 1, 0.5 * step_s, within, first=part == 0)
        borders.correct_fluxes(
            self._state.reshape(-1),
            self._moving,
            active,
            inner.stencils,
            inner.ways,
            inner.facing,
            inner.register,
            self._coordinates,
            *level.narrow,
            self._ratio(k, step_s),
            self._components,
            _COMPONENTS,
        )
        self._average(k + 1)
        level.steps += 1

    def _sweep(self, k: int, axis: int, step_s: float, weights: Reals, *, measure: bool) -> None:
        level = self._levels[k]
        runs = np.empty((len(level.slots), 2), dtype=np.int32)
        count = borders.find_runs(level.slots, self._active, self._beside, axis, runs)
        kids = self._levels[k + 1].register if k + 1 < len(self._levels) else level.register

        def move(thread: int, first: int, end: int) -> None:
            work, work_code, flux, signals = self._work[thread]
            sweep_blocks(
                self._state,
                self._code,
                self._beside,
                self._coordinates,
                self._children,
                self._still,
                runs,
                first,
                end,
                axis,
                self._fuel,
                measure,
                self._ratio(k, step_s),
                level.narrow[axis],
                level.border,
                level.border_code,
                level.register,
                weights,
                kids,
                self._pressures,
                level.walls.entries,
                level.walls.first,
                level.places.shape,
                work,
                work_code,
                flux,
                signals,
                self._notes[thread],
            )

        if self._pool is None:
            move(0, 0, count)
            return
        bounds = [count * n // self._threads for n in range(self._threads + 1)]
        others = [
            self._pool.submit(move, n, bounds[n], bounds[n + 1]) for n in range(1, self._threads)
        ]
        move(0, bounds[0], bounds[1])
        for other in others:
            other.result()

    def _ratio(self, k: int, step_s: float) -> Any:
        return self._real(step_s * self.velocity_m_s / self._levels[k].places.cell_m)

    def _react(self, k: int, step_s: float) -> None:
        """Burn fuel and cool products on a level."""
        level = self._levels[k]
        if self._burning is not None:
            share = self._real(-expm1(-step_s / self._burning.time_s))
            heat = self._real(self._burning.heat_j_kg / self.velocity_m_s**2)
            borders.burn_blocks(self._state, level.slots, self._active, share, heat)
        elif (
            self._settling is not None
            and self.time_s >= self._settling.time_s
            and level.steps % _COOL_EVERY == 0
        ):
            hottest = self._real(self._settling.hottest)
            borders.cool_blocks(self._state, level.slots, self._active, hottest)

    def _settle(self) -> None:
        """Burn the rest of the fuel; from then on, gas is cooled."""
        if self._burning is None:
            return
        heat = self._real(self._burning.heat_j_kg / self.velocity_m_s**2)
        for level in self._levels:
            every = np.ones(len(self._state), dtype=np.uint8)
            borders.burn_blocks(self._state, level.slots, every, self._real(1.0), heat)
        self._burning, self._fuel = None, False

    def _record(self, step_s: float) -> None:
        self.steps += 1
        self.time_s += step_s
        for recorder in self.recorders:
            recorder.record(self, step_s)

    @property
    def _components(self) -> int:
        return _COMPONENTS - (not self._fuel)

    def _see(self, k: int, sweep: int) -> None:
        """Interpolate the cells beyond the borders of a level, after a sweep of those cells."""
        level = self._levels[k]
        if sweep == 0:
            level.register[:] = 0.0
        borders.see_beyond(
            self._state.reshape(-1),
            self._still,
            self._active,
            level.stencils,
            level.ways,
            level.facing,
            level.border,
            self._components,
            sweep,
        )

    def _average(self, k: int) -> None:
        level = self._levels[k]
        borders.take_means(
            self._state,
            self._code,
            self._clear,
            self._moving,
            self._active,
            level.slots,
            self._parents,
            self._coordinates,
            self._components,
        )

    # Blocks

    def _refine(self, k: int) -> None:
        """Begin and end blocks of the levels within a level."""
        count = len(self._levels)
        wanted = {n: self._wanted(n) for n in range(k + 1, count)}
        for n in range(count - 1, k + 1, -1):
            borders.hold_around(wanted[n], wanted[n - 1], self._levels[n - 1].places.kinds)
        held = self._exists(k)
        changed = False
        for n in range(k + 1, count):
            places = self._levels[n].places
            borders.drop_unheld(wanted[n], places.kinds, held, self._levels[n - 1].places.kinds)
            held = wanted[n]
            changed = changed or bool((wanted[n] != self._exists(n)).any())
        if not changed:
            return
        for n in range(count - 1, k, -1):
            self._remove(n, self._exists(n) & ~wanted[n])
        for n in range(k + 1, count):
            self._add(n, wanted[n] & ~self._exists(n))
        self._connect(k + 1)

    def _wanted(self, k: int) -> NDArray[np.uint8]:
        """Return the places of blocks that a level should have by the level of larger cells."""
        level, larger = self._levels[k], self._levels[k - 1]
        wanted = np.zeros_like(level.places.always)
        borders.find_fronts(
            self._state,
            self._code,
            self._moving,
            larger.slots,
            self._beside,
            self._coordinates,
            wanted,
            level.highest,
            self._jump,
            _REACH,
        )
        return (wanted & level.followed) | level.places.always

    def _exists(self, k: int) -> NDArray[np.uint8]:
        return (self._levels[k].table >= 0).astype(np.uint8)

    def _begin_levels(self) -> list[_Level]:
        levels: list[_Level] = []
        first = 0
        count = len(self._map.levels)
        for k, places in enumerate(self._map.levels):
            walls, number = places.wall_faces(self.faces, first, 2 ** (count - 1 - k))
            first += number
            x, y, z = (each.astype(self._real) for each in places.narrow)
            none = np.empty(0, dtype=np.int32)
            levels.append(
                _Level(
                    places,
                    walls,
                    np.full(places.shape, -1, dtype=np.int32),
                    none,
                    none.reshape(0, CORNERS**2, 7),
                    none,
                    none,
                    np.zeros((0, 4, _COMPONENTS, 2 * SIDE**2), dtype=self._real),
                    np.zeros((0, 2 * SIDE**2), dtype=np.int8),
                    np.zeros((0, _COMPONENTS, CORNERS**2), dtype=self._real),
                    (x, y, z),
                    np.zeros(places.shape, dtype=np.float32),
                    self._followed(*places.middles_m(self.grid)).astype(np.uint8)[None],
                )
            )
        return levels

    def _reserve(self, more: int) -> None:
        """Make room for more blocks."""
        if more == 0:
            self._used = 0
            self._state: Reals = np.empty((0, _COMPONENTS, BLOCK), dtype=self._real)
            self._code = np.empty((0, BLOCK), dtype=np.int8)
            self._beside = np.empty((0, 6), dtype=np.int32)
            self._coordinates = np.empty((0, 3), dtype=np.int32)
            self._children = np.empty((0, 8), dtype=np.int32)
            self._parents = np.empty(0, dtype=np.int32)
            self._moving = np.empty(0, dtype=np.uint8)
            self._clear = np.empty(0, dtype=np.uint8)
            self._active = np.empty(0, dtype=np.uint8)
            return
        room = self._used + more
        if room <= len(self._state):
            return
        room += room // 4
        for name in (
            *("_state", "_code", "_beside", "_coordinates", "_children", "_parents"),
            *("_moving", "_active", "_clear"),
        ):
            old = getattr(self, name)
            new = np.zeros((room, *old.shape[1:]), dtype=old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)

    def _add(self, k: int, wanted: NDArray[np.uint8]) -> None:
        """Begin blocks of a level at places."""
        level = self._levels[k]
        places = np.argwhere(wanted).astype(np.int32)
        if not len(places):
            return
        self._reserve(max(len(places) - len(self._free), 1))
        slots = np.empty(len(places), dtype=np.int32)
        for n in range(len(places)):
            if self._free:
                slots[n] = self._free.pop()
            else:
                slots[n] = self._used
                self._used += 1
        level.table[tuple(places.T)] = slots
        self._coordinates[slots] = places
        self._children[slots] = -1
        self._parents[slots] = -1
        self._state[slots] = self._still[:, None]
        self._moving[slots] = 0
        borders.find_codes(
            level.places.solid,
            level.places.lead,
            self._map.outside,
            level.places.factor,
            slots,
            self._coordinates,
            self._code,
            self._clear,
        )
        if k > 0:
            larger = self._levels[k - 1].table
            parents = larger[tuple((places // 2).T)]
            child = places[:, 0] % 2 * 4 + places[:, 1] % 2 * 2 + places[:, 2] % 2
            self._parents[slots] = parents
            self._children[parents, child] = slots
            self._moving[slots] = self._moving[parents]
            borders.divide(
                self._state,
                self._still,
                self._code,
                larger,
                slots,
                self._coordinates,
                self._components,
            )

    def _remove(self, k: int, unwanted: NDArray[np.uint8]) -> None:
        """End blocks of a level at places; their means are in the larger cells."""
        level = self._levels[k]
        places = np.argwhere(unwanted)
        slots = level.table[tuple(places.T)]
        child = places[:, 0] % 2 * 4 + places[:, 1] % 2 * 2 + places[:, 2] % 2
        self._children[self._parents[slots], child] = -1
        level.table[tuple(places.T)] = -1
        self._free.extend(int(slot) for slot in slots[::-1])

    def _connect(self, first: int) -> None:
        """Find what is beside each block of a level and those within it."""
        for k in range(first, len(self._levels)):
            level = self._levels[k]
            level.slots = level.table[level.table >= 0]
            count = borders.find_neighbours(
                level.table,
                level.places.kinds,
                self._map.borders,
                level.slots,
                self._coordinates,
                self._beside,
            )
            if k > 0:
                self._begin_borders(k, count)
        self._tables = tuple(each.table for each in self._levels)
        self._lead = self._levels[-1].places.lead
        leaves = np.zeros(len(self.faces), dtype=np.int8)
        borders.find_leaves(self._tables, self._lead, self.faces.air, leaves)
        own = np.stack([each.walls.own for each in self._levels])
        self._source = own[leaves, np.arange(len(self.faces))]

    def _begin_borders(self, k: int, count: int) -> None:
        level = self._levels[k]
        level.border = level.border[:0].copy()  # free the old ones first
        level.stencils = np.empty((count, CORNERS**2, 7), dtype=np.int32)
        level.border = np.empty((count, 4, _COMPONENTS, 2 * SIDE**2), dtype=self._real)
        level.facing = np.empty(count, dtype=np.int32)
        level.border_code = np.empty((count, 2 * SIDE**2), dtype=np.int8)
        level.register = np.zeros((count, _COMPONENTS, CORNERS**2), dtype=self._real)
        beside = self._beside[level.slots].ravel()
        level.ways = (np.flatnonzero(beside <= FIRST_BORDER) % 6).astype(np.int32)
        borders.place_borders(
            level.slots,
            self._beside,
            self._coordinates,
            self._levels[k - 1].table,
            self._code,
            _COMPONENTS,
            level.stencils,
            level.border_code,
            level.facing,
        )

    def _block_of(
        self, values: NDArray[np.float64], level: BlockLevel, block: tuple[int, int, int]
    ) -> NDArray[np.float64]:
        """Return the means of values of the smallest cells over the air of those of a block."""
        ratio = self._map.levels[-1].factor // level.factor
        size = SIDE * ratio
        result = np.zeros((_COMPONENTS, size, size, size))
        result[:] = self._still[:, None, None, None].astype(np.float64)
        air = np.zeros((size, size, size))
        part, to = [], []
        for at, n in zip(block, self.grid.shape, strict=True):
            low, high = max(at * ratio, 0), min(at * ratio + size, n)
            part.append(slice(low, max(high, low)))
            to.append(slice(low - at * ratio, max(high, low) - at * ratio))
        air[tuple(to)] = ~self.grid.solid[tuple(part)]
        result[(slice(None), *to)] = values[(slice(None), *part)]
        shape = (SIDE, ratio, SIDE, ratio, SIDE, ratio)
        sums = (result * air).reshape(_COMPONENTS, *shape).sum(axis=(2, 4, 6))
        counts = air.reshape(shape).sum(axis=(1, 3, 5))
        still = self._still[:, None, None, None].astype(np.float64)
        means = np.where(counts > 0, sums / np.maximum(counts, 1.0), still)
        return np.ascontiguousarray(means.transpose(0, 3, 2, 1))


_NO_TABLE: Final = np.empty((0, 0, 0), dtype=np.int32)
