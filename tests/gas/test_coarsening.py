"""Cells that double: nothing is lost, and loads stay near those of the smallest cells."""

from typing import NamedTuple

import numpy as np
import pytest

from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas import (
    CELLS,
    CoarseningSolver,
    FaceKind,
    FaceLoads,
    Gas,
    GasCharge,
    GasGrid,
    GasSolver,
    Gauges,
    GroundMap,
    Settling,
    exposed_faces,
    set_charge,
    shape_to_double,
    with_double_cells,
)
from studies.bench import street

CELL_M = 0.5
CHARGE = GasCharge(20.0, (4.0, 8.0, 0.0))
DOUBLED_S = (0.008, 0.016)
MIRROR = FaceKind.MIRROR


def site() -> GasGrid:
    """Return a house that cells of 2 m show as it is, and a wall that is too thin for them."""
    solid = np.zeros(shape_to_double((32, 32, 16), 6, 2), dtype=bool)
    solid[14, 10:18, 0:4] = True
    solid[22:30, 10:22, 0:7] = True
    return GasGrid(CELL_M, solid, buffer_layers=6)


class Run(NamedTuple):
    """A run, and what has looked at it."""

    gas: Gas
    loads: FaceLoads
    gauges: Gauges
    ground: GroundMap


def run(
    doubled_s: tuple[float, ...], until_s: float, grid: GasGrid | None = None, threads: int = 1
) -> Run:
    grid = site() if grid is None else grid
    faces = exposed_faces(grid, grid.solid)
    looking = FaceLoads(len(faces)), Gauges(grid, [(19, 16, 2), (8, 4, 0)]), GroundMap(grid)
    solver = GasSolver(
        grid,
        faces=faces,
        recorders=looking,
        with_fuel=True,
        burning=CHARGE.burning,
        settling=Settling(0.012, 4.0),
        threads=threads,
    )
    set_charge(solver, CHARGE, 2.0)
    gas: Gas = CoarseningSolver(solver, doubled_s) if doubled_s else solver
    gas.advance(until_s)
    return Run(gas, *looking)


def test_nothing_is_lost_in_a_closed_box() -> None:
    """Mass, momentum along the ground, energy and fuel, at the moment of doubling."""
    solid = np.zeros((24, 24, 12), dtype=bool)
    solid[12:16, 8:16, 0:4] = True
    fine = GasGrid(
        CELL_M, solid, x_low=MIRROR, x_high=MIRROR, y_low=MIRROR, y_high=MIRROR, z_high=MIRROR
    )
    solver = GasSolver(fine, with_fuel=True, burning=CHARGE.burning, precision="double")
    set_charge(solver, GasCharge(20.0, (3.0, 6.0, 0.0)), 2.0)
    solver.advance(0.006)
    grid = with_double_cells(fine)
    before = solver.totals()
    after = solver.on_double_cells(grid, exposed_faces(grid, grid.solid)).totals()
    assert after.mass_kg == pytest.approx(before.mass_kg, rel=1e-12)
    assert after.energy_j == pytest.approx(before.energy_j, rel=1e-12)
    assert after.fuel_kg == pytest.approx(before.fuel_kg, rel=1e-12)
    assert after.momentum_kg_m_s == pytest.approx(before.momentum_kg_m_s, rel=1e-9, abs=1e-6)
    assert before.momentum_kg_m_s[0] > 100.0  # it has met the wall


def test_the_skirt_stays_where_it_is() -> None:
    """Its first layer becomes cells of the grid, and the open borders do not move."""
    fine = site()
    grid = with_double_cells(fine)
    assert grid.buffer_layers == fine.buffer_layers - 1
    for axis in range(3):
        low, high = (1.0 / case.narrowness(axis)[2:-2] for case in (fine, grid))
        assert fine.cell_m * low.sum() == pytest.approx(grid.cell_m * high.sum())
    fine_z, coarse_z = ((1.0 / case.narrowness(2))[2:-2] for case in (fine, grid))
    assert (coarse_z[-5:] * 2.0 == fine_z[-5:]).all()
    assert grid.origin_m == (-1.0, -1.0, 0.0)


@pytest.mark.parametrize("shape", [(31, 30, 13), (32, 33, 16), (5, 6, 7)])
@pytest.mark.parametrize("buffer_layers", [0, 6])
def test_a_shape_can_be_doubled(shape: tuple[int, int, int], buffer_layers: int) -> None:
    for times in range(4):
        more = shape_to_double(shape, buffer_layers, times)
        assert all(0 <= b - a < 2**times for a, b in zip(shape, more, strict=True))
        grid = GasGrid(CELL_M, np.zeros(more, dtype=bool), buffer_layers=buffer_layers)
        for _ in range(times):
            assert all(n % 2 == 0 for n in grid.shape)
            grid = with_double_cells(grid)


def test_threads_change_nothing() -> None:
    one, two = run(DOUBLED_S, 0.02), run(DOUBLED_S, 0.02, threads=3)
    assert one.gas.steps == two.gas.steps
    assert (one.loads.impulse_pa_s == two.loads.impulse_pa_s).all()
    assert (one.gauges.history_pa == two.gauges.history_pa).all()


def test_loads_stay_near_those_of_the_smallest_cells() -> None:
    """On cells of 2 m in the end; the largest peaks come before that, and are the same."""
    small, doubled = run((), 0.04), run(DOUBLED_S, 0.04)
    assert doubled.gas.cell_updates < 0.4 * small.gas.cell_updates
    for one, other in ((small.loads, doubled.loads), (small.gauges, doubled.gauges)):
        wanted = one.impulse_pa_s
        off = np.abs(other.impulse_pa_s - wanted).mean() / wanted.mean()
        assert off < 0.12
        assert other.peak_pa.max() == pytest.approx(one.peak_pa.max(), rel=1e-12)
    maps = small.ground.impulse_pa_s, doubled.ground.impulse_pa_s
    assert (np.isnan(maps[0]) == np.isnan(maps[1])).all()
    assert np.nanmean(np.abs(maps[0] - maps[1])) < 0.12 * np.nanmean(maps[0])


def test_a_mirrored_site_has_the_mirrored_loads() -> None:
    """To rounding in single precision; the charge is in the middle of the site."""
    grid = site()
    turned = GasGrid(CELL_M, grid.solid[:, ::-1].copy(), buffer_layers=6)
    plain = run(DOUBLED_S, 0.02, grid).ground.impulse_pa_s
    other = run(DOUBLED_S, 0.02, turned).ground.impulse_pa_s
    assert other[:, ::-1] == pytest.approx(plain, rel=1e-3, abs=0.1, nan_ok=True)


def test_a_blast_on_growing_cells_has_about_the_loads_of_uniform_ones() -> None:
    """On a street of 50 m, against cells that are small to the end; for a part of the work."""
    site = street(50.0)
    small, growing = (GasBlast(site, engine=GasEngine(cells=cells)).run() for cells in CELLS[:2])
    assert isinstance(growing.run.solver, CoarseningSolver)
    assert growing.run.solver.current.grid.cell_m == 1.0
    assert growing.run.solver.cell_updates < 0.95 * small.run.solver.cell_updates
    for load, other in zip(small.loads().structures, growing.loads().structures, strict=True):
        assert other.impulse_pa_s == pytest.approx(load.impulse_pa_s, rel=0.05)
