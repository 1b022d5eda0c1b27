"""The profile counts what happens in a blast and times its parts."""

import pytest

from blast_env import simulate
from blast_env.scenario.build_scene import build_scene
from blast_env.studies.benchmark.engines import BenchmarkScene
from scripts.event_profile import Profile, look_aheads, profile
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD


@pytest.fixture(scope="module")
def of_courtyard() -> Profile:
    return profile(BenchmarkScene("courtyard", COURTYARD), repeats=3)


def test_collisions_are_those_of_the_blast(of_courtyard: Profile) -> None:
    assert of_courtyard.collisions == simulate(COURTYARD, engine="event").steps
    assert of_courtyard.crossings > of_courtyard.collisions  # in sparse air


def test_every_part_takes_time_and_the_loop_takes_most(of_courtyard: Profile) -> None:
    profiled = of_courtyard
    parts = (profiled.scene_s, profiled.start_s, profiled.loop_s, profiled.result_s)
    assert min(parts) > 0.0
    assert profiled.loop_s == max(parts)


def test_time_of_an_event_is_the_loop_s_over_all_events() -> None:
    assert Profile(10, 20, 20, 1.0, 1.0, 5e-6, 1.0).event_ns == pytest.approx(100.0)


def test_look_aheads_are_timed_while_the_fan_spreads_and_loses_balls() -> None:
    looks = list(look_aheads(build_scene(COURTYARD), repeats=2))
    assert [look.time_s for look in looks] == [0.004, 0.016, 0.064]
    assert looks[0].explosive == COURTYARD.parameters.explosive.ball_count
    assert looks[0].explosive > looks[1].explosive > looks[2].explosive > 0
    assert all(look.explosive_ns > 0.0 for look in looks)
    assert looks[0].air_ns > looks[2].air_ns  # the whole fan is in the cells around an air ball
