"""The figures of a calibration and of a pressure history say what the numbers say."""

import numpy as np
import pytest

from blast_env import load_scenario, simulate
from blast_env.calibration import Friedlander
from blast_env.fitting.figure import calibration_figure
from blast_env.fitting.free_field import (
    CalibrationReport,
    FreeFieldStudy,
    calibrate,
    kingery_bulmash_reference,
)
from studies.particles.pressure.figure import PressureCase, pressure_figure
from studies.particles.pressure.pulses import facade_history

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


def test_a_pressure_figure_has_a_panel_a_distance_and_one_legend() -> None:
    results = [simulate(SMALL.at_stand_off(8.0), seed=seed, engine="event") for seed in (1, 2)]
    history = facade_history(results, "building", "left", 5e-4)
    wave = Friedlander.from_impulse(1e5, 0.01, 300.0, 0.01)
    case = PressureCase(8.0, history, wave, wave)
    figure = pressure_figure([case, case], "two panels")
    assert [axes.get_title() for axes in figure.axes] == ["8 m", "8 m"]
    assert {axes.get_xlabel() for axes in figure.axes} == {"time since the detonation (ms)"}
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 3
    drawn = np.asarray(figure.axes[0].lines[1].get_ydata(), dtype=float)
    assert np.nanmax(drawn) == pytest.approx(100.0, rel=0.01)  # kPa
