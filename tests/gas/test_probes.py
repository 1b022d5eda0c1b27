"""Grids, and loads on faces, gauges, maps and pictures."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.gas import (
    Burning,
    FaceKind,
    FaceLoads,
    GasGrid,
    GasSolver,
    Gauges,
    GroundMap,
    LoadTable,
    PatchHistories,
    Settling,
    Snapshots,
    exposed_faces,
    ground_faces,
)
from tests.gas.flows import all_faces, blast, face_loads, recorder, street

STEP_S = 1e-3
HISTORY_PA = np.array([0.0, 50.0, 250.0, 400.0, 100.0, -50.0, -20.0, 30.0, 500.0, 0.0])
"""Foot, first phase, negative phase, second phase."""


def recorded(history_pa: NDArray[np.float64]) -> LoadTable:
    """Return a table of two points: one with a history, and one in still air."""
    table = LoadTable(2, arrival_pa=100.0, is_mean=True)
    for k, value in enumerate(history_pa):
        table.add(np.array([value, 0.0]), (k + 1) * STEP_S, STEP_S)
    return table


def test_loads_of_a_history_by_hand() -> None:
    table = recorded(HISTORY_PA)
    assert table.impulse_pa_s == pytest.approx([0.8 - 0.07 + 0.53, 0.0])
    assert table.impulse_time_s[0] == pytest.approx(9e-3)
    assert table.net_impulse_pa_s == pytest.approx([1.26, 0.0])
    assert table.peak_pa.tolist() == [500.0, 0.0]
    assert table.peak_time_s[0] == pytest.approx(8.5e-3)
    # From 50 to 250 Pa, between the middles of the steps.
    assert table.arrival_s == pytest.approx([1.75e-3, np.nan], nan_ok=True)
    assert table.steepest_s == pytest.approx([8.0e-3, np.nan], nan_ok=True)


def test_a_later_pulse_counts_only_above_the_largest_value_so_far() -> None:
    """An echo that does not make up for the suction before it adds nothing."""
    echo = np.where(np.arange(len(HISTORY_PA)) == 8, 40.0, HISTORY_PA)
    table = recorded(echo)
    assert table.impulse_pa_s[0] == pytest.approx(0.8)
    assert table.impulse_time_s[0] == pytest.approx(5e-3)
    assert table.net_impulse_pa_s[0] == pytest.approx(0.8)


@given(arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e5, 1e6)), st.floats(1e-5, 1e-2))
def test_impulses_of_whole_histories_are_those_of_the_recorder(
    history_pa: NDArray[np.float64], step_s: float
) -> None:
    """And no more than the sum of all positive phases, no less than what came in the end."""
    table = LoadTable(1, is_mean=True)
    for k, value in enumerate(history_pa):
        table.add(np.array([value]), (k + 1) * step_s, step_s)
    whole = max(float(step_s * np.cumsum(history_pa).max()), 0.0)
    scale = step_s * np.abs(history_pa).sum() + 1e-12
    assert table.impulse_pa_s[0] == pytest.approx(whole, abs=1e-9 * scale)
    assert table.net_impulse_pa_s[0] <= table.impulse_pa_s[0]
    positive = step_s * np.maximum(history_pa, 0.0).sum()
    assert table.impulse_pa_s[0] <= positive + 1e-9 * scale


def test_values_at_the_ends_of_steps_are_joined_by_lines() -> None:
    table = LoadTable(1, arrival_pa=1.0, is_mean=False)
    for k, value in enumerate([0.0, 100.0, 50.0]):
        table.add(np.array([value]), (k + 1) * 1e-3, 1e-3)
    assert table.impulse_pa_s == pytest.approx([0.125])
    assert table.arrival_s == pytest.approx([1e-3 + 1e-5])


def test_faces_of_chosen_cells() -> None:
    solid = np.zeros((6, 5, 4), dtype=bool)
    solid[2:4, 2, 0:2] = True
    solid[5, 2, 0] = True  # at the border: nothing is beyond
    grid = GasGrid(0.5, solid, origin_m=(10.0, 0.0, 0.0))
    chosen = np.zeros_like(solid)
    chosen[2:4, 2, 0:2] = True
    faces = exposed_faces(grid, chosen)
    # Two on each end, four on each side, two above, none below.
    count = {(axis, side): 0 for axis in range(3) for side in (-1, 1)}
    for axis, side in zip(faces.axis.tolist(), faces.side.tolist(), strict=True):
        count[axis, side] += 1
    assert count == {(0, -1): 2, (0, 1): 2, (1, -1): 4, (1, 1): 4, (2, -1): 0, (2, 1): 2}
    assert solid[tuple(faces.solid.T)].all()
    assert not solid[tuple(faces.air.T)].any()
    top = faces.centres_m(grid)[faces.axis == 2]
    assert sorted(top.tolist()) == [[11.25, 1.25, 1.0], [11.75, 1.25, 1.0]]
    assert len(ground_faces(grid)) == 30 - 3
    with pytest.raises(BlastEnvError, match="cells of air"):
        exposed_faces(grid, np.ones_like(solid))


def test_faces_are_loaded_from_their_own_side() -> None:
    """A wall between mirrors: the side of the blast is loaded, the other is not; x, y and z."""
    for axis in range(3):
        solid = np.zeros((21, 21, 21), dtype=bool)
        np.moveaxis(solid, axis, 0)[12] = True
        centre = [10.5, 10.5, 10.5]
        centre[axis] = 6.5
        solver = blast(
            solid,
            (centre[0], centre[1], centre[2]),
            loaded=all_faces,
            looking=face_loads,
            faces={"z_low": FaceKind.OPEN},
        )
        solver.advance(0.01)
        loads = recorder(solver, FaceLoads)
        load = loads.impulse_pa_s
        near = solver.faces.side == -1
        assert (load[near] > 0.0).all()
        assert (load[~near] == 0.0).all()
        # The most loaded face is the one opposite the charge.
        air = solver.faces.air[np.flatnonzero(near)[load[near].argmax()]]
        expected = [10, 10, 10]
        expected[axis] = 11
        assert air.tolist() == expected


def test_patches_keep_the_mean_history_of_their_faces() -> None:
    """Their running impulse is the mean of the faces', and a patch without a face is refused."""

    def looking(grid: GasGrid, count: int) -> tuple[FaceLoads, PatchHistories]:
        faces = all_faces(grid)
        patch = np.where(faces.axis == 2, -1, faces.side > 0)
        return FaceLoads(count), PatchHistories(patch, 2)

    solver = blast(street(), (6, 9, 0), loaded=all_faces, looking=looking)
    solver.advance(0.03)
    loads, patches = recorder(solver, FaceLoads), recorder(solver, PatchHistories)
    assert patches.history_pa.shape == (2, solver.steps)
    assert (np.diff(patches.time_s) > 0.0).all()
    whole = loads.net_impulse_pa_s
    for side, history in enumerate(patches.history_pa):
        members = (solver.faces.axis != 2) & ((solver.faces.side > 0) == bool(side))
        assert history @ patches.step_s == pytest.approx(whole[members].mean(), rel=1e-5)
    with pytest.raises(BlastEnvError, match="each must have a face"):
        PatchHistories(np.array([0, 2]), 3)


