"""The charge of the gas: TNT from its detonation products to a state of the grid.

A charge burns and expands with spherical symmetry (`SphericalBlast`) until its front reaches the
first obstacle, or the place of a possible one. Then density, momentum, energy and unburnt fuel are
mapped onto the grid, and the solver continues, with fuel burning at the same time constant.

One run, for 1 kg in free air, serves all charges: lengths and times, including the time constant of
afterburning, scale with the cube root of the mass (Hopkinson-Cranz).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import cbrt, ceil, exp, inf, isfinite, log, log2, pi, sqrt
from threading import Lock
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from blast_env.compilation import compiled
from blast_env.errors import BlastEnvError
from blast_env.gas.grid import GasGrid
from blast_env.gas.solver import AIR_DENSITY_KG_M3, AIR_PRESSURE_PA, Burning, GasSolver
from blast_env.gas.spherical import PRODUCTS, Floats, SphericalBlast
from blast_env.gas.state import GAMMA
from blast_env.site.blast_site import TNT_KG_M3

LEAST_RADIUS_CELLS: Final = 2
"""Least radius of the front, in cells, at which it is mapped onto a grid."""

_RADIUS_RATIO: Final = 1.03
"""Ratio of the radii of the fronts of consecutive stored profiles."""

_SAMPLES_PER_RADIUS: Final = 32
_LEAST_SAMPLES: Final = 4
_MOST_SAMPLES: Final = 16


@dataclass(frozen=True)
class Explosive:
    """An explosive as a source of energy in air.

    Attributes:
        density_kg_m3: Density of the charge.
        prompt_j_kg: Energy of the products at the beginning of their expansion.
        later_j_kg: Energy released by their burning with air.
        later_s_kg: Time constant of the burning of 1 kg in free air; grows with the cube root of
            the mass.
        ground_factor: Mass in free air, kg, with the same blast as 1 kg on the ground. A mirror
            has 2; real ground absorbs some of the energy in a crater and in waves.
    """

    density_kg_m3: float
    prompt_j_kg: float
    later_j_kg: float
    later_s_kg: float
    ground_factor: float

    def radius_m(self, charge_kg: float) -> float:
        """Return the radius of a sphere of the explosive."""
        return cbrt(3.0 * charge_kg / (4.0 * pi * self.density_kg_m3))

    def in_free_air(self, charge_kg: float, gauges_m: ArrayLike = ()) -> SphericalBlast:
        """Return the blast of a sphere of the explosive before its expansion, with gauges."""
        return SphericalBlast(
            charge_kg,
            self.density_kg_m3,
            self.prompt_j_kg,
            self.later_j_kg,
            self.later_s_kg * cbrt(charge_kg),
            gauges_m=gauges_m,
        )


TNT: Final = Explosive(
    density_kg_m3=TNT_KG_M3,
    prompt_j_kg=2.95e6,
    later_j_kg=2.62e6,
    later_s_kg=1.0e-3,
    ground_factor=1.8,
)
"""The source of this engine, fitted within the known range of the properties of TNT.

The prompt energy is below the heat of detonation (4.2 to 4.5 MJ/kg), because the products stay hot;
a part of the heat of burning with air (about 10 MJ/kg) is released later. 1.8 is the ratio between
Kingery and Bulmash's curves for charges on the ground and in free air, within 0.5 % in both
impulses.

