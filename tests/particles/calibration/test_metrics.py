"""Measures of agreement, errors at unseen distances, intervals of the coefficients."""

import re

import numpy as np
import pytest

from blast_env.calibration import (
    PowerLaw,
    bootstrap_coefficients,
    fit_linear,
    fit_metrics,
    fit_power_law,
    fit_proportional,
    leave_one_out,
    paper_table,
    shape_rms_percent,
)
from blast_env.errors import BlastEnvError

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
def test_bad_input_is_named(
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
