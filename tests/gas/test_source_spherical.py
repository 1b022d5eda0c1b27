"""The blast along a radius: exact sums, a known solution, scaling, and how the grid goes on."""

from math import cbrt

import numpy as np
import pytest

from blast_env.calibration import kingery_bulmash
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas import (
    AIR_DENSITY_KG_M3,
    TNT,
    GasCharge,
    GasGrid,
    GasRun,
    GasSolver,
    Gauges,
    SphericalBlast,
    largest_radius_m,
    set_charge,
)
from blast_env.gas.spherical import DENSITY, ENERGY, PRODUCTS
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.geometry import Rectangle
from blast_env.site import BlastSite, Charge, Gauge

Z = np.array([1.7, 2.2, 2.7, 3.5, 4.3, 5.4])


@pytest.fixture(scope="module")
def blast_on_ground() -> SphericalBlast:
    """1 kg on the ground, with gauges at scaled distances."""
    blast = TNT.in_free_air(TNT.ground_factor, Z)
    blast.advance(until_s=0.015)
    return blast


def total(blast: SphericalBlast, component: int) -> float:
    return float(blast.state[component] @ blast.volumes_m3)


def test_mass_energy_and_products_are_kept_while_shells_are_merged() -> None:
    blast = SphericalBlast(1.0, 1000.0, 4e6)
    radius_m = blast.front_m
    blast.advance(until_front_m=60.0 * radius_m)
    volume_m3 = blast.volumes_m3.sum()
    still = volume_m3 - 1.0 / 1000.0
    assert total(blast, DENSITY) == pytest.approx(1.0 + still * AIR_DENSITY_KG_M3, rel=1e-12)
    assert total(blast, PRODUCTS) == pytest.approx(1.0, rel=1e-12)
    assert total(blast, ENERGY) == pytest.approx(4e6 + volume_m3 * 101_325.0 / 0.4, rel=1e-12)


def test_afterburning_adds_its_share_of_energy() -> None:
    with_it = SphericalBlast(1.0, 1000.0, 4e6, 3e6, 1e-3)
    with_it.advance(until_s=1e-3)
    still_j = with_it.volumes_m3.sum() * 101_325.0 / 0.4
    expected = 4e6 + 3e6 * -np.expm1(-with_it.time_s / 1e-3)
    assert total(with_it, ENERGY) - still_j == pytest.approx(expected, rel=1e-9)


def test_a_strong_point_source_follows_sedov() -> None:
    energy_j = 1e13
    mass_kg = 1e-3
    blast = SphericalBlast(mass_kg, AIR_DENSITY_KG_M3, energy_j / mass_kg)
    radius_m = blast.front_m
    blast.advance(until_front_m=20.0 * radius_m)
    # Sedov: 1.0328 for a ratio of the heats of 1.4.
    expected_m = 1.0328 * (energy_j * blast.time_s**2 / AIR_DENSITY_KG_M3) ** 0.2
    pressure = blast.pressure()
    behind = np.flatnonzero(pressure > 0.5 * pressure.max())
    assert blast.edges_m[behind[-1] + 1] == pytest.approx(expected_m, rel=0.01)
    assert blast.state[DENSITY].max() / AIR_DENSITY_KG_M3 == pytest.approx(6.0, rel=0.1)
    # In the middle it is 0.366 of that at the front, which the grid clips a little.
    assert pressure[5] / pressure.max() == pytest.approx(0.366, rel=0.1)


def test_blasts_scale_with_the_cube_root_of_the_mass() -> None:
    small, large = TNT.in_free_air(1.0), TNT.in_free_air(1000.0)
    small.advance(until_front_m=1.5)
    large.advance(until_front_m=15.0 * (1.0 - 1e-9))
    assert large.time_s == pytest.approx(10.0 * small.time_s, rel=1e-9)
    scale = np.abs(small.state).max(axis=1, keepdims=True)
    np.testing.assert_allclose(large.state / scale, small.state / scale, atol=1e-8)


