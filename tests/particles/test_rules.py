"""The rules of the paper: impulse, rebound, shrinking, r_min, the border, seams, destruction."""

import numpy as np
import pytest

from blast_env import simulate
from blast_env.evaluation.engines import CALIBRATED_ENGINES, ParticleEngine
from blast_env.evaluation.engines.particles import PymunkEngine
from blast_env.particles import COLLISION_DTYPE, CollisionType, Scene, incidence_angle_rad
from blast_env.results import EndReason
from blast_env.site import SimulationParameters
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    FACADE,
    FAR_WALL,
    KEEP_MASS,
    balls,
    finished,
    parameters,
    scene,
    states_at,
    step_s,
    wall,
)
from tests.scenarios import BALLISTIC_COURTYARD


def shot(
    position: tuple[float, float],
    velocity: tuple[float, float],
    kind: CollisionType = EXPLOSIVE,
    mass: float = 1.0,
    **overrides: dict,
) -> Scene:
    """One ball against the facade."""
    return scene(balls([kind], [position], [velocity], mass), [FACADE], parameters(**overrides))


@pytest.mark.parametrize("kind", [EXPLOSIVE, AIR])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_head_on_ball(engine: ParticleEngine, kind: CollisionType, restitution: float) -> None:
    """I = m |v| and transferred (1 + C_e) m |v|: the paper's formula and Newton's."""
    contact = {"module_restitution": restitution}
    of_scene = shot((80.0, 99.0), (500.0, 0.0), kind, 2.0, contact=contact)
    (hit,) = finished(of_scene, engine).log.to_array()
    assert hit["impulse"] == pytest.approx(1000.0, rel=1e-9)
    assert hit["transferred_impulse"] == pytest.approx((1.0 + restitution) * 1000.0, rel=1e-9)
    assert hit["kind"] == kind
    assert hit["time_s"] == pytest.approx(19.0 / 500.0, abs=2e-3)


def test_impulse_of_an_oblique_ball_uses_the_whole_speed(engine: ParticleEngine) -> None:
    hits = finished(shot((80.0, 80.0), (300.0, 300.0)), engine).log.to_array()
    assert hits[0]["impulse"] == pytest.approx(300.0 * np.sqrt(2.0), rel=1e-9)
    assert np.degrees(incidence_angle_rad(hits))[0] == pytest.approx(45.0)
    assert hits[0]["transferred_impulse"] == pytest.approx(1.5 * 300.0, rel=1e-9)


@pytest.mark.parametrize("y", [91.7, 91.999, 92.0, 92.001, 95.0, 99.99, 100.0, 107.95, 109.5])
@pytest.mark.parametrize("across", [0.0, 250.0])
def test_a_seam_is_no_corner(engine: ParticleEngine, y: float, across: float) -> None:
    """Near a seam the ball overlaps two squares, but the wall is flat: one hit, no push aside."""
    wait = 9.0 / 400.0
    run = engine.start(shot((90.0, y - across * wait), (400.0, across)))
    run.advance(0.03)
    (hit,) = run.log.to_array()
    if engine.name == EVENT.name:
        assert (hit["normal_x"], hit["normal_y"]) == (-1.0, 0.0)
    assert run.balls().velocity[0] == pytest.approx([-200.0, across], abs=1e-9)
    reached = y + across * 2.0 * step_s(run)
    assert (y - 90.0) // 2 - (y % 2.0 == 0.0) <= hit["module"] <= (reached - 90.0) // 2


def test_a_free_corner_does_push_to_the_side(engine: ParticleEngine) -> None:
    assert states_at(shot((90.0, 110.6), (400.0, 0.0)), 0.06, engine).velocity[0, 1] > 10.0


def test_a_ball_in_an_inner_corner_counts_once_in_a_step() -> None:
    walls = [wall((100.0, 90.0), 10, 1, "upright"), wall((80.0, 88.0), 1, 11, "flat")]
    # 45 degrees into the corner at (100, 90): it touches both walls in the same step.
    of_scene = scene(
        balls([AIR], [(90.0, 80.0 + 20.0)], [(300.0, -300.0)]),
        walls,
        parameters(contact={"module_restitution": 1.0}),
    )
    (hit,) = finished(of_scene, PymunkEngine()).log.to_array()
    assert hit["impulse"] == pytest.approx(300.0 * np.sqrt(2.0))
    assert hit["transferred_impulse"] == pytest.approx(2.0 * 2.0 * 300.0, rel=1e-6)


