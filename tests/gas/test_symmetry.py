"""Mirrors and quarter turns of a scene turn its result, and what must not matter does not."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env import simulate
from blast_env.gas import FaceLoads, exposed_faces, kernels, simd
from blast_env.gas import solver as solver_module
from tests.builders import block, site
from tests.gas.flows import blast, face_loads, recorder, street

Turn = Callable[[NDArray[Any]], NDArray[Any]]
TIME_S = 0.02


def as_it_is(values: NDArray[Any]) -> NDArray[Any]:
    return values


@cache
def turned(turn: Turn, precision: str) -> NDArray[np.float64]:
    """Return the pressure of the blast in a turned street."""
    plain = blast(street(), (6, 9, 0))
    density, pressure = plain.density(), plain.pressure()
    solver = blast(np.ascontiguousarray(turn(street())), (0, 0, 0), radius=0.0, precision=precision)
    solver.set_state(density_kg_m3=turn(density), pressure_pa=turn(pressure))
    solver.advance(TIME_S)
    return solver.pressure()


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("single", 1e-4)])
def test_a_mirrored_scene_mirrors_the_result(precision: str, tolerance: float) -> None:
    plain = turned(as_it_is, precision)
    other = turned(np.flipud, precision)
    # Relative to the largest overpressure.
    scale = plain.max() - 101_325.0
    assert scale > 1e4
    assert np.abs(other - np.flipud(plain)).max() < tolerance * scale


def test_a_block_wider_than_vectors_of_cells_mirrors_the_result() -> None:
    """Vectors without air are left out; other ones in the mirrored scene."""
    solid = np.zeros((70, 20, 12), dtype=bool)
    solid[21:62, 8:12, :6] = True
    plain = blast(solid, (14, 3, 0), precision="double")
    other = blast(np.flipud(solid).copy(), (0, 0, 0), radius=0.0, precision="double")
    other.set_state(
        density_kg_m3=np.flipud(plain.density()), pressure_pa=np.flipud(plain.pressure())
    )
    for solver in (plain, other):
        solver.advance(TIME_S)
    scale = plain.pressure().max() - 101_325.0
    assert scale > 1e4
    assert np.abs(other.pressure() - np.flipud(plain.pressure())).max() < 1e-12 * scale


@pytest.mark.parametrize("walled", [False, True], ids=["open", "walled"])
@pytest.mark.parametrize(("charge_kg", "gap_m"), [(20.0, 8.0), (100.0, 10.0)])
def test_a_quarter_turn_changes_loads_by_a_thousandth(
    charge_kg: float, gap_m: float, walled: bool
) -> None:
    """A cross of four blocks around a charge, also behind four walls: x and y are alike.

    The sweeps of a step follow each other, so that they are not so to the last bit.
    """
    near, far = 20.0 - gap_m - 2.0, 20.0 + gap_m
    wide = {"south": (14.0, near), "north": (14.0, far)}
    deep = {"west": (near, 14.0), "east": (far, 14.0)}
    walls = ((18.0, 15.5, 1, 8), (18.0, 24.0, 1, 8), (15.5, 18.0, 8, 1), (24.0, 18.0, 8, 1))
    scenario = site(
        "cross",
        (40.0, 40.0),
        {"kind": "point", "position_m": (20.0, 20.0), "tnt_kg": charge_kg},
        *(block(name, *place, 4, 24, protected=True) for name, place in wide.items()),
        *(block(name, *place, 24, 4, protected=True) for name, place in deep.items()),
        *(block(f"wall_{k}", *wall) for k, wall in enumerate(walls if walled else ())),
    )
    result = simulate(scenario, engine="gas")
    south, north, west, east = (result.impulse(name).pa_s for name in (*wide, *deep))
    assert south > 150.0
    assert north == pytest.approx(south, rel=1e-6)
    assert east == pytest.approx(west, rel=1e-6)
    assert west == pytest.approx(south, rel=1e-3)


@pytest.mark.parametrize(("precision", "time_s"), [("double", 0.002), ("single", 0.02)])
def test_leaving_out_still_air_changes_no_bit(precision: str, time_s: float) -> None:
    """While most of the air is still, and when hardly any is."""
    left_out = blast(street(), (6, 9, 0), precision=precision)
    all_done = blast(street(), (6, 9, 0), precision=precision, skip_still_air=False)
    left_out.advance(time_s)
    all_done.advance(time_s)
    assert left_out.cell_updates < all_done.cell_updates == all_done.steps * street().size
    assert left_out.time_s == all_done.time_s
    assert (left_out.state == all_done.state).all()


def test_only_rows_that_the_wave_has_reached_are_moved() -> None:
    """A hemisphere has 0.52 of the cells of the box around it."""
    solver = blast(np.zeros((60, 60, 30), dtype=bool), (30, 30, 0))
    solver.advance(0.008)
    cells = np.diff(solver.extent)[..., 0]
    planes, rows = (np.count_nonzero(cells.any(axis=axis)) for axis in (1, 0))
    assert 20 < cells.max() < 60
    assert cells.sum() < 0.65 * planes * rows * cells.max()


def test_nothing_happens_in_still_air() -> None:
    solver = blast(street(), (6, 9, 0), radius=0.0)
    before = solver.state.copy()
    solver.advance(0.01)
    assert solver.cell_updates == 0
    assert (solver.state == before).all()
    everywhere = blast(street(), (6, 9, 0), radius=0.0, skip_still_air=False)
    everywhere.advance(0.01)
    assert (everywhere.state == before).all()


def test_threads_and_calls_change_no_bit() -> None:
    """One thread or three, in one go or in many."""
    states = []
    for threads in (1, 3, 1):
        solver = blast(street(), (6, 9, 0), threads=threads)
        solver.advance(TIME_S)
        states.append(solver.state)
    stopped = blast(street(), (6, 9, 0))
    for time_s in np.linspace(0.0, TIME_S, 30):
        stopped.advance(float(time_s))
    for state in (*states[1:], stopped.state):
        assert (state == states[0]).all()


def test_compiled_code_comes_back_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Large grids were deaf to Ctrl-C for seconds; how a pass is cut into calls does not matter."""
    whole = blast(street(), (6, 9, 0), threads=2)
    whole.advance(TIME_S)
    moved: list[int] = []
    compiled = kernels.sweep

    def sweep(*arguments: Any) -> None:
        _, _, _, extent, (_, second), first, end, *_ = arguments
        cells = np.diff(extent)
        is_pair = second >= 0
        moved.append(int((2 * cells[:, first:end] if is_pair else cells[first:end]).sum()))
        compiled(*arguments)

    monkeypatch.setattr(kernels, "sweep", sweep)
    monkeypatch.setattr(solver_module, "_CELLS_PER_CALL", 500)
    cut = blast(street(), (6, 9, 0), threads=2)
    cut.advance(TIME_S)
    nx, ny, nz = street().shape
    assert len(moved) > 4 * whole.steps
    assert max(moved) <= max(500, nx * ny, 2 * nx * nz)
    assert (cut.state == whole.state).all()


