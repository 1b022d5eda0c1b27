"""Friction: none at all, and Coulomb's law for discs that spin, by hand."""

from math import sqrt

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
    parameters,
    scene,
    states_at,
    wall,
)
from tests.particles.worlds import WorldRun

FAR_WALL = wall((180.0, 180.0), 2, 2)
RESTITUTION = 0.64


def settings(coefficient: float, inertia_factor: float = 0.5) -> SimulationParameters:
    """Both coefficients of a contact are products: these give `coefficient` and RESTITUTION."""
    of_ball = {
        "elasticity": sqrt(RESTITUTION),
        "friction": sqrt(coefficient),
        "inertia_factor": inertia_factor,
    }
    contact = {"module_restitution": RESTITUTION, "module_friction": sqrt(coefficient)}
    return parameters(explosive=of_ball, air=of_ball, contact=KEEP_MASS | contact)


@pytest.mark.parametrize("along", [0.0, 123.456789, -1e-7, 3e4])
def test_without_friction_tangential_velocities_stay_to_the_last_bit(along: float) -> None:
    """Two balls at exactly the same height, then one at a wall: the normal is exactly along x."""
    velocities = [(300.0, along), (-1e3, along)]
    pair = balls([AIR, AIR], [(50.0, 120.0), (52.5, 120.0)], velocities, [1.0, 3.0])
    met = states_at(scene(pair, [FAR_WALL], settings(0.0)), 1e-3)
    assert (met.velocity[:, 0] != pair.velocity[:, 0]).all()
    assert met.velocity[:, 1].tolist() == [along, along]
    at_wall = balls([AIR], [(98.5, 120.0)], [(300.0, along)])
    bounced = states_at(scene(at_wall, [wall((100.0, 2.0), 98, 1)], settings(0.0)), 2e-3)
    assert bounced.velocity[0, 0] == pytest.approx(-RESTITUTION * 300.0)
    assert bounced.velocity[0, 1] == along


def brushing(
    of_settings: SimulationParameters, masses: tuple[float, float], radii: tuple[float, float]
) -> Scene:
    """The first ball comes with (200, 80) and meets the second, at rest, along x."""
    time_s = 0.05
    first = (60.0, 80.0)
    second = (60.0 + 200.0 * time_s + sum(radii), 80.0 + 80.0 * time_s)
    pair = balls([AIR, EXPLOSIVE], [first, second], [(200.0, 80.0), (0.0, 0.0)], masses, radii)
    return scene(pair, [FAR_WALL], of_settings)


@pytest.mark.parametrize("inertia_factor", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("coefficient", [0.01, 0.05, 0.2, 5.0])
def test_balls_slide_or_stick_by_coulomb_s_law(coefficient: float, inertia_factor: float) -> None:
    """The tangential impulse is what stops the slip, but at most the coefficient times J.

    Slip of the surfaces: v_t - w1 r1 - w2 r2. An impulse P changes it by
    P (1/m1 + 1/m2) (1 + 1/f) where f m r^2 are the moments of inertia.
    """
    (m1, m2), (r1, r2) = masses, radii = (0.4, 1.5), (0.8, 1.3)
    run = WorldRun(brushing(settings(coefficient, inertia_factor), masses, radii))
    one, other = run.balls_at(0.06)
    reduced = m1 * m2 / (m1 + m2)
    normal = (1.0 + RESTITUTION) * reduced * 200.0
    sticking = 80.0 * reduced / (1.0 + 1.0 / inertia_factor)
    along = min(sticking, coefficient * normal)
    assert one["vx"] == pytest.approx(200.0 - normal / m1, rel=1e-9)
    assert other["vx"] == pytest.approx(normal / m2, rel=1e-9)
    assert one["vy"] == pytest.approx(80.0 - along / m1, rel=1e-9)
    assert other["vy"] == pytest.approx(along / m2, rel=1e-9)
    # The first brushes past on its right side, upwards: it is turned clockwise, and so is the
    # second on its left side, like two gears that both turn back.
    assert one["spin"] == pytest.approx(-along * r1 / (inertia_factor * m1 * r1**2), rel=1e-9)
    assert other["spin"] == pytest.approx(-along * r2 / (inertia_factor * m2 * r2**2), rel=1e-9)
    slip = other["vy"] - one["vy"] - (one["spin"] * r1 + other["spin"] * r2)
    assert (abs(slip) < 1e-9 * 80.0) == (sticking <= coefficient * normal)


def test_a_ball_that_sticks_to_a_wall_rolls_and_then_brakes_at_the_opposite_wall() -> None:
    """Solid disc: v_t falls to 2/3, with w r = v_t. At the other wall the spin is the wrong way
    round: the slip is 2 v_t, and v_t falls to a third.
    """
    of_scene = scene(
        balls([AIR], [(90.0, 40.0)], [(500.0, 90.0)]),
        [wall((100.0, 20.0), 80, 1), wall((78.0, 20.0), 80, 1, "left")],
        settings(10.0),
    )
    run = WorldRun(of_scene)
    first = run.balls_at(9.0 / 500.0 + 1e-6)[0]
    assert first["vx"] == pytest.approx(-RESTITUTION * 500.0)
    assert first["vy"] == pytest.approx(60.0)
    assert abs(first["spin"]) == pytest.approx(60.0)
    second = run.balls_at(9.0 / 500.0 + 18.0 / (RESTITUTION * 500.0) + 1e-6)[0]
    assert second["collisions"] == 2
    assert second["vy"] == pytest.approx(20.0)
    assert second["spin"] == pytest.approx(np.sign(-first["spin"]) * 20.0)


@pytest.mark.parametrize("coefficient", [0.02, 0.03])
def test_a_ball_slides_along_a_wall_by_coulomb_s_law(coefficient: float) -> None:
    of_scene = scene(
        balls([AIR], [(90.0, 40.0)], [(500.0, 90.0)], 2.5, 0.8),
        [wall((100.0, 20.0), 80, 1)],
        settings(coefficient),
    )
    run = EVENT.start(of_scene)
    run.advance(0.03)
    push = coefficient * (1.0 + RESTITUTION) * 500.0
    assert run.balls().velocity[0] == pytest.approx([-RESTITUTION * 500.0, 90.0 - push])
    # The record is that of the normal: friction is no part of it.
    assert run.log.to_array()["transferred_impulse"] == pytest.approx((1 + RESTITUTION) * 1250.0)