@pytest.mark.parametrize("kind", [EXPLOSIVE, AIR])
def test_modules_take_three_tenths_off_at_each_new_contact(
    engine: ParticleEngine, kind: int
) -> None:
    """Many bounces between two walls; only explosive balls shrink. Mass in the record is that
    before the collision.
    """
    factor = 0.7 if kind == EXPLOSIVE else 1.0
    of_scene = scene(
        balls([kind], [(94.0, 99.0)], [(400.0, 0.0)], 2.0),
        [FACADE, wall((88.0, 90.0), 10, 1, "left")],
        parameters(contact={"module_restitution": 1.0, "minimum_radius_units": 0.001}),
    )
    run = engine.start(of_scene)
    run.advance(0.2)
    hits = run.log.to_array()
    assert len(hits) >= 8
    masses = 2.0 * factor ** np.arange(len(hits))
    assert hits["mass"] == pytest.approx(masses, rel=1e-12)
    assert hits["impulse"] == pytest.approx(400.0 * masses, rel=1e-9)
    assert run.balls().radius[0] == pytest.approx(factor ** len(hits))


@pytest.mark.parametrize("elasticity", [0.0, 0.8])
def test_an_explosive_ball_shrinks_once_per_contact_with_air(
    engine: ParticleEngine, elasticity: float
) -> None:
    """Inelastic balls stay together for many steps: still one contact."""
    of_scene = scene(
        balls([EXPLOSIVE, AIR], [(50.0, 50.0), (60.0, 50.0)], [(400.0, 0.0), (0.0, 0.0)]),
        [FACADE],
        parameters(explosive={"elasticity": elasticity}, contact={"minimum_radius_units": 0.01}),
    )
    after = states_at(of_scene, 0.1, engine)
    assert after.mass == pytest.approx([0.9, 1.0])
    assert after.radius == pytest.approx([0.9, 1.0])


def test_balls_of_one_charge_meet_only_if_asked_to_and_do_not_shrink(
    engine: ParticleEngine,
) -> None:
    pair = balls([EXPLOSIVE] * 2, [(50.0, 50.0), (60.0, 50.0)], [(300.0, 0.0), (0.0, 0.0)])
    apart, met = (
        states_at(
            scene(pair, [FAR_WALL], parameters(explosive={"collide_within_charge": within})),
            0.1,
            engine,
        )
        for within in (False, True)
    )
    assert apart.velocity.tolist() == [[300.0, 0.0], [0.0, 0.0]]
    assert met.velocity[1, 0] > 0.0
    assert met.radius.tolist() == met.mass.tolist() == [1.0, 1.0]


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


def test_a_ball_is_removed_at_the_collision_that_takes_it_below_r_min(
    engine: ParticleEngine,
) -> None:
    """0.9^3 = 0.729 is above 0.7, 0.9^4 = 0.656 is not: the fifth air ball is left alone."""
    run = engine.start(through_air(5, parameters(contact={"minimum_radius_units": 0.7})))
    run.advance(38.0 / 400.0)  # at x = 58, before it meets the fourth
    assert run.balls().radius[0] == pytest.approx(0.729)
    run.advance(0.12)
    assert run.balls().index.tolist() == [1, 2, 3, 4, 5]
    assert run.balls().velocity[3, 0] > 100.0
    assert run.balls().velocity[4].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("velocity", "way"),
    [((-500.0, 30.0), 29.0), ((500.0, 0.0), 169.0), ((3.0, -500.0), 39.0), ((0.0, 500.0), 159.0)],
)
def test_a_ball_leaves_when_its_edge_reaches_the_border(
    engine: ParticleEngine, velocity: tuple[float, float], way: float
) -> None:
    """From (30, 40) on a site of 200 units, with a radius of 1."""
    pair = balls([AIR, AIR], [(30.0, 40.0), (100.0, 100.0)], [velocity, (0.001, 0.0)])
    run = engine.start(scene(pair, [wall((103.0, 95.0), 5, 1)], parameters()))
    run.advance(way / 500.0 - step_s(run))
    assert run.balls().index.tolist() == [0, 1]
    run.advance(way / 500.0 + 2.0 * step_s(run))
    assert run.balls().index.tolist() == [1]


