"""The figures of the environment's benchmark are about what they say."""

from collections.abc import Callable

import numpy as np
import pytest

from blast_env import Scenario, load_scenario, simulate
from blast_env.engines.particles import EventEngine
from blast_env.studies.benchmark.environment import (
    TimedEngine,
    benchmark_engine,
    measure_environment,
    measure_frame_ms,
    random_action,
)
from blast_env.studies.benchmark.parallel import (
    AsyncFleet,
    Fleet,
    OneEnvironment,
    SubprocFleet,
    measure_fleet,
)
from tests.envs.small import small_document


def small() -> Scenario:
    """A small site in the bundled scenarios' model, which the event engine runs in no time."""
    return Scenario.model_validate(small_document())


def collisional_courtyard() -> Scenario:
    document = load_scenario("courtyard").with_simulation("collisional").model_dump()
    document["calibration"] = "collisional_kb"
    return Scenario.from_document(document, "courtyard")


def test_a_timed_engine_gives_the_same_blast_and_its_share_of_the_time() -> None:
    engine = TimedEngine(EventEngine())
    scenario = load_scenario("courtyard")
    assert simulate(scenario, engine=engine).digest == simulate(scenario, engine="event").digest
    assert engine.seconds > 0.0
    assert (engine.name, engine.version) == (EventEngine().name, EventEngine().version)


def test_every_part_of_an_episode_is_timed() -> None:
    figures = measure_environment(small(), repeats=2)
    assert figures.engine == "event"
    assert figures.outside_physics < figures.outside_engine < 1.0
    parts_ms = (figures.reset_ms, figures.mask_ms, figures.observation_ms, figures.episode_ms)
    assert min(parts_ms) > 0.0


def test_a_frame_is_timed() -> None:
    assert measure_frame_ms(small(), repeats=1) > 0.0


def test_the_engine_is_one_that_the_calibration_allows() -> None:
    assert benchmark_engine(collisional_courtyard()) == "event"
    assert benchmark_engine(load_scenario("courtyard")) == "event"


def test_random_actions_are_legal_and_finish_when_nothing_is_free() -> None:
    rng = np.random.default_rng(0)
    mask = np.array([False, True, False, True, True])
    assert {random_action(mask, rng) for _ in range(50)} == {1, 3}
    assert random_action(np.array([False, False, True]), rng) == 2


@pytest.mark.parametrize("kind", ["one", "async", "subproc"])
def test_fleets_count_their_steps_and_blasts(kind: str) -> None:
    """Three modules and two realisations: four blasts to three steps, however many there are."""
    fleets: dict[str, tuple[int, Callable[[], Fleet]]] = {
        "one": (1, lambda: OneEnvironment(small())),
        "async": (2, lambda: AsyncFleet(small(), 2)),
        "subproc": (1, lambda: SubprocFleet(small(), 1)),  # each process loads torch
    }
    count, make = fleets[kind]
    figures = measure_fleet(kind, count, make(), episodes=2)
    assert (figures.name, figures.processes) == (kind, count)
    assert figures.steps_per_s > 0.0
    assert figures.blasts_per_s == pytest.approx(4.0 / 3.0 * figures.steps_per_s)
