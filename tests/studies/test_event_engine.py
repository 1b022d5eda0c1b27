"""The gas on which the cost of an event is measured, the fit, and the profile of a blast."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from blast_env import simulate
from blast_env.physics.event.engine import EventRun
from blast_env.scenario.build_scene import build_scene
from blast_env.studies.benchmark.engines import BenchmarkScene
from studies.particles.event_engine import (
    Cost,
    Profile,
    cost_figure,
    gas,
    log_fit,
    look_aheads,
    measure,
    measure_once,
    profile,
)
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD


def test_gas_has_room_for_every_ball_and_all_move() -> None:
    balls = gas(400).balls
    assert len(balls) == 400
    assert pdist(balls.position).min() >= 2.0 * balls.radius.max()
    assert (np.hypot(*balls.velocity.T) > 0.0).all()


def test_no_ball_leaves_the_box() -> None:
    run = EventRun(gas(100))
    run.advance(0.5)
    assert len(run.balls()) == 100
    assert sum(obstacle.hits for obstacle in run.obstacles) > 1000


def test_same_density_means_as_many_collisions_a_ball() -> None:
    """Otherwise the costs of different sizes would not compare."""
    small, large = measure([gas(900), gas(6400)], repeats=1)
    assert (small.balls, large.balls) == (900, 6400)
    assert large.collisions / 6400 == pytest.approx(small.collisions / 900, rel=0.1)
    assert large.collisions > 3 * large.balls


def test_a_run_is_timed_with_all_its_events() -> None:
    cost = measure_once(gas(400))
    assert cost.events > cost.collisions > 0
    assert Cost(10, 200, 100, 1e-6, 1.0).event_ns == pytest.approx(5.0)
    assert Cost(10, 200, 100, 1e-6, 1.0).collision_ns == pytest.approx(10.0)


def test_fit_finds_the_cost_of_a_doubling() -> None:
    costs = [Cost(2**k, 1000, 500, 1e-6 * (100.0 + 20.0 * k), 2**k / 5e3) for k in range(8, 16)]
    fit = log_fit(costs)
    assert fit.at_one == pytest.approx(100.0)
    assert fit.per_doubling == pytest.approx(20.0)
    (axes,) = cost_figure(costs, fit).axes
    assert axes.get_xscale() == "log"
    assert axes.get_ylim()[1] > 1000.0  # the target is in the picture


@pytest.fixture(scope="module")
def of_courtyard() -> Profile:
    return profile(BenchmarkScene("courtyard", COURTYARD), repeats=3)


def test_collisions_are_those_of_the_blast(of_courtyard: Profile) -> None:
    assert of_courtyard.collisions == simulate(COURTYARD, engine="event").steps
    assert of_courtyard.crossings > of_courtyard.collisions  # in sparse air


def test_every_part_is_timed(of_courtyard: Profile) -> None:
    assert min(of_courtyard[3:]) > 0.0


def test_time_of_an_event_is_the_loop_s_over_all_events() -> None:
    assert Profile(10, 20, 20, 1.0, 1.0, 5e-6, 1.0).event_ns == pytest.approx(100.0)


def test_look_aheads_are_timed_while_the_fan_spreads_and_loses_balls() -> None:
    looks = list(look_aheads(build_scene(COURTYARD), repeats=2))
    assert [look.time_s for look in looks] == [0.004, 0.016, 0.064]
    assert looks[0].explosive == COURTYARD.parameters.explosive.ball_count
    assert looks[0].explosive > looks[1].explosive > looks[2].explosive > 0
    assert all(look.explosive_ns > 0.0 for look in looks)
