"""The smooth curve of load over path length that stands for the free field."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.physics.collisions import CollisionArray
from blast_env.simulation import BlastResult
from blast_env.statistics import Estimate
from blast_env.studies.shielding.scenes import BlockGeometry

_ITERATIONS: Final = 30

_LONGEST_STEP: Final = 2.0  # in log load, which keeps Newton's method from running away

_RIDGE: Final = 1e-9  # of the mean diagonal; only matters where the loads do not fix the curve


@dataclass(frozen=True, eq=False)
class LogQuadratic:
    """log load = c0 + c1 u + c2 u^2 with u = log path - origin.

    Attributes:
        coefficients: c0, c1, c2 of each curve (..., 3).
        origin: Mean log path of the fit.
    """

    coefficients: FloatArray
    origin: float

    def __call__(self, path_m: FloatArray) -> FloatArray:
        """Return the loads (..., n) at path lengths (n,)."""
        load: FloatArray = np.exp(self.coefficients @ _powers(path_m, self.origin).T)
        return load


def fit_log_quadratic(path_m: FloatArray, load: FloatArray) -> LogQuadratic:
    """Fit a quadratic in the logarithms to loads that may be noisy, or 0 in places.

    Quasi-likelihood with a logarithmic link and a variance that grows with the mean (quasi-Poisson
    regression): loads are sums over collisions. Unlike least squares of log load, it takes a
    module that was not hit as what it is, and does not lie below noisy means; the fitted loads
    add up to the loads.

    Args:
        path_m: Path lengths (n,).
        load: Mean loads of one curve or of many (..., n), each with a positive sum.
    """
    origin = float(np.log(path_m).mean())
    powers = _powers(path_m, origin)  # (n, 3)
    relative = load / load.mean(axis=-1, keepdims=True)
    coefficients = np.zeros((*load.shape[:-1], 3))
    for _ in range(_ITERATIONS):
        mean = np.exp(coefficients @ powers.T)
        gradient = (relative - mean) @ powers
        curvature = np.einsum("...n,ni,nj->...ij", mean, powers, powers)
        ridge = _RIDGE * np.trace(curvature, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
        step = np.linalg.solve(curvature + ridge, gradient[..., None])[..., 0]
        longest = np.abs(step @ powers.T).max(axis=-1, keepdims=True)
        coefficients = coefficients + step * _LONGEST_STEP / np.maximum(longest, _LONGEST_STEP)
    coefficients[..., 0] += np.log(load.mean(axis=-1))
    return LogQuadratic(coefficients, origin)


def _powers(path_m: FloatArray, origin: float) -> FloatArray:
    """Return 1, u, u^2 for each path (n, 3)."""
    u = np.log(path_m) - origin
    return np.stack((np.ones_like(u), u, u * u), axis=-1)


LATE_SHARE_OF_TIME: Final = 0.2
"""The last part of the time limit; what arrives in it shows whether loads are complete."""

_LEAST_COSINE: Final = 0.99  # of a normal with its face's; hits on corners belong to no face


class Face(IntEnum):
    """A side of a structure, for someone who looks along x, from the charge."""

    FRONT = 0
    BACK = 1
    LEFT = 2
    RIGHT = 3


class LoadKind(IntEnum):
    """What is summed up.

    Attributes:
        TRANSFERRED: Momentum really transferred along the normal, simulation units.
        IMPULSE: The paper's m |v|, simulation units.
        LATE: As `TRANSFERRED`, of the last fifth of the time limit.
    """

    TRANSFERRED = 0
    IMPULSE = 1
    LATE = 2


def face_loads(result: BlastResult) -> FloatArray:
    """Return the loads on the faces of the modules of the one structure of a blast.

    Returns:
        Loads (kinds, faces, rows, columns), indexed by `LoadKind` and `Face`.
    """
    collisions = result.collision_array
    (structure,) = result.obstacles
    limit_s = result.blast.scene.parameters.stepping.time_limit_s
    late = collisions["time_s"] >= (1.0 - LATE_SHARE_OF_TIME) * limit_s
    transferred = collisions["transferred_impulse"]
    amounts = {
        LoadKind.TRANSFERRED: transferred,
        LoadKind.IMPULSE: collisions["impulse"],
        LoadKind.LATE: np.where(late, transferred, 0.0),
    }
    # The modules of a whole grid are numbered row by row.
    loads = np.zeros((len(LoadKind), len(Face), structure.rows * structure.columns))
    for face, on_face in faces_hit(collisions).items():
        for kind, amount in amounts.items():
            np.add.at(loads[kind, face], collisions["module"][on_face], amount[on_face])
    return loads.reshape(len(LoadKind), len(Face), structure.rows, structure.columns)


def faces_hit(collisions: CollisionArray) -> dict[Face, NDArray[np.bool_]]:
    """Return for each face which collisions (n,) are with it."""
    x, y = collisions["normal_x"], collisions["normal_y"]
    outward = {Face.FRONT: -x, Face.BACK: x, Face.LEFT: y, Face.RIGHT: -y}
    return {face: cosine > _LEAST_COSINE for face, cosine in outward.items()}


Region = Literal["one_corner", "one_corner_near", "one_corner_far", "two_corners"]
"""All gauges of the sides, the third of them at the front, the third at the back; the back."""

REGIONS: Final[tuple[Region, ...]] = (
    "one_corner",
    "one_corner_near",
    "one_corner_far",
    "two_corners",
)

RESAMPLES: Final = 1000
"""Draws of seeds for an interval."""

_RNG_SEED: Final = 0

_CONFIDENCE: Final = 0.95


# Loads at the ends of the wall are those of an edge, not of a surface that goes on.
_EDGE_MODULES: Final = 2


class ExperimentalBand(NamedTuple):
    """A measured share of the free-field impulse, and how far from it still agrees with it."""

    value: float
    tolerance: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper end."""
        return self.value - self.tolerance, self.value + self.tolerance


