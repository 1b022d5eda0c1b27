"""Means, reductions and tails over threats, with their uncertainty, and means over areas."""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError

CVAR_LEVEL: Final = 0.8
"""Default level of the conditional value at risk: the mean of the worst 20 % of the threats."""


class Estimate(NamedTuple):
    """A value over threats with its 95 % confidence interval.

    Attributes:
        value: The estimate.
        low: Lower end; NaN with a single threat, which has no spread.
        high: Upper end; NaN with a single threat.
    """

    value: float
    low: float
    high: float

    def scaled(self, factor: float) -> "Estimate":
        """Return the estimate in another unit; the factor is positive."""
        return Estimate(self.value * factor, self.low * factor, self.high * factor)


def mean_estimate(values: FloatArray) -> Estimate:
    """Return the mean over threats, with Student's t interval.

    Args:
        values: One value per threat (threats,), at least one.
    """
    mean = float(values.mean())
    half_width = _half_width(values - mean)
    return Estimate(mean, mean - half_width, mean + half_width)


def p_value_of_mean(values: FloatArray) -> float:
    """Return the two-sided p value of Student's t test that the mean is 0.

    Args:
        values: Values (n,), such as differences of pairs.

    Returns:
        The p value; 1 for one value, and for values that are all 0.
    """
    count, mean = len(values), float(values.mean())
    if count < 2 or mean == 0.0:
        return 1.0
    # t = mean / (s / sqrt(n)) with n - 1 degrees of freedom, both tails.
    spread = float(values.std(ddof=1))
    if spread == 0.0:
        return 0.0
    from scipy.special import stdtr  # as in `_half_width`

    return float(2.0 * stdtr(count - 1, -abs(mean) / spread * np.sqrt(count)))


def holm_adjusted(p_values: Sequence[float]) -> list[float]:
    """Return p values adjusted for their number, in their order.

    Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6 (1979) 65:
    the k-th smallest of m is multiplied by m - k + 1, and none is below a smaller one's.
    """
    # (1) Sort; (2) the smallest of m counts m times, the next m - 1 times, ...; (3) monotone from
    # small to large; (4) back in the given order, at most 1.
    order = np.argsort(p_values)
    factors = np.arange(len(order), 0, -1)
    adjusted = np.empty(len(order))
    adjusted[order] = np.maximum.accumulate(np.asarray(p_values)[order] * factors)
    return [float(value) for value in np.minimum(adjusted, 1.0)]


def stratified_estimate(groups: Sequence[tuple[float, Sequence[float]]]) -> Estimate:
    """Return the sum of weighted means of groups, with Student's t interval within the groups.

    The groups are fixed and only their values are drawn, so the interval covers other draws of
    values from the same groups.

    Args:
        groups: Weight and values of each group, at least one value per group.

    Returns:
        The estimate, without an interval (NaN) if no group has two values.
    """
    arrays = [(weight, np.asarray(values, dtype=np.float64)) for weight, values in groups]
    value = float(sum(weight * values.mean() for weight, values in arrays))
    several = [(weight, values) for weight, values in arrays if len(values) > 1]
    freedom = sum(len(values) - 1 for _, values in several)
    if not freedom:
        return Estimate(value, np.nan, np.nan)
    from scipy.special import stdtrit  # as in `_half_width`

    # Groups are independent: variances of weighted means add up, and degrees of freedom too. A
    # group of one value has no spread to contribute.
    variance = sum(w**2 * float(values.var(ddof=1)) / len(values) for w, values in several)
    half_width = float(stdtrit(freedom, 0.975) * np.sqrt(variance))
    return Estimate(value, value - half_width, value + half_width)


def reductions(impulse: FloatArray | float, unprotected: FloatArray | float) -> NDArray[np.float64]:
    """Return 1 - impulse / unprotected, elementwise; NaN if there is no load without a barrier.

    Args:
        impulse: Impulse with the barrier, any shape.
        unprotected: Impulse without it, the same shape.
    """
    with_barrier, without = np.asarray(impulse, float), np.asarray(unprotected, float)
    left: FloatArray = np.full(without.shape, np.nan)
    np.divide(with_barrier, without, out=left, where=without > 0.0)
    return np.asarray(1.0 - left)


