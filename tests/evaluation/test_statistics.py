"""Means, reductions and tails against hand computations, bounds and known values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student_t

from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)

IMPULSES = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=40).map(np.array)
LEVELS = st.floats(0.0, 0.999)


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (0.0, 30.0),  # the mean
        (0.6, 45.0),  # the two worst
        (0.7, (50.0 + 0.5 * 40.0) / 1.5),  # one and a half
        (0.8, 50.0),  # the worst one
        (0.95, 50.0),  # a quarter of the worst one
    ],
)
def test_cvar_of_five_values_by_hand(level: float, expected: float) -> None:
    values = np.array([30.0, 10.0, 50.0, 20.0, 40.0])
    assert conditional_value_at_risk(values, level) == pytest.approx(expected)


@given(IMPULSES, LEVELS, LEVELS)
def test_cvar_lies_between_mean_and_maximum_and_grows_with_the_level(
    values: np.ndarray, one: float, other: float
) -> None:
    low, high = sorted((one, other))
    milder, harder = (conditional_value_at_risk(values, level) for level in (low, high))
    slack = 1e-9 * (values.max() + 1.0)
    assert values.mean() - slack <= milder <= harder + slack
    assert harder <= values.max() + slack


@pytest.mark.parametrize("level", [-0.1, 1.0, float("nan")])
def test_cvar_levels_out_of_bounds_are_refused(level: float) -> None:
    with pytest.raises(BlastEnvError, match=f"cvar_level is {level:g}, must be at least 0"):
        conditional_value_at_risk(np.ones(3), level)


def test_the_interval_of_a_mean_is_student_s() -> None:
    values = np.array([3.0, 1.0, 4.0, 1.0, 5.0])
    low, high = student_t.interval(0.95, 4, values.mean(), values.std(ddof=1) / np.sqrt(5))
    assert mean_estimate(values) == pytest.approx(Estimate(2.8, low, high))
    assert mean_estimate(values).scaled(10.0) == pytest.approx((28.0, 10 * low, 10 * high))


def test_a_reduction_is_that_of_the_sums_not_the_mean_of_the_ratios() -> None:
    """The second threat does next to nothing; that it doubles must not outweigh the first."""
    impulse, unprotected = np.array([50.0, 0.2]), np.array([100.0, 0.1])
    assert reduction_estimate(impulse, unprotected).value == pytest.approx(1.0 - 50.2 / 100.1)


@given(IMPULSES.filter(lambda values: values.mean() > 1e-3))
def test_a_barrier_that_changes_nothing_reduces_by_exactly_nothing(values: np.ndarray) -> None:
    estimate = reduction_estimate(values, values)
    assert estimate.value == 0.0
    if len(values) > 1:
        assert estimate == (0.0, 0.0, 0.0)


@given(st.lists(st.tuples(st.floats(1.0, 1e3), st.floats(0.0, 2.0)), min_size=2, max_size=30))
def test_reductions_do_not_depend_on_unit_or_order_and_lie_in_their_interval(
    pairs: list[tuple[float, float]],
) -> None:
    unprotected, share = np.array(pairs).T
    impulse = share * unprotected
    estimate = reduction_estimate(impulse, unprotected)
    assert estimate.low <= estimate.value <= estimate.high <= 1.0
    again = reduction_estimate(6894.757 * impulse[::-1], 6894.757 * unprotected[::-1])
    assert again == pytest.approx(estimate, rel=1e-9, abs=1e-9)


def coverage(
    share: float, noise: float, spread: float, threats: int, rng: np.random.Generator
) -> float:
    """Return how often the interval of synthetic loads covers the reduction 1 - share."""
    shape = (400, threats)
    unprotected = rng.lognormal(0.0, spread, shape)
    impulse = share * unprotected * rng.uniform(1.0 - noise, 1.0 + noise, shape)
    estimates = [reduction_estimate(*pair) for pair in zip(impulse, unprotected, strict=True)]
    return float(np.mean([e.low <= 1.0 - share <= e.high for e in estimates]))


@given(
    share=st.floats(0.1, 1.0),
    noise=st.floats(0.05, 1.0),
    spread=st.floats(0.05, 0.5),
    threats=st.integers(8, 32),
    seed=st.integers(0, 2**32 - 1),
)
def test_intervals_cover_a_known_reduction(
    share: float, noise: float, spread: float, threats: int, seed: int
) -> None:
    """The standard error of 400 repetitions is 0.011; skewed loads cost a little coverage."""
    assert coverage(share, noise, spread, threats, np.random.default_rng(seed)) >= 0.88


def test_intervals_are_not_wider_than_they_say() -> None:
    """Intervals that always cover would pass the test above; 95 % ones must miss at times."""
    covered = [coverage(0.4, 0.8, 0.3, 16, np.random.default_rng(seed)) for seed in range(10)]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


def test_pairing_makes_the_interval_narrower() -> None:
    """What a threat does to both sides of its pair says nothing about the barrier."""
    rng = np.random.default_rng(0)
    unprotected = rng.lognormal(0.0, 0.5, 16)
    impulse = 0.4 * unprotected
    paired, mixed = (
        reduction_estimate(values, unprotected) for values in (impulse, rng.permutation(impulse))
    )
    assert paired.high - paired.low < 1e-9
    assert mixed.high - mixed.low > 0.1


def test_one_threat_has_no_interval_and_no_load_no_reduction() -> None:
    single = reduction_estimate(np.array([1.0]), np.array([4.0]))
    assert single.value == 0.75
    assert np.isnan([single.low, single.high]).all()
    assert np.isnan(reduction_estimate(np.zeros(3), np.zeros(3))).all()
