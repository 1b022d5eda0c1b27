"""The charge at the moment of the detonation."""

import numpy as np
import pytest

from blast_env.site.balls import Balls, explosion_fan
from blast_env.site.parameters import ExplosiveParameters

KEPT = ExplosiveParameters(ball_count=20_000)


def fan(parameters: ExplosiveParameters) -> Balls:
    return explosion_fan(parameters, (50.0, 60.0), np.random.default_rng(0))


def kinetic_energy(balls: Balls) -> float:
    return float(0.5 * (balls.mass * (balls.velocity**2).sum(axis=1)).sum())


def test_every_ball_flies_straight_out_in_its_own_direction() -> None:
    balls = fan(ExplosiveParameters(ball_count=720))
    outwards = balls.position - (50.0, 60.0)
    assert np.hypot(*outwards.T) == pytest.approx(KEPT.offset_units)
    assert balls.velocity == pytest.approx(2000.0 / KEPT.offset_units * outwards)
    angle = np.sort(np.arctan2(*balls.velocity.T[::-1]))
    assert np.diff(angle) == pytest.approx(2.0 * np.pi / 720)
    assert balls.mass == pytest.approx(KEPT.mass)


@pytest.mark.parametrize("share", [0.25, 0.75, 1.0])
def test_the_thermal_share_moves_energy_and_adds_none(share: float) -> None:
    """With 20,000 balls the energy of the random part scatters by less than 1 %."""
    hot = fan(KEPT.model_copy(update={"thermal_share": share}))
    assert kinetic_energy(hot) == pytest.approx(kinetic_energy(fan(KEPT)), rel=0.03)
    direction = (hot.position - (50.0, 60.0)) / KEPT.offset_units
    radial = (hot.velocity * direction).sum(axis=1)
    assert radial.mean() == pytest.approx(2000.0 * np.sqrt(1.0 - share), abs=40.0)
    across = hot.velocity - radial[:, np.newaxis] * direction
    assert (across**2).sum(axis=1).mean() == pytest.approx(share / 2.0 * 2000.0**2, rel=0.03)