Sources with the right reflected impulse have too little incident impulse close to the charge;
those with the right incident impulse have too much reflected impulse. This one matches the
reflected impulse. Its ratios to the curves for 20, 100 and 1000 kg with cells of 0.5 m, 0.25 m for
20 kg, (`python -m studies.gas kingery-bulmash`) are: reflected impulse 0.94 to 1.06 at Z = 1.7 to
8.7 m/kg^(1/3), incident impulse 0.89 to 0.94 at 2.7 to 8.6, but 0.88 at 2.1 and 0.84 at 1.7;
arrival 0.96 to 1.03. Peaks are 0.39 to 0.83: they need finer cells.
"""


@dataclass(frozen=True)
class GasCharge:
    """A charge at a place.

    A charge whose centre is not higher than its radius lies on the ground: it is treated as a half
    sphere with its centre in the ground's surface, and part of its energy goes into the ground.

    Attributes:
        mass_kg: Mass of the charge.
        position_m: Its centre: x, y, and height above the ground.
        explosive: Its explosive.

    Raises:
        BlastEnvError: If the mass is not above 0, or the position is not finite or below ground.
    """

    mass_kg: float
    position_m: tuple[float, float, float]
    explosive: Explosive = TNT

    def __post_init__(self) -> None:
        if not 0.0 < self.mass_kg < inf:
            raise BlastEnvError(f"mass_kg of the charge is {self.mass_kg}, but must be above 0")
        if len(self.position_m) != 3 or not all(isfinite(value) for value in self.position_m):
            raise BlastEnvError(
                f"position_m of the charge is {self.position_m}, but must be three finite lengths"
            )
        if self.position_m[2] < 0.0:
            raise BlastEnvError(
                f"the charge is at a height of {self.position_m[2]:g} m, below the ground"
            )

    @property
    def on_ground(self) -> bool:
        """Whether the charge lies on the ground."""
        return self.position_m[2] <= self.explosive.radius_m(self.mass_kg)

    @property
    def free_air_kg(self) -> float:
        """Mass with the same blast in free air."""
        return self.mass_kg * (self.explosive.ground_factor if self.on_ground else 1.0)

    @property
    def burning(self) -> Burning:
        """The burning of its products in the solver."""
        time_s = self.explosive.later_s_kg * cbrt(self.free_air_kg)
        return Burning(time_s, self.explosive.later_j_kg)

    @property
    def least_radius_m(self) -> float:
        """The least radius of the front, that of a sphere of `free_air_kg`."""
        return self.explosive.radius_m(self.free_air_kg)

    def profile(self, radius_m: float) -> "RadialProfile":
        """Return the blast with its front at a radius, or up to 3 % before it.

        Raises:
            BlastEnvError: If the radius is within the charge.
        """
        if not self.least_radius_m <= radius_m < inf:
            raise BlastEnvError(
                f"the front of {self.mass_kg:g} kg is asked for at a radius of {radius_m:g} m, "
                f"but must be at {self.least_radius_m:g} m or more, the radius of the charge"
            )
        unit = _unit_profiles(self.explosive).before(radius_m / cbrt(self.free_air_kg))
        return unit.scaled(self.free_air_kg)


@dataclass(frozen=True, eq=False)
class RadialProfile:
    """A blast with spherical symmetry at one time.

    Attributes:
        time_s: Time since detonation.
        front_m: Radius of the front, beyond which the air is still.
        shell_m: Thickness of a shell.
        state: Density, radial momentum, energy and unburnt fuel in each shell, per volume (4, n).
    """

    time_s: float
    front_m: float
    shell_m: float
    state: Floats

    def scaled(self, mass: float) -> "RadialProfile":
        """Return the same profile for a charge of `mass` times the mass, at its scaled time."""
        # Hopkinson and Cranz: lengths and times grow as the cube root of the mass, at equal states.
        length = cbrt(mass)
        return RadialProfile(
            self.time_s * length, self.front_m * length, self.shell_m * length, self.state
        )

    def totals(self) -> Floats:
        """Return mass, energy and fuel in excess of still air, kg, J and kg (3,)."""
        # Volumes of shells, 4/3 pi (r_out^3 - r_in^3); still air is taken off, so that shells
        # beyond the front add nothing.
        edges = self.shell_m * np.arange(self.state.shape[1] + 1.0)
        volumes = 4.0 / 3.0 * pi * np.diff(edges**3)
        still = np.array([AIR_DENSITY_KG_M3, AIR_PRESSURE_PA / (GAMMA - 1.0), 0.0])
        return np.asarray((self.state[[0, 2, 3]] - still[:, None]) @ volumes)


def set_charge(solver: GasSolver, charge: GasCharge, radius_m: float | None = None) -> None:
    """Set the state and the time of a solver, with gas at rest, to those of an expanded charge.

    Args:
        solver: Created with `with_fuel=True` and `burning=charge.burning`.
        radius_m: Radius of the front, `largest_radius_m` by default. Loads depend on it (by some
            per cent), so use the same for all runs in a comparison.

    Raises:
        BlastEnvError: If the radius is within the charge, the charge is too close above the ground
            for the cells, or, without a radius, it is outside the grid or in a solid cell.
    """
    grid = solver.grid
    if radius_m is None:
        radius_m = largest_radius_m(grid, charge)
    profile = charge.profile(radius_m)
    start, (density, momentum, energy, fuel) = lay(profile, grid, charge)
    velocity = momentum / density
    inner = energy - 0.5 * (momentum * velocity).sum(axis=0)
    # The hot products of a charge close above the ground overlap those of its mirror image: both
    # together take more air away than there is.
    if not (density.min() > 0.0 and inner.min() > 0.0):
        raise BlastEnvError(
            f"the charge of {charge.mass_kg:g} kg is {charge.position_m[2]:g} m high, too close"
            f" above the ground for cells of {grid.cell_m:g} m, on which its front begins at"
            f" {radius_m:.2g} m: take smaller cells or a height of 0"
        )
    solver.set_state(
        density_kg_m3=density,
        velocity_m_s=tuple(velocity),
        pressure_pa=(GAMMA - 1.0) * inner,
        fuel_kg_m3=fuel,
        start=start,
    )
    solver.time_s = profile.time_s


def largest_radius_m(
    grid: GasGrid, charge: GasCharge, kept_clear: NDArray[np.bool_] | None = None
) -> float:
    """Return the radius of the front at the first solid cell or the ground, m.

    In a grid with a skirt, it is also at most the distance to the nearest open face. It is at least
    `least_clearance_m`, even if the ground is nearer: the part of the blast below the ground is
    mapped onto the grid as its mirror image. It is at most the distance to the farthest corner.

    Args:
        kept_clear: Further cells to treat as solid (nx, ny, nz), the possible places of a barrier.
            The charge may be among them.

    Raises:
        BlastEnvError: If the charge is outside the grid or in a solid cell.
    """
    clear, least = clearance_m(grid, charge), least_clearance_m(grid, charge)
    x, y, z = _centre(charge)
    if kept_clear is not None:
        clear = min(clear, _distance_to(kept_clear, grid, (x, y, z)))
    if not charge.on_ground:
        clear = min(clear, max(z, least))
    if grid.buffer_layers > 0:
        clear = min(clear, _nearest_face(grid, (x, y, z)))  # a skirt must begin with still air
    return min(max(clear, least), _farthest_corner(grid, (x, y, z)))


def clearance_m(grid: GasGrid, charge: GasCharge) -> float:
    """Return the distance from a charge to the nearest solid cell, m, infinite if there is none.

    Raises:
        BlastEnvError: If the charge is outside the grid or in a solid cell.
    """
    grid.cell_at(charge.position_m)  # raises the error outside the grid
    clear = _distance_to(grid.solid, grid, _centre(charge))
    if clear <= 0.0:
        raise BlastEnvError(
            f"the charge of {charge.mass_kg:g} kg at {charge.position_m} is inside a solid cell"
        )
    return clear


def least_clearance_m(grid: GasGrid, charge: GasCharge) -> float:
    """Return the least distance of a charge from solid cells: 2 cells or its radius, m.

    A closer charge is nevertheless mapped onto the grid with its front at that distance. The part
    in solid cells is lost, so that such a result is unreliable.
    """
    return max(charge.least_radius_m, LEAST_RADIUS_CELLS * grid.cell_m)


def lay(
    profile: RadialProfile, grid: GasGrid, charge: GasCharge
) -> tuple[tuple[int, int, int], tuple[Floats, Floats, Floats, Floats]]:
    """Map a blast onto the cells of a grid that it has reached, as means over each cell.

    Each mean is over evenly spaced points in the cell, at least 4 along each edge, and 16 for a
    front at two cells. Mirror images of a scene give the same values to the last bit if centre and
    cells are exact in binary.

    Returns:
        The first of those cells; density, momentum along x, y and z, energy and unburnt fuel, per
        volume: (nx, ny, nz), (3, nx, ny, nz), (nx, ny, nz) and (nx, ny, nz). Solid cells hold
        still air.
    """
    # 1. More points in each cell the nearer the front is, in powers of two, which divide exactly.
    wanted = _SAMPLES_PER_RADIUS * grid.cell_m / profile.front_m
    samples = 2 ** ceil(log2(min(max(wanted, _LEAST_SAMPLES), _MOST_SAMPLES)))
    centre = _centre(charge)
    still = np.array([AIR_DENSITY_KG_M3, 0.0, AIR_PRESSURE_PA / (GAMMA - 1.0), 0.0])
    excess = profile.state - still[:, None]
    # 2. The cells within the front; 3. what the blast adds there to still air, and what the ground
    # reflects: a second blast from the mirror image of a charge above it.
    middle = (np.array(centre) - np.array(grid.origin_m)) / grid.cell_m
    front = profile.front_m / grid.cell_m
    low = np.maximum(np.floor(middle - front), 0.0).astype(np.int64)
    high = np.minimum(np.ceil(middle + front), grid.shape).astype(np.int64)
    solid = grid.solid[tuple(slice(a, b) for a, b in zip(low, high, strict=True))]
    solid = np.ascontiguousarray(solid)
    result = np.zeros((6, *solid.shape))
    heights = (centre[2],) if centre[2] == 0.0 else (centre[2], -centre[2])
    for height in heights:  # the ground is a mirror
        place = np.array([centre[0], centre[1], height])
        place = (place - np.array(grid.origin_m)) / grid.cell_m
        shell = profile.shell_m / grid.cell_m
        _lay(result, solid, low, excess, shell, front, place, samples)
    result[0] += still[0]
    result[4] += still[2]
    start = (int(low[0]), int(low[1]), int(low[2]))
    return start, (result[0], result[1:4], result[4], result[5])


def _centre(charge: GasCharge) -> tuple[float, float, float]:
    """Return the centre of the sphere, in the ground's surface if the charge lies on it."""
    x, y, z = charge.position_m
    return x, y, 0.0 if charge.on_ground else z


