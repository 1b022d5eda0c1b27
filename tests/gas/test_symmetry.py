"""Mirrors and quarter turns of a scene turn its result, and what must not matter does not."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env.gas import FaceLoads, exposed_faces, kernels
from blast_env.gas import solver as solver_module
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


@pytest.mark.parametrize("turn", [np.flipud, np.rot90], ids=["mirror", "quarter turn"])
@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("single", 1e-4)])
def test_a_turned_scene_turns_the_result(turn: Turn, precision: str, tolerance: float) -> None:
    plain = turned(as_it_is, precision)
    other = turned(turn, precision)
    # Relative to the largest overpressure.
    scale = plain.max() - 101_325.0
    assert scale > 1e4
    assert np.abs(other - turn(plain)).max() < tolerance * scale


@pytest.mark.parametrize(("precision", "time_s"), [("double", 0.002), ("single", 0.02)])
def test_leaving_out_still_air_changes_no_bit(precision: str, time_s: float) -> None:
    """While most of the air is still, and when hardly any is."""
    left_out = blast(street(), (6, 9, 0), precision=precision)
    all_done = blast(street(), (6, 9, 0), precision=precision, skip_still_air=False)
    left_out.advance(time_s)
    all_done.advance(time_s)
    assert left_out.cell_updates < all_done.cell_updates == 2 * all_done.steps * street().size
    assert left_out.time_s == all_done.time_s
    assert (left_out.state == all_done.state).all()


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
    compiled = kernels.advance_planes

    def advance_planes(*arguments: Any) -> None:
        _, _, _, _, extent, first, end, *_ = arguments
        sides = np.diff(extent[first:end])[:, ::2]
        moved.append(int(sides.prod(axis=1).sum()))
        compiled(*arguments)

    monkeypatch.setattr(kernels, "advance_planes", advance_planes)
    monkeypatch.setattr(solver_module, "_CELLS_PER_CALL", 500)
    cut = blast(street(), (6, 9, 0), threads=2)
    cut.advance(TIME_S)
    layer = street().shape[0] * street().shape[1]
    assert len(moved) > 2 * whole.steps
    assert max(moved) <= max(500, layer)
    assert (cut.state == whole.state).all()


def test_rows_longer_than_a_tile() -> None:
    """Tiles cut rows along x, but not columns along y: a turned scene shows any seam."""
    length = 2 * kernels.TILE + 31
    solid = np.zeros((length, 8, 4), dtype=bool)
    solid[::37, 2:5, :2] = True
    density = np.full(solid.shape, 1.225)
    pressure = np.full(solid.shape, 101_325.0)
    hot = np.arange(length) % 60 < 3
    pressure[hot, 1:4, :2] = 3e6
    results = []
    turns: tuple[Turn, ...] = (lambda v: v, lambda v: v.transpose(1, 0, 2))
    for turn in turns:
        solver = blast(
            np.ascontiguousarray(turn(solid)), (0, 0, 0), radius=0.0, precision="double",
            with_fuel=True,
        )  # fmt: skip
        solver.set_state(
            density_kg_m3=turn(density), pressure_pa=turn(pressure), fuel_kg_m3=turn(pressure > 2e5)
        )
        solver.advance(0.01)
        results.append((turn(solver.pressure()), turn(solver.fuel())))
    assert results[0][0] == pytest.approx(results[1][0], rel=1e-11)
    assert results[0][1] == pytest.approx(results[1][1], rel=1e-9, abs=1e-12)


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
