"""Elastic mechanics runs backwards: the sharpest test of the order and the times of collisions.

A collision that is missed, made twice, or made with the wrong partner or at the wrong time, sends
every ball after it elsewhere.
"""

from dataclasses import replace

import numpy as np
import pytest

from blast_env.site.parameters import SimulationParameters
from blast_env.site.scene import Scene
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    closed_box,
    parameters,
    scene,
    wall,
)

ELASTIC: dict[str, object] = {"elasticity": 1.0}


def gas(settings: SimulationParameters, seed: int) -> Scene:
    """Balls of two sizes and masses in a closed box with an obstacle that has corners."""
    rng = np.random.default_rng(seed)
    obstacle = wall((92.0, 96.0), 4, 6, "obstacle", cells=((0, 0), (0, 1), (1, 1), (3, 3), (2, 5)))
    grid = np.stack(np.meshgrid(np.arange(28), np.arange(28)), axis=-1).reshape(-1, 2)
    position = 61.5 + 2.85 * grid + rng.uniform(-0.3, 0.3, grid.shape)
    clear = (np.abs(position - (98.0, 100.0)) > (7.5, 5.5)).any(axis=1)
    position = position[clear]
    explosive = rng.random(len(position)) < 0.3
    return scene(
        balls(
            np.where(explosive, EXPLOSIVE, AIR).tolist(),
            position.tolist(),
            rng.normal(0.0, 300.0, position.shape).tolist(),
            mass=np.where(explosive, 1.0, 0.3),
            radius=np.where(explosive, 0.7, 1.0),
        ),
        [*closed_box((60.0, 60.0), (40, 40)), obstacle],
        settings,
    )


@pytest.mark.parametrize("collide_within_charge", [True, False])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_gas_finds_its_way_back(seed: int, collide_within_charge: bool) -> None:
    """Ten collisions a ball. An error in a position grows by some 1 + 2 l / r in each, where l is
    the way between two of them and r a radius: here about by three. From a rounding of 1e-14
    units, 3^10 makes 1e-9, and more for the ball that meets most others. A single wrong collision
    gives errors of whole units.
    """
    settings = parameters(
        explosive={**ELASTIC, "collide_within_charge": collide_within_charge},
        air=ELASTIC,
        contact={**KEEP_MASS, "module_restitution": 1.0},
    )
    there = gas(settings, seed)
    run = EVENT.start(there)
    run.advance(0.02)
    turned = run.balls()
    assert run.steps > 3000
    assert len(run.log) > 100
    back = replace(there.balls, position=turned.position, velocity=-turned.velocity)
    return_run = EVENT.start(replace(there, balls=back))
    return_run.advance(0.02)
    assert return_run.steps == run.steps
    assert len(return_run.log) == len(run.log)
    error = np.hypot(*(return_run.balls().position - there.balls.position).T)
    assert np.median(error) < 1e-9
    assert error.max() < 1e-5
