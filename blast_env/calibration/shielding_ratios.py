"""Ratios of loads round a block to loads in the open, with intervals from draws of seeds."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.calibration.shielding_fit import LogQuadratic, fit_log_quadratic
from blast_env.calibration.shielding_scenes import BlockGeometry, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.statistics import Estimate

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
