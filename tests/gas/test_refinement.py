"""Cells that are small at fronts: nothing is lost, and loads stay near those of small cells."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas import (
    FaceKind,
    FaceLoads,
    GasGrid,
    GasSolver,
    Gauges,
    RefinedSolver,
    exposed_faces,
    shape_of_blocks,
)
from blast_env.units import MODULE_SIDE_M
from tests.builders import block, point, site
from tests.gas.flows import CLOSED

SHAPE = (128, 64, 32)
CELL_M = 0.25
TIME_S = 0.03


def two_houses() -> NDArray[np.bool_]:
    """Return a wall of a small cell's thickness, and a house; no larger cells show them."""
    solid = np.zeros(SHAPE, dtype=bool)
    solid[35, 11:37, 0:13] = True
    solid[47:58, 9:22, 0:19] = True
    return solid


class Run(NamedTuple):
    """A run and what it recorded."""

    gas: Any
    loads: FaceLoads
    gauges: Gauges


def run(levels: int, precision: str = "single", until_s: float = TIME_S, **options: Any) -> Run:
    """Return a hot ball between two houses, on uniform cells for 0 levels."""
    faces: dict[str, Any] = options.pop("faces", {})
    grid = GasGrid(CELL_M, options.pop("solid", two_houses()), **faces)
    walls = exposed_faces(grid, grid.solid)
    looking = FaceLoads(len(walls)), Gauges(grid, [(25, 20, 2), (60, 40, 5)])
    settings = {"faces": walls, "recorders": looking, "precision": precision, **options}
    gas: Any = RefinedSolver(grid, levels, **settings) if levels else GasSolver(grid, **settings)
    places = np.indices(grid.shape) + 0.5
    distance = np.sqrt(sum((places[k] - (20, 22, 0)[k]) ** 2 for k in range(3)))
    hot = (distance < 6) & ~grid.solid
    gas.set_state(
        density_kg_m3=np.where(hot, 3.0, gas.density_kg_m3),
        pressure_pa=np.where(hot, 1e6, gas.pressure_pa),
    )
    gas.advance(until_s)
    return Run(gas, *looking)


@cache
def uniform(precision: str = "single") -> Run:
    return run(0, precision)


@cache
def refined(levels: int) -> Run:
    return run(levels)


def test_one_level_is_the_solver_of_uniform_cells() -> None:
    """To rounding, on cells that are not refined, with an open border."""
    one, other = refined(1), uniform()
    assert one.gas.steps == other.gas.steps
    assert one.gas.time_s == pytest.approx(other.gas.time_s, rel=1e-7)
    peak = other.loads.peak_pa.max()
    assert one.loads.peak_pa == pytest.approx(other.loads.peak_pa, abs=1e-5 * peak)
    assert one.gauges.history_pa == pytest.approx(other.gauges.history_pa, abs=1e-5 * peak)


@pytest.mark.parametrize(("precision", "tolerance"), [("single", 1e-6), ("double", 1e-12)], ids=str)
def test_nothing_is_lost_in_a_closed_box(precision: str, tolerance: float) -> None:
    """Over borders of three levels that move with the front."""
    begun = run(3, precision, 0.0, faces=CLOSED)
    before = begun.gas.totals()
    begun.gas.advance(2.0 * TIME_S)
    after = begun.gas.totals()
    assert begun.gas.steps > 100
    assert min(begun.gas.blocks()) > 0
    assert begun.gas.floored_cells == 0
    assert after.mass_kg == pytest.approx(before.mass_kg, rel=tolerance)
    assert after.energy_j == pytest.approx(before.energy_j, rel=tolerance)


@pytest.mark.parametrize("levels", [2, 3])
def test_loads_are_those_of_small_cells(levels: int) -> None:
    """On walls and in the air, with cells of up to four times the side elsewhere."""
    small, other = uniform(), refined(levels)
    for one, two in ((small.loads, other.loads), (small.gauges, other.gauges)):
        scale = np.abs(one.impulse_pa_s).mean()
        assert np.abs(two.impulse_pa_s - one.impulse_pa_s).mean() < 0.05 * scale
        assert two.peak_pa.mean() == pytest.approx(one.peak_pa.mean(), rel=0.03)


def test_threads_and_the_division_of_a_run_change_nothing() -> None:
    one = refined(3)
    two = run(3, threads=3, until_s=0.01)
    two.gas.advance(TIME_S)
    assert one.gas.steps == two.gas.steps
    assert (one.loads.impulse_pa_s == two.loads.impulse_pa_s).all()
    assert (one.gauges.history_pa == two.gauges.history_pa).all()


