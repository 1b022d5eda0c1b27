"""The solver of the gas on a grid: state, time steps, recorders; still air is skipped."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from math import expm1, sqrt
from threading import Event
from typing import Any, Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blast_env.errors import BlastEnvError
from blast_env.gas import kernels, state
from blast_env.gas.faces import NO_FACES, Faces
from blast_env.gas.grid import GasGrid
from blast_env.gas.simd import LANES, lanes_of
from blast_env.gas.state import ENERGY, GAMMA, MARGIN, OPEN, Reals

AIR_PRESSURE_PA: Final = 101_325.0
AIR_DENSITY_KG_M3: Final = 1.225

COURANT: Final = 0.9
"""Courant number of a sweep along an axis, by the largest speed along any; stable to 1."""

_FIRST_STEPS: Final = 10
_FIRST_SHARE: Final = 0.2
"""Share of the full time step at the first one; increases linearly over the first steps."""

_COOL_EVERY: Final = 4
"""Number of steps between two searches for gas that is too hot."""

_SWEEPS: Final = (((0, 2), (1, -1)), ((1, -1), (2, 0)))
"""Axes of the sweeps of a step, in turn: x, z, y, and the reverse for second order in time.

Those along x and z move the rows at a y along both, while they are in the cache. With z in the
middle x and y are alike: a quarter turn of a site changes its loads by less than 0.1 %
(`tests/gas/test_symmetry.py`).
"""

_CELLS_PER_CALL: Final = 3_000_000
"""Cells moved in one call of compiled code, a tenth of a second, before Python checks signals."""

_DTYPES: Final = {"single": np.float32, "double": np.float64}


class Totals(NamedTuple):
    """Sums over the air cells.

    Attributes:
        mass_kg: Mass.
        momentum_kg_m_s: Momentum along x, y and z.
        energy_j: Energy, including that of still air.
        fuel_kg: Mass of the passive scalar.
    """

    mass_kg: float
    momentum_kg_m_s: tuple[float, float, float]
    energy_j: float
    fuel_kg: float


class Burning(NamedTuple):
    """Burning of the passive scalar at a constant relative rate, everywhere.

    Attributes:
        time_s: Time constant, after which 1/e of the scalar remains.
        heat_j_kg: Energy released per mass.
    """

    time_s: float
    heat_j_kg: float


class Settling(NamedTuple):
    """Treatment of the products of a charge as hot gas of limited temperature.

    Under the Euler equations they stay hot, up to 20 times as hot as still air, while real products
    mix with air and cool. The temperature does not affect their pressure, and hence hardly any
    load, but their speed of sound limits the time step.

    Attributes:
        time_s: Time at which the rest of the passive scalar burns at once. From then on, mass is
            added to gas above `hottest`.
        hottest: Limit of the temperature, in units of still air's.
    """

    time_s: float
    hottest: float


class Gas(Protocol):
    """The interface of a gas to recorders and runs; see `GasSolver` for its members."""

    grid: GasGrid
    faces: Faces
    recorders: "tuple[Recorder, ...]"
    pressure_pa: float

    @property
    def time_s(self) -> float:
        """Simulated time."""

    @property
    def steps(self) -> int:
        """Number of steps."""

    @property
    def cell_updates(self) -> int:
        """Number of cell updates."""

    @property
    def floored_cells(self) -> int:
        """Number of cells raised to the floor."""

    @property
    def wall_pressure(self) -> Reals:
        """Mean pressures on the faces during the last step, in the solver's units (n,)."""

    def step(self) -> None:
        """Make a time step."""

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`."""

    def wall_overpressure_pa(self) -> NDArray[np.float64]:
        """Return the mean overpressures on the faces during the last step (n,)."""

    def overpressure_at(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the overpressures in some cells, x, y and z (n, 3)."""

    def overpressure_in(self, axis: int, layer: int) -> NDArray[np.float64]:
        """Return the overpressures in a layer of cells, along the two other axes."""


class Recorder(Protocol):
    """The interface of objects that read the gas after every step."""

    def record(self, solver: Gas, step_s: float) -> None:
        """Read the gas after a step of `step_s`."""


def _check(precision: str, threads: int, courant: float) -> None:
    """Refuse settings of the solver that are out of bounds (`BlastEnvError`)."""
    if precision not in _DTYPES:
        raise BlastEnvError(f"precision is {precision!r}, but must be 'single' or 'double'")
    if threads < 1:
        raise BlastEnvError(f"threads is {threads}, but must be at least 1")
    if not 0.0 < courant <= 1.0:
        raise BlastEnvError(f"courant is {courant}, but must be above 0 and at most 1")


def _check_gas(
    pressure_pa: float,
    density_kg_m3: float,
    with_fuel: bool,
    burning: Burning | None,
    settling: Settling | None,
) -> None:
    """Refuse properties of the gas that are out of bounds (`BlastEnvError`)."""
    if not (pressure_pa > 0.0 and density_kg_m3 > 0.0):
        raise BlastEnvError(
            f"still air has {pressure_pa} Pa and {density_kg_m3} kg/m^3, but both must be above 0"
        )
    if burning is not None and not (with_fuel and burning.time_s > 0.0):
        raise BlastEnvError(f"burning is {burning}, but needs with_fuel=True and a time above 0 s")
    if settling is not None and not settling.hottest > 1.0:
        raise BlastEnvError(f"hottest is {settling.hottest}, but must be above 1, still air's")


class GasSolver:
    """A gas in a grid, at rest until `set_state` is called.

    Internally, the state is in units of still air: its density, its pressure, and the velocity
    derived from both. The interface is in SI units.

    Attributes:
        grid: The grid.
        faces: Faces on which the pressure is known after every step; see `wall_pressure`.
        time_s: Simulated time.
        steps: Number of steps.
        cell_updates: Number of cell updates, one per cell and step of three sweeps. Cells of still
            air, which are skipped, do not count.
        state: The state in the solver's units (5 or 6, z, y, x), including the margin, and beyond
            the high ends of y and x cells of no gas.
        wall_pressure: Mean pressures on `faces` during the last step, in the solver's units (n,).
            They are the fluxes of momentum, so that their integral is exactly the momentum taken
            up by the wall.
        extent: Cells of `state` outside which the air is still (z, y, 2); see `state.Extent`.

    Raises:
        BlastEnvError: If an argument is out of bounds.
    """

    def __init__(
        self,
        grid: GasGrid,
        *,
        faces: Faces = NO_FACES,
        recorders: Sequence[Recorder] = (),
        precision: Literal["single", "double"] = "single",
        with_fuel: bool = False,
        burning: Burning | None = None,
        settling: Settling | None = None,
        threads: int = 1,
        courant: float = COURANT,
        skip_still_air: bool = True,
        pressure_pa: float = AIR_PRESSURE_PA,
        density_kg_m3: float = AIR_DENSITY_KG_M3,
    ) -> None:
        _check(precision, threads, courant)
        _check_gas(pressure_pa, density_kg_m3, with_fuel, burning, settling)
        self.grid = grid
        self.faces = faces
        self.recorders = tuple(recorders)
        self.time_s = 0.0
        self.steps = 0
        self.cell_updates = 0
        self.pressure_pa = pressure_pa
        self.density_kg_m3 = density_kg_m3
        self.velocity_m_s = sqrt(pressure_pa / density_kg_m3)
        self._courant = courant
        self._burning = burning
        self._settling = settling
        self._skip = skip_still_air
        self._threads = threads
        self._make_arrays(np.dtype(_DTYPES[precision]), 6 if with_fuel else 5)
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._signal = 0.0
        self._floored_cells = 0

    def _make_arrays(self, dtype: np.dtype[Any], components: int) -> None:
        """Make the state, still air everywhere, and what compiled code needs beside it."""
        # 1. The codes of the cells. Rows are whole vectors, an odd number of them, in an odd number
        # of rows, or else all planes would compete for the same few lines of the cache.
        nx, ny, _ = self.grid.array_shape
        vectors = -(-nx // LANES) // 2 * 2 + 1
        beyond = ((0, 0), (0, 1 - ny % 2), (0, vectors * LANES - nx))
        self._code = np.pad(self.grid.codes(), beyond, constant_values=OPEN)
        lanes = lanes_of(dtype.itemsize)
        airy = (self._code == state.AIR).reshape(*self._code.shape[:2], -1, lanes).any(axis=3)
        self._airy = airy.astype(np.int8)
        # 2. The state and its extent.
        self._still = np.zeros(components, dtype=dtype)
        self._still[state.DENSITY] = 1.0
        self._still[ENERGY] = 1.0 / (GAMMA - 1.0)
        self.state: Reals = np.empty((components, *self._code.shape), dtype=dtype)
        self.state[:] = self._still[:, None, None, None]
        self._whole = np.zeros((*self._code.shape[:2], 2), dtype=np.int32)
        self._whole[MARGIN:-MARGIN, MARGIN : ny - MARGIN] = MARGIN, nx - MARGIN
        self.extent = np.zeros_like(self._whole) if self._skip else self._whole.copy()
        # 3. Recorded faces, widths of cells, and a workspace of each thread.
        self.wall_pressure: Reals = np.ones(len(self.faces), dtype=dtype)
        self._walls, self._first_wall = self.faces.kernel_table(self.grid, self._code.shape, lanes)
        x, y, z = (self.grid.narrowness(axis).astype(dtype) for axis in range(3))
        self._narrow = np.pad(x, beyond[2], mode="edge"), y, z
        shape = kernels.WORK_ROWS, lanes
        self._work = [np.zeros(shape, dtype=dtype) for _ in range(self._threads)]
        self._notes = np.zeros((self._threads, 2))

    @property
    def floored_cells(self) -> int:
        """Number of cells raised to the floor of density or pressure."""
        return self._floored_cells

    def set_state(
        self,
        *,
        density_kg_m3: ArrayLike,
        velocity_m_s: Sequence[ArrayLike] = (0.0, 0.0, 0.0),
        pressure_pa: ArrayLike,
        fuel_kg_m3: ArrayLike = 0.0,
        start: tuple[int, int, int] | None = None,
    ) -> None:
        """Set the gas in the air cells, from arrays over x, y and z or scalars.

        Arrays may cover a part of the grid with `start` as its first cell; the rest is still air.

        Raises:
            BlastEnvError: If a density or a pressure in the air is not above 0.
        """
        if start is not None:
            self.state[:] = self._still[:, None, None, None]
        shape = self.grid.shape if start is None else np.shape(density_kg_m3)
        part = tuple(slice(a, a + n) for a, n in zip(start or (0, 0, 0), shape, strict=True))
        density = np.broadcast_to(np.asarray(density_kg_m3, dtype=np.float64), shape)
        pressure = np.broadcast_to(np.asarray(pressure_pa, dtype=np.float64), shape)
        solid = self.grid.solid[part]
        air = ~solid
        for name, values in (("density_kg_m3", density), ("pressure_pa", pressure)):
            least = values[air].min(initial=np.inf)
            if not least > 0.0:
                raise BlastEnvError(f"{name} falls to {least}, but must be above 0 everywhere")
        # In units of the still air, where its density and pressure are 1:
        # E = p / (gamma - 1) + rho v^2 / 2.
        density = density / self.density_kg_m3
        pressure = pressure / self.pressure_pa
        energy = pressure / (GAMMA - 1.0)
        self._put(state.DENSITY, density, part, solid)
        for k, component in enumerate(velocity_m_s):
            velocity = np.asarray(component, dtype=np.float64) / self.velocity_m_s
            self._put(state.X_MOMENTUM + k, density * velocity, part, solid)
            energy = energy + 0.5 * density * velocity * velocity
        self._put(ENERGY, energy, part, solid)
        if len(self.state) > state.FUEL:
            self._put(state.FUEL, np.asarray(fuel_kg_m3) / self.density_kg_m3, part, solid)
        self._signal = 0.0
        if self._skip:
            self.extent = self._whole.copy()
            state.tighten(self.state, self._still, self.extent)

    def advance(self, until_s: float, *, land: bool = False) -> None:
        """Continue until the simulated time is at least `until_s`.

        Without `land`, the division of a run into calls does not change its results.

        Args:
            land: Whether to shorten the last step so that it ends at `until_s`.
        """
        while self.time_s < until_s:
            self.step(until_s - self.time_s if land else np.inf)

    def step(self, most_s: float = np.inf) -> None:
        """Make one time step, of at most `most_s`."""
        if self._signal == 0.0:
            self._signal = float(state.fastest_signal(self.state))
        # 1. The step by the Courant number, ramped over the first steps: waves of a discontinuous
        # start are faster than its states tell.
        share = min(1.0, _FIRST_SHARE + (1.0 - _FIRST_SHARE) * self.steps / _FIRST_STEPS)
        reduced = share * self._courant * self.grid.cell_m / self._signal
        step_s = min(reduced / self.velocity_m_s, most_s)
        ratio = self.state.dtype.type(step_s * self.velocity_m_s / self.grid.cell_m)
        self._notes[:] = 0.0
        # 2. The sweeps, in the reverse order in every other step (Strang).
        sweeps = _SWEEPS[self.steps % len(_SWEEPS)]
        for axes in sweeps:
            cells = self._sweep(axes, ratio, last=axes == sweeps[-1])
        self.cell_updates += cells
        if self._skip:
            state.tighten(self.state, self._still, self.extent)
        if self._burning is not None:
            self._burn(self._burning, step_s)
        # 3. The fastest signal, for the next step; that of still air where all is at rest.
        self._signal = max(float(self._notes[:, 0].max()), sqrt(GAMMA))
        self._floored_cells += int(self._notes[:, 1].sum())
        self.steps += 1
        self.time_s = self.time_s + step_s
        if self._settling is not None and self.time_s >= self._settling.time_s:
            self._settle(self._settling)
        for recorder in self.recorders:
            recorder.record(self, step_s)

    def on_double_cells(self, grid: GasGrid, faces: Faces) -> "GasSolver":
        """Return a solver that continues with this gas on cells of twice the side.

        Args:
            grid: The result of `with_double_cells` for the grid of this solver.
            faces: Faces on that grid.
        """
        other = GasSolver(
            grid,
            faces=faces,
            precision="single" if self.state.dtype == np.float32 else "double",
            with_fuel=len(self.state) > state.FUEL,
            burning=self._burning,
            settling=self._settling,
            threads=self._threads,
            courant=self._courant,
            skip_still_air=self._skip,
            pressure_pa=self.pressure_pa,
            density_kg_m3=self.density_kg_m3,
        )
        # First fine layer of each coarse one, by axis: pairs in the grid, single ones in its
        # buffers and the margin, which keep their number.
        starts = []
        for axis in range(3):
            low, high = self.grid.buffer_layers_by_axis[axis]
            first, end = MARGIN + low, MARGIN + low + self.grid.shape[axis]
            pairs = np.arange(first, end, 2)
            starts.append(np.concatenate((np.arange(first), pairs, np.arange(end, end + high + 3))))
        x, y, z = starts
        state.merge(self.state, self._code, other.state, other._code, z, y, x)
        other.time_s, other.steps = self.time_s, self.steps
        other.cell_updates, other._floored_cells = self.cell_updates, self._floored_cells
        other._signal = self._signal
        if self._skip:
            other.extent = other._whole.copy()
            state.tighten(other.state, other._still, other.extent)
        return other

    def density(self) -> NDArray[np.float64]:
        """Return the density, kg/m^3 (nx, ny, nz)."""
        return self.density_kg_m3 * self._get(state.DENSITY)

    def velocity(self) -> NDArray[np.float64]:
        """Return the velocity, m/s (3, nx, ny, nz)."""
        momentum = np.stack([self._get(state.X_MOMENTUM + k) for k in range(3)])
        return self.velocity_m_s * momentum / self._get(state.DENSITY)

    def pressure(self) -> NDArray[np.float64]:
        """Return the pressure, Pa (nx, ny, nz)."""
        motion = sum(self._get(state.X_MOMENTUM + k) ** 2 for k in range(3))
        inner = self._get(ENERGY) - 0.5 * motion / self._get(state.DENSITY)
        return self.pressure_pa * (GAMMA - 1.0) * inner

    def fuel(self) -> NDArray[np.float64]:
        """Return the density of the passive scalar, kg/m^3 (nx, ny, nz); 0 after settling."""
        if len(self.state) <= state.FUEL:
            return np.zeros(self.grid.shape)
        return self.density_kg_m3 * self._get(state.FUEL)

    def wall_overpressure_pa(self) -> NDArray[np.float64]:
        """Return the mean overpressures on `faces` during the last step (n,)."""
        return self.pressure_pa * (self.wall_pressure - 1.0).astype(np.float64)

    def overpressure_at(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the overpressures in some cells, x, y and z (n, 3)."""
        x, y, z = (cells + self.grid.lead).T
        return self.pressure_pa * self._excess(self.state[:, z, y, x])

    def overpressure_in(self, axis: int, layer: int) -> NDArray[np.float64]:
        """Return the overpressures in a layer of cells, along the two other axes."""
        inner = self.state[(slice(None), *self.grid.inner)]
        return self.pressure_pa * self._excess(np.take(inner, layer, axis=3 - axis)).T

    def totals(self) -> Totals:
        """Return mass, momentum and energy of the gas in the grid, without the skirt."""
        air = ~self.grid.solid
        volume = self.grid.cell_m**3
        sums = [float(self._get(k)[air].sum()) * volume for k in range(len(self.state))]
        along = self.density_kg_m3 * self.velocity_m_s
        return Totals(
            mass_kg=self.density_kg_m3 * sums[state.DENSITY],
            momentum_kg_m_s=(along * sums[1], along * sums[2], along * sums[3]),
            energy_j=self.pressure_pa * sums[ENERGY],
            fuel_kg=self.density_kg_m3 * sums[state.FUEL] if len(sums) > state.FUEL else 0.0,
        )

    def _sweep(self, axes: tuple[int, int], ratio: Any, *, last: bool) -> int:
        """Move the gas along one or two axes; return the number of cells."""
        own = [axis for axis in axes if axis >= 0]
        if self._skip:
            # What moves loads at most the next cell in a sweep; all beyond is still air, and is
            # left out.
            for axis in own:
                state.widen(self.extent, self._whole, axis)

        def move(k: int, first: int, end: int) -> None:
            kernels.sweep(
                self.state,
                self._code,
                self._airy,
                self.extent,
                axes,
                first,
                end,
                last,
                ratio,
                self._narrow,
                self._still,
                (self.wall_pressure, self._walls, self._first_wall),
                self._work[k],
                self._notes[k],
            )

        first, end, cells = state.layers_of(self.extent, 1 if len(own) > 1 else 2)
        if self._threads == 1 and len(own) * cells <= _CELLS_PER_CALL:
            move(0, first, end)
        else:
            self._share_out(move, first, end, len(own) * cells)
        return cells

    def _burn(self, burning: Burning, step_s: float) -> None:
        real = self.state.dtype.type
        share = real(-expm1(-step_s / burning.time_s))
        heat = real(burning.heat_j_kg / self.velocity_m_s**2)
        state.burn(self.state, self.extent, share, heat)

    def _settle(self, settling: Settling) -> None:
        real = self.state.dtype.type
        if self._burning is not None:
            heat = real(self._burning.heat_j_kg / self.velocity_m_s**2)
            state.burn(self.state, self.extent, real(1.0), heat)
            self._burning = None
            # Without a scalar the state is smaller by a sixth.
            self.state, self._still = self.state[: state.FUEL], self._still[: state.FUEL]
        if self.steps % _COOL_EVERY == 0:
            state.cool(self.state, self.extent, real(settling.hottest))

    def _share_out(
        self, move: Callable[[int, int, int], None], first: int, end: int, cells: int
    ) -> None:
        """Split layers from first to end among the threads, and among calls of some cells."""
        count, broken_off = self._threads, Event()
        bounds = [first + (end - first) * k // count for k in range(count + 1)]
        layers = max(_CELLS_PER_CALL * (end - first) // max(cells, 1), 1)

        def in_parts(k: int) -> None:
            for part in range(bounds[k], bounds[k + 1], layers):
                if broken_off.is_set():
                    return
                move(k, part, min(part + layers, bounds[k + 1]))

        others = [self._pool.submit(in_parts, k) for k in range(1, count) if self._pool is not None]
        try:
            in_parts(0)
            for other in others:
                other.result()
        finally:  # also after Ctrl-C: stop the other threads
            broken_off.set()

    def _excess(self, values: Reals) -> NDArray[np.float64]:
        """Return the overpressure in units of still air's pressure, exactly 0 in still air."""
        real = self.state.dtype.type
        motion = values[1] * values[1] + values[2] * values[2] + values[3] * values[3]
        inner = values[ENERGY] - real(0.5) * motion / values[state.DENSITY]
        return (real(GAMMA - 1.0) * inner - real(1.0)).astype(np.float64)

    def _put(
        self,
        component: int,
        values: NDArray[np.float64],
        part: tuple[slice, ...],
        solid: NDArray[np.bool_],
    ) -> None:
        """Set a component in the air cells of a part; solid cells hold still air."""
        inner = self.state[(component, *self.grid.inner)].T[part]
        inner[:] = np.where(solid, float(self._still[component]), values)

    def _get(self, component: int) -> NDArray[np.float64]:
        inner = self.state[(component, *self.grid.inner)]
        return inner.T.astype(np.float64)