def test_gauges_keep_the_history() -> None:
    solver = blast(
        street(),
        (6, 9, 0),
        looking=lambda grid, _: [Gauges(grid, [grid.cell_at((8.0, 4.5, 0.1)), (27, 4, 2)])],
    )
    solver.advance(0.03)
    gauges = recorder(solver, Gauges)
    history, time_s = gauges.history_pa, gauges.time_s
    assert history.shape == (solver.steps, 2)
    assert time_s[-1] == solver.time_s
    assert (np.diff(time_s) > 0.0).all()
    assert (history[:3, 1] == 0.0).all()
    assert gauges.peak_pa == pytest.approx(history.max(axis=0))
    assert gauges.arrival_s[0] < gauges.arrival_s[1]
    joined = np.concatenate((np.zeros((1, 2)), history))
    steps = np.diff(np.concatenate(([0.0], time_s)))
    means = 0.5 * (joined[1:] + joined[:-1])
    expected = np.cumsum(means.T * steps, axis=-1).max(axis=-1)
    assert gauges.impulse_pa_s == pytest.approx(expected, rel=1e-9)
    with pytest.raises(BlastEnvError, match="which is solid"):
        Gauges(solver.grid, [(12, 5, 0)])
    with pytest.raises(BlastEnvError, match="but the grid is"):
        Gauges(solver.grid, [(30, 5, 0)])


