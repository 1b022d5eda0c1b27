"""The benchmark, and pytest-benchmark's view of the parts (`pytest --benchmark-enable`)."""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from blast_env import Blast, load_scenario
from blast_env.engines.particles import PymunkEngine
from blast_env.errors import BlastEnvError
from blast_env.physics.pymunk.space import build_space
from blast_env.scenario.build_scene import build_scene
from blast_env.studies.benchmark import engines, parallel
from blast_env.studies.benchmark.engines import (
    BenchmarkScene,
    dense_courtyard,
    measure_engines,
    measure_memory_mb,
    measure_speed,
)
from blast_env.studies.benchmark.parallel import ThreadFigures, measure_threads
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD


def test_speed_is_measured_on_the_scene_and_steps_of_the_blast() -> None:
    speed = measure_speed(COURTYARD, "courtyard", repeats=1)
    assert speed.ratio_same_balls > 0.0 < speed.ratio_all_balls
    assert speed.balls == len(build_scene(COURTYARD).balls)
    assert speed.steps == Blast(COURTYARD).run().steps


def test_times_become_medians_and_ratios(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the times that a clock would have given: event, pymunk, pymunk at the close step."""
    times = iter([1.0, 10.0, 40.0, 2.0, 30.0, 90.0, 4.0, 20.0, 200.0])
    monkeypatch.setattr(engines, "_timed", lambda _: next(times))
    figures = measure_engines(BenchmarkScene("courtyard", COURTYARD, 0.25), repeats=3)
    assert (figures.event_s, figures.pymunk_s, figures.close_pymunk_s) == (2.0, 20.0, 90.0)
    assert (figures.ratio, figures.close_ratio) == (10.0, 45.0)
    assert figures.balls == len(build_scene(COURTYARD).balls)


def test_without_a_close_step_there_is_no_ratio_at_it() -> None:
    figures = measure_engines(BenchmarkScene("courtyard", COURTYARD), repeats=1)
    assert figures.close_pymunk_s is figures.close_ratio is None
    assert figures.ratio > 0.0


def test_a_step_that_is_the_scenario_s_is_not_timed_twice() -> None:
    figures = measure_engines(BenchmarkScene("courtyard", COURTYARD, 0.5), repeats=1)
    assert figures.close_pymunk_s == figures.pymunk_s


def test_dense_air_is_dense_and_elastic() -> None:
    parameters = dense_courtyard().parameters
    assert parameters.air.spacing_units == 3.0 * parameters.air.radius_units
    assert parameters.air.elasticity == parameters.explosive.elasticity == 1.0


def test_a_blast_of_60_000_balls_fits_into_500_mb() -> None:
    overrides = {
        "air": {"spacing_units": 1.38, "radius_units": 0.5},
        "stepping": {"time_limit_s": 0.002},
    }
    many = load_scenario("free_field").at_stand_off(60.0).with_simulation(overrides=overrides)
    assert len(build_scene(many).balls) > 60_000
    assert measure_memory_mb(many) < 500.0


def test_time_to_lay_out_a_scene(benchmark: BenchmarkFixture) -> None:
    assert len(benchmark(build_scene, COURTYARD).balls) > 800


def test_time_to_build_a_space(benchmark: BenchmarkFixture) -> None:
    scene = build_scene(COURTYARD)
    built = benchmark(lambda: build_space(scene, scene.obstacles()))
    assert len(built.ball_bodies) == len(scene.balls)


@pytest.mark.parametrize("until_s", [0.01, 1.0])
def test_time_of_a_run(benchmark: BenchmarkFixture, until_s: float) -> None:
    scene = build_scene(COURTYARD)

    def run() -> float:
        started = PymunkEngine().start(scene)
        started.advance(until_s)
        return started.time_s

    assert benchmark(run) > 0.009


def test_time_of_the_tables(benchmark: BenchmarkFixture) -> None:
    blast = Blast(COURTYARD)
    run = blast.start()
    run.advance(1.0e9)
    assert len(benchmark(lambda: blast.result(run).collisions)) > 100


SHORT = COURTYARD.with_simulation(
    overrides={"stepping": {"time_limit_s": 0.01}, "air": {"spacing_units": 3.0}}
)


def test_twice_as_fast_is_a_scaling_of_two() -> None:
    assert ThreadFigures(40, 2, one_thread_s=3.0, all_threads_s=1.5).scaling == 2.0


def test_both_are_timed_on_the_same_whole_number_of_blasts_a_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parallel, "_LOT_S", 0.2)
    figures = measure_threads(SHORT, threads=3, repeats=1)
    assert figures.threads == 3
    assert figures.blasts % 3 == 0
    assert figures.blasts >= 12
    assert figures.one_thread_s > 0.0 < figures.all_threads_s


def test_no_threads_are_refused() -> None:
    with pytest.raises(BlastEnvError, match="threads is 0"):
        measure_threads(SHORT, threads=0, repeats=1)
