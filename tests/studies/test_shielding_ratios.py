"""How shares of the free field's load are reckoned."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.statistics import Estimate
from blast_env.studies.shielding.ratios import fit_log_quadratic
from blast_env.studies.shielding.report import ShieldingReport, scaled_ratio
from tests.studies.shielding_cases import NARROW, made_up

# The ratios


def test_equal_shares_at_all_gauges_are_the_ratio() -> None:
    report = made_up(0.4)
    for estimate in (
        report.one_corner,
        report.ratio("one_corner_near"),
        report.ratio("one_corner_far"),
        report.two_corners,
        report.ratio("one_corner", "impulse"),
    ):
        assert estimate == pytest.approx((0.4, 0.4, 0.4), rel=1e-6)
    assert report.gauges.ratio.to_numpy() == pytest.approx(0.4, rel=1e-6)
    assert report.free_field_slope.value == pytest.approx(-1.0, rel=1e-6)
    assert -0.97 < report.reference_slope < -0.85  # Kingery and Bulmash's, 8 to 25 m


def test_thirds_and_faces_are_the_gauges_that_their_names_say() -> None:
    even = made_up(1.0, seeds=1)
    shares = np.concatenate((np.full(8, 0.2), np.full(7, 0.5), np.full(8, 0.8), np.full(12, 0.3)))
    report = ShieldingReport(even.study, even.block * shares, even.wall)
    assert report.ratio("one_corner_near").value == pytest.approx(0.2, rel=1e-6)
    assert report.ratio("one_corner_far").value == pytest.approx(0.8, rel=1e-6)
    assert report.two_corners.value == pytest.approx(0.3, rel=1e-6)
    assert 0.4 < report.one_corner.value < 0.5  # farther gauges have less of the free field


def test_the_module_in_the_middle_of_the_back_counts_once() -> None:
    even = made_up(1.0, seeds=1)
    only_middle = np.zeros_like(NARROW.gauge_path_m)
    only_middle[-1] = 1.0
    ratio = ShieldingReport(even.study, even.block * only_middle, even.wall).two_corners
    whole = 2.0 * (1.0 / NARROW.back_path_m[:-1]).sum() + 1.0 / NARROW.back_path_m[-1]
    assert ratio.value == pytest.approx(1.0 / NARROW.back_path_m[-1] / whole, rel=1e-6)


def test_the_interval_covers_what_seeds_differ_by() -> None:
    even = made_up(0.5, seeds=8)
    share = np.linspace(0.5, 1.5, 8)[:, None, None]  # of each seed's load on the block
    estimate = ShieldingReport(
        even.study, even.block / np.arange(1.0, 9.0)[:, None, None] * share, np.ones_like(even.wall)
    ).one_corner
    assert estimate.low < 0.9 * estimate.value
    assert estimate.high > 1.1 * estimate.value


def test_one_seed_has_no_interval() -> None:
    value, low, high = made_up(0.4, seeds=1).two_corners
    assert value == pytest.approx(0.4, rel=1e-6)
    assert np.isnan([low, high]).all()


@given(ratio=st.floats(0.01, 2.0), exponent=st.floats(0.2, 3.0))
def test_a_scaled_ratio_is_the_ratio_to_the_power_of_the_exponent(
    ratio: float, exponent: float
) -> None:
    scaled = scaled_ratio(Estimate(ratio, 0.9 * ratio, 1.2 * ratio), exponent)
    assert scaled == pytest.approx(
        (ratio**exponent, (0.9 * ratio) ** exponent, (1.2 * ratio) ** exponent)
    )
    assert scaled.low < scaled.value < scaled.high


def test_the_summary_has_scaled_ratios_only_with_an_exponent() -> None:
    report = made_up(0.4)
    assert "scaled" not in report.summary()
    table = report.summary(1.3).set_index(["load", "region"])
    assert table.scaled.to_numpy() == pytest.approx(0.4**1.3, rel=1e-6)
    experiment = table.loc["transferred_impulse"]
    assert experiment.experiment["one_corner"] == 0.57
    assert experiment.experiment["two_corners"] == 0.49
    assert np.isnan(experiment.experiment["one_corner_near"])


# The free-field curve


@given(slope=st.floats(-3.0, 3.0), bend=st.floats(-1.0, 1.0), level=st.floats(1e-3, 1e6))
def test_the_curve_finds_a_quadratic_in_the_logarithms(
    slope: float, bend: float, level: float
) -> None:
    path_m = np.linspace(6.0, 30.0, 40)
    u = np.log(path_m / 12.0)
    load = level * np.exp(slope * u + bend * u * u)
    assert fit_log_quadratic(path_m, load)(path_m) == pytest.approx(load, rel=1e-6)


def test_the_curve_takes_modules_that_nothing_hit_and_keeps_the_sum() -> None:
    path_m = np.linspace(6.0, 30.0, 40)
    load = np.random.default_rng(3).poisson(0.05 * path_m, size=(5, 40)).astype(float)
    assert (load == 0.0).any()
    fitted = fit_log_quadratic(path_m, load)(path_m)
    assert fitted.sum(axis=1) == pytest.approx(load.sum(axis=1), rel=1e-6)
    # Each curve is fitted for itself.
    assert fit_log_quadratic(path_m, load[2])(path_m) == pytest.approx(fitted[2])


@pytest.mark.parametrize("exponent", [0.0, -1.0, float("nan"), float("inf")])
def test_an_exponent_that_is_none_is_refused(exponent: float) -> None:
    with pytest.raises(BlastEnvError, match="exponent is"):
        made_up(0.4).summary(exponent)
