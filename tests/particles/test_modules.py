"""Balls on modules, in every engine: impulse, rebound, shrinking, seams, destruction."""

import numpy as np
import pytest

from blast_env.evaluation.engines import ParticleEngine
from blast_env.evaluation.engines.particles import PymunkEngine
from blast_env.particles.run import CollisionArray, incidence_angle_rad
from blast_env.site.balls import CollisionType
from tests.particles.scenes import AIR, EXPLOSIVE, balls, finished, parameters, scene, wall

FACADE = wall((100.0, 90.0), 10, 1)


def shot(
    engine: ParticleEngine,
    position: tuple[float, float],
    velocity: tuple[float, float],
    kind: CollisionType = EXPLOSIVE,
    mass: float = 1.0,
    **overrides: dict,
) -> CollisionArray:
    """One ball against the facade."""
    of_scene = scene(balls([kind], [position], [velocity], mass), [FACADE], parameters(**overrides))
    return finished(of_scene, engine).log.to_array()


@pytest.mark.parametrize("kind", [EXPLOSIVE, AIR])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_head_on_ball(engine: ParticleEngine, kind: CollisionType, restitution: float) -> None:
    """I = m |v| and transferred (1 + C_e) m |v|: the paper's formula and Newton's."""
    (hit,) = shot(
        engine, (80.0, 99.0), (500.0, 0.0), kind, 2.0, contact={"module_restitution": restitution}
    )
    assert hit["impulse"] == pytest.approx(1000.0, rel=1e-9)
    assert hit["transferred_impulse"] == pytest.approx((1.0 + restitution) * 1000.0, rel=1e-9)
    assert (hit["normal_x"], hit["normal_y"]) == pytest.approx((-1.0, 0.0))
    assert hit["mass"] == 2.0
    assert hit["kind"] == kind
    assert hit["first_contact"]
    assert hit["earlier_collisions"] == 0
    assert hit["time_s"] == pytest.approx(19.0 / 500.0, abs=2e-3)


def test_impulse_of_an_oblique_ball_uses_the_whole_speed(engine: ParticleEngine) -> None:
    hits = shot(engine, (80.0, 80.0), (300.0, 300.0))
    assert hits[0]["impulse"] == pytest.approx(300.0 * np.sqrt(2.0), rel=1e-9)
    assert np.degrees(incidence_angle_rad(hits))[0] == pytest.approx(45.0)
    assert hits[0]["transferred_impulse"] == pytest.approx(1.5 * 300.0, rel=1e-9)


@pytest.mark.parametrize("y", [91.7, 92.0, 92.3, 95.0, 98.0, 99.99, 100.0, 107.95])
def test_a_seam_gives_no_push_to_the_side(engine: ParticleEngine, y: float) -> None:
    """Near a seam the ball overlaps two squares, but the wall is flat."""
    of_scene = scene(balls([EXPLOSIVE], [(90.0, y)], [(400.0, 0.0)]), [FACADE], parameters())
    run = engine.start(of_scene)
    run.advance(0.06)
    (hit,) = run.log.to_array()
    assert run.balls().velocity[0] == pytest.approx([-200.0, 0.0], abs=1e-9)
    assert hit["module"] == int((y - 90.0) // 2.0) or y in (92.0, 98.0, 100.0)


def test_a_free_corner_does_push_to_the_side(engine: ParticleEngine) -> None:
    of_scene = scene(balls([EXPLOSIVE], [(90.0, 110.6)], [(400.0, 0.0)]), [FACADE], parameters())
    run = engine.start(of_scene)
    run.advance(0.06)
    assert run.balls().velocity[0, 1] > 10.0


def test_a_ball_in_an_inner_corner_counts_once_in_a_step() -> None:
    walls = [wall((100.0, 90.0), 10, 1, "upright"), wall((80.0, 88.0), 1, 11, "flat")]
    # 45 degrees into the corner at (100, 90): it touches both walls in the same step.
    of_scene = scene(
        balls([AIR], [(90.0, 80.0 + 20.0)], [(300.0, -300.0)]),
        walls,
        parameters(contact={"module_restitution": 1.0}),
    )
    run = finished(of_scene, PymunkEngine())
    hits = run.log.to_array()
    assert len(hits) == 1
    assert hits["impulse"].sum() == pytest.approx(300.0 * np.sqrt(2.0))
    assert hits["transferred_impulse"].sum() == pytest.approx(2.0 * 2.0 * 300.0, rel=1e-6)


def test_an_explosive_ball_shrinks_once_per_contact_with_a_module(engine: ParticleEngine) -> None:
    for kind, factor in ((EXPLOSIVE, 0.7), (AIR, 1.0)):
        of_scene = scene(balls([kind], [(90.0, 99.0)], [(400.0, 0.0)]), [FACADE], parameters())
        run = engine.start(of_scene)
        run.advance(0.05)
        assert len(run.log) == 1
        assert run.balls().mass == pytest.approx(factor)
        assert run.balls().radius == pytest.approx(factor)


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
    run = engine.start(of_scene)
    run.advance(0.1)
    assert run.balls().mass == pytest.approx([0.9, 1.0])
    assert run.balls().radius == pytest.approx([0.9, 1.0])


def test_a_ball_below_the_minimum_radius_is_removed(engine: ParticleEngine) -> None:
    of_scene = scene(
        balls([EXPLOSIVE], [(90.0, 99.0)], [(400.0, 0.0)]),
        [FACADE],
        parameters(contact={"minimum_radius_units": 0.75}),
    )
    run = finished(of_scene, engine)
    assert len(run.log) == 1
    assert len(run.balls()) == 0


def test_a_module_passes_its_capacity_and_is_removed(engine: ParticleEngine) -> None:
    """Two rows of modules; the ball that breaks the front one lets the next reach the back."""
    two_deep = wall((100.0, 98.0), 1, 2, capacity=500.0)
    of_scene = scene(
        balls(
            [AIR, AIR, AIR],
            [(80.0, 99.0), (60.0, 99.0), (40.0, 99.0)],
            [(400.0, 0.0)] * 3,
            radius=0.5,
        ),
        [two_deep],
        # No rebound, and balls so light that they do not stop the ones behind them.
        parameters(contact={"module_restitution": 1.0}, air={"elasticity": 1.0}),
    )
    run = finished(of_scene, engine)
    front, back = run.obstacles[0].parts
    assert (front.destroyed, front.hits) == (True, 2)
    assert back.hits >= 1


def test_hits_are_summed_per_module(engine: ParticleEngine) -> None:
    of_scene = scene(
        balls([AIR] * 3, [(80.0, 91.0), (70.0, 91.0), (80.0, 95.0)], [(400.0, 0.0)] * 3),
        [FACADE],
        parameters(contact={"module_restitution": 0.0}, air={"elasticity": 0.0}),
    )
    run = finished(of_scene, engine)
    log, parts = run.log.to_array(), run.obstacles[0].parts
    for index, part in enumerate(parts):
        of_part = log[log["module"] == index]
        assert part.hits == len(of_part)
        assert part.impulse == of_part["impulse"].sum()
        assert part.transferred_impulse == pytest.approx(of_part["transferred_impulse"].sum())
    assert parts[2].hits == 1
    assert log[log["module"] == 0]["first_contact"].tolist()[0]
    assert log["first_contact"].sum() == sum(part.hits > 0 for part in parts)
