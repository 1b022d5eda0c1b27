"""Loads of particles in Pa s where a calibration gives them, on one scale for several blasts."""

import matplotlib
import pytest

from blast_env import simulate
from blast_env.calibration import LoadUnit
from blast_env.evaluation.engines import BlastResult
from blast_env.particles.calibration.model import seen_width_m
from blast_env.plots.figures import common_scale, heat_map, impulse_over_time
from blast_env.plots.style import nice_ceiling
from blast_env.units import MODULE_SIDE_M
from tests.design.search_cases import small_scenario

WALL = ((1, 0), (2, 0))


@pytest.fixture(scope="module")
def unprotected() -> BlastResult:
    return simulate(small_scenario(), seed=0, engine="event")


@pytest.fixture(scope="module")
def protected() -> BlastResult:
    return simulate(small_scenario(), WALL, seed=0, engine="event")


@pytest.fixture(scope="module")
def uncalibrated() -> BlastResult:
    plain = small_scenario().model_copy(update={"calibration": None})
    return simulate(plain, seed=0, engine="event")


def texts(figure: matplotlib.figure.Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    labels = [axes.get_ylabel() + axes.get_title() for axes in figure.axes]
    return "\n".join([*found, *labels])


def test_a_load_spread_evenly_over_the_seen_width_is_that_of_the_structure(
    unprotected: BlastResult,
) -> None:
    unit = unprotected.load_unit
    (building,) = (each for each in unprotected.obstacles if each.protected)
    pa_s = unprotected.impulse(building.name).pa_s
    width_m = seen_width_m(building.rectangle_m, unprotected.blast.scene.charge.position_m)
    each = building.impulse * MODULE_SIDE_M / width_m
    assert unit.factor * each == pytest.approx(pa_s)
    assert unit.of_structure(building) == f"{pa_s:,.0f} Pa s"


def test_without_a_calibration_loads_stay_in_simulation_units(uncalibrated: BlastResult) -> None:
    unit = uncalibrated.load_unit
    assert unit == LoadUnit()
    assert not unit.is_calibrated
    assert "simulation units" in texts(heat_map(uncalibrated))
    assert "simulation units" in texts(impulse_over_time(uncalibrated))


def test_maps_without_and_with_a_barrier_have_one_scale_in_pa_s(
    unprotected: BlastResult, protected: BlastResult
) -> None:
    scale = common_scale([protected, unprotected])
    figures = [heat_map(each, scale=scale) for each in (unprotected, protected)]
    ends = [figure.axes[-1].get_ylim() for figure in figures]
    assert ends[0] == ends[1] == (0.0, scale.full)
    assert scale.full == nice_ceiling(scale.full)
    assert all("Pa s" in texts(figure) for figure in figures)
    assert f"{protected.impulse('building').pa_s:,.0f} Pa s from" in texts(figures[1])
    assert "Pa s" in texts(impulse_over_time(unprotected))


def test_films_beside_each_other_say_each_blast_s_own_load(
    unprotected: BlastResult, protected: BlastResult
) -> None:
    """The law of a calibration is no straight line: one factor for both would be wrong."""
    shared = unprotected.load_unit.with_loads_of(protected.load_unit)
    (building,) = (each for each in protected.obstacles if each.protected)
    assert shared.of_structure(building) == f"{protected.impulse('building').pa_s:,.0f} Pa s"
    assert unprotected.load_unit.of_structure(building) != shared.of_structure(building)
    assert (shared.factor, shared.label) == (
        unprotected.load_unit.factor,
        unprotected.load_unit.label,
    )
