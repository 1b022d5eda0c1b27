"""The paper's rules in the event engine: shrinking, r_min, I_b, C_e, the border, capacity."""

import numpy as np
import pytest

from blast_env.particles.run import EndReason
from blast_env.site.parameters import SimulationParameters
from blast_env.site.scene import Scene
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    parameters,
    scene,
    states_at,
    wall,
)

FACADE = wall((100.0, 90.0), 10, 1)
FAR_WALL = wall((180.0, 180.0), 2, 2)


def through_air(count: int, settings: SimulationParameters) -> Scene:
    """A heavy explosive ball flies through light air balls, left and right of its way in turn.

    They fly off sideways, so that it meets each of them once. It passes x = 30, 40, 50, ... 0.025 s
    after each other.
    """
    row = balls(
        [EXPLOSIVE] + [AIR] * count,
        [(20.0, 50.0), *((30.0 + 10.0 * i, 50.0 + 1.1 * (-1.0) ** i) for i in range(count))],
        [(400.0, 0.0)] + [(0.0, 0.0)] * count,
        mass=[1.0] + [1e-6] * count,
    )
    return scene(row, [FAR_WALL], settings)


def test_explosive_balls_do_not_shrink_at_each_other() -> None:
    settings = parameters(explosive={"collide_within_charge": True})
    pair = balls([EXPLOSIVE] * 2, [(50.0, 50.0), (60.0, 50.0)], [(300.0, 0.0), (0.0, 0.0)])
    after = states_at(scene(pair, [FAR_WALL], settings), 0.1)
    assert after.velocity[1, 0] > 0.0
    assert after.radius.tolist() == after.mass.tolist() == [1.0, 1.0]


def test_balls_of_one_charge_pass_through_each_other_unless_told_otherwise() -> None:
    pair = balls([EXPLOSIVE] * 2, [(50.0, 50.0), (60.0, 50.0)], [(300.0, 0.0), (0.0, 0.0)])
    run = EVENT.start(scene(pair, [FAR_WALL], parameters()))
    run.advance(0.1)
    assert run.steps == 0
    assert run.balls().position.tolist() == [[80.0, 50.0], [60.0, 50.0]]


@pytest.mark.parametrize("kind", [EXPLOSIVE, AIR])
def test_modules_take_three_tenths_off_at_each_new_contact(kind: int) -> None:
    """Thirteen bounces between two walls; only explosive balls shrink. Mass in the record is
    that before the collision.
    """
    factor = 0.7 if kind == EXPLOSIVE else 1.0
    of_scene = scene(
        balls([kind], [(94.0, 99.0)], [(400.0, 0.0)], 2.0),
        [FACADE, wall((88.0, 90.0), 10, 1, "left")],
        parameters(contact={"module_restitution": 1.0, "minimum_radius_units": 0.001}),
    )
    run = EVENT.start(of_scene)
    run.advance(0.2)
    hits = run.log.to_array()
    assert len(hits) >= 8
    masses = 2.0 * factor ** np.arange(len(hits))
    assert hits["mass"] == pytest.approx(masses, rel=1e-12)
    assert hits["impulse"] == pytest.approx(400.0 * masses, rel=1e-9)
    assert run.balls().radius[0] == pytest.approx(factor ** len(hits))


def test_one_contact_shrinks_once_however_often_the_ball_rattles_in_it() -> None:
    """A heavy ball presses a light explosive one on the wall: all within the contact time."""
    settings = parameters(
        explosive={"elasticity": 1.0},
        air={"elasticity": 1.0},
        contact={"air_shrink": 1.0, "module_restitution": 1.0},
        stepping={"contact_time_s": 0.01},
    )
    pair = balls(
        [EXPLOSIVE, AIR], [(98.5, 99.0), (96.0, 99.0)], [(0.0, 0.0), (400.0, 0.0)], [1.0, 100.0]
    )
    run = EVENT.start(scene(pair, [FACADE], settings))
    run.advance(0.02)
    hits = run.log.to_array()
    assert len(hits) > 3
    assert np.diff(hits["time_s"]).max() < 0.01
    assert run.balls().radius.tolist() == [0.7, 1.0]


