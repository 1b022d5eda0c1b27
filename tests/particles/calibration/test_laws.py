"""Laws from simulated to reference impulse, measures of agreement, the Friedlander waveform."""

import re
import warnings
from math import exp, inf, nan

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from blast_env.calibration import (
    FewDistancesWarning,
    Friedlander,
    LinearLaw,
    PowerLaw,
    ProportionalLaw,
    ScalingLaw,
    bootstrap_coefficients,
    fit_linear,
    fit_metrics,
    fit_power_law,
    fit_proportional,
    kingery_bulmash,
    leave_one_out,
    paper_table,
    shape_rms_percent,
)
from blast_env.errors import BlastEnvError
from blast_env.particles.calibration import Fit

FITS = (fit_proportional, fit_linear, fit_power_law)
LAWS = (ProportionalLaw(4.27e-5), LinearLaw(-0.017, 4.39e-5), PowerLaw(1.24e-4, 0.881))
I_SIM = [100.0, 300.0, 500.0, 900.0]
I_REFERENCE = [0.1, 0.2, 0.4, 0.5]

impulses = st.lists(st.floats(1.0, 1e5), min_size=4, max_size=12, unique=True)


def paper_columns() -> tuple[pd.Series, pd.Series]:
    table = paper_table()
    return table["i_sim"], table["i_ufc_psi_s"]


def test_the_paper_s_columns_give_the_known_coefficients() -> None:
    """Known from the tables themselves; k is not the 4.343e-5 of the paper's text."""
    proportional, linear, power = (fit(*paper_columns()) for fit in FITS)
    assert proportional.coefficients == pytest.approx({"k": 4.2707e-5}, rel=1e-5)
    assert linear.coefficients == pytest.approx({"a": -0.016963, "b": 4.3916e-5}, rel=1e-5)
    assert power.coefficients == pytest.approx({"A": 1.2413e-4, "B": 0.88133}, rel=2e-5)


@given(impulses, st.data())
def test_the_line_is_that_of_equation_8_as_printed(x: list[float], data: st.DataObject) -> None:
    y = data.draw(st.lists(st.floats(0.1, 10.0), min_size=len(x), max_size=len(x)))
    if np.ptp(x) < 1e-3 * max(x):
        return  # the printed form loses all digits there
    law = fit_linear(x, y)
    n, sx, sy = len(x), np.sum(x), np.sum(y)
    b = (n * np.dot(x, y) - sx * sy) / (n * np.dot(x, x) - sx**2)
    scale = max(y) / np.ptp(x)
    assert law.b == pytest.approx(b, rel=1e-6, abs=1e-6 * scale)
    assert law.a == pytest.approx((sy - b * sx) / n, rel=1e-6, abs=1e-6 * scale * max(x))


@given(impulses)
def test_a_fit_finds_the_law_that_made_the_numbers(x: list[float]) -> None:
    if np.ptp(x) < 1e-3 * max(x):
        return
    for fit, law in zip(FITS, (LAWS[0], LinearLaw(0.3, 4.39e-5), LAWS[2]), strict=True):
        found = fit(x, law(x))
        assert found(x) == pytest.approx(law(x), rel=1e-9)
        assert type(found) is type(law)


@pytest.mark.parametrize("law", LAWS)
@given(i_sim=st.floats(1e-3, 1e6))
def test_the_inverse_undoes_the_law(law: ScalingLaw, i_sim: float) -> None:
    assert law.inverse(law(i_sim)) == pytest.approx(i_sim, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_numbers_stay_numbers_and_arrays_keep_their_shape(law: ScalingLaw) -> None:
    grid = np.array([[1.0, 2.0, 3.0], [0.0, 5.0, 6.0]])
    converted = law(grid)
    assert converted.shape == grid.shape
    assert type(law(5.0)) is float
    assert law(5.0) == converted[1, 1]
    assert law(pd.Series([5.0, 6.0])).tolist() == converted[1, 1:].tolist()
    assert type(law.inverse(0.5)) is float
    assert law.inverse(converted) == pytest.approx(grid)


@pytest.mark.parametrize("law", LAWS)
def test_negative_impulses_and_what_is_no_number_are_refused(law: ScalingLaw) -> None:
    with pytest.raises(BlastEnvError, match="i_sim is -1, must be at least 0"):
        law(-1.0)
    with pytest.raises(BlastEnvError, match=r"i_sim\[1, 0\] is -2, must be at least 0"):
        law(np.array([[1.0, 2.0], [-2.0, 4.0]]))
    with pytest.raises(BlastEnvError, match=r"i_sim\[1\] is nan, must be a finite number"):
        law([1.0, float("nan")])
    with pytest.raises(BlastEnvError, match="i_sim must be made of numbers"):
        law("much")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("law", "reference"),
    [(LAWS[0], -0.1), (LAWS[1], -0.018), (LAWS[2], -0.1), (PowerLaw(1.0, -1.0), 0.0)],
)
def test_a_reference_out_of_reach_has_no_inverse(law: ScalingLaw, reference: float) -> None:
    with pytest.raises(BlastEnvError, match=r"i_reference\[1\] is .* no i_sim of at least 0"):
        law.inverse([0.5, reference])