def _distance_to(
    cells: NDArray[np.bool_], grid: GasGrid, point: tuple[float, float, float]
) -> float:
    """Return the distance to the nearest of chosen cells, infinite if there is none."""
    chosen = np.argwhere(cells)
    if len(chosen) == 0:
        return inf
    low = np.array(grid.origin_m) + grid.cell_m * chosen
    outside = np.maximum(np.maximum(low - point, point - low - grid.cell_m), 0.0)
    return sqrt(float((outside**2).sum(axis=1).min()))


def _nearest_face(grid: GasGrid, point: tuple[float, float, float]) -> float:
    """Return the distance to the nearest open face with a skirt."""
    low = np.array(grid.origin_m)
    ways = np.stack((point - low, low + grid.cell_m * np.array(grid.shape) - point), axis=1)
    return float(np.where(np.array(grid.buffer_layers_by_axis) > 0, ways, inf).min())


def _farthest_corner(grid: GasGrid, point: tuple[float, float, float]) -> float:
    low = np.array(grid.origin_m)
    high = low + grid.cell_m * np.array(grid.shape)
    return sqrt(float((np.maximum(np.abs(low - point), np.abs(high - point)) ** 2).sum()))


class _Profiles:
    """Profiles of 1 kg in free air, with radii of the front in a geometric sequence."""

    def __init__(self, explosive: Explosive) -> None:
        self._later_s = explosive.later_s_kg
        self._blast = explosive.in_free_air(1.0)
        self._profiles = [self._now()]
        self._lock = Lock()

    def before(self, radius_m: float) -> RadialProfile:
        """Return the last profile with its front at or before a radius."""
        first = self._profiles[0].front_m
        wanted = int(log(radius_m / first) / log(_RADIUS_RATIO) + 1e-9) if radius_m > first else 0
        with self._lock:
            while len(self._profiles) <= wanted:
                # `front_m` is the outer radius of the shell that the front has reached, hence -1.
                radius = first * _RADIUS_RATIO ** len(self._profiles)
                self._blast.advance(until_front_m=radius - self._blast.shell_m)
                self._profiles.append(self._now())
        return self._profiles[wanted]

    def _now(self) -> RadialProfile:
        blast = self._blast
        state = blast.state.copy()
        # The products burn on, with a time constant that scales as all times do: what is left.
        state[PRODUCTS] *= exp(-blast.time_s / self._later_s)
        return RadialProfile(blast.time_s, blast.front_m, blast.shell_m, state)