def test_a_ball_is_removed_at_the_collision_that_takes_it_below_r_min() -> None:
    """0.9^3 = 0.729 is above 0.7, 0.9^4 = 0.656 is not: the fifth air ball is left alone."""
    settings = parameters(contact={"minimum_radius_units": 0.7})
    run = EVENT.start(through_air(5, settings))
    run.advance(38.0 / 400.0)  # at x = 58, before it meets the fourth
    assert run.balls().radius[0] == pytest.approx(0.729)
    run.advance(0.12)
    assert run.balls().index.tolist() == [1, 2, 3, 4, 5]
    assert run.steps == 4
    assert run.balls().velocity[3, 0] > 100.0
    assert run.balls().velocity[4].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("velocity", "way"),
    [((-500.0, 30.0), 29.0), ((500.0, 0.0), 169.0), ((3.0, -500.0), 39.0), ((0.0, 500.0), 159.0)],
)
def test_a_ball_leaves_when_its_edge_reaches_the_border(
    velocity: tuple[float, float], way: float
) -> None:
    """From (30, 40) on a site of 200 units, with a radius of 1."""
    one = balls([AIR, AIR], [(30.0, 40.0), (100.0, 100.0)], [velocity, (0.001, 0.0)])
    run = EVENT.start(scene(one, [wall((103.0, 95.0), 5, 1)], parameters()))
    run.advance(way / 500.0 - 1e-9)
    assert run.balls().index.tolist() == [0, 1]
    run.advance(way / 500.0 + 1e-9)
    assert run.balls().index.tolist() == [1]


def test_the_edge_of_a_ball_that_has_shrunk_is_that_of_the_small_ball() -> None:
    """0.7 units after the facade; it flies back to the left border at C_e = 1."""
    one = balls([EXPLOSIVE], [(90.0, 99.0)], [(500.0, 0.0)])
    run = EVENT.start(scene(one, [FACADE], parameters(contact={"module_restitution": 1.0})))
    end_s = (9.0 + 99.0 - 0.7) / 500.0
    run.advance(end_s - 1e-9)
    assert len(run.balls()) == 1
    run.advance(end_s + 1e-9)
    assert len(run.balls()) == 0
    assert run.end_reason is EndReason.OUT_OF_REACH
    assert run.time_s == pytest.approx(end_s, rel=1e-12)


def test_destroyed_modules_open_the_way_to_the_ones_behind() -> None:
    """Each bears 500, each ball brings an m|v| of 400: two balls a module."""
    deep = wall((100.0, 98.0), 1, 3, capacity=500.0)
    x = 80.0 - 15.0 * np.arange(5)
    row = balls([EXPLOSIVE] * 5, [(c, 99.0) for c in x], [(400.0, 0.0)] * 5, radius=0.5)
    run = EVENT.start(scene(row, [deep], parameters(contact=KEEP_MASS)))
    run.advance(0.4)
    hits = run.log.to_array()
    assert hits["module"].tolist() == [0, 0, 1, 1, 2]
    face = 100.0 + np.array([0.0, 0.0, 2.0, 2.0, 4.0])
    assert hits["time_s"] == pytest.approx((face - 0.5 - x) / 400.0, rel=1e-12)
    assert [part.destroyed for part in run.obstacles[0].parts] == [True, True, False]
    assert hits["first_contact"].tolist() == [True, False, True, False, True]


def test_destroying_a_module_uncovers_corners() -> None:
    """A wall of three: when the middle one is gone, its neighbours have corners there."""
    middle = wall((100.0, 92.0), 1, 1, "middle", capacity=100.0)
    sides = [wall((100.0, 90.0), 1, 1, "below"), wall((100.0, 94.0), 1, 1, "above")]
    row = balls(
        [EXPLOSIVE, EXPLOSIVE], [(80.0, 93.0), (60.0, 92.5)], [(400.0, 0.0)] * 2, radius=0.8
    )
    run = EVENT.start(scene(row, [middle, *sides], parameters(contact=KEEP_MASS)))
    run.advance(0.12)
    hits = run.log.to_array()
    assert hits["module"].tolist()[:2] == [0, 1]
    # 0.5 above the corner (100, 92) of the lower one, at a distance of 0.8.
    assert hits["normal_y"][1] == pytest.approx(0.5 / 0.8)
    assert hits["normal_x"][1] == pytest.approx(-np.sqrt(1.0 - (0.5 / 0.8) ** 2))