def reduction_estimate(impulse: FloatArray, unprotected: FloatArray) -> Estimate:
    """Return 1 - mean(impulse) / mean(unprotected), with its 95 % confidence interval.

    The ratio of the means, not the mean of the ratios: it is the avoided share of the expected
    impulse, and a threat with a small load without a barrier has a small weight. In a mean of
    ratios such a threat could outweigh all others, and one without a load would have no ratio.

    The interval is the delta method's for a ratio of paired means: the spread of
    impulse - ratio * unprotected over the threats, with Student's t. Variation common to both
    sides of a pair cancels, and a layout without an effect gets the interval (0, 0). The upper end
    is at most 1, as any reduction is.

    Args:
        impulse: Impulse with the barrier, one value per threat (threats,).
        unprotected: Impulse without it, for the same threats (threats,).

    Returns:
        The estimate; all NaN if there is no load without a barrier.
    """
    mean = float(unprotected.mean())
    if not mean > 0.0:
        return Estimate(np.nan, np.nan, np.nan)
    # Delta method: the spread of a ratio of means a / b is that of a - (a / b) b, over b.
    ratio = float(impulse.mean()) / mean
    half_width = _half_width(impulse - ratio * unprotected) / mean
    reduction = 1.0 - ratio
    return Estimate(reduction, reduction - half_width, min(reduction + half_width, 1.0))


def conditional_value_at_risk(values: FloatArray, level: float) -> float:
    """Return the mean of the worst share 1 - level of the values (CVaR).

    If that share is not a whole number of values, the last one counts in part (definition of
    Rockafellar and Uryasev): with 16 values and the level 0.8, the three largest and a fifth of the
    fourth. Level 0 gives the mean, levels from 1 - 1 / count the largest value.

    Args:
        values: One value per threat (threats,), at least one.
        level: At least 0 and below 1.

    Raises:
        BlastEnvError: If the level is out of bounds.
    """
    check_cvar_level(level)
    if len(values) == 1:  # the usual case of an episode; with the rounding of the sums below
        share = 1.0 - level
        return float(share * values[0] / share)
    # Whole values first, then the part of the next one that is left of the share 1 - level.
    worst_first = np.sort(values)[::-1]
    tail = (1.0 - level) * len(values)
    weight = np.clip(tail - np.arange(len(values)), 0.0, 1.0)
    return float(weight @ worst_first / weight.sum())


def check_cvar_level(level: float) -> None:
    """Refuse a level that is not at least 0 and below 1 (`BlastEnvError`)."""
    if not 0.0 <= level < 1.0:
        raise BlastEnvError(f"cvar_level is {level:g}, must be at least 0 and below 1")


def _half_width(deviation: FloatArray) -> float:
    """Return the half-width of a mean's 95 % interval from the deviations from it (threats,)."""
    count = len(deviation)
    if count < 2:
        return np.nan
    from scipy.special import stdtrit  # Student's t; takes a fifth of a second to import

    # Deviations from a known mean: Bessel's correction for its estimate.
    standard_error = np.sqrt(float(deviation @ deviation) / (count - 1) / count)
    return float(stdtrit(count - 1, 0.975) * standard_error)


class _Part(Protocol):
    @property
    def protected(self) -> bool: ...


AnyPart = TypeVar("AnyPart", bound=_Part)


def counted_parts(parts: Sequence[AnyPart]) -> Sequence[AnyPart]:
    """Return the parts whose loads make up a building's load: the protected ones, or else all."""
    return [part for part in parts if part.protected] or parts


def mean_over_area(load: FloatArray, area: FloatArray) -> float:
    """Return the area-weighted mean load of a wall, structure or building; NaN without any area.

    Args:
        load: Loads on its parts (n,).
        area: Their areas, in any unit (n,).
    """
    return float(np.average(load, weights=area)) if area.any() else np.nan