@lru_cache(maxsize=4)
def _unit_profiles(explosive: Explosive) -> _Profiles:
    return _Profiles(explosive)


@compiled(nogil=True, error_model="numpy")
def _lay(
    result: Floats,
    solid: NDArray[np.bool_],
    low: NDArray[np.int64],
    excess: Floats,
    shell: float,
    front: float,
    place: Floats,
    samples: int,
) -> None:
    """Add the means of a blast over the air cells; lengths are in cells.

    Points on either side of the centre are summed separately, outwards from it, before the sums are
    added, so that a mirrored scene has the same sums.
    """
    halves = np.empty((8, 6))
    for a, b, c in np.ndindex(solid.shape):
        i, j, k = a + low[0], b + low[1], c + low[2]
        # The point of the cell that is nearest to the centre: beyond the front, the air is still.
        x = max(i - place[0], place[0] - i - 1.0, 0.0)
        y = max(j - place[1], place[1] - j - 1.0, 0.0)
        z = max(k - place[2], place[2] - k - 1.0, 0.0)
        if solid[a, b, c] or x * x + y * y + z * z >= front * front:
            continue
        halves[:] = 0.0
        for side in range(8):
            _add_side(halves[side], i, j, k, side, excess, shell, place, samples)
        for m in range(6):
            total = (halves[0, m] + halves[1, m]) + (halves[2, m] + halves[3, m])
            total += (halves[4, m] + halves[5, m]) + (halves[6, m] + halves[7, m])
            result[m, a, b, c] += total / samples**3


