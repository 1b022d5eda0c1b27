"""Contacts that never end for ideal hard discs: pressed, wedged, touching and overlapping balls.

Each run gets a limit of collisions that it must not reach, unless the test says otherwise.
"""

from math import ceil, pi, sqrt

import numpy as np
import pytest

from blast_env import load_scenario, simulate
from blast_env.particles.event import engine as event_engine
from blast_env.particles.run import EndReason
from blast_env.site.balls import Balls
from blast_env.site.parameters import SimulationParameters
from blast_env.site.scene import StructureOutline
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    energy,
    finished,
    momentum,
    parameters,
    scene,
    wall,
)

FACADE = wall((100.0, 90.0), 10, 1)
FAR_WALL = wall((180.0, 180.0), 2, 2)


def rules(restitution: float, at_module: float = 0.5, **overrides: dict) -> SimulationParameters:
    of_ball = {"elasticity": sqrt(restitution)}
    stepping = {"most_collisions": 50_000} | overrides.pop("stepping", {})
    contact = {**KEEP_MASS, "module_restitution": at_module}
    return parameters(
        explosive={**of_ball, **overrides.pop("explosive", {})},
        air=of_ball,
        contact=contact,
        stepping=stepping,
    )


def run_to(
    time_s: float,
    of_balls: Balls,
    settings: SimulationParameters,
    structures: tuple[StructureOutline, ...] = (FACADE,),
) -> tuple[Balls, int]:
    """Return the balls as they are then, and the number of collisions."""
    run = EVENT.start(scene(of_balls, structures, settings))
    run.advance(time_s)
    assert run.end_reason is not EndReason.EVENT_LIMIT
    states = run.balls()
    assert np.isfinite(states.position).all()
    assert np.isfinite(states.velocity).all()
    return (
        Balls(states.kind, states.position, states.velocity, states.mass, states.radius),
        run.steps,
    )


@pytest.mark.parametrize("at_module", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_ball_pressed_between_a_heavy_one_and_a_wall_gets_free(
    gap: float, restitution: float, at_module: float
) -> None:
    """Without loss there are about pi sqrt(M / m) collisions, half of them at the wall.

    With loss ideal discs would collide for ever; here the contact loses no energy in between. The
    heavy ball comes back, so that both leave the wall.
    """
    pair = balls(
        [AIR, AIR], [(99.0 - gap, 99.0), (90.0, 99.0)], [(0.0, 0.0), (400.0, 0.0)], [1.0, 1000.0]
    )
    after, steps = run_to(0.2, pair, rules(restitution, at_module))
    assert steps <= ceil(pi * sqrt(1000.0)) + 10
    assert (after.velocity[:, 0] < 0.0).all()
    assert after.position[0, 0] - after.position[1, 0] >= 2.0
    assert energy(after) <= energy(pair) * (1.0 + 1e-12)


@pytest.mark.parametrize(("gap", "time_s"), [(0.0, 0.2), (0.01, 0.2), (0.5, 0.6)])
@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5])
def test_a_line_of_twenty_that_is_hit_moves_on_together(
    restitution: float, gap: float, time_s: float
) -> None:
    """The textbook case of inelastic collapse: more than some 15 balls at a restitution of 0.5."""
    line = balls(
        [AIR] * 21,
        [(20.0, 150.0), *((30.0 + (2.0 + gap) * i, 150.0) for i in range(20))],
        [(400.0, 0.0)] + [(0.0, 0.0)] * 20,
    )
    after, steps = run_to(time_s, line, rules(restitution), (FAR_WALL,))
    assert 20 <= steps < 5000
    assert momentum(after) == pytest.approx(momentum(line), rel=1e-12)
    assert (np.diff(after.position[:, 0]) >= 2.0 - 1e-9).all()  # still one behind the other
    assert energy(after) <= energy(line)
    assert after.velocity[-1, 0] > 0.0


def test_balls_in_touch_that_part_do_not_collide() -> None:
    pair = balls([AIR, AIR], [(50.0, 150.0), (52.0, 150.0)], [(0.0, 10.0), (50.0, 0.0)])
    after, steps = run_to(0.1, pair, rules(1.0), (FAR_WALL,))
    assert steps == 0
    assert after.velocity.tolist() == pair.velocity.tolist()


