"""The figure of a calibration says what the numbers say."""

import numpy as np
import pytest

from blast_env import load_scenario
from blast_env.particles.calibration.free_field import (
    CalibrationReport,
    FreeFieldStudy,
    calibrate,
    kingery_bulmash_reference,
)
from blast_env.plots.calibration_figures import calibration_figure

SMALL = load_scenario("free_field").with_simulation(
    overrides={"explosive": {"ball_count": 180}, "stepping": {"time_limit_s": 0.12}}
)


@pytest.fixture(scope="module")
def report() -> CalibrationReport:
    study = FreeFieldStudy(SMALL, (8.0, 11.0, 15.0, 20.0), (1, 2, 3), "event")
    return calibrate(study, study.run(), kingery_bulmash_reference(study.distances_m, 100.0))


def test_a_calibration_figure_draws_means_laws_and_residuals(report: CalibrationReport) -> None:
    figure = calibration_figure(report, "small")
    simulated, scaled, in_pa_s, residuals = figure.axes
    assert "simulation units" in simulated.get_ylabel()
    means = simulated.lines[0]
    assert np.asarray(means.get_ydata()) == pytest.approx(report.summary.i_sim.to_numpy())
    assert scaled.get_ylabel() == "impulse (psi·s)"
    assert in_pa_s.get_ylabel() == "impulse (Pa·s)"
    assert in_pa_s.get_ylim()[0] == pytest.approx(6894.757 * scaled.get_ylim()[0])
    legend = scaled.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert f"power: MAPE {report.metrics['power'].mape_percent:.1f} %" in texts
    power = np.asarray(residuals.lines[2].get_ydata())
    assert power == pytest.approx(report.table().power_error_percent.to_numpy())
