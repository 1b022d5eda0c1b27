"""Intervals of the surrogate: on made-up errors of which the coverage is known."""

import numpy as np
import pytest
from scipy.stats import norm

from blast_env.design.surrogate.fitting import folds
from blast_env.design.surrogate.intervals import COVERAGE, covered, interval_factor
from blast_env.errors import BlastEnvError

SITES = np.repeat(np.arange(2000), 3)


def normal_errors(seed: int = 0, scale: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Errors of a normal distribution with `scale` times the spread, and the spreads."""
    rng = np.random.default_rng(seed)
    spreads = rng.uniform(0.01, 0.1, len(SITES))
    return scale * spreads * rng.standard_normal(len(SITES)), spreads


def test_the_factor_is_the_quantile_of_the_errors_over_spreads() -> None:
    factor = interval_factor(*normal_errors(), SITES)
    assert factor == pytest.approx(2.0 * norm.ppf(0.5 + COVERAGE / 2.0), rel=0.05)


def test_new_sites_are_covered_as_often_as_wanted() -> None:
    errors, spreads = normal_errors(1)
    for coverage in (0.5, 0.8, 0.95):
        inside = covered(errors, spreads, SITES, folds(SITES, 5, 0), coverage)
        assert inside.mean() == pytest.approx(coverage, abs=0.02)


def test_a_site_of_many_loads_weighs_as_much_as_one_of_few() -> None:
    """One bad site of a thousand loads among 99 good ones of one load: 1 % of the sites."""
    sites = np.concatenate((np.arange(99), np.full(1000, 99)))
    errors = np.where(sites == 99, 1.0, 0.01)
    assert interval_factor(errors, np.full(len(sites), 0.1), sites) == pytest.approx(0.1)


def test_too_few_sites_are_refused() -> None:
    for count in (18, 19):
        sites = np.arange(count)
        if count == 19:
            assert interval_factor(np.ones(count), np.ones(count), sites) == 1.0
            continue
        with pytest.raises(BlastEnvError, match=r"18 sites are too few .* at least 19"):
            interval_factor(np.ones(count), np.ones(count), sites)
