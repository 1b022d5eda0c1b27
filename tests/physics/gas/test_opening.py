"""The stage before the grid joins on to what the grid computes."""

import numpy as np
import pytest

from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.opening import opening_of
from blast_env.physics.gas.probes import Gauges
from blast_env.physics.gas.solver import GasSolver
from blast_env.physics.gas.source import GasCharge, set_charge


def grid() -> GasGrid:
    return GasGrid(0.5, np.zeros((24, 8, 12), dtype=bool))


def test_the_opening_continues_on_the_grid() -> None:
    """A gauge has the same load whether the grid takes over before it or behind it."""
    charge = GasCharge(5.0, (1.0, 2.0, 0.0))
    cells = [(9, 4, 0)]
    gauges = Gauges(grid(), cells)
    solver = GasSolver(grid(), recorders=[gauges], with_fuel=True, burning=charge.burning)
    set_charge(solver, charge, 2.0)
    solver.advance(0.05)
    opening = opening_of(grid(), charge)
    distance_m = np.hypot(3.75, 0.25)
    assert opening.front_m > 2.0 * distance_m
    assert opening.peak_pa(distance_m) > gauges.peak_pa[0]  # the grid's cells clip it
    assert opening.positive_impulse_pa_s(distance_m) == pytest.approx(
        gauges.first_impulse_pa_s[0], rel=0.1
    )
    assert opening.at(opening.end_s, opening.front_m * 1.01) == 0.0
    assert opening.at(0.0, 3.0) == 0.0


def test_mass_scales_the_opening() -> None:
    small = opening_of(grid(), GasCharge(1.0, (1.0, 2.0, 0.0)))
    large = GasGrid(1.0, np.zeros((24, 8, 12), dtype=bool))
    large_one = opening_of(large, GasCharge(8.0, (2.0, 4.0, 0.0)))
    assert large_one.end_s == pytest.approx(2.0 * small.end_s)
    assert large_one.peak_pa(4.0) == pytest.approx(small.peak_pa(2.0), rel=1e-3)
