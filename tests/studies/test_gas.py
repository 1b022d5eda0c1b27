"""The studies of the gas engine, on scenes that take seconds."""

from math import cbrt

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.results import EndReason
from blast_env.site import Scenario
from studies.gas.cells import CellLoads, difference
from studies.gas.corners import BlockGeometry, corner_waves
from studies.gas.ending import ending
from studies.gas.judgement import Judgement
from studies.gas.loads import impulse_until, yard
from studies.gas.peaks import facade_load
from studies.gas.reference import free_field, wide_wall
from tests.gas_sites import glazed_hut

WALL = tuple((row, 4) for row in range(4, 12))


@pytest.fixture(scope="module")
def site() -> Scenario:
    return yard()


def test_waves_are_held_against_the_curves() -> None:
    """With cells of half a metre impulses and arrival are as wanted, and peaks are clipped."""
    wall = wide_wall(100.0, 12.3, 0.5)
    (wave,) = free_field(100.0, [2.7], 0.5)
    assert wall.z_m_kg == pytest.approx(12.5 / cbrt(100.0))  # rounded up to cells
    assert wall.impulse == pytest.approx(1.0, abs=0.06)
    assert wave.impulse == pytest.approx(1.0, abs=0.10)
    assert (wall.arrival, wave.arrival) == pytest.approx((1.0, 1.0), abs=0.05)
    assert max(wall.peak, wave.peak) < 0.7


def test_opposite_a_charge_a_facade_has_the_impulse_of_the_curve_and_less_peak() -> None:
    load = facade_load(20.0, 10.0, GasEngine())
    assert load.impulse == pytest.approx(1.0, abs=0.06)
    assert 0.4 < load.peak < 0.6


def test_a_run_misses_next_to_nothing(site: Scenario) -> None:
    found = ending(GasBlast(site, WALL))
    assert found.reason is EndReason.LOADS_KNOWN
    assert 0.0 <= found.missed < 0.01
    assert 0.0 <= found.missed_of_all < 0.003
    assert found.levels == (None, None)
    cut = ending(GasBlast(site, WALL, engine=GasEngine(until=0.012)))
    assert cut.reason is EndReason.TIME_ASKED
    assert cut.missed_of_all > 0.1


def test_facades_reach_the_same_level_later() -> None:
    found = ending(GasBlast(glazed_hut()))
    assert found.levels[0] is not None
    assert found.levels[0] == found.levels[1]


def test_borders_farther_away_change_loads_little(site: Scenario) -> None:
    """What comes back from them comes after the load."""
    until_s = 0.06
    default, wide, near = (
        impulse_until(GasBlast(site, WALL, engine=engine), until_s)
        for engine in (GasEngine(), GasEngine(margin_m=6.0, border_m=40.0), GasEngine(border_m=0.0))
    )
    assert default == pytest.approx(wide, rel=0.01)
    assert near == pytest.approx(wide, rel=0.01)


def test_differences_of_cells_by_hand() -> None:
    coarse = CellLoads("0.5 m", 100.0, np.array([90.0, 80.0, 60.0]), 1.0)
    fine = CellLoads("0.25 m", 100.0, np.array([90.0, 60.0, 80.0]), 16.0)
    found = difference(coarse, fine)
    assert found.impulse == pytest.approx((0.0 + 0.0 + 1.0 / 3.0 - 0.25) / 4.0)
    assert found.reduction == pytest.approx(0.0)
    assert abs(found.largest) == pytest.approx(0.2)
    assert found.rank == pytest.approx(0.5)
    few = difference(coarse, CellLoads("0.125 m", 50.0, np.array([45.0]), 256.0))
    assert few.impulse == pytest.approx(1.0)
    assert few.reduction == pytest.approx(0.0)
    assert np.isnan(few.rank)


def test_the_first_wave_is_weaker_behind_corners() -> None:
    geometry = BlockGeometry(side_modules=8, stand_off_m=6.0)
    found = corner_waves(0.5, 3.0, geometry)
    assert found.height_m == 3.0
    assert found.coefficient.shape == (8 + 4,)
    assert 0.2 < found.mean("one_corner") < 0.8
    assert found.gauges_of("two_corners").tolist() == found.coefficient[8:].tolist()
    # The mean is that of modules: a gauge stands for as many on both sides of the middle.
    assert found.mean("two_corners") == pytest.approx(found.coefficient[8:].mean())


def test_a_block_below_a_module_is_named() -> None:
    with pytest.raises(BlastEnvError, match=r"height_m is 0\.2, must be at least 0\.5"):
        corner_waves(0.5, 0.2)


# --- What is said of two models' reductions: order, overstatement, regret.


def test_order_overstatement_and_regret() -> None:
    """Four layouts, two charges: the first charge is ordered alike, the second the other way."""
    particle = np.array([[0.2, 0.8], [0.4, 0.6], [0.6, 0.4], [0.8, 0.2]])
    gas = np.array([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    found = Judgement(particle, gas)
    assert found.means == pytest.approx((0.5, 0.25))
    assert found.overstatement == pytest.approx(2.0)
    assert found.regret.value == pytest.approx(0.5 * (0.0 + 0.3))
    assert found.all_pairs == pytest.approx(0.0, abs=0.2)