def test_the_edge_of_a_ball_that_has_shrunk_is_that_of_the_small_ball() -> None:
    """0.7 units after the facade; it flies back to the left border at C_e = 1."""
    run = EVENT.start(shot((90.0, 99.0), (500.0, 0.0), contact={"module_restitution": 1.0}))
    end_s = (9.0 + 99.0 - 0.7) / 500.0
    run.advance(end_s - 1e-9)
    assert len(run.balls()) == 1
    run.advance(end_s + 1e-9)
    assert len(run.balls()) == 0
    assert run.end_reason is EndReason.OUT_OF_REACH
    assert run.time_s == pytest.approx(end_s, rel=1e-12)


def test_destroyed_modules_open_the_way_to_the_ones_behind(engine: ParticleEngine) -> None:
    """Each bears 500, each ball brings an m|v| of 400: two balls a module."""
    deep = wall((100.0, 98.0), 1, 3, capacity=500.0)
    x = 80.0 - 15.0 * np.arange(5)
    row = balls([EXPLOSIVE] * 5, [(c, 99.0) for c in x], [(400.0, 0.0)] * 5, radius=0.5)
    run = engine.start(scene(row, [deep], parameters(contact=KEEP_MASS)))
    run.advance(0.4)
    hits = run.log.to_array()
    assert hits["module"].tolist() == [0, 0, 1, 1, 2]
    face = 100.0 + np.array([0.0, 0.0, 2.0, 2.0, 4.0])
    assert hits["time_s"] == pytest.approx((face - 0.5 - x) / 400.0, abs=2.0 * step_s(run))
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


@pytest.mark.parametrize("engine_name", CALIBRATED_ENGINES)
def test_the_record_agrees_with_the_run_and_the_modules(engine_name: str) -> None:
    """Field by field."""
    result = simulate(BALLISTIC_COURTYARD, [(4, 0), (5, 0)], seed=2, engine=engine_name)
    log, of_scene = result.collision_array, result.blast.scene
    assert log.dtype == COLLISION_DTYPE
    assert len(log) > 100
    assert (np.diff(log["time_s"]) >= 0.0).all()
    assert (log["kind"] == of_scene.balls.kind[log["ball"]]).all()
    vx, vy, normal_x, normal_y = (
        np.asarray(log[name], dtype=float) for name in ("vx", "vy", "normal_x", "normal_y")
    )
    quantum = of_scene.impulse_quantum
    assert log["impulse"] == pytest.approx(log["mass"] * np.hypot(vx, vy), abs=quantum)
    assert (log["impulse"] / quantum % 1.0 == 0.0).all()
    assert np.hypot(normal_x, normal_y) == pytest.approx(1.0, rel=1e-12)
    assert (log["transferred_impulse"] > 0.0).all()
    if engine_name == "event":  # in steps several contacts may share one
        towards = -(vx * normal_x + vy * normal_y)
        restitution = BALLISTIC_COURTYARD.parameters.contact.module_restitution
        given = (1.0 + restitution) * log["mass"] * towards
        assert log["transferred_impulse"] == pytest.approx(given, rel=1e-12)
    assert (incidence_angle_rad(log) <= np.pi / 2).all()
    parts = [part for obstacle in result.obstacles for part in obstacle.parts]
    for index, part in enumerate(parts):
        of_part = log[log["module"] == index]
        assert part.hits == len(of_part)
        assert part.impulse == of_part["impulse"].sum()
        assert part.transferred_impulse == pytest.approx(of_part["transferred_impulse"].sum())
        if part.hits:
            assert part.first_hit_s == of_part["time_s"][0]
            assert of_part["first_contact"].tolist() == [True] + [False] * (part.hits - 1)
        else:
            assert part.first_hit_s is None