def test_maps_agree_with_gauges() -> None:
    cells = [(16, 9, 0), (3, 20, 0)]
    solver = blast(
        street(), (6, 9, 0), looking=lambda grid, _: (Gauges(grid, cells), GroundMap(grid))
    )
    solver.advance(0.03)
    gauges, ground = recorder(solver, Gauges), recorder(solver, GroundMap)
    for k, (x, y, _) in enumerate(cells):
        assert ground.peak_pa[x, y] == pytest.approx(gauges.peak_pa[k], rel=1e-5)
        impulse = gauges.impulse_pa_s[k]
        assert ground.impulse_pa_s[x, y] == pytest.approx(impulse, rel=0.02)
    assert np.isnan(ground.peak_pa[13, 5])
    with pytest.raises(BlastEnvError, match="0 to 9"):
        GroundMap(solver.grid, layer=10)


def test_pictures_are_taken_once_at_their_times() -> None:
    times = [0.0, 0.002, 0.0020001, 0.01, 1.0]
    solver = blast(
        street(),
        (6, 9, 0),
        looking=lambda grid, _: [Snapshots(grid, 2, 1, times), Snapshots(grid, 1, 12, times)],
    )
    solver.advance(0.02)
    plan, section = solver.recorders
    assert isinstance(plan, Snapshots)
    assert isinstance(section, Snapshots)
    assert len(plan.frames) == len(section.frames) == 3
    assert plan.frames[0].overpressure_pa.shape == (30, 26)
    assert section.frames[0].overpressure_pa.shape == (30, 10)
    assert [frame.time_s for frame in plan.frames] == [frame.time_s for frame in section.frames]
    assert all(
        time_s <= frame.time_s < time_s + 0.002
        for time_s, frame in zip((0.0, 0.002, 0.01), plan.frames, strict=True)
    )
    for one, other in zip(plan.frames, section.frames, strict=True):
        line = one.overpressure_pa[:, 12]
        np.testing.assert_array_equal(line, other.overpressure_pa[:, 1])
    assert np.isnan(plan.frames[0].overpressure_pa[13, 5])


# --- Grids and arguments that make no sense are refused, with the value and the bound.


WRONG: Any = "wall"
AIR = np.zeros((4, 3, 2), dtype=bool)
GRID = GasGrid(0.5, AIR, origin_m=(1.0, 2.0, 0.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GasGrid(0.0, AIR), "cell_m is 0.0, but must be above 0"),
        (lambda: GasGrid(float("nan"), AIR), "cell_m is nan"),
        (lambda: GasGrid(0.5, AIR[0]), "must be of three dimensions"),
        (lambda: GasGrid(0.5, AIR.astype(int)), "and bool"),
        (lambda: GasGrid(0.5, AIR[:0]), "no cells at all"),
        (lambda: GasGrid(0.5, AIR, x_low=WRONG), "x_low is 'wall', but must be one of"),
        (lambda: GasGrid(0.5, AIR, origin_m=WRONG[:2]), "three finite lengths"),
        (lambda: GRID.cell_at((3.1, 2.0, 0.0)), "x = 3.1 m is outside the grid, 1.0 to 3.0 m"),
        (lambda: GasSolver(GRID, precision=WRONG), "precision is 'wall'"),
        (lambda: GasSolver(GRID, threads=0), "threads is 0, but must be at least 1"),
        (lambda: GasSolver(GRID, courant=1.1), "courant is 1.1, but must be above 0"),
        (lambda: GasSolver(GRID, pressure_pa=0.0), "0.0 Pa"),
        (lambda: GasSolver(GRID, burning=Burning(1.0, 1.0)), "needs with_fuel=True"),
        (lambda: GasSolver(GRID, settling=Settling(0.1, 1.0)), "hottest is 1.0, but must be above"),
        (
            lambda: GasSolver(GRID).set_state(density_kg_m3=1.0, pressure_pa=-1.0),
            "pressure_pa falls to -1.0",
        ),
        (lambda: LoadTable(1, 0.0, is_mean=True), "arrival_pa is 0.0"),
        (lambda: Snapshots(GRID, 3, 0, []), "axis is 3"),
        (lambda: Snapshots(GRID, 2, 2, []), "layer is 2, but must be 0 to 1"),
    ],
)
def test_errors_carry_the_value(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        make()


def test_places_in_the_grid() -> None:
    assert GRID.shape == (4, 3, 2)
    assert GRID.centres_m(0).tolist() == [1.25, 1.75, 2.25, 2.75]
    assert GRID.cell_at((1.0, 2.6, 0.9)) == (0, 1, 1)
    assert GRID.cell_at((3.0, 3.5, 1.0)) == (3, 2, 1)