@pytest.mark.parametrize("precision", ["single", "double"])
def test_where_vectors_begin_changes_no_bit(precision: str) -> None:
    """The same scene, some cells further along rows of several vectors."""
    length = 3 * simd.LANES + 5
    solid = np.zeros((length, 8, 4), dtype=bool)
    solid[::13, 2:5, :2] = True
    pressure = np.full(solid.shape, 101_325.0)
    pressure[np.arange(length) % 20 < 3, 1:4, :2] = 3e6
    results = []
    for shift in (0, 1, 7, simd.LANES - 1):
        around = ((30 + shift, 60 - shift), (0, 0), (0, 0))
        grown = np.pad(solid, around)
        hot = np.pad(pressure, around, constant_values=101_325.0)
        solver = blast(grown, (0, 0, 0), radius=0.0, precision=precision, with_fuel=True)
        solver.set_state(density_kg_m3=1.225, pressure_pa=hot, fuel_kg_m3=hot > 2e5)
        solver.advance(0.004)
        pressures = np.roll(solver.pressure(), -shift, axis=0)
        results.append((solver.time_s, pressures[2:-60], np.roll(solver.fuel(), -shift, 0)[2:-60]))
    for time_s, pressures, fuel in results[1:]:
        assert time_s == results[0][0]
        assert (pressures == results[0][1]).all()
        assert (fuel == results[0][2]).all()


def test_single_precision_gives_the_loads_of_double() -> None:
    """To 1e-4, on every face of the house."""

    def loads(precision: str) -> FaceLoads:
        house = np.zeros_like(street())
        house[20:25, 10:15, 0:8] = True
        solver = blast(
            street(),
            (6, 9, 0),
            loaded=lambda grid: exposed_faces(grid, house),
            looking=face_loads,
            precision=precision,
        )
        solver.advance(0.05)
        return recorder(solver, FaceLoads)

    single, double = loads("single"), loads("double")
    assert double.impulse_pa_s.min() > 10.0
    for name in ("impulse_pa_s", "net_impulse_pa_s", "peak_pa", "arrival_s"):
        assert getattr(single, name) == pytest.approx(getattr(double, name), rel=1e-4)
