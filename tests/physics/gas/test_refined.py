"""Cells of several sizes: nothing is lost at seams, and loads are those of the finest cells."""

from typing import NamedTuple

import numpy as np
import pytest

from blast_env.physics.gas.faces import exposed_faces
from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.probes import FaceLoads
from blast_env.physics.gas.refined import RefinedSolver, Refinement
from blast_env.physics.gas.solver import GasSolver
from blast_env.physics.gas.source import GasCharge, set_charge

CELL_M = 0.5
CHARGE = GasCharge(20.0, (4.0, 7.0, 0.0))
FINE, COARSE = Refinement((0.01, 0.01)), Refinement((0.3, 0.6))
ONLY_COARSE = Refinement((1e6, 1e6), least=1e6)


class Run(NamedTuple):
    """A run, and the loads of its faces."""

    solver: RefinedSolver | GasSolver
    loads: FaceLoads


def site() -> GasGrid:
    """Return a wall and a house that cells of 2 m can show: they need no finer ones."""
    solid = np.zeros((32, 28, 16), dtype=bool)
    solid[16:20, 8:20, 0:4] = True
    solid[24:28, 8:20, 0:8] = True
    return GasGrid(CELL_M, solid, skirt=6)


def run(refinement: Refinement | None, until_s: float, threads: int = 1) -> Run:
    grid = site()
    faces = exposed_faces(grid, grid.solid)
    loads = FaceLoads(len(faces))
    solver: RefinedSolver | GasSolver
    if refinement is None:
        burning = CHARGE.burning
        solver = GasSolver(grid, faces=faces, recorders=[loads], with_fuel=True, burning=burning)
    else:
        solver = RefinedSolver(
            grid,
            refinement,
            faces=faces,
            recorders=[loads],
            burning=CHARGE.burning,
            threads=threads,
        )
    set_charge(solver, CHARGE, 2.0)
    while solver.time_s < until_s:
        solver.step()
    return Run(solver, loads)


def test_nothing_is_lost_at_seams() -> None:
    """Mass and energy while waves cross seams, before anything leaves; nothing burns."""
    grid = site()
    solver = RefinedSolver(grid, COARSE)
    set_charge(solver, CHARGE, 2.0)
    before = solver.totals()
    charge_j = 5e7  # its energy is of this size, all the air's is a thousand times that
    counts = set()
    while solver.time_s < 0.02:
        solver.step()
        counts.add(len(solver.levels[-1].slots))
    after = solver.totals()
    assert len(counts) > 3  # finer cells came and went
    assert solver.lifted == 0
    assert after.mass_kg == pytest.approx(before.mass_kg, rel=2e-7)
    assert after.energy_j == pytest.approx(before.energy_j, abs=0.01 * charge_j)
    assert after.fuel_kg == pytest.approx(before.fuel_kg, rel=1e-4)


def test_still_air_stays_still() -> None:
    """To the last bit, on every level and through every seam."""
    grid = site()
    solver = RefinedSolver(grid, FINE)
    still = {"density_kg_m3": solver.density_kg_m3, "pressure_pa": solver.pressure_pa}
    part = (4, 4, 4)
    values = {name: np.full(part, value) for name, value in still.items()}
    nothing = np.zeros(part)
    start = (4, 4, 0)
    solver.set_state(**values, velocity_m_s=(nothing,) * 3, fuel_kg_m3=nothing, start=start)
    assert len(solver.levels[-1].slots) > 0
    solver.step()
    for level in solver.levels:
        assert (level.old[level.slots, 0] == 1.0).all()
        assert (level.old[level.slots, 1:4] == 0.0).all()
        assert (level.old[level.slots, 4] == np.float32(2.5)).all()


def test_threads_change_nothing() -> None:
    one, two = run(COARSE, 0.012), run(COARSE, 0.012, threads=3)
    assert one.solver.steps == two.solver.steps
    assert (one.solver.wall_overpressure_pa() == two.solver.wall_overpressure_pa()).all()
    assert (one.loads.positive_impulse_pa_s == two.loads.positive_impulse_pa_s).all()


def test_finer_cells_come_nearer_to_uniform_ones() -> None:
    """The first wave on all faces; cells that are never halved clip its peaks."""
    until_s = 0.03
    uniform, fine, coarse = run(None, until_s), run(FINE, until_s), run(ONLY_COARSE, until_s)

    def off(each: Run) -> tuple[float, float]:
        exact = uniform.loads
        impulse = each.loads.positive_impulse_pa_s - exact.positive_impulse_pa_s
        peak = each.loads.peak_pa - exact.peak_pa
        return (
            float(np.abs(impulse).mean() / exact.positive_impulse_pa_s.mean()),
            float(np.abs(peak).mean() / exact.peak_pa.mean()),
        )

    assert off(fine)[0] < 0.02
    assert off(fine)[1] < 0.02
    assert off(coarse)[1] > 5.0 * off(fine)[1]


def test_a_mirrored_site_has_the_mirrored_loads() -> None:
    """To rounding: boxes are cut in another order."""
    grid = site()
    solid = grid.solid[:, ::-1].copy()
    mirrored = GasGrid(CELL_M, solid, skirt=6)
    faces = exposed_faces(mirrored, solid)
    loads = FaceLoads(len(faces))
    solver = RefinedSolver(mirrored, FINE, faces=faces, recorders=[loads])
    set_charge(solver, CHARGE, 2.0)
    while solver.time_s < 0.012:
        solver.step()
    plain = RefinedSolver(grid, FINE, faces=exposed_faces(grid, grid.solid))
    set_charge(plain, CHARGE, 2.0)
    while plain.time_s < 0.012:
        plain.step()
    # The charge is in the middle of the site, so that it is its own mirror image.
    ground = plain.overpressure_in(2, 0)
    assert solver.overpressure_in(2, 0)[:, ::-1] == pytest.approx(ground, abs=20.0)
    assert np.abs(ground).max() > 5e4
