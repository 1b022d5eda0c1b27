"""A blast with spherical symmetry: the Euler equations along a radius, on a growing grid.

The scheme is MUSCL-Hancock with HLLC in shells of equal thickness. Whenever the front approaches
the last shell, shells are merged in pairs, and the same number of shells of still air is added
outside. The front thus always has between half of all shells and all of them behind it, at any
distance from the charge.
"""

from math import inf, pi, sqrt
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from blast_env.compilation import compiled
from blast_env.errors import BlastEnvError
from blast_env.gas.solver import AIR_DENSITY_KG_M3, AIR_PRESSURE_PA
from blast_env.gas.state import GAMMA

Floats = NDArray[np.float64]

SHELLS: Final = 800
"""Number of shells of the grid, even."""

CHARGE_SHELLS: Final = 40
"""Number of shells within the charge at the beginning."""

COURANT: Final = 0.5

DENSITY, MOMENTUM, ENERGY, PRODUCTS = 0, 1, 2, 3
"""Components of the state, each per volume."""

_FRONT_SHARE: Final = 1e-3
"""Least relative deviation from still air's pressure at the front."""

_STILL_SHARE: Final = 1e-12
"""Relative deviation from still air's pressure up to which outer shells are not updated."""

_SPARE_SHELLS: Final = 4
"""Least number of shells of still air outside."""

_FIRST_STEPS: Final = 20
_LEAST_SHARE: Final = 0.05
_LEAST_PRESSURE_PA: Final = 1.0
_BATCH: Final = 4096


