"""Fits of laws, and their agreement with the reference (paper, section 3).

A fit takes one impulse per distance: `i_sim` in simulation units and `i_reference` in any unit, for
the paper's column psi*s. The law gives impulses in the unit of `i_reference`. Beyond the paper: the
error at distances left out of the fit, and bootstrap intervals of the coefficients.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.particles.calibration.model import LinearLaw, PowerLaw, ProportionalLaw, ScalingLaw
from blast_env.statistics import Estimate
from blast_env.values import Numbers, checked_array

LEAST_DISTANCES: Final = 4
"""A fit on fewer distances warns: two coefficients then fit almost any data."""

_CONSTANT: Final = 1e-12  # relative spread up to which numbers count as equal


class FewDistancesWarning(BlastEnvWarning):
    """A law was fitted on fewer than `LEAST_DISTANCES` distances."""


Fit = Callable[[Numbers, Numbers], ScalingLaw]
"""One of `fit_proportional`, `fit_linear` and `fit_power_law`."""


def fit_proportional(i_sim: Numbers, i_reference: Numbers) -> ProportionalLaw:
    """Fit i_scaled = k i_sim by least squares (equation 6).

    Args:
        i_sim: Simulated impulse at each distance, simulation units, at least 0 (n,).
        i_reference: Reference impulse at each distance, above 0 (n,).

    Raises:
        BlastEnvError: If there are no numbers to fit, if they are out of bounds, or if `i_sim` is
            the same everywhere.

    Warns:
        FewDistancesWarning: If n is below four.
    """
    x, y = _checked_pair(i_sim, i_reference)
    return ProportionalLaw(k=float(x @ y / (x @ x)))


def fit_linear(i_sim: Numbers, i_reference: Numbers) -> LinearLaw:
    """Fit i_scaled = a + b i_sim by least squares (equation 8).

    Arguments, errors and warning as in `fit_proportional`.
    """
    return LinearLaw(*_line(*_checked_pair(i_sim, i_reference)))


def fit_power_law(i_sim: Numbers, i_reference: Numbers) -> PowerLaw:
    """Fit i_scaled = A i_sim^B by least squares of the logarithms (section 3.3).

    Arguments, errors and warning as in `fit_proportional`, but `i_sim` must be above 0.
    """
    x, y = _checked_pair(i_sim, i_reference)
    checked_array("i_sim", x, above=0.0)
    # ln i = ln A + B ln i_sim is a line.
    intercept, exponent = _line(np.log(x), np.log(y))
    return PowerLaw(A=float(np.exp(intercept)), B=exponent)


def _checked_pair(i_sim: Numbers, i_reference: Numbers) -> tuple[FloatArray, FloatArray]:
    """Check the impulses of a fit and return them as arrays (n,)."""
    x = checked_array("i_sim", i_sim, least=0.0, dimensions=1)
    y = checked_array("i_reference", i_reference, above=0.0, dimensions=1)
    if len(x) != len(y):
        raise BlastEnvError(
            f"i_sim has {len(x)} values and i_reference {len(y)}, must be one per distance each"
        )
    if not len(x):
        raise BlastEnvError("i_sim is empty, must have one value a distance")
    if np.ptp(x) <= _CONSTANT * x.max():
        raise BlastEnvError(
            f"i_sim is {x[0]:g} at every distance ({len(x)}), must differ for a fit"
        )
    if len(x) < LEAST_DISTANCES:
        warnings.warn(
            f"the fit rests on {len(x)} distances, should be at least {LEAST_DISTANCES}",
            FewDistancesWarning,
            stacklevel=3,
        )
    return x, y


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return offset and slope of the least-squares line.

    Equation (8) with deviations from the means, which is equal but has smaller rounding errors.
    """
    from_mean = x - x.mean()
    slope = float(from_mean @ (y - y.mean()) / (from_mean @ from_mean))
    return float(y.mean() - slope * x.mean()), slope


