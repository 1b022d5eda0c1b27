"""Conservation laws, to rounding: without a time step there is no other error."""

import numpy as np
import pytest

from blast_env.site.parameters import SimulationParameters
from tests.particles.scenes import (
    EVENT,
    KEEP_MASS,
    closed_box,
    energy,
    hot_cloud,
    momentum,
    parameters,
    wall,
)
from tests.particles.worlds import WorldRun, angular_momentum, whole_energy

FAR_WALL = wall((180.0, 180.0), 2, 2)
BOX = closed_box((58.0, 66.0), (24, 18))
"""Around the cloud, so that it stays together and collides on."""


def settings(
    elasticity: float, friction: float = 0.0, inertia_factor: float = 0.5
) -> SimulationParameters:
    of_ball = {"elasticity": elasticity, "friction": friction, "inertia_factor": inertia_factor}
    return parameters(
        explosive=of_ball,
        air={**of_ball, "mass": 0.1},
        contact={**KEEP_MASS, "module_restitution": elasticity, "module_friction": friction},
    )


@pytest.mark.parametrize("friction", [0.0, 0.7])
@pytest.mark.parametrize("elasticity", [1.0, 0.9, 0.3, 0.0])
def test_momentum_is_kept_to_rounding(elasticity: float, friction: float) -> None:
    """Impulses are equal and opposite, whatever else goes wrong with a contact."""
    of_scene = hot_cloud(settings(elasticity, friction), [FAR_WALL])
    run = EVENT.start(of_scene)
    run.advance(0.05)
    assert run.steps > 500
    scale = (of_scene.balls.mass * np.hypot(*of_scene.balls.velocity.T)).sum()
    assert momentum(run.balls()) == pytest.approx(momentum(of_scene.balls), abs=1e-14 * scale)


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
