"""The gas on which the cost of an event is measured, and the fit."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from blast_env.physics.event.engine import EventRun
from scripts.event_cost import Cost, cost_figure, gas, log_fit, measure, measure_once


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


def test_an_event_takes_less_than_10_microseconds() -> None:
    """Ten times the target, because tests run on any machine: catches a loop not compiled."""
    cost = measure_once(gas(2000))
    assert cost.events > cost.collisions
    assert 0.0 < cost.event_ns < cost.collision_ns
    assert cost.event_ns < 10_000.0


def test_fit_finds_the_cost_of_a_doubling() -> None:
    costs = [Cost(2**k, 1000, 500, 1e-6 * (100.0 + 20.0 * k), 2**k / 5e3) for k in range(8, 16)]
    fit = log_fit(costs)
    assert fit.at_one == pytest.approx(100.0)
    assert fit.per_doubling == pytest.approx(20.0)
    (axes,) = cost_figure(costs, fit).axes
    assert axes.get_xscale() == "log"
    assert axes.get_ylim()[1] > 1000.0  # the target is in the picture