@dataclass(frozen=True)
class FitMetrics:
    """The paper's three measures (Table 4).

    Attributes:
        mape_percent: Mean absolute percentage error.
        rmse: Root mean squared error, unit of the reference.
        integral_error_percent: Absolute difference of the areas under the two impulse-distance
            curves, by the trapezoidal rule, in percent of the reference's area. Errors of opposite
            sign cancel in it.
    """

    mape_percent: float
    rmse: float
    integral_error_percent: float


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Predictions at each distance by a fit to all others.

    Attributes:
        distance_m: Distances (n,).
        predicted: Impulse at each distance by the law of all others, unit of the reference (n,).
        error_percent: predicted / reference - 1, in percent (n,).
        laws: The law fitted without each distance (n,).
        metrics: The measures of `predicted` against the reference.
    """

    distance_m: FloatArray
    predicted: FloatArray
    error_percent: FloatArray
    laws: tuple[ScalingLaw, ...]
    metrics: FitMetrics


def fit_metrics(distance_m: Numbers, predicted: Numbers, reference: Numbers) -> FitMetrics:
    """Compare impulses with a reference (section 3.4).

    Args:
        distance_m: Distances, ascending (n,), at least two.
        predicted: Impulses of the law, unit of the reference (n,).
        reference: Impulses of the reference, above 0 (n,).

    Raises:
        BlastEnvError: If a number is not finite or out of bounds, if distances are repeated or out
            of order, or if the lengths differ.
    """
    distance = _checked_distances(distance_m)
    model = _checked_column("predicted", predicted, len(distance))
    expected = _checked_column("reference", reference, len(distance), above=0.0)
    area, expected_area = (float(np.trapezoid(i, distance)) for i in (model, expected))
    return FitMetrics(
        mape_percent=100.0 * float(np.mean(np.abs(model - expected) / expected)),
        rmse=float(np.sqrt(np.mean((model - expected) ** 2))),
        integral_error_percent=100.0 * abs(area - expected_area) / expected_area,
    )


def shape_rms_percent(i_sim: Numbers, expected: Numbers) -> float:
    """Return the least rms of c i_sim / expected - 1 over c, percent: the difference in shape.

    Args:
        i_sim: Simulated impulse at each distance, above 0 (n,).
        expected: Impulse at each distance to which it should be proportional, above 0 (n,).

    Raises:
        BlastEnvError: If a number is not finite or out of bounds, or the lengths differ.
    """
    wanted = checked_array("expected", expected, above=0.0, dimensions=1)
    share = _checked_column("i_sim", i_sim, len(wanted), above=0.0) / wanted
    factor = share.sum() / (share @ share)  # the c with the least rms
    return float(100.0 * np.sqrt(np.mean((factor * share - 1.0) ** 2)))


def leave_one_out(
    distance_m: Numbers, i_sim: Numbers, i_reference: Numbers, fit: Fit
) -> LeaveOneOut:
    """Fit without each distance in turn and predict the impulse there.

    Args:
        distance_m: Distances, ascending (n,), at least three.
        i_sim: Simulated impulse at each distance, simulation units (n,).
        i_reference: Reference impulse at each distance, above 0 (n,).
        fit: One of the fits above.

    Raises:
        BlastEnvError: If a number is out of bounds, or no fit is possible with all distances or
            without one of them.
    """
    distance = _checked_distances(distance_m, least_count=3)
    simulated = _checked_column("i_sim", i_sim, len(distance), least=0.0)
    reference = _checked_column("i_reference", i_reference, len(distance), above=0.0)
    # 1. All distances once, so that their faults are named without "left out".
    fit(simulated, reference)  # warnings and errors of the fit to all distances
    laws = []
    with _quiet():
        for index, left_out_m in enumerate(distance):
            try:
                laws.append(fit(np.delete(simulated, index), np.delete(reference, index)))
            except BlastEnvError as error:
                raise BlastEnvError(f"without the distance {left_out_m:g} m: {error}") from error
    # 2. Each distance by the law that has not seen it.
    predicted = np.array([law(float(x)) for law, x in zip(laws, simulated, strict=True)])
    return LeaveOneOut(
        distance_m=distance,
        predicted=predicted,
        error_percent=100.0 * (predicted / reference - 1.0),
        laws=tuple(laws),
        metrics=fit_metrics(distance, predicted, reference),
    )


def bootstrap_coefficients(
    i_sim_by_seed: Numbers,
    i_reference: Numbers,
    fit: Fit,
    resamples: int = 2000,
    confidence: float = 0.95,
    rng_seed: int = 0,
) -> dict[str, Estimate]:
    """Return percentile intervals of a law's coefficients from the scatter between seeds.

    Whole seeds are drawn with replacement, which preserves the correlation between the distances
    of a seed, and the law is fitted to the means of each draw. The intervals show the dependence of
    the coefficients on the seeds, not the agreement with the reference (see `leave_one_out`). With
    fewer than about ten seeds they are too narrow.

    Args:
        i_sim_by_seed: Simulated impulses, simulation units (seeds, distances); at least two seeds.
        i_reference: Reference impulse at each distance, above 0 (distances,).
        fit: One of the fits above.
        resamples: Number of draws, at least 100.
        confidence: Confidence level of the interval, between 0 and 1.
        rng_seed: Seed of the draws; one seed gives one result.

    Returns:
        The interval of each coefficient by its name, as in `ScalingLaw.coefficients`.

    Raises:
        BlastEnvError: If an argument is out of bounds or a draw cannot be fitted.
    """
    simulated = checked_array("i_sim_by_seed", i_sim_by_seed, least=0.0, dimensions=2)
    seeds = len(simulated)
    if seeds < 2:
        raise BlastEnvError(f"i_sim_by_seed has {seeds} seeds, must have at least 2")
    if resamples < 100:
        raise BlastEnvError(f"resamples is {resamples}, must be at least 100")
    if not 0.0 < confidence < 1.0:
        raise BlastEnvError(f"confidence is {confidence:g}, must be between 0 and 1")
    reference = checked_array("i_reference", i_reference, above=0.0, dimensions=1)
    estimate = fit(simulated.mean(axis=0), reference).coefficients
    draws = np.random.default_rng(rng_seed).integers(seeds, size=(resamples, seeds))
    drawn = np.array([_coefficients(simulated[draw], reference, fit) for draw in draws])
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(drawn, (tail, 1.0 - tail), axis=0)
    return {
        name: Estimate(value, float(low[index]), float(high[index]))
        for index, (name, value) in enumerate(estimate.items())
    }


def _coefficients(simulated: FloatArray, reference: FloatArray, fit: Fit) -> list[float]:
    """Return the coefficients of one draw of seeds (seeds, distances)."""
    try:
        with _quiet():
            return list(fit(simulated.mean(axis=0), reference).coefficients.values())
    except BlastEnvError as error:
        raise BlastEnvError(
            f"a draw of {len(simulated)} seeds with replacement cannot be fitted: {error}"
        ) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the warning of inner fits, which the fit to all distances has issued."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FewDistancesWarning)
        yield


def _checked_distances(distance_m: Numbers, least_count: int = 2) -> FloatArray:
    """Check that distances ascend and return them (n,)."""
    distance = checked_array("distance_m", distance_m, least=0.0, dimensions=1)
    if len(distance) < least_count:
        raise BlastEnvError(
            f"distance_m has {len(distance)} values, must have at least {least_count}"
        )
    not_after = np.flatnonzero(np.diff(distance) <= 0.0)
    if len(not_after):
        index = int(not_after[0]) + 1
        before, here = distance[index - 1 : index + 1]
        fault = "repeated" if here == before else f"out of order after {before:g}"
        raise BlastEnvError(f"distance_m[{index}] is {here:g}, {fault}: must ascend")
    return distance


def _checked_column(
    name: str,
    values: Numbers,
    count: int,
    least: float | None = None,
    above: float | None = None,
) -> FloatArray:
    """Check that there is one number per distance and return them (count,)."""
    column = checked_array(name, values, least=least, above=above, dimensions=1)
    if len(column) != count:
        raise BlastEnvError(f"{name} has {len(column)} values, must have {count}: one per distance")
    return column