@pytest.mark.parametrize("law", [LinearLaw(0.3, 0.0), PowerLaw(0.3, 0.0), ProportionalLaw(0.0)])
def test_a_constant_has_no_inverse(law: ScalingLaw) -> None:
    with pytest.raises(BlastEnvError, match=r"no inverse: [kbB] is 0"):
        law.inverse(0.3)


def test_a_falling_power_law_refuses_zero() -> None:
    with pytest.raises(BlastEnvError, match="i_sim is 0, must be above 0"):
        PowerLaw(1.0, -0.5)(0.0)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize(
    ("i_sim", "i_reference", "message"),
    [
        ([], [], "i_sim is empty"),
        ([7.0, 7.0, 7.0, 7.0], I_REFERENCE, r"i_sim is 7 at every distance \(4\)"),
        ([1.0, float("nan"), 3.0, 4.0], I_REFERENCE, r"i_sim\[1\] is nan"),
        ([1.0, 2.0, -3.0, 4.0], I_REFERENCE, r"i_sim\[2\] is -3, must be at least 0"),
        (I_SIM, [0.1, 0.2, 0.0, 0.4], r"i_reference\[2\] is 0, must be above 0"),
        (I_SIM, I_REFERENCE[:3], "i_sim has 4 values and i_reference 3"),
    ],
)
def test_bad_input_is_named(
    fit: Fit, i_sim: list[float], i_reference: list[float], message: str
) -> None:
    with pytest.raises(BlastEnvError, match=message):
        fit(i_sim, i_reference)


@pytest.mark.parametrize("fit", FITS)
def test_fewer_than_four_distances_warn_where_the_fit_is_called(fit: Fit) -> None:
    with pytest.warns(FewDistancesWarning, match="3 distances, should be at least 4") as caught:
        fit(I_SIM[:3], I_REFERENCE[:3])
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(I_SIM, I_REFERENCE)


# --- Measures of agreement, errors at unseen distances, intervals of the coefficients.


DISTANCE_M = [10.0, 20.0, 40.0, 50.0]
LAW = PowerLaw(1.24e-4, 0.881)


def seed_impulses(seeds: int, scatter: float) -> np.ndarray:
    """Return impulses (seeds, 8) that scatter around the paper's."""
    noise = np.random.default_rng(5).uniform(1.0 - scatter, 1.0 + scatter, (seeds, 8))
    return paper_table()["i_sim"].to_numpy() * noise


def test_the_measures_of_a_case_worked_out_by_hand() -> None:
    """Errors +1, -1, 0, +2; areas of 15 + 50 + 40 predicted and 15 + 60 + 30."""
    reference = [1.0, 2.0, 4.0, 2.0]
    predicted = [2.0, 1.0, 4.0, 4.0]
    metrics = fit_metrics(DISTANCE_M, predicted, reference)
    assert metrics.mape_percent == pytest.approx(100.0 * (1.0 + 0.5 + 0.0 + 1.0) / 4.0)
    assert metrics.rmse == pytest.approx(np.sqrt(6.0 / 4.0))
    assert metrics.integral_error_percent == pytest.approx(0.0)
    lower = fit_metrics(DISTANCE_M, [2.0, 1.0, 4.0, 2.0], reference)
    assert lower.integral_error_percent == pytest.approx(100.0 * 10.0 / 105.0)


@pytest.mark.parametrize(
    ("distance_m", "predicted", "reference", "message"),
    [
        ([10.0, 20.0, 20.0], [1.0] * 3, [1.0] * 3, "distance_m[2] is 20, repeated"),
        ([10.0, 30.0, 20.0], [1.0] * 3, [1.0] * 3, "distance_m[2] is 20, out of order after 30"),
        ([10.0], [1.0], [1.0], "distance_m has 1 values, must have at least 2"),
        ([10.0, 20.0], [1.0] * 3, [1.0] * 2, "predicted has 3 values, must have 2"),
        ([10.0, 20.0], [1.0] * 2, [1.0, 0.0], "reference[1] is 0, must be above 0"),
    ],
)
def test_bad_input_of_the_measures_is_named(
    distance_m: list[float], predicted: list[float], reference: list[float], message: str
) -> None:
    with pytest.raises(BlastEnvError, match=re.escape(message)):
        fit_metrics(distance_m, predicted, reference)


