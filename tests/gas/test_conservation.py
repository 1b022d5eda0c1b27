"""Nothing is lost, nothing leaks, and density and pressure stay positive."""

from typing import Any

import numpy as np
import pytest

from blast_env.gas import Burning, FaceKind, FaceLoads, Settling, ground_faces
from blast_env.gas.state import ENERGY
from tests.gas.flows import CLOSED, blast, face_loads, recorder, street


@pytest.mark.parametrize(("precision", "share"), [("single", 1e-6), ("double", 1e-12)])
def test_mass_and_energy_in_a_closed_box(precision: str, share: float) -> None:
    """Rounding must not add up."""
    solver = blast(street(), (6, 9, 0), faces=CLOSED, precision=precision)
    before = solver.totals()
    solver.advance(0.06)
    after = solver.totals()
    assert after.mass_kg == pytest.approx(before.mass_kg, rel=share)
    assert after.energy_j == pytest.approx(before.energy_j, rel=share)


@pytest.mark.parametrize("skip", [True, False])
def test_a_box_of_walls_lets_nothing_out(skip: bool) -> None:
    """Walls one cell thick around a blast: outside, not a bit changes."""
    solid = np.zeros((24, 22, 20), dtype=bool)
    solid[5:18, 4:17, 3:15] = True
    solid[6:17, 5:16, 4:14] = False
    solver = blast(solid, (11, 10, 9), skip_still_air=skip)
    outside = np.ones(solid.shape, dtype=bool)
    outside[5:18, 4:17, 3:15] = False
    cells = (slice(None), *solver.grid.inner)
    before = solver.state[cells].copy()
    solver.advance(0.02)
    after = solver.state[cells]
    assert (after != before).any()
    assert (after[:, outside.T] == before[:, outside.T]).all()


def test_the_ground_takes_up_momentum_too() -> None:
    solid = np.zeros((24, 24, 20), dtype=bool)
    options: dict[str, Any] = {"pressure_pa": 1e6, "density_kg_m3": 3.0, "precision": "double"}
    solver = blast(solid, (12, 12, 4), loaded=ground_faces, looking=face_loads, **options)
    solver.advance(0.002)  # before anything leaves
    loads = recorder(solver, FaceLoads)
    upward = solver.grid.cell_m**2 * float(loads.net_impulse_pa_s.sum())
    # The open top is still at rest, and pushes back with the pressure of still air.
    assert solver.totals().momentum_kg_m_s[2] == pytest.approx(upward, rel=1e-9)


def test_a_blast_in_a_corner_equals_its_mirror_images() -> None:
    """Eight balls in the open, or one in a corner of three mirrors, or of three walls."""
    n = 14
    options: dict[str, Any] = {"radius": 2.5, "precision": "double"}
    low = {f"{axis}_low": FaceKind.MIRROR for axis in "xyz"}
    corner = blast(np.zeros((n, n, n), dtype=bool), (4, 5, 3), faces=low, **options)
    corner.advance(0.01)

    walls = np.zeros((n + 1, n + 1, n + 1), dtype=bool)
    walls[0], walls[:, 0], walls[:, :, 0] = True, True, True
    protected = blast(walls, (5, 6, 4), faces={"z_low": FaceKind.OPEN}, **options)
    protected.advance(0.01)

    images = blast(
        np.zeros((2 * n, 2 * n, 2 * n), dtype=bool),
        (0, 0, 0),
        radius=0.0,
        faces={"z_low": FaceKind.OPEN},
        precision="double",
    )
    places = np.indices((n, n, n)) + 0.5
    hot = sum((places[k] - (4, 5, 3)[k]) ** 2 for k in range(3)) < 2.5**2
    for axis in range(3):
        hot = np.concatenate((np.flip(hot, axis), hot), axis=axis)
    images.set_state(
        density_kg_m3=np.where(hot, 50.0, images.density_kg_m3),
        pressure_pa=np.where(hot, 5e7, images.pressure_pa),
    )
    images.advance(0.01)
    exact = images.pressure()[n:, n:, n:]
    assert corner.steps == protected.steps == images.steps
    assert corner.pressure() == pytest.approx(exact, rel=1e-11)
    assert protected.pressure()[1:, 1:, 1:] == pytest.approx(exact, rel=1e-11)


def test_fuel_is_kept_until_it_burns() -> None:
    """The passive scalar has a mass of its own, and gives its heat to the gas."""
    kept = blast(street(), (6, 9, 0), faces=CLOSED, precision="double", with_fuel=True)
    before = kept.totals()
    kept.advance(0.02)
    after = kept.totals()
    assert after.fuel_kg == pytest.approx(before.fuel_kg, rel=1e-12)
    share = kept.fuel() / kept.density()
    assert share.min() >= 0.0
    assert share.max() <= 1.0 + 1e-12

    burning = Burning(time_s=0.01, heat_j_kg=1e6)
    burnt = blast(
        street(), (6, 9, 0), faces=CLOSED, precision="double", with_fuel=True, burning=burning
    )
    burnt.advance(0.02, land=True)
    totals = burnt.totals()
    assert totals.fuel_kg == pytest.approx(before.fuel_kg * np.exp(-2.0), rel=1e-9)
    heat = 1e6 * (before.fuel_kg - totals.fuel_kg)
    assert totals.energy_j - before.energy_j == pytest.approx(heat, rel=1e-6)
    assert totals.mass_kg == pytest.approx(before.mass_kg, rel=1e-12)


def test_fuel_changes_nothing_else() -> None:
    plain = blast(street(), (6, 9, 0))
    fuelled = blast(street(), (6, 9, 0), with_fuel=True)
    plain.advance(0.01)
    fuelled.advance(0.01)
    assert (fuelled.state[:5] == plain.state).all()


def test_settled_products_keep_their_energy_and_have_burnt() -> None:
    """What settles is burnt, and not hotter than told; momentum and energy stay."""
    burning, settling = Burning(time_s=0.01, heat_j_kg=1e6), Settling(time_s=0.01, hottest=4.0)
    options: dict[str, Any] = {"faces": CLOSED, "precision": "double", "with_fuel": True}
    hot = blast(street(), (6, 9, 0), burning=burning, **options)
    settled = blast(street(), (6, 9, 0), burning=burning, settling=settling, **options)
    before = settled.totals()
    settled.advance(0.03)
    hot.advance(0.03)
    after = settled.totals()
    temperature = settled.pressure() / settled.density()
    still = settled.pressure_pa / settled.density_kg_m3
    assert (hot.pressure() / hot.density()).max() > 8.0 * still
    assert temperature[~settled.grid.solid].max() <= 6.0 * still  # waves between two looks
    assert after.fuel_kg == 0.0
    assert (settled.fuel() == 0.0).all()
    heat = 1e6 * before.fuel_kg
    assert after.energy_j - before.energy_j == pytest.approx(heat, rel=1e-10)
    assert after.mass_kg > before.mass_kg
    assert settled.steps < 0.9 * hot.steps


# --- Density and pressure stay positive where a strong blast meets walls, corners and gaps.


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