def test_calls_do_not_change_a_run() -> None:
    once, often = TNT.in_free_air(1.0, [0.3]), TNT.in_free_air(1.0, [0.3])
    once.advance(until_front_m=0.5)
    for front_m in (0.1, 0.2, 0.3, 0.5):
        often.advance(until_front_m=front_m)
    assert often.time_s == once.time_s
    assert np.array_equal(often.state, once.state)
    assert np.array_equal(often.history, once.history)


def test_impulse_and_arrival_agree_with_kingery_bulmash(blast_on_ground: SphericalBlast) -> None:
    time_s, *histories = blast_on_ground.history.T
    for z, over_pa in zip(Z, histories, strict=True):
        arrival = int(np.argmax(over_pa > 0.5 * over_pa.max()))
        end = arrival + int(np.argmax(over_pa[arrival:] < 0.0))
        impulse = np.trapezoid(np.maximum(over_pa[:end], 0.0), time_s[:end])
        expected_s = kingery_bulmash("arrival_time", z, 1.0)
        assert time_s[arrival] == pytest.approx(expected_s, rel=0.05)
        # Closer to the curve here is farther from it on a wall.
        low = 0.82 if z < 2.0 else 0.87 if z < 2.5 else 0.9
        assert low < impulse / kingery_bulmash("incident_impulse", z, 1.0) < 1.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": 0.0}, "mass_kg is 0.0, but must be above 0"),
        ({"density_kg_m3": float("nan")}, "density_kg_m3 is nan"),
        ({"prompt_j_kg": -1.0}, "prompt_j_kg is -1.0"),
        ({"shells": 801}, "shells is 801, but must be even"),
        ({"gauges_m": [0.01]}, "inside the charge of"),
    ],
)
def test_bad_values_are_named(change: dict, message: str) -> None:
    values: dict = {"mass_kg": 1.0, "density_kg_m3": 1630.0, "prompt_j_kg": 4e6}
    with pytest.raises(BlastEnvError, match=message):
        SphericalBlast(**(values | change))


def test_a_run_needs_a_bound() -> None:
    with pytest.raises(BlastEnvError, match="never ends"):
        SphericalBlast(1.0, cbrt(1000.0), 4e6).advance()


# --- The stage before the grid joins on to what the grid computes.


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
    opening = spherical_stage(charge, largest_radius_m(grid(), charge))
    distance_m = np.hypot(3.75, 0.25)
    assert opening.front_m > 2.0 * distance_m
    assert opening.peak_pa(distance_m) > gauges.peak_pa[0]  # the grid's cells clip it
    _, largest_pa_s = opening.impulses_pa_s(distance_m)
    assert largest_pa_s == pytest.approx(gauges.impulse_pa_s[0], rel=0.1)
    assert opening.at(opening.end_s, opening.front_m * 1.01) == 0.0
    assert opening.at(0.0, 3.0) == 0.0


def test_gauges_nearer_than_the_first_obstacle_miss_nothing() -> None:
    """They had missed the front: it is laid onto the grid when it has already passed them."""
    site = BlastSite(
        site_m=Rectangle(0.0, 0.0, 12.0, 10.0),
        charge=Charge((2.0, 5.0), 5.0),
        structures=(),
        gauges=(Gauge("near", (5.25, 5.25, 0.25)),),
        air_height_m=6.0,
    )
    run = GasRun(GasEngine(margin_m=0.0, border_m=0.0, until=0.03), site)
    run.advance(0.03)
    gauges = run.gauges
    assert gauges is not None
    distance_m = np.hypot(3.25, 0.25)
    expected = kingery_bulmash("incident_impulse", distance_m, 5.0)
    assert gauges.impulse_pa_s[0] == pytest.approx(expected, rel=0.25)
    assert gauges.arrival_s[0] == pytest.approx(
        kingery_bulmash("arrival_time", distance_m, 5.0), rel=0.1
    )
    assert (np.diff(gauges.time_s) > 0.0).all()
    assert gauges.history_pa.shape == (len(gauges.time_s), 1)
