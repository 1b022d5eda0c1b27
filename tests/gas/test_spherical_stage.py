"""The stage before the grid joins on to what the grid computes."""

import numpy as np
import pytest

from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import Gauges
from blast_env.gas.solver import GasSolver
from blast_env.gas.source import GasCharge, largest_radius_m, set_charge
from blast_env.gas.spherical_stage import spherical_stage
from blast_env.geometry import Rectangle
from blast_env.particles.calibration.references import kingery_bulmash
from blast_env.site.scene import BlastSite, Charge, Gauge


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
    run = GasEngine(margin_m=0.0, border_m=0.0, until=0.03).start_on(site)
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
