"""What blasts tell of guesses for layouts that are alike, and intervals with known coverage."""

import numpy as np
import pytest
from scipy.stats import norm

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.surrogate import COVERAGE, Correction, covered, folds, interval_factor, stacked
from blast_env.surrogate import apart_m3 as apart_from_all_m3

NOTHING = np.empty((0, 5))


def walls(*lefts_m: float, height_m: float = 2.0) -> FloatArray:
    """Return walls of 3 m by 0.5 m that begin so far from the left border."""
    return np.array([[left, 0.0, left + 3.0, 0.5, height_m] for left in lefts_m]).reshape(-1, 5)


def apart_m3(one: FloatArray, other: FloatArray) -> float:
    """Return the volume that only one of two barriers fills; the other is met among more."""
    _, own, _ = apart_from_all_m3(one, stacked([NOTHING, other, walls(1.0, 5.0, 9.0)]))
    return float(own)


def test_the_volume_that_only_one_of_two_barriers_fills() -> None:
    one = walls(0.0, 10.0)
    assert apart_m3(one, one) == 0.0
    assert apart_m3(one, NOTHING) == apart_m3(NOTHING, one) == pytest.approx(6.0)
    assert apart_m3(one, walls(0.5, 10.0)) == pytest.approx(2 * 0.5 * 0.5 * 2.0)
    assert apart_m3(one, walls(0.0, 10.0, height_m=3.0)) == pytest.approx(3.0)
    assert apart_m3(one, walls(20.0)) == apart_m3(walls(20.0), one) == pytest.approx(9.0)
    assert apart_m3(NOTHING, NOTHING) == 0.0


def test_layouts_that_are_alike_are_off_alike() -> None:
    """Guesses were right of walls on the left, and by a fifth too low for walls on the right."""
    met = [walls(0.0), walls(1.0), walls(20.0), walls(21.0)]
    correction = Correction.of(met, np.array([0.0, 0.0, 0.2, 0.2]))
    mean, spread = correction.expected([*met, walls(0.5), walls(20.5), walls(100.0)])
    assert mean[:4] == pytest.approx([0.0, 0.0, 0.2, 0.2], abs=0.02)
    assert mean[4] < 0.03
    assert mean[5] > 0.17
    assert mean[6] == pytest.approx(0.1, abs=0.02)  # as the others on the mean
    assert spread[6] == pytest.approx(0.1, rel=0.05)
    assert (spread[:4] < 0.3 * spread[6]).all()
    assert (spread[4:6] < 0.6 * spread[6]).all()


def test_one_blast_on_the_empty_site_tells_what_it_was_off_by() -> None:
    correction = Correction.of([NOTHING], np.array([-0.3]))
    mean, spread = correction.expected([NOTHING, walls(2.0)])
    assert mean == pytest.approx([-0.3, -0.3])
    assert 0.0 < spread[0] < spread[1]


# --- Intervals of the surrogate: on made-up errors of which the coverage is known.


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
