"""Conservation: to rounding in the event engine, within bounds in steps of the other."""

import numpy as np
import pytest

from blast_env.evaluation.engines import ParticleEngine
from blast_env.evaluation.engines.particles import PymunkEngine
from blast_env.site import SimulationParameters
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    FAR_WALL,
    KEEP_MASS,
    balls,
    closed_box,
    energy,
    hot_cloud,
    momentum,
    parameters,
    scene,
    states_at,
)
from tests.particles.worlds import WorldRun, angular_momentum, whole_energy

BOX = closed_box((58.0, 66.0), (24, 18))
"""Around the cloud, so that it stays together and collides on."""


def settings(
    elasticity: float,
    friction: float = 0.0,
    inertia_factor: float = 0.5,
    base_impulse: float = 0.0,
    step_radii: float = 0.5,
) -> SimulationParameters:
    of_ball = {"elasticity": elasticity, "friction": friction, "inertia_factor": inertia_factor}
    at_module = {"module_restitution": elasticity, "module_friction": friction}
    return parameters(
        explosive=of_ball,
        air={**of_ball, "mass": 0.1},
        contact={**KEEP_MASS, **at_module, "base_impulse": base_impulse},
        stepping={"step_radii": step_radii},
    )


@pytest.mark.parametrize("friction", [0.0, 0.7])
@pytest.mark.parametrize(
    ("elasticity", "base_impulse"), [(1.0, 0.0), (0.9, 5.0), (0.3, 0.0), (0.0, 0.0)]
)
def test_a_cloud_keeps_its_momentum_to_rounding(
    engine: ParticleEngine, elasticity: float, base_impulse: float, friction: float
) -> None:
    """Impulses are equal and opposite, whatever else goes wrong with a contact."""
    of_scene = hot_cloud(settings(elasticity, friction, base_impulse=base_impulse), [FAR_WALL])
    start, after = of_scene.balls, states_at(of_scene, 0.02, engine)
    assert len(after) == len(start)
    assert (after.velocity != start.velocity).any(axis=1).mean() > 0.9  # nearly all have met
    scale = (start.mass * np.hypot(*start.velocity.T)).sum()
    assert momentum(after) == pytest.approx(momentum(start), abs=1e-13 * scale)


def test_base_impulse_pushes_both_apart_along_the_normal(engine: ParticleEngine) -> None:
    start = balls((AIR, AIR), [(80.0, 80.0), (84.0, 80.0)], [(100.0, 0.0), (0.0, 0.0)], [1.0, 2.0])
    plain, pushed = (
        states_at(scene(start, [FAR_WALL], parameters(contact={"base_impulse": i})), 0.1, engine)
        for i in (0.0, 12.0)
    )
    gained = pushed.velocity - plain.velocity
    assert gained == pytest.approx(np.array([[-12.0, 0.0], [6.0, 0.0]]), abs=1e-9)


def test_elasticities_multiply(engine: ParticleEngine) -> None:
    start = balls((AIR, EXPLOSIVE), [(80.0, 80.0), (90.0, 80.0)], [(100.0, 0.0), (0.0, 0.0)])
    of_parameters = parameters(
        air={"elasticity": 0.5}, explosive={"elasticity": 0.8}, contact=KEEP_MASS
    )
    after = states_at(scene(start, [FAR_WALL], of_parameters), 0.2, engine)
    assert after.velocity == pytest.approx(np.array([[30.0, 0.0], [70.0, 0.0]]), abs=1e-9)


def test_friction_spins_discs_of_any_inertia(engine: ParticleEngine) -> None:
    start = balls((AIR, AIR), [(80.0, 80.0), (90.0, 81.0)], [(100.0, 0.0), (0.0, 0.0)])
    across = []
    for friction, inertia in ((0.0, 0.5), (1.0, 0.5), (1.0, 1.0)):
        of_parameters = parameters(air={"friction": friction, "inertia_factor": inertia})
        after = states_at(scene(start, [FAR_WALL], of_parameters), 0.2, engine)
        across.append(round(after.velocity[1, 1], 6))
    assert len(set(across)) == 3


@pytest.mark.parametrize("step_radii", [0.5, 0.25, 0.125])
def test_an_elastic_cloud_in_steps_keeps_its_energy(step_radii: float) -> None:
    """Stated bound of the stepping engine: 8e-6 of the energy, times the step in radii."""
    of_scene = hot_cloud(settings(1.0, step_radii=step_radii), [FAR_WALL])
    after = states_at(of_scene, 0.02, PymunkEngine())
    assert abs(energy(after) / energy(of_scene.balls) - 1.0) < 8e-6 * step_radii


def test_the_energy_of_an_elastic_gas_is_kept_to_rounding() -> None:
    """Also at the walls: thousands of collisions, each wrong by an ulp or so."""
    run = EVENT.start(hot_cloud(settings(1.0), BOX))
    run.advance(0.5)
    assert run.steps > 10_000
    assert len(run.log) > 1000
    assert energy(run.balls()) == pytest.approx(energy(run.scene.balls), rel=1e-12)


@pytest.mark.parametrize("inertia_factor", [0.5, 1.0])
def test_angular_momentum_with_that_of_the_spins_is_kept(inertia_factor: float) -> None:
    """Friction turns the balls as it slows them: it acts at the point of contact."""
    run = WorldRun(hot_cloud(settings(0.8, 0.7, inertia_factor), [FAR_WALL]))
    before = angular_momentum(run.world.balls, inertia_factor)
    after = run.balls_at(0.05)
    assert np.abs(after["spin"]).max() > 10.0
    assert after["alive"].all()
    # Rounding of positions of some 100 units times momenta.
    scale = 100.0 * (after["mass"] * np.hypot(after["vx"], after["vy"])).sum()
    assert angular_momentum(after, inertia_factor) == pytest.approx(before, abs=1e-13 * scale)


@pytest.mark.parametrize(
    ("elasticity", "friction"), [(1.0, 0.7), (0.95, 0.0), (0.7, 0.3), (0.2, 2.0), (0.0, 0.0)]
)
def test_energy_never_rises_in_collisions_that_lose_some(
    elasticity: float, friction: float
) -> None:
    """Looked at after every few collisions, walls included."""
    run = WorldRun(hot_cloud(settings(elasticity, friction), BOX))
    energies = [
        whole_energy(run.balls_at(float(time_s)), 0.5) for time_s in np.linspace(0.0, 0.1, 500)
    ]
    assert energies[-1] < 0.9 * energies[0]
    assert np.diff(energies).max() <= 1e-14 * energies[0]