def test_a_charge_whose_balls_all_overlap_flies_apart() -> None:
    """200 balls of radius 1 in a disc of radius 2, in all directions: they push each other out."""
    rng = np.random.default_rng(0)
    angle = 2.0 * np.pi * np.arange(200) / 200
    position = 150.0 + np.column_stack((np.cos(angle), np.sin(angle)))
    charge = balls([EXPLOSIVE] * 200, position.tolist(), rng.normal(0, 500.0, (200, 2)).tolist())
    settings = rules(1.0, explosive={"collide_within_charge": True})
    after, steps = run_to(0.01, charge, settings, (FAR_WALL,))
    assert steps > 1000
    assert len(after) == 200
    assert energy(after) == pytest.approx(energy(charge), rel=1e-12)
    assert np.median(np.hypot(*(after.position - 150.0).T)) > 5.0


@pytest.mark.parametrize("velocity", [(10.0, 0.0), (-10.0, 3.0)])
def test_two_balls_at_the_very_same_place_pass_through_each_other(
    velocity: tuple[float, float],
) -> None:
    """There is no direction in which they could push each other."""
    pair = balls([AIR, AIR], [(150.0, 150.0)] * 2, [(10.0, 0.0), velocity])
    after, steps = run_to(0.5, pair, rules(0.5), (FAR_WALL,))
    assert steps == 0
    assert after.velocity.tolist() == pair.velocity.tolist()


@pytest.mark.parametrize("aside", [1e-15, 1e-12, 1e-9])
def test_a_ball_that_hardly_touches_another_is_hardly_moved(aside: float) -> None:
    """Depth d gives a normal velocity of v sqrt(d), whose momentum is kept."""
    pair = balls([AIR, AIR], [(140.0, 150.0), (160.0, 152.0 - aside)], [(512.0, 0.0), (0.0, 0.0)])
    after, steps = run_to(0.05, pair, rules(1.0), (FAR_WALL,))
    assert steps <= 1
    assert np.abs(after.velocity - pair.velocity).max() <= 512.0 * sqrt(aside + 3e-14)


SLOT = (wall((98.0, 60.0), 20, 1, "left"), wall((102.0, 60.0), 20, 1, "right"))
"""Exactly as wide as a ball of radius 1."""


def test_a_ball_flies_through_a_gap_of_its_own_diameter() -> None:
    one = balls([AIR], [(101.0, 50.0)], [(0.0, 400.0)])
    after, steps = run_to(0.2, one, rules(1.0), SLOT)
    assert steps == 0
    assert after.position[0] == pytest.approx([101.0, 130.0])


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("at_module", [0.0, 0.5, 0.9])
def test_a_ball_caught_in_the_mouth_of_such_a_gap_ends_there(
    at_module: float, aside: float
) -> None:
    """The two corners make a funnel that gets ever narrower: it bounces back, or is wedged."""
    one = balls([AIR], [(101.0 + aside, 50.0)], [(0.0, 400.0)])
    _, steps = run_to(0.4, one, rules(1.0, at_module), SLOT)
    assert steps < 100


@pytest.mark.parametrize("seed", [118, 144, 210])
def test_balls_that_press_on_each_other_in_gaps_come_to_rest(seed: int) -> None:
    """Default balls are exactly as wide as a gap of one module: here several are caught in one."""
    scattered = np.random.default_rng(seed).random((6, 6)) < 0.42
    layout = [(22 + row, 4 + column) for row, column in np.argwhere(scattered)[:16].tolist()]
    scenario = load_scenario("courtyard").with_simulation("ballistic")
    result = simulate(scenario, layout, seed=seed, engine="event")
    assert result.steps < 10_000


def test_an_elastic_ball_in_such_a_gap_meets_the_limit_of_collisions() -> None:
    """Nothing can stop it: that is what the limit is for. The record is kept up to there."""
    settings = rules(1.0, 1.0, stepping={"most_collisions": 12_345})
    run = finished(scene(balls([AIR], [(101.0, 80.0)], [(10.0, 0.0)]), SLOT, settings))
    assert run.end_reason is EndReason.EVENT_LIMIT
    assert run.steps == len(run.log) == 12_345
    assert run.time_s == 0.0
    run.advance(np.inf)  # it stays at its end
    assert run.steps == 12_345


def test_a_record_too_large_for_memory_ends_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long before 10^8 collisions, if all of them are hits."""
    monkeypatch.setattr(event_engine, "MOST_RECORDS", 10_000)
    settings = rules(1.0, 1.0, stepping={"most_collisions": 10**8})
    run = finished(scene(balls([AIR], [(101.0, 80.0)], [(10.0, 0.0)]), SLOT, settings))
    assert run.end_reason is EndReason.EVENT_LIMIT
    assert 10_000 <= len(run.log) < 20_000