@njit(error_model="numpy")
def _add_side(
    sums: Floats,
    i: int,
    j: int,
    k: int,
    side: int,
    excess: Floats,
    shell: float,
    place: Floats,
    samples: int,
) -> None:
    """Add the points of a cell that lie in one of the eight octants around the centre."""
    toward_x = 1.0 if side & 1 else -1.0
    toward_y = 1.0 if side & 2 else -1.0
    toward_z = 1.0 if side & 4 else -1.0
    last = excess.shape[1] - 1
    for a in range(samples):
        # Outwards from the centre: up for the high side, down for the low one.
        u = (a if toward_x > 0.0 else samples - 1 - a) + 0.5
        dx = i + u / samples - place[0]
        if dx * toward_x < 0.0 or (dx == 0.0 and toward_x < 0.0):
            continue
        for b in range(samples):
            v = (b if toward_y > 0.0 else samples - 1 - b) + 0.5
            dy = j + v / samples - place[1]
            if dy * toward_y < 0.0 or (dy == 0.0 and toward_y < 0.0):
                continue
            for c in range(samples):
                w = (c if toward_z > 0.0 else samples - 1 - c) + 0.5
                dz = k + w / samples - place[2]
                if dz * toward_z < 0.0 or (dz == 0.0 and toward_z < 0.0):
                    continue
                distance = sqrt(dx * dx + dy * dy + dz * dz)
                # Linear between the middles of shells; momentum points away from the centre.
                at = max(distance / shell - 0.5, 0.0)
                low = int(at)
                if low >= last:
                    continue
                share = at - low
                radial = (1.0 - share) * excess[1, low] + share * excess[1, low + 1]
                sums[0] += (1.0 - share) * excess[0, low] + share * excess[0, low + 1]
                if distance > 0.0:
                    sums[1] += radial * dx / distance
                    sums[2] += radial * dy / distance
                    sums[3] += radial * dz / distance
                sums[4] += (1.0 - share) * excess[2, low] + share * excess[2, low + 1]
                sums[5] += (1.0 - share) * excess[3, low] + share * excess[3, low + 1]