EXPERIMENT: Final[Mapping[Region, ExperimentalBand]] = MappingProxyType(
    {"one_corner": ExperimentalBand(0.57, 0.10), "two_corners": ExperimentalBand(0.49, 0.12)}
)
"""Street-junction experiments, scale 1:5: impulse over free-field impulse at the same path length.

One corner away they gave 0.48 to 0.67, near and far from the edge.
"""


def gauge_loads(faces: FloatArray) -> FloatArray:
    """Return the loads on the gauges of a block, symmetric ones folded (kinds, gauges).

    Args:
        faces: Loads on all faces (kinds, faces, rows, columns).
    """
    # Along the sides a gauge is a column of modules, at the back it is a row.
    side = (faces[:, Face.LEFT] + faces[:, Face.RIGHT]).sum(axis=1) / 2.0
    back = faces[:, Face.BACK].sum(axis=2)
    back = (back + back[:, ::-1]) / 2.0
    half = (back.shape[1] + 1) // 2
    return np.concatenate((side, back[:, :half]), axis=1)


def wall_loads(faces: FloatArray) -> FloatArray:
    """Return the loads on the wall in the open, mean of its two faces (kinds, modules).

    Args:
        faces: Loads on all faces (kinds, faces, rows, columns).
    """
    loads: FloatArray = (faces[:, Face.LEFT] + faces[:, Face.RIGHT]).sum(axis=1) / 2.0
    return loads


@dataclass(frozen=True, eq=False)
class DrawnLoads:
    """Mean loads over all seeds (row 0), and over draws of seeds with replacement (the others).

    Attributes:
        loads: On the gauges (draws, gauges).
        curve: The free-field curves (draws,).
        free_field: Their values at the gauges' path lengths (draws, gauges).
    """

    loads: FloatArray
    curve: LogQuadratic
    free_field: FloatArray

    def ratio(self, weight: FloatArray) -> Estimate:
        """Return the ratio of the weighted sums over the gauges; weights (gauges,)."""
        return estimate((self.loads @ weight) / (self.free_field @ weight))


def draw_loads(
    loads: FloatArray, path_m: FloatArray, wall: FloatArray, geometry: BlockGeometry
) -> DrawnLoads:
    """Average loads over draws of seeds, and fit the free-field curve of each draw.

    Draws without any load in the open have no ratio; they are left out.

    Args:
        loads: Loads on gauges (seeds, gauges).
        path_m: Path length to each gauge (gauges,).
        wall: Loads on the wall in the open (seeds, modules).
        geometry: The scenes.
    """
    seeds = len(loads)
    shares = np.full((1, seeds), 1.0 / seeds)
    if seeds > 1:
        rng = np.random.default_rng(_RNG_SEED)
        drawn = rng.multinomial(seeds, shares[0], size=RESAMPLES) / seeds
        shares = np.concatenate((shares, drawn))
    fitted = fitted_modules(geometry)
    shares = shares[(shares @ wall)[:, fitted].sum(axis=1) > 0.0]
    curve = fit_log_quadratic(geometry.wall_path_m[fitted], (shares @ wall)[:, fitted])
    return DrawnLoads(shares @ loads, curve, curve(path_m))


def fitted_modules(geometry: BlockGeometry) -> NDArray[np.bool_]:
    """Return which modules of the wall (modules,) the free-field curve is fitted to."""
    index = np.arange(geometry.wall_modules)
    return (index >= _EDGE_MODULES) & (index < geometry.wall_modules - _EDGE_MODULES)


def region_weight(region: Region, geometry: BlockGeometry) -> FloatArray:
    """Return how many modules of a region each gauge stands for (gauges,)."""
    side = geometry.side_modules
    weight, third = np.zeros(len(geometry.gauge_path_m)), round(side / 3)
    if region == "two_corners":
        weight[side:] = 2.0
        if side % 2:
            weight[-1] = 1.0  # the one in the middle
        return weight
    first = side - third if region == "one_corner_far" else 0
    last = third if region == "one_corner_near" else side
    weight[first:last] = 2.0
    return weight


def estimate(values: FloatArray) -> Estimate:
    """Return the first of the values (draws,) with the 95 % interval that the others span.

    Without others, from a single seed, the interval is NaN.
    """
    if len(values) == 1:
        return Estimate(float(values[0]), np.nan, np.nan)
    tail = (1.0 - _CONFIDENCE) / 2.0
    low, high = np.quantile(values[1:], (tail, 1.0 - tail))
    return Estimate(float(values[0]), float(low), float(high))


def scaled_ratio(ratio: Estimate, exponent: float) -> Estimate:
    """Return ratio ** exponent, the ratio of two impulses after a calibration's power law.

    Args:
        ratio: Ratio of simulated impulses.
        exponent: The law's exponent B.

    Raises:
        BlastEnvError: If the exponent is not positive and finite.
    """
    check_exponent(exponent)
    return Estimate(*(float(value**exponent) for value in ratio))


def check_exponent(exponent: float) -> None:
    """Refuse an exponent that is not positive and finite (`BlastEnvError`)."""
    if not 0.0 < exponent < np.inf:
        raise BlastEnvError(f"exponent is {exponent:g}, must be above 0 and finite")
