"""The charge: what of it arrives on a grid, and which charges cannot be laid there."""

from typing import Literal

import numpy as np
import pytest

from blast_env.calibration import kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.gas import (
    LEAST_RADIUS_CELLS,
    TNT,
    GasCharge,
    GasGrid,
    GasSolver,
    RadialProfile,
    clearance_m,
    largest_radius_m,
    lay,
    least_clearance_m,
    set_charge,
)
from blast_env.gas.spherical import Floats

STILL_J_M3 = 101_325.0 / 0.4


def empty_grid(cell_m: float = 0.5, cells: int = 24) -> GasGrid:
    """Return a grid of air, the ground's origin in the middle of its lowest layer."""
    solid = np.zeros((2 * cells, 2 * cells, cells), dtype=np.bool_)
    return GasGrid(cell_m, solid, (-cells * cell_m, -cells * cell_m, 0.0))


def laid(
    profile: RadialProfile, grid: GasGrid, charge: GasCharge
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a blast over the whole of a grid."""
    start, (density, momentum, energy, fuel) = lay(profile, grid, charge)
    after = [n - at - m for n, at, m in zip(grid.shape, start, density.shape, strict=True)]
    around = list(zip(start, after, strict=True))
    return (
        np.pad(density, around, constant_values=1.225),
        np.pad(momentum, [(0, 0), *around]),
        np.pad(energy, around, constant_values=STILL_J_M3),
        np.pad(fuel, around),
    )


def laid_over_given(charge: GasCharge, radius_m: float, grid: GasGrid) -> list[float]:
    """Return energy and fuel on the grid over those of the whole sphere."""
    profile = charge.profile(radius_m)
    density, _, energy, fuel = laid(profile, grid, charge)
    mass_kg, energy_j, fuel_kg = profile.totals()
    volume = grid.cell_m**3
    laid_kg = (density - 1.225).sum() * volume
    given = laid_kg / mass_kg, fuel.sum() * volume / fuel_kg
    assert given[0] == pytest.approx(given[1], rel=5e-3)
    return [(energy - STILL_J_M3).sum() * volume / energy_j, given[1]]


@pytest.mark.parametrize("radius_m", [1.0, 2.0, 4.0, 8.0])
def test_half_of_a_charge_on_the_ground_is_laid(radius_m: float) -> None:
    charge = GasCharge(100.0, (0.0, 0.0, 0.0))
    assert laid_over_given(charge, radius_m, empty_grid()) == pytest.approx([0.5, 0.5], rel=1e-3)


@pytest.mark.parametrize("place", [(0.0, 0.0, 3.0), (0.13, 0.27, 3.21), (0.25, 0.25, 3.25)])
def test_all_of_a_charge_above_the_ground_is_laid(place: tuple[float, float, float]) -> None:
    charge = GasCharge(20.0, place)
    assert laid_over_given(charge, 2.5, empty_grid()) == pytest.approx([1.0, 1.0], rel=1e-3)


def test_what_has_passed_through_the_ground_comes_back() -> None:
    charge = GasCharge(20.0, (0.0, 0.0, 0.4))
    grid = empty_grid()
    assert not charge.on_ground
    assert largest_radius_m(grid, charge) == LEAST_RADIUS_CELLS * grid.cell_m
    assert laid_over_given(charge, 1.0, grid) == pytest.approx([1.0, 1.0], rel=1e-3)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.0, 0.0, 3.0), (0.25, 0.25, 2.75)])
def test_a_charge_is_laid_symmetrically(place: tuple[float, float, float]) -> None:
    shift = place[0]
    solid = np.zeros((25, 25, 12), dtype=np.bool_) if shift else np.zeros((24, 24, 12), np.bool_)
    grid = GasGrid(0.5, solid, (-6.0, -6.0, 0.0))
    charge = GasCharge(50.0, place)
    density, momentum, energy, _ = laid(charge.profile(2.0), grid, charge)
    assert np.array_equal(density, density[::-1])
    assert np.array_equal(energy, energy[:, ::-1])
    assert np.array_equal(momentum[0], -momentum[0, ::-1])
    assert np.array_equal(momentum[2], momentum[2, :, ::-1])
    np.testing.assert_allclose(density, density.transpose(1, 0, 2), rtol=1e-12)
    np.testing.assert_allclose(momentum[0], momentum[1].transpose(1, 0, 2), atol=1e-9)


def test_momentum_points_away_from_the_charge() -> None:
    grid = empty_grid()
    charge = GasCharge(20.0, (0.0, 0.0, 3.0))
    profile = charge.profile(2.5)
    _, momentum, _, _ = laid(profile, grid, charge)
    x, y, z = np.meshgrid(*(grid.centres_m(axis) for axis in range(3)), indexing="ij")
    outwards = momentum[0] * x + momentum[1] * y + momentum[2] * (z - 3.0)
    assert profile.state[1].min() >= 0.0
    assert outwards.min() >= 0.0
    moving = np.abs(momentum).max(axis=0) > 0.0
    distance = np.sqrt(x**2 + y**2 + (z - 3.0) ** 2)
    assert moving[distance < 1.5].all()
    assert not moving[distance > 3.0].any()


def test_charges_scale_exactly() -> None:
    small, large = GasCharge(1.0, (0.0, 0.0, 0.0)), GasCharge(8.0, (0.0, 0.0, 0.0))
    one, other = small.profile(1.0), large.profile(2.0)
    assert np.array_equal(one.state, other.state)
    assert other.time_s == pytest.approx(2.0 * one.time_s, rel=1e-12)
    assert other.front_m == pytest.approx(2.0 * one.front_m, rel=1e-12)


def test_profiles_do_not_depend_on_the_order_they_are_asked_for() -> None:
    charge = GasCharge(10.0, (0.0, 0.0, 0.0))
    far, near = charge.profile(5.0), charge.profile(2.0)
    assert near.time_s < far.time_s
    assert np.array_equal(charge.profile(5.0).state, far.state)
    assert 2.0 / 1.06 < near.front_m <= 2.02


def test_the_ground_takes_its_share() -> None:
    on_ground, above = GasCharge(100.0, (0.0, 0.0, 0.2)), GasCharge(100.0, (0.0, 0.0, 0.3))
    assert on_ground.on_ground
    assert not above.on_ground
    assert on_ground.free_air_kg == pytest.approx(100.0 * TNT.ground_factor)
    assert above.free_air_kg == 100.0


@pytest.mark.parametrize("impulse", ["incident_impulse", "reflected_impulse"])
def test_the_share_of_the_ground_is_that_between_the_curves(
    impulse: Literal["incident_impulse", "reflected_impulse"],
) -> None:
    z = np.linspace(1.7, 8.6, 30)
    on_ground = kingery_bulmash(impulse, z, 1.0)
    in_air = kingery_bulmash(impulse, z, TNT.ground_factor, "spherical")
    np.testing.assert_allclose(on_ground, in_air, rtol=5e-3)


def test_a_solver_gets_all_of_a_charge() -> None:
    charge = GasCharge(20.0, (0.0, 0.0, 0.0))
    grid = empty_grid(cells=12)
    solver = GasSolver(grid, with_fuel=True, burning=charge.burning, precision="double")
    before_j = solver.totals().energy_j
    set_charge(solver, charge, 3.0)
    profile = charge.profile(3.0)
    assert solver.time_s == profile.time_s
    totals = solver.totals()
    assert 2.0 * (totals.energy_j - before_j) == pytest.approx(profile.totals()[1], rel=1e-3)
    assert 2.0 * totals.fuel_kg == pytest.approx(profile.totals()[2], rel=1e-3)
    solver.advance(solver.time_s + 1e-4)
    assert solver.totals().fuel_kg < totals.fuel_kg
    assert solver.totals().energy_j > totals.energy_j


def test_the_front_runs_to_the_first_solid_cell() -> None:
    solid = np.zeros((24, 24, 12), dtype=np.bool_)
    solid[20, 12, 0] = True
    grid = GasGrid(0.5, solid)
    assert largest_radius_m(grid, GasCharge(20.0, (6.0, 6.25, 0.0))) == pytest.approx(4.0)
    assert largest_radius_m(grid, GasCharge(20.0, (6.0, 6.25, 2.5))) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("mass_kg", "place", "message"),
    [
        (0.0, (0.0, 0.0, 0.0), "mass_kg of the charge is 0.0, but must be above 0"),
        (-5.0, (0.0, 0.0, 0.0), "mass_kg of the charge is -5.0"),
        (float("inf"), (0.0, 0.0, 0.0), "mass_kg of the charge is inf"),
        (5.0, (0.0, 0.0, -0.5), "at a height of -0.5 m, below the ground"),
        (5.0, (float("nan"), 0.0, 0.0), "three finite lengths"),
    ],
)
def test_bad_charges_are_named(
    mass_kg: float, place: tuple[float, float, float], message: str
) -> None:
    with pytest.raises(BlastEnvError, match=message):
        GasCharge(mass_kg, place)


def test_a_radius_within_the_charge_is_named() -> None:
    with pytest.raises(BlastEnvError, match=r"at a radius of 0.1 m, but must be at 0.29\d* m"):
        GasCharge(100.0, (0.0, 0.0, 0.0)).profile(0.1)


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((10.25, 6.25, 0.25), "is inside a solid cell"),
        ((-1.0, 6.0, 0.0), "x = -1.0 m is outside the grid"),
    ],
)
def test_charges_that_do_not_fit_are_named(place: tuple[float, float, float], message: str) -> None:
    solid = np.zeros((24, 24, 12), dtype=np.bool_)
    solid[20, 12, 0] = True
    with pytest.raises(BlastEnvError, match=message):
        largest_radius_m(GasGrid(0.5, solid), GasCharge(5.0, place))


def test_a_small_charge_close_above_the_ground_needs_smaller_cells() -> None:
    """Its hot products and their mirror image would leave less than no air."""
    charge = GasCharge(1.0, (3.0, 3.0, 0.1))
    for cell_m in (0.25, 0.5):
        grid = GasGrid(cell_m, np.zeros((24, 24, 12), dtype=np.bool_))
        solver = GasSolver(grid, with_fuel=True, burning=charge.burning)
        if cell_m == 0.25:
            set_charge(solver, charge)
            continue
        words = r"charge of 1 kg is 0\.1 m high, too close above the ground for cells of 0\.5 m"
        with pytest.raises(BlastEnvError, match=words):
            set_charge(solver, charge)


def test_a_charge_close_to_a_solid_is_laid_all_the_same() -> None:
    """When its front has run two cells; whoever asks is told how close it is."""
    solid = np.zeros((24, 24, 12), dtype=np.bool_)
    solid[20, 12, 0] = True
    grid, charge = GasGrid(0.5, solid), GasCharge(5.0, (9.25, 6.25, 0.0))
    assert clearance_m(grid, charge) == pytest.approx(0.75)
    assert largest_radius_m(grid, charge) == least_clearance_m(grid, charge) == 1.0
