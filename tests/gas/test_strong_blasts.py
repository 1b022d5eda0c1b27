"""Density and pressure stay positive where a strong blast meets walls, corners and gaps."""

import numpy as np
import pytest

from blast_env.gas.state import ENERGY
from tests.gas.flows import CLOSED, blast


@pytest.mark.parametrize(("precision", "pressure_pa"), [("single", 2e10), ("double", 5e8)])
def test_beside_walls_in_corners_and_gaps(precision: str, pressure_pa: float) -> None:
    """A ball of 1,600 kg/m^3 that touches a wall, with gaps of one cell, a corner and a notch."""
    solid = np.zeros((28, 24, 12), dtype=bool)
    solid[9:11, 2:22, 0:8] = True
    solid[9:11, 8, 0:8] = False  # a gap of one cell
    solid[9:11, 12, 3] = False  # a hole of one cell
    solid[0:9, 3:5, 0:6] = True  # a corner
    solid[16:24, 10, 0:6] = True
    solid[18, 10, 0:3] = False
    solid[20:22, 14:16, 5:7] = True  # hangs in the air
    solver = blast(
        solid, (6, 8, 1), pressure_pa=pressure_pa, density_kg_m3=1600.0, precision=precision
    )
    for time_s in np.linspace(0.001, 0.02, 20):
        solver.advance(float(time_s))
        air = ~solid
        assert solver.density()[air].min() > 0.0
        assert solver.pressure()[air].min() > 0.0
        assert np.isfinite(solver.state).all()
    assert solver.steps < 2000


def test_streams_that_part_leave_next_to_nothing() -> None:
    """Faster than the gas can follow: a vacuum in all but name."""
    solver = blast(np.zeros((40, 1, 1), dtype=bool), (0, 0, 0), radius=0.0, faces=CLOSED)
    x = np.arange(40).reshape(-1, 1, 1)
    solver.set_state(
        density_kg_m3=1.225,
        velocity_m_s=[np.where(x < 20, -20_000.0, 20_000.0), 0.0, 0.0],
        pressure_pa=101_325.0,
    )
    solver.advance(2e-4)
    assert np.isfinite(solver.state).all()
    assert 0.0 < solver.density().min() < 0.02
    assert solver.pressure().min() > 0.0


@pytest.mark.parametrize("energy", [-1.0, 0.0, float("nan")])
def test_cells_without_pressure_are_lifted_and_counted(energy: float) -> None:
    """Should a cell ever lose its pressure, the run goes on, and says so."""
    solver = blast(np.zeros((12, 12, 12), dtype=bool), (4, 4, 4))
    solver.step()
    assert solver.floored_cells == 0
    solver.state[ENERGY, 6, 6, 6] = energy
    solver.step()
    assert solver.floored_cells == 1
    assert np.isfinite(solver.state).all()
    assert solver.pressure().min() > 0.0
