"""How far the loads of pymunk are from those of the event engine, with intervals."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit
from scipy.stats import ks_2samp

from blast_env.arrays import FloatArray

QUANTITIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "impulse": "impulse m|v|",
        "transferred": "transferred impulse",
        "hits": "hits",
        "arrival_ms": "first arrival",
        "angle_deg": "angle of incidence",
    }
)
"""What is compared, one value a blast: column of `totals` and words."""


CLOSE: Final = 0.05
"""The engines count as agreeing when they differ by less than this share."""


class Difference(NamedTuple):
    """A relative difference of two means with its 95 % interval.

    Attributes:
        value: Share of the event engine's mean.
        half_width: Half of the interval.
    """

    value: float
    half_width: float

    @property
    def is_close(self) -> bool:
        """Whether the whole interval lies within `CLOSE`."""
        return abs(self.value) + self.half_width < CLOSE

    def __str__(self) -> str:
        """Return both in percent."""
        return f"{100.0 * self.value:+.1f} ± {100.0 * self.half_width:.1f}"


def totals(collisions: pd.DataFrame, structure: str, seeds: int) -> pd.DataFrame:
    """Return one row a blast.

    Args:
        collisions: As `BlastSet.collisions` returns them.
        structure: The structure.
        seeds: Number of blasts; those without a hit have no collision.

    Returns:
        `impulse`, `transferred` and `hits`; `arrival_ms`, the time of the first hit, and
        `angle_deg`, the angle of incidence weighted by m |v|, which are NaN without a hit.
    """
    of_structure = collisions[collisions.structure == structure]
    weighted = of_structure.assign(angle=of_structure.angle_deg * of_structure.impulse)
    groups = weighted.groupby("seed")
    table = groups[["impulse", "transferred", "angle"]].sum()
    table["hits"] = groups.size()
    table = table.reindex(range(seeds), fill_value=0.0)
    table["arrival_ms"] = groups.time_ms.min()
    table["angle_deg"] = table.angle / table.impulse.where(table.impulse > 0.0)
    return table[list(QUANTITIES)]


def relative_difference(values: FloatArray, event: FloatArray) -> Difference:
    """Return how far the mean of blasts on pymunk is from that on the event engine.

    The engines share charge and air of a seed, so their loads are correlated, though weakly: paths
    are chaotic. The regression of the one on the other uses as much of that as there is, and the
    event engine's mean is known from more seeds (double sampling, Cochran's regression estimator).

    Args:
        values: From pymunk, for the seeds 0 to n - 1 (n,); NaN where there is none.
        event: From the event engine, for these seeds and more (m,); likewise.
    """
    first = event[: len(values)]
    paired = ~np.isnan(values) & ~np.isnan(first)
    values, first, event = values[paired], first[paired], event[~np.isnan(event)]
    covariance = np.cov(values, first)
    slope = float(covariance[0, 1] / covariance[1, 1])
    mean = float(values.mean() - slope * (first.mean() - event.mean()))
    ratio = mean / float(event.mean())
    residual = values - values.mean() - slope * (first - first.mean())
    count = len(values)
    variance = float(residual @ residual) / (count - 2) / count
    variance += (slope - ratio) ** 2 * float(event.var(ddof=1)) / len(event)
    half_width = float(stdtrit(count - 2, 0.975)) * variance**0.5 / abs(float(event.mean()))
    return Difference(ratio - 1.0, half_width)


@dataclass(frozen=True)
class Comparison:
    """Pymunk at one step against the event engine, on one structure of one scene.

    Attributes:
        scene: Name of the scene.
        structure: Name of the structure.
        step_radii: The step.
        seeds: Blasts on pymunk.
        differences: By quantity.
        distances: Kolmogorov-Smirnov distance of the distributions over the blasts, by quantity.
        p_values: The probability of such a distance between equal distributions.
        pooled: Of the distributions over all collisions, weighted by the transferred impulse:
            of `time_ms` and `angle_deg`.
        pooled_floor: The same between two lots of blasts on the event engine, as many and as
            different in their seeds: what chance does.
    """

    scene: str
    structure: str
    step_radii: float
    seeds: int
    differences: Mapping[str, Difference]
    distances: Mapping[str, float]
    p_values: Mapping[str, float]
    pooled: Mapping[str, float]
    pooled_floor: Mapping[str, float]

    @property
    def is_close(self) -> bool:
        """Whether m |v| and the transferred impulse agree; see `Difference.is_close`."""
        return self.differences["impulse"].is_close and self.differences["transferred"].is_close

    @property
    def is_near(self) -> bool:
        """Whether the estimates themselves are within `CLOSE`, whatever their intervals."""
        both = (self.differences["impulse"], self.differences["transferred"])
        return all(abs(difference.value) < CLOSE for difference in both)


def longest_close_step(comparisons: list[Comparison]) -> float | None:
    """Return the step at which pymunk is within 5 % of the event engine; None if at none.

    That is the longest one for which the 95 % intervals of both m |v| and the transferred impulse
    lie within 5 %, and from which on no shorter step has an estimate outside.

    Args:
        comparisons: Of one structure of one scene.
    """
    found = None
    for comparison in sorted(comparisons, key=lambda each: each.step_radii):
        if not comparison.is_near:
            break
        if comparison.is_close:
            found = comparison.step_radii
    return found


def compare(
    pymunk: pd.DataFrame,
    event: pd.DataFrame,
    seeds: tuple[int, int],
    scene: str,
    structure: str,
    step_radii: float,
) -> Comparison:
    """Compare the collisions of blasts on pymunk with those on the event engine.

    Args:
        pymunk: Collisions of blasts with the seeds 0 and up.
        event: Likewise, of more blasts.
        seeds: How many blasts each has.
        scene: Name of the scene.
        structure: Name of the structure.
        step_radii: The step.
    """
    ours = totals(pymunk, structure, seeds[0])
    theirs = totals(event, structure, seeds[1])
    tests = {
        name: ks_2samp(ours[name].dropna(), theirs[name][seeds[0] :].dropna())
        for name in QUANTITIES
    }
    pymunk = pymunk[pymunk.structure == structure]
    event = event[event.structure == structure]
    same, others = event[event.seed < seeds[0]], event[event.seed >= seeds[0]]
    return Comparison(
        scene=scene,
        structure=structure,
        step_radii=step_radii,
        seeds=seeds[0],
        differences={
            name: relative_difference(ours[name].to_numpy(), theirs[name].to_numpy())
            for name in QUANTITIES
        },
        distances={name: float(test.statistic) for name, test in tests.items()},
        p_values={name: float(test.pvalue) for name, test in tests.items()},
        pooled={name: weighted_distance(pymunk, others, name) for name in _POOLED},
        pooled_floor={name: weighted_distance(same, others, name) for name in _POOLED},
    )


_POOLED: Final = ("time_ms", "angle_deg")


def weighted_distance(one: pd.DataFrame, other: pd.DataFrame, column: str) -> float:
    """Return the largest difference of two distributions of the transferred impulse.

    Weighted, so that it does not matter whether a push counts as one collision or as two.

    Args:
        one: Collisions.
        other: Collisions.
        column: Over what the impulse is distributed.
    """
    places = np.union1d(one[column], other[column])
    shares = []
    for collisions in (one, other):
        ordered = collisions.sort_values(column)
        passed = np.concatenate(([0.0], np.cumsum(ordered.transferred.to_numpy(dtype=np.float64))))
        upto = np.searchsorted(ordered[column].to_numpy(), places, side="right")
        shares.append(passed[upto] / passed[-1])
    return float(np.abs(shares[0] - shares[1]).max())