def test_each_distance_is_predicted_by_the_law_of_the_others() -> None:
    table = paper_table()
    left_out = leave_one_out(table["r_m"], table["i_sim"], table["i_ufc_psi_s"], fit_linear)
    others = table[table["r_m"] != 45.0]
    law = fit_linear(others["i_sim"], others["i_ufc_psi_s"])
    i_sim, i_reference = (float(table[name].iloc[2]) for name in ("i_sim", "i_ufc_psi_s"))
    assert left_out.laws[2] == law
    assert left_out.predicted[2] == law(i_sim)
    assert left_out.error_percent[2] == pytest.approx(100.0 * (law(i_sim) / i_reference - 1.0))
    assert left_out.metrics == fit_metrics(table["r_m"], left_out.predicted, table["i_ufc_psi_s"])


def test_the_distance_without_which_nothing_can_be_fitted_is_named() -> None:
    with pytest.raises(BlastEnvError, match="without the distance 40 m: i_sim is 5 at every"):
        leave_one_out(DISTANCE_M, [5.0, 5.0, 9.0, 5.0], [0.1] * 4, fit_linear)
    with pytest.raises(BlastEnvError, match="distance_m has 2 values, must have at least 3"):
        leave_one_out([1.0, 2.0], [1.0, 2.0], [1.0, 2.0], fit_linear)


def test_an_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    """80 % intervals of k from 12 seeds, 100 times: 65 to 92 hits lie within 3.5 sigma."""
    truth, rng = np.array([900.0, 500.0, 200.0, 90.0]), np.random.default_rng(3)
    covered = 0
    for _ in range(100):
        by_seed = truth * rng.uniform(0.7, 1.3, (12, 4))
        interval = bootstrap_coefficients(
            by_seed, 1e-4 * truth, fit_proportional, resamples=100, confidence=0.8
        )["k"]
        covered += interval.low <= 1e-4 <= interval.high
    assert 65 <= covered <= 92


def test_more_confidence_is_a_wider_interval_and_one_seed_one_result() -> None:
    reference = paper_table()["i_ufc_psi_s"]
    by_seed = seed_impulses(10, 0.2)

    def interval(confidence: float, rng_seed: int = 0) -> tuple[float, float]:
        found = bootstrap_coefficients(
            by_seed, reference, fit_proportional, 200, confidence, rng_seed
        )
        return found["k"].low, found["k"].high

    assert interval(0.99)[0] < interval(0.5)[0] < interval(0.5)[1] < interval(0.99)[1]
    assert interval(0.9) == interval(0.9)
    assert interval(0.9) != interval(0.9, rng_seed=1)


def test_seeds_are_drawn_as_a_whole() -> None:
    """Seeds that differ by a common factor alone leave the exponent exactly as it is."""
    i_sim = paper_table()["i_sim"].to_numpy()
    by_seed = i_sim * np.array([0.7, 0.9, 1.0, 1.3])[:, None]
    intervals = bootstrap_coefficients(by_seed, LAW(i_sim), fit_power_law, resamples=100)
    assert intervals["B"].high - intervals["B"].low < 1e-12
    assert intervals["A"].high > 1.1 * intervals["A"].low


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"i_sim_by_seed": np.ones((1, 4))}, "has 1 seeds, must have at least 2"),
        ({"resamples": 99}, "resamples is 99, must be at least 100"),
        (
            {"i_sim_by_seed": np.array([[1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 4.0]])},
            r"a draw of 2 seeds with replacement cannot be fitted: i_sim\[3\] is 0",
        ),
    ],
)
def test_bad_input_of_the_bootstrap_is_named(changes: dict[str, object], message: str) -> None:
    by_seed = np.array([[1.0, 2.0, 3.0, 4.0], [2.0, 3.0, 4.0, 6.0]])
    arguments = {"i_sim_by_seed": by_seed, "i_reference": np.array([1.0, 2.0, 3.0, 4.0])}
    with pytest.raises(BlastEnvError, match=message):
        bootstrap_coefficients(fit=fit_power_law, **(arguments | changes))  # type: ignore[arg-type]


def test_the_shape_error_forgets_a_common_factor() -> None:
    expected = np.array([5.0, 3.0, 2.0])
    assert shape_rms_percent(1e4 * expected, expected) == pytest.approx(0.0, abs=1e-9)
    # Shares 1 and 3: the best factor is 4 / 10, which leaves -0.6 and 0.2.
    assert shape_rms_percent([1.0, 3.0], [1.0, 1.0]) == pytest.approx(100.0 * np.sqrt(0.2))
    with pytest.raises(BlastEnvError, match=r"i_sim\[1\] is 0"):
        shape_rms_percent([1.0, 0.0], [1.0, 1.0])


# --- The Friedlander waveform: equation 1, equation 2, and the limit where it is a triangle.