def test_still_air_stays_still_to_the_last_bit() -> None:
    """Around borders of levels, walls, and the open borders."""
    grid = GasGrid(CELL_M, two_houses(), buffer_layers=8)
    walls = exposed_faces(grid, grid.solid)
    gas = RefinedSolver(grid, 3, faces=walls)
    gas.set_state(density_kg_m3=gas.density_kg_m3, pressure_pa=gas.pressure_pa)
    gas.advance(0.005)
    assert gas.cell_updates == 0
    assert (gas.wall_overpressure_pa() == 0.0).all()
    assert (gas.overpressure_in(2, 0) == 0.0).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_front_crosses_a_border_of_levels_as_if_it_were_not_there(axis: int) -> None:
    """A shock in a pipe: where it is, and how strong, against small cells throughout."""
    shape = [16, 16, 16]
    shape[axis] = 128
    grid = GasGrid(CELL_M, np.zeros(shape, dtype=bool), **CLOSED)
    histories = []
    places = [[8, 8, 8] for _ in range(2)]
    for place, at in zip(places, (50, 80), strict=True):
        place[axis] = at
    for levels in (0, 3):
        gauges = Gauges(grid, np.array(places))
        solver: Any = RefinedSolver(grid, levels) if levels else GasSolver(grid)
        solver.recorders = (gauges,)
        row = np.arange(128).reshape([-1 if k == axis else 1 for k in range(3)])
        high = np.broadcast_to(row < 30, shape)
        solver.set_state(
            density_kg_m3=np.where(high, 4.0 * solver.density_kg_m3, solver.density_kg_m3),
            pressure_pa=np.where(high, 4.0 * solver.pressure_pa, solver.pressure_pa),
        )
        solver.advance(0.04)
        histories.append(gauges)
    small, other = histories
    assert other.peak_pa == pytest.approx(small.peak_pa, rel=0.003)
    assert other.steepest_s == pytest.approx(small.steepest_s, abs=1e-3)  # two steps
    times_s = np.linspace(0.0, 0.04, 200)
    for one, two in zip(small.history_pa.T, other.history_pa.T, strict=True):
        apart = np.interp(times_s, other.time_s, two) - np.interp(times_s, small.time_s, one)
        assert np.abs(apart).mean() < 0.01 * one.max()


def test_small_cells_are_where_the_front_is() -> None:
    """Most of the large cells behind it are whole again."""
    large, middle, small = refined(3).gas.blocks()
    assert large == 2 * 8 * 4 // 8
    assert 0 < small < 0.5 * 64 * large
    assert small < 8 * middle < 64 * large


def test_fronts_have_small_cells_only_where_they_are_followed() -> None:
    """The thin wall needs small cells; the front has them nowhere else, and peaks fall."""
    wide = refined(3)
    none = run(3, followed=lambda x_m, y_m: np.zeros(np.broadcast(x_m, y_m).shape, dtype=bool))
    assert none.gas.blocks()[2] < wide.gas.blocks()[2]
    assert none.gas.cell_updates < 0.8 * wide.gas.cell_updates
    assert none.loads.peak_pa.mean() < 0.98 * wide.loads.peak_pa.mean()


def test_the_grid_consists_of_whole_blocks() -> None:
    assert shape_of_blocks((17, 16, 1), 3) == (32, 16, 16)
    grid = GasGrid(CELL_M, np.zeros((16, 16, 20), dtype=bool))
    with pytest.raises(BlastEnvError, match="multiples of 16 for 3 levels"):
        RefinedSolver(grid, 3)


def test_a_blast_on_adaptive_cells_has_about_the_loads_of_small_ones() -> None:
    """With a charge, a skirt and the end of a run; faces and their order are the same."""
    house = block("house", 15.0, 6.0, 12, 6, height_m=3.0, protected=True)
    shed = block("shed", 15.0, 14.0, 4, 4, height_m=2.0)
    scene = site("yard", (24.0, 18.0, 8.0), point(6.0, 9.0, 5.0), house, shed)
    one, other = (
        GasBlast(scene, engine=engine).run()
        for engine in (GasEngine(cell_m=CELL_M), GasEngine(cells="adaptive"))
    )
    assert isinstance(other.run.solver, RefinedSolver)
    assert other.run.grid.cell_m == one.run.grid.cell_m == 0.5 * MODULE_SIDE_M
    (load, _), (near, aside) = (found.loads().structures for found in (one, other))
    assert near.impulse_pa_s == pytest.approx(load.impulse_pa_s, rel=0.03)
    assert near.peak_pa == pytest.approx(load.peak_pa, rel=0.03)
    # Fronts are followed to what is protected alone, and the load on the shed says so.
    for found, is_flagged in ((load, False), (near, False), (aside, True)):
        assert found.validation.reason.startswith("adaptive cells follow") == is_flagged


def test_a_mirror_is_a_border_of_all_levels() -> None:
    """Half a scene at a mirror is half of the whole scene."""
    half = GasGrid(CELL_M, np.zeros((32, 32, 16), dtype=bool), y_low=FaceKind.MIRROR)
    whole = GasGrid(CELL_M, np.zeros((32, 64, 16), dtype=bool))
    planes = []
    for grid, middle in ((half, 0), (whole, 32)):
        gas = RefinedSolver(grid, 3)
        places = np.indices(grid.shape) + 0.5
        distance = np.sqrt(sum((places[k] - (16, middle, 0)[k]) ** 2 for k in range(3)))
        gas.set_state(
            density_kg_m3=np.where(distance < 6, 3.0, gas.density_kg_m3),
            pressure_pa=np.where(distance < 6, 1e6, gas.pressure_pa),
        )
        gas.advance(0.008)
        planes.append(gas.overpressure_in(2, 0)[:, -32:])
    assert planes[0] == pytest.approx(planes[1], abs=1e-3 * np.abs(planes[1]).max())
