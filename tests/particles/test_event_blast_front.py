"""The front of a strong blast: laws of gas dynamics that no rule of the engine knows of."""

from math import pi

import numpy as np
import pytest

from tests.particles.blast_front import (
    AIR_DENSITY,
    SEDOV_GAS,
    SPACING_UNITS,
    FrontCase,
    front_at,
)


def test_an_elastic_blast_is_sedov_s() -> None:
    """60,000 balls; the air swept up is 20 to 115 times as heavy as the charge.

    One seed's densest place scatters by 2 %, which is 0.02 in an exponent over this range. A last
    bit makes as much of a difference as a seed, so the bounds are three deviations of seeds away.
    """
    case = FrontCase(restitution=1.0, side_spacings=245)
    law = np.geomspace(45.0, 105.0, 8)
    time_s = (law * SPACING_UNITS) ** 2 * (SEDOV_GAS * AIR_DENSITY / case.energy) ** 0.5
    front = front_at(case, time_s)
    assert np.log(front.radius / law).mean() == pytest.approx(0.0, abs=0.05)
    assert np.abs(front.radius / law - 1.0).max() < 0.1
    assert front.exponent(time_s) == pytest.approx(1.0 / 2.0, abs=0.06)
    assert 1.3 < front.compression.min() < front.compression.max() < 3.0  # 3 in a sharp front


def test_an_inelastic_blast_is_a_snowplough() -> None:
    """It reaches t^(1/3) only slowly, because the swept air is hot at first: its pressure adds to
    the radial momentum, so the law is taken with what there is at each time.
    """
    case = FrontCase(restitution=0.3, side_spacings=120, ball_count=100)
    of_charge = case.ball_count * case.speed_units_per_s
    radius = np.geomspace(22.0, 50.0, 8) * SPACING_UNITS
    time_s = radius**3 * pi * AIR_DENSITY / 3.0 / of_charge
    front = front_at(case, time_s)
    law = (3.0 * front.momentum * time_s / (pi * AIR_DENSITY)) ** (1.0 / 3.0) / SPACING_UNITS
    assert np.log(front.radius / law).mean() == pytest.approx(0.0, abs=0.05)
    assert front.exponent(time_s) == pytest.approx(1.0 / 3.0, abs=0.06)
    assert front.compression[-1] > 3.0  # beyond what any elastic front of this gas can reach
    assert front.momentum[1:] == pytest.approx(front.momentum[:-1], rel=0.1)
