"""Momentum and energy of balls that meet only each other, in every engine."""

import numpy as np
import pytest

from blast_env.evaluation.engines import ParticleEngine
from blast_env.evaluation.engines.particles import PymunkEngine
from blast_env.site.scene import Scene
from tests.particles.scenes import (
    AIR,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    energy,
    hot_cloud,
    momentum,
    parameters,
    scene,
    states_at,
    wall,
)

FAR_WALL = wall((180.0, 180.0), 2, 2)


def cloud(step_radii: float, elasticity: float = 1.0, base_impulse: float = 0.0) -> Scene:
    settings = parameters(
        explosive={"elasticity": elasticity},
        air={"elasticity": elasticity, "mass": 0.1},
        contact={**KEEP_MASS, "base_impulse": base_impulse},
        stepping={"step_radii": step_radii},
    )
    return hot_cloud(settings, [FAR_WALL])


@pytest.mark.parametrize("base_impulse", [0.0, 30.0])
@pytest.mark.parametrize("kinds", [(AIR, AIR), (EXPLOSIVE, AIR)])
def test_two_balls_keep_their_momentum(
    kinds: tuple, base_impulse: float, engine: ParticleEngine
) -> None:
    start = balls(kinds, [(80.0, 80.0), (90.0, 81.1)], [(300.0, 0.0), (-50.0, 20.0)], [1.0, 0.3])
    of_scene = scene(
        start, [FAR_WALL], parameters(contact={**KEEP_MASS, "base_impulse": base_impulse})
    )
    before = momentum(start)
    after = states_at(of_scene, 0.1, engine)
    assert after.velocity[0] != pytest.approx(start.velocity[0])  # they did meet
    assert momentum(after) == pytest.approx(before, rel=1e-12)


def test_base_impulse_pushes_both_apart_along_the_normal(engine: ParticleEngine) -> None:
    start = balls((AIR, AIR), [(80.0, 80.0), (84.0, 80.0)], [(100.0, 0.0), (0.0, 0.0)], [1.0, 2.0])
    plain, pushed = (
        states_at(scene(start, [FAR_WALL], parameters(contact={"base_impulse": i})), 0.1, engine)
        for i in (0.0, 12.0)
    )
    gained = pushed.velocity - plain.velocity
    assert gained == pytest.approx(np.array([[-12.0, 0.0], [6.0, 0.0]]), abs=1e-9)


@pytest.mark.parametrize("base_impulse", [0.0, 5.0])
def test_a_cloud_keeps_its_momentum(base_impulse: float, engine: ParticleEngine) -> None:
    of_scene = cloud(0.5, elasticity=0.9, base_impulse=base_impulse)
    start = of_scene.balls
    before = momentum(start)
    after = states_at(of_scene, 0.02, engine)
    assert len(after) == len(start)
    assert (after.velocity != start.velocity).any(axis=1).mean() > 0.9  # nearly all have met
    scale = (start.mass * np.hypot(*start.velocity.T)).sum()
    assert momentum(after) == pytest.approx(before, abs=1e-13 * scale)


@pytest.mark.parametrize("step_radii", [0.5, 0.25, 0.125])
def test_an_elastic_cloud_in_steps_keeps_its_energy(step_radii: float) -> None:
    """Stated bound of the stepping engine: 8e-6 of the energy, times the step in radii."""
    of_scene = cloud(step_radii)
    start = of_scene.balls
    before = energy(start)
    after = states_at(of_scene, 0.02, PymunkEngine())
    assert abs(energy(after) / before - 1.0) < 8e-6 * step_radii


def test_inelastic_balls_lose_energy(engine: ParticleEngine) -> None:
    elastic, inelastic = (energy(states_at(cloud(0.5, e), 0.02, engine)) for e in (1.0, 0.8))
    assert inelastic < 0.9 * elastic


def test_head_on_elastic_balls_of_equal_mass_swap_velocities(engine: ParticleEngine) -> None:
    start = balls((AIR, AIR), [(80.0, 80.0), (90.0, 80.0)], [(100.0, 0.0), (0.0, 0.0)])
    after = states_at(scene(start, [FAR_WALL], parameters(air={"elasticity": 1.0})), 0.2, engine)
    assert after.velocity == pytest.approx(np.array([[0.0, 0.0], [100.0, 0.0]]), abs=1e-9)


def test_elasticities_multiply(engine: ParticleEngine) -> None:
    start = balls((AIR, EXPLOSIVE), [(80.0, 80.0), (90.0, 80.0)], [(100.0, 0.0), (0.0, 0.0)])
    settings = parameters(air={"elasticity": 0.5}, explosive={"elasticity": 0.8}, contact=KEEP_MASS)
    after = states_at(scene(start, [FAR_WALL], settings), 0.2, engine)
    assert after.velocity[1, 0] - after.velocity[0, 0] == pytest.approx(40.0)


def test_friction_spins_discs_of_any_inertia_and_keeps_momentum(engine: ParticleEngine) -> None:
    start = balls((AIR, AIR), [(80.0, 80.0), (90.0, 81.0)], [(100.0, 0.0), (0.0, 0.0)])
    across = []
    for friction, inertia in ((0.0, 0.5), (1.0, 0.5), (1.0, 1.0)):
        settings = parameters(air={"friction": friction, "inertia_factor": inertia})
        after = states_at(scene(start, [FAR_WALL], settings), 0.2, engine)
        assert momentum(after) == pytest.approx(np.array([100.0, 0.0]), rel=1e-12, abs=1e-12)
        across.append(after.velocity[1, 1])
    assert len({round(value, 6) for value in across}) == 3