class SphericalBlast:
    """A sphere of compressed gas that expands into still air.

    The gas of the sphere, the "products", may release more energy during its expansion: per
    kilogram, `later_j_kg * (1 - exp(-t / later_s))` by the time t.

    Attributes:
        shell_m: Thickness of a shell.
        state: Density, radial momentum, energy and products in each shell, per volume (4, n).
        time_s: Time since the release of the sphere.
        front_m: Outer radius of the shell that the front has reached.
        steps: Number of time steps.

    Args:
        mass_kg: Mass of the sphere.
        density_kg_m3: Its density.
        prompt_j_kg: Energy per kilogram in excess of that of the air in its place.
        later_j_kg: Energy per kilogram released later.
        later_s: Time constant of that release.
        gauges_m: Radii at which the pressure is recorded, outside the sphere.
        shells: Number of shells of the grid, even.

    Raises:
        BlastEnvError: If an argument is out of bounds, or a gauge is inside the sphere.
    """

    def __init__(
        self,
        mass_kg: float,
        density_kg_m3: float,
        prompt_j_kg: float,
        later_j_kg: float = 0.0,
        later_s: float = 1.0,
        *,
        gauges_m: ArrayLike = (),
        shells: int = SHELLS,
    ) -> None:
        for name, value in (
            ("mass_kg", mass_kg),
            ("density_kg_m3", density_kg_m3),
            ("prompt_j_kg", prompt_j_kg),
            ("later_s", later_s),
        ):
            if not 0.0 < value < inf:
                raise BlastEnvError(f"{name} is {value}, but must be above 0")
        if shells < 2 * CHARGE_SHELLS or shells % 2:
            raise BlastEnvError(
                f"shells is {shells}, but must be even and at least {2 * CHARGE_SHELLS}"
            )
        # The sphere of this mass and density is CHARGE_SHELLS shells thick, whatever its size.
        radius_m = (3.0 * mass_kg / (4.0 * pi * density_kg_m3)) ** (1.0 / 3.0)
        self._gauges_m = np.atleast_1d(np.asarray(gauges_m, dtype=np.float64))
        if self._gauges_m.min(initial=inf) < radius_m:
            raise BlastEnvError(
                f"a gauge is at {self._gauges_m.min()} m, inside the charge of {radius_m:g} m"
            )
        self.shell_m = radius_m / CHARGE_SHELLS
        self.state: Floats = np.zeros((4, shells))
        self.state[DENSITY] = AIR_DENSITY_KG_M3
        self.state[ENERGY] = AIR_PRESSURE_PA / (GAMMA - 1.0)
        # The charge is gas at rest: its energy comes on top of that of the air in its place.
        inside = slice(0, CHARGE_SHELLS)
        self.state[DENSITY, inside] = self.state[PRODUCTS, inside] = density_kg_m3
        self.state[ENERGY, inside] += density_kg_m3 * prompt_j_kg
        self.time_s = 0.0
        self.front_m = radius_m
        self.steps = 0
        self._later_j_kg = float(later_j_kg)
        self._later_s = float(later_s)
        self._history: list[Floats] = []

    @property
    def edges_m(self) -> Floats:
        """Radii between the shells, from 0 (n + 1)."""
        return np.asarray(self.shell_m * np.arange(self.state.shape[1] + 1.0))

    @property
    def volumes_m3(self) -> Floats:
        """Volumes of the shells (n,)."""
        return np.asarray(4.0 / 3.0 * pi * np.diff(self.edges_m**3))

    @property
    def history(self) -> Floats:
        """Time, s, and overpressure at each gauge, Pa, before every step (steps, 1 + gauges)."""
        if not self._history:
            return np.zeros((0, 1 + len(self._gauges_m)))
        return np.concatenate(self._history)

    def advance(self, *, until_s: float = inf, until_front_m: float = inf) -> None:
        """Continue until a time or a radius of the front is reached, whichever is first.

        It ends with the first step at or beyond it, so that the division of a run into calls does
        not change its results.

        Raises:
            BlastEnvError: If neither is given.
        """
        if until_s == inf and until_front_m == inf:
            raise BlastEnvError("a blast without a bound in time or space never ends")
        record = np.zeros((_BATCH, 1 + len(self._gauges_m)))
        while self.time_s < until_s and self.front_m < until_front_m:
            steps, self.time_s, front, last = _march(
                self.state,
                self.shell_m,
                self.time_s,
                self.steps,
                self._later_j_kg,
                self._later_s,
                until_s,
                until_front_m,
                self._gauges_m,
                record,
            )
            self.steps += steps
            self.front_m = self.shell_m * (front + 1.0)
            self._history.append(record[:steps].copy())
            if last >= self.state.shape[1] - _SPARE_SHELLS:
                self._merge_shells()

    def pressure(self) -> Floats:
        """Return the pressure in each shell, Pa."""
        motion = 0.5 * self.state[MOMENTUM] ** 2 / self.state[DENSITY]
        return np.asarray((GAMMA - 1.0) * (self.state[ENERGY] - motion))

    def _merge_shells(self) -> None:
        """Merge shells in pairs, and add still air outside."""
        shells = self.state.shape[1]
        volumes = self.volumes_m3
        merged = (self.state * volumes).reshape(4, shells // 2, 2).sum(axis=2)
        self.state[:, : shells // 2] = merged / volumes.reshape(-1, 2).sum(axis=1)
        self.state[:, shells // 2 :] = 0.0
        self.state[DENSITY, shells // 2 :] = AIR_DENSITY_KG_M3
        self.state[ENERGY, shells // 2 :] = AIR_PRESSURE_PA / (GAMMA - 1.0)
        self.shell_m *= 2.0


@compiled(nogil=True, error_model="numpy")
def _march(
    state: Floats,
    shell_m: float,
    time_s: float,
    steps_before: int,
    later_j_kg: float,
    later_s: float,
    until_s: float,
    until_front_m: float,
    gauges_m: Floats,
    record: Floats,
) -> tuple[int, float, int, int]:
    """Make steps until a bound is reached, or the grid or the record is full.

    Returns:
        The number of steps, the time, the shell of the front, and the outermost shell that is not
        still.
    """
    shells = state.shape[1]
    edges = np.arange(shells + 1) * shell_m
    radii: Floats = 0.5 * (edges[:-1] + edges[1:])
    areas: Floats = edges**2
    volumes: Floats = (edges[1:] ** 3 - edges[:-1] ** 3) / 3.0
    gas = np.zeros((4, shells))  # density, velocity, pressure, share of products
    inner = np.zeros((4, shells))
    outer = np.zeros((4, shells))
    flux = np.zeros((4, shells + 1))
    last = shells - 1 - _SPARE_SHELLS  # outermost shell that is not still
    steps = 0
    while True:
        # 1. Where gas moves and where the front is; the end of the march, or of the grid.
        end = min(shells, last + 1 + _SPARE_SHELLS)  # all shells in the first round
        fastest = _primitive(state, gas, end)
        last = _outermost(gas, end, _STILL_SHARE)
        front = _outermost(gas, last + 1, _FRONT_SHARE)
        full = last >= shells - _SPARE_SHELLS or steps == len(record)
        if full or time_s >= until_s or shell_m * (front + 1.0) >= until_front_m:
            return steps, time_s, front, last
        end = min(end, last + 1 + _SPARE_SHELLS)
        # 2. The step by the fastest signal; the first ones grow from a tenth of it.
        share = min(1.0, 0.1 + (steps_before + steps) / _FIRST_STEPS)
        step_s = share * COURANT * shell_m / fastest
        # 3. The overpressure at the gauges, between the middles of shells.
        record[steps, 0] = time_s
        for k in range(len(gauges_m)):
            place = gauges_m[k] / shell_m - 0.5
            i = int(place)
            over = 0.0
            if i < end - 1:
                over = gas[2, i] + (place - i) * (gas[2, i + 1] - gas[2, i]) - AIR_PRESSURE_PA
            record[steps, 1 + k] = over
        # 4. Fluxes through spheres (areas r^2 over volumes r^3 / 3: the 4 pi cancel out), and what
        # products that burn later release within the step.
        _reconstruct(gas, inner, outer, radii, shell_m, step_s, end)
        _fluxes(inner, outer, flux, end)
        released = later_j_kg * np.exp(-time_s / later_s) * -np.expm1(-step_s / later_s)
        for i in range(end):
            ratio = step_s / volumes[i]
            for k in range(4):
                state[k, i] -= ratio * (areas[i + 1] * flux[k, i + 1] - areas[i] * flux[k, i])
            # Outward push of the pressure on the sides of the conical element.
            sides = 0.5 * (inner[2, i] + outer[2, i])
            state[1, i] += ratio * sides * (areas[i + 1] - areas[i])
            state[2, i] += released * state[3, i]
        time_s += step_s
        steps += 1


@njit(error_model="numpy")
def _outermost(gas: Floats, end: int, share: float) -> int:
    """Return the outermost shell whose pressure differs from still air's by more than a share."""
    for i in range(end - 1, -1, -1):
        if abs(gas[2, i] - AIR_PRESSURE_PA) > share * AIR_PRESSURE_PA:
            return i
    return 0


@njit(error_model="numpy")
def _primitive(state: Floats, gas: Floats, end: int) -> float:
    """Set density, velocity, pressure and share of products; return the largest signal speed."""
    fastest = 0.0
    for i in range(end):
        density = state[0, i]
        velocity = state[1, i] / density
        pressure = (GAMMA - 1.0) * (state[2, i] - 0.5 * density * velocity * velocity)
        pressure = max(pressure, _LEAST_PRESSURE_PA)
        gas[0, i] = density
        gas[1, i] = velocity
        gas[2, i] = pressure
        gas[3, i] = state[3, i] / density
        fastest = max(fastest, abs(velocity) + sqrt(GAMMA * pressure / density))
    return fastest


@njit(error_model="numpy")
def _reconstruct(
    gas: Floats,
    inner: Floats,
    outer: Floats,
    radii: Floats,
    shell_m: float,
    step_s: float,
    end: int,
) -> None:
    """Set the states at the inner and the outer face of each shell after half a step."""
    ratio = 0.5 * step_s / shell_m
    slope = np.empty(4)
    for i in range(end):
        for k in range(4):
            low = gas[k, i] - gas[k, i - 1] if i > 0 else 0.0
            if i == 0 and k == 1:
                low = 2.0 * gas[1, 0]  # the mirror image beyond the centre
            high = gas[k, i + 1] - gas[k, i] if i + 1 < end else 0.0
            slope[k] = 2.0 * low * high / (low + high) if low * high > 0.0 else 0.0  # van Leer
        density, velocity, pressure, share = gas[0, i], gas[1, i], gas[2, i], gas[3, i]
        spread = step_s * velocity / radii[i]
        half_density = density - ratio * (velocity * slope[0] + density * slope[1])
        half_density -= density * spread
        half_velocity = velocity - ratio * (velocity * slope[1] + slope[2] / density)
        half_pressure = pressure - ratio * (velocity * slope[2] + GAMMA * pressure * slope[1])
        half_pressure -= GAMMA * pressure * spread
        half_share = share - ratio * velocity * slope[3]
        if (
            half_density - 0.5 * abs(slope[0]) < _LEAST_SHARE * density
            or half_pressure - 0.5 * abs(slope[2]) < _LEAST_SHARE * pressure
        ):
            slope[:] = 0.0
            half_density, half_velocity = density, velocity
            half_pressure, half_share = pressure, share
        inner[0, i], outer[0, i] = half_density - 0.5 * slope[0], half_density + 0.5 * slope[0]
        inner[1, i], outer[1, i] = half_velocity - 0.5 * slope[1], half_velocity + 0.5 * slope[1]
        inner[2, i], outer[2, i] = half_pressure - 0.5 * slope[2], half_pressure + 0.5 * slope[2]
        inner[3, i], outer[3, i] = half_share - 0.5 * slope[3], half_share + 0.5 * slope[3]


@njit(error_model="numpy")
def _fluxes(inner: Floats, outer: Floats, flux: Floats, end: int) -> None:
    """Set the fluxes through the outer faces of the shells by HLLC; that at the centre stays 0."""
    for i in range(1, end + 1):
        left = outer[:, i - 1]
        right = inner[:, i] if i < end else left
        d1, u1, p1 = left[0], left[1], left[2]
        d2, u2, p2 = right[0], right[1], right[2]
        c1, c2 = sqrt(GAMMA * p1 / d1), sqrt(GAMMA * p2 / d2)
        w1, w2 = sqrt(d1), sqrt(d2)
        mean = (w1 * u1 + w2 * u2) / (w1 + w2)
        jump = w1 * w2 / (w1 + w2) ** 2 * (u2 - u1) ** 2
        sound = sqrt((w1 * c1 * c1 + w2 * c2 * c2) / (w1 + w2) + 0.5 * jump)
        s1, s2 = min(u1 - c1, mean - sound), max(u2 + c2, mean + sound)
        contact = p2 - p1 + d1 * u1 * (s1 - u1) - d2 * u2 * (s2 - u2)
        contact /= d1 * (s1 - u1) - d2 * (s2 - u2)
        if contact >= 0.0:
            d, u, p, share, s = d1, u1, p1, left[3], min(s1, 0.0)
        else:
            d, u, p, share, s = d2, u2, p2, right[3], max(s2, 0.0)
        energy = p / (GAMMA - 1.0) + 0.5 * d * u * u
        flux[0, i] = d * u
        flux[1, i] = d * u * u + p
        flux[2, i] = (energy + p) * u
        if s != 0.0:  # between the waves
            star = d * (s - u) / (s - contact)
            inside = energy / d + (contact - u) * (contact + p / (d * (s - u)))
            flux[0, i] += s * (star - d)
            flux[1, i] += s * (star * contact - d * u)
            flux[2, i] += s * (star * inside - energy)
        flux[3, i] = flux[0, i] * share