peaks = st.floats(1e2, 1e8)
durations = st.floats(1e-4, 1.0)
decays = st.floats(0.0, 200.0)


def test_the_waveform_is_equation_1() -> None:
    wave = Friedlander(peak=200e3, positive_duration_s=0.01, decay=1.5, arrival_s=0.03)
    assert wave.pressure(0.03) == 200e3
    assert wave.pressure(0.034) == pytest.approx(200e3 * 0.6 * exp(-0.6))
    times_s = [0.0, 0.0299, 0.04, 0.05]
    assert wave.pressure(times_s).tolist() == [0.0, 0.0, 0.0, 0.0]
    assert type(wave.pressure(0.034)) is float
    with pytest.raises(BlastEnvError, match="positive_duration_s is inf"):
        Friedlander(1e5, inf, 1.0)


@given(peaks, durations, st.floats(1e-6, 0.499))
def test_peak_duration_and_impulse_come_back(peak: float, duration_s: float, share: float) -> None:
    impulse = share * peak * duration_s
    wave = Friedlander.from_impulse(peak, duration_s, impulse, arrival_s=0.02)
    assert (wave.peak, wave.positive_duration_s, wave.arrival_s) == (peak, duration_s, 0.02)
    assert wave.impulse() == pytest.approx(impulse, rel=1e-12)
    assert wave.decay > 0.0
    assert not wave.is_triangular


@given(peaks, durations, st.floats(0.5, 100.0))
def test_without_a_solution_it_is_the_triangle_of_the_same_peak_and_impulse(
    peak: float, duration_s: float, share: float
) -> None:
    impulse = share * peak * duration_s
    wave = Friedlander.from_impulse(peak, duration_s, impulse)
    if impulse / peak / duration_s < 0.5:
        return  # rounding put it on the other side
    assert wave.is_triangular
    assert wave.peak == peak
    assert wave.impulse() == pytest.approx(impulse, rel=1e-12)
    assert wave.pressure(wave.positive_duration_s / 2.0) == pytest.approx(peak / 2.0)
    assert wave.positive_duration_s >= duration_s * (1.0 - 1e-12)


def test_the_triangle_is_the_limit_of_the_waveforms() -> None:
    below = Friedlander.from_impulse(1e5, 0.01, 500.0 * (1.0 - 1e-9))
    limit = Friedlander.from_impulse(1e5, 0.01, 500.0)
    assert not below.is_triangular
    assert limit.is_triangular
    times_s = np.linspace(0.0, 0.01, 50)
    assert below.pressure(times_s) == pytest.approx(limit.pressure(times_s), rel=1e-7, abs=1e-3)


@given(durations, decays, st.floats(0.0, 1.5))
def test_the_impulse_comes_over_time(duration_s: float, decay: float, x: float) -> None:
    wave = Friedlander(2e5, duration_s, decay, arrival_s=0.1)
    until_s = 0.1 + x * duration_s
    end_s = min(until_s, 0.1 + duration_s)
    knee_s = min(0.1 + duration_s / max(decay, 1.0), end_s)
    parts = [quad(wave.pressure, *ends)[0] for ends in ((0.1, knee_s), (knee_s, end_s))]
    assert wave.impulse_until(until_s) == pytest.approx(sum(parts), rel=1e-7, abs=1e-6)
    assert wave.impulse_until([0.0, 0.1]).tolist() == [0.0, 0.0]
    assert type(wave.impulse_until(until_s)) is float
    assert wave.impulse_until(0.1 + 2.0 * duration_s) == pytest.approx(wave.impulse(), rel=1e-12)


def test_kingery_and_bulmash_s_curves_make_waveforms() -> None:
    """Over the whole range of the reflected wave from the ground the decay exists and is sane."""
    for distance_m in np.geomspace(1.0, 180.0, 40):
        peak, duration_s, impulse = (
            kingery_bulmash(quantity, float(distance_m), 100.0)
            for quantity in ("reflected_overpressure", "positive_duration", "reflected_impulse")
        )
        wave = Friedlander.from_impulse(peak, duration_s, impulse)
        assert 0.0 < wave.decay < 100.0
        assert wave.impulse() == pytest.approx(impulse, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, 0.01, 1.0), "peak is 0, must be above 0"),
        ((1e5, -0.01, 1.0), "positive_duration_s is -0.01, must be above 0"),
        ((1e5, 0.01, nan), "impulse is nan, must be a finite number"),
        ((1e5, 0.01, 0.0), "impulse is 0, must be above 0"),
        ((1e300, 1.0, 1e-300), "impulse is 1e-300, which is too small a share"),
        ((1e5, 0.01, 100.0, -1.0), "arrival_s is -1, must be at least 0"),
    ],
)
def test_bad_waves_are_refused(arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        Friedlander.from_impulse(*arguments)
