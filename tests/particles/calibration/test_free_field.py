"""The free-field study: resumable, parallel, summed up with intervals."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from blast_env import load_scenario, simulate
from blast_env.errors import BlastEnvError
from blast_env.particles.calibration import (
    CalibrationReport,
    FreeFieldStudy,
    calibrate,
    impulse_by_seed,
    kingery_bulmash_reference,
    summarise,
)
from blast_env.particles.calibration import free_field as study_module
from blast_env.plots import calibration_figure
from blast_env.store import Store

SMALL = load_scenario("free_field").with_simulation(
    overrides={"explosive": {"ball_count": 120}, "stepping": {"time_limit_s": 0.1}}
)
STUDY = FreeFieldStudy(SMALL, (8.0, 12.0), (5, 6, 7))


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    """What the study finds; not to be changed."""
    return STUDY.run()


def test_every_run_is_the_blast_of_its_distance_and_seed(runs: pd.DataFrame) -> None:
    assert runs[["distance_m", "seed"]].to_numpy().tolist() == [
        [d, s] for d in (8.0, 12.0) for s in (5, 6, 7)
    ]
    expected = simulate(SMALL.at_stand_off(12.0), seed=6, engine="pymunk")
    (row,) = runs[(runs.distance_m == 12.0) & (runs.seed == 6)].itertuples()
    assert row.impulse_sim == expected.impulse_sim("building")
    assert row.transferred_impulse_sim == expected.obstacle("building").transferred_impulse
    assert row.first_hit_s == expected.collisions.time_s.min()


def test_two_processes_give_the_same_table(runs: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(STUDY.run(processes=2), runs, check_exact=True)


def test_an_interrupted_study_goes_on_without_repeating(
    runs: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, run_one = tmp_path / "runs.sqlite", study_module._run_one
    ran: list[tuple[float, int]] = []

    def counted(job: tuple) -> object:
        _, _, distance_m, seed, _ = job
        if len(ran) == 4:
            raise KeyboardInterrupt
        ran.append((distance_m, seed))
        return run_one(job)

    monkeypatch.setattr(study_module, "_run_one", counted)
    with pytest.raises(KeyboardInterrupt):
        STUDY.run(store=store)
    assert len(Store(store)) == 4
    first, ran[:] = list(ran), []
    pd.testing.assert_frame_equal(STUDY.run(store=store), runs, check_exact=True)
    assert len(ran) == 2
    assert not set(ran) & set(first)
    ran.clear()
    shares: list[float] = []
    STUDY.run(store=store, progress=shares.append)
    assert ran == []


def test_runs_of_other_parameters_are_not_believed(tmp_path: Path) -> None:
    store = tmp_path / "runs.sqlite"
    FreeFieldStudy(SMALL, (8.0,), (5,)).run(store=store)
    heavier = SMALL.with_simulation(overrides={"air": {"mass": 0.5}})
    other = FreeFieldStudy(heavier, (8.0,), (5,)).run(store=store)
    assert len(Store(store)) == 2
    expected = simulate(heavier.at_stand_off(8.0), seed=5, engine="pymunk").impulse_sim("building")
    assert other.impulse_sim.tolist() == [expected]


def test_the_summary_has_means_and_student_intervals(runs: pd.DataFrame) -> None:
    table = summarise(runs)
    values = runs[runs.distance_m == 8.0].impulse_sim.to_numpy()
    assert table.i_sim[0] == pytest.approx(values.mean())
    low, high = stats.t.interval(0.95, 2, values.mean(), stats.sem(values))
    assert table.ci95[0] == pytest.approx((high - low) / 2)
    assert table.seeds.tolist() == [3, 3]
    assert impulse_by_seed(runs).mean(axis=0) == pytest.approx(table.i_sim.to_numpy())


@pytest.mark.parametrize(
    ("distances", "seeds", "words"),
    [
        ((8.0, 8.0), (1,), "8 m follows 8 m"),
        ((12.0, 8.0), (1,), "8 m follows 12 m"),
        ((), (1,), "distances"),
        ((8.0,), (), "seeds"),
        ((8.0,), (1, 1), "seeds"),
    ],
)
def test_bad_studies_are_refused(
    distances: tuple[float, ...], seeds: tuple[int, ...], words: str
) -> None:
    with pytest.raises(BlastEnvError, match=words):
        FreeFieldStudy(SMALL, distances, seeds)


@pytest.fixture(scope="module")
def report() -> CalibrationReport:
    scenario = load_scenario("free_field").with_simulation(
        overrides={"explosive": {"ball_count": 180}, "stepping": {"time_limit_s": 0.12}}
    )
    study = FreeFieldStudy(scenario, (8.0, 11.0, 15.0, 20.0), (1, 2, 3), "event")
    return calibrate(study, study.run(), kingery_bulmash_reference(study.distances_m, 100.0))


def test_a_calibration_converts_the_runs_it_was_made_of(report: CalibrationReport) -> None:
    stored = report.calibration("small")
    stored.check(report.study.scenario.parameters, "event")
    row = report.table().iloc[1]
    converted = stored.convert(row.i_sim, stored.facade_width_m, 11.0, 100.0)
    assert converted.psi_s == pytest.approx(row.power_psi_s)
    assert converted.in_range


def test_a_calibration_figure_draws_means_laws_and_residuals(report: CalibrationReport) -> None:
    simulated, scaled, in_pa_s, residuals = calibration_figure(report, "small").axes
    means = np.asarray(simulated.lines[0].get_ydata())
    assert means == pytest.approx(report.summary.i_sim.to_numpy())
    assert scaled.get_ylabel() == "impulse (psi·s)"
    assert in_pa_s.get_ylabel() == "impulse (Pa·s)"
    assert in_pa_s.get_ylim()[0] == pytest.approx(6894.757 * scaled.get_ylim()[0])
    legend = scaled.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert f"power: MAPE {report.metrics['power'].mape_percent:.1f} %" in texts
    power = np.asarray(residuals.lines[2].get_ydata())
    assert power == pytest.approx(report.table().power_error_percent.to_numpy())
