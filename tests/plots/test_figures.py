"""Heat maps and loads over time, in simulation units, and in Pa s on one scale."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from blast_env import simulate
from blast_env.calibration import LoadUnit
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.particles import faces_hit
from blast_env.particles.calibration import seen_width_m
from blast_env.plots import LoadScale, impulse_over_time, nice_ceiling, short_number
from blast_env.plots.figures import heat_map
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M
from tests.design.search_cases import small_scenario


def modules_of(figure: Figure, panel: int) -> PolyCollection:
    (modules,) = (
        artist for artist in figure.axes[panel].collections if isinstance(artist, PolyCollection)
    )
    return modules


def texts_of(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_the_heat_map_shows_every_modules_impulse(barrier_result: BlastResult) -> None:
    figure = heat_map(barrier_result)
    impulse = modules_of(figure, 1).get_array()
    shelter = barrier_result.obstacle("shelter")
    assert isinstance(impulse, np.ma.MaskedArray)
    assert impulse.filled(0.0).tolist() == [part.impulse for part in shelter.parts]
    assert impulse.mask.tolist() == [part.hits == 0 for part in shelter.parts]
    written = [text.get_text() for text in figure.axes[1].texts]
    assert written == [short_number(part.impulse) for part in shelter.parts if part.hits]

    for axes in figure.axes[:2]:
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert figure.axes[-1].get_ylabel() == "impulse per module (simulation units); white: not hit"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [
        "barrier module",
        "charge",
        "protected structure",
        "other structure",
        "build zone",
        "no-build area",
        "site border",
    ]
    assert {"shelter", "wall"} <= set(texts_of(figure))


def test_impulse_over_time_ends_at_the_sums_of_the_facades(result: BlastResult) -> None:
    figure = impulse_over_time(result)
    for axes, name in zip(figure.axes, ("shelter", "wall"), strict=True):
        assert axes.get_xlabel() == "time (ms)"
        assert axes.get_ylabel() == "cumulative impulse (simulation units)"
        assert axes.get_title().startswith(name)
        ends = [float(np.asarray(line.get_ydata())[-1]) for line in axes.lines]
        assert sum(ends) == pytest.approx(result.impulse_sim(name))
    assert any("ms" in text.get_text() for text in figure.texts)


def test_the_normal_of_a_collision_gives_its_facade(result: BlastResult) -> None:
    table = result.collisions
    facade = faces_hit(table)
    modules = result.modules.set_index("module_id")
    on_wall = table[(table["structure"] == "wall") & (facade == "south")]
    assert len(on_wall) > 10
    assert (modules.loc[on_wall["module_id"], "row"] == 0).all()


def test_a_blast_without_hits_can_be_drawn(result: BlastResult) -> None:
    empty = replace(
        result, collision_array=result.collision_array[:0], obstacles=result.blast.scene.obstacles()
    )
    assert "no hits" in texts_of(impulse_over_time(empty))
    heat_map(empty).draw_without_rendering()


def test_the_parts_of_a_building_are_one_on_the_heat_map(blast: Blast) -> None:
    document = blast.scenario.model_dump(mode="json", exclude_none=True)
    for structure in document["structures"]:
        structure["building"] = "town"
    joined = replace(blast, scenario=Scenario.from_document(document, "joined")).run()
    figure = heat_map(joined)
    title, *_ = (axes.get_title() for axes in figure.axes[1:])
    count = sum(obstacle.hits for obstacle in joined.obstacles if obstacle.cells is None)
    assert title.startswith("town (protected)\n")
    assert f"{count} hits" in title
    assert len(figure.axes) == 3  # the site, the building, the bar


# --- Loads by particles in Pa s where a calibration gives them, on one scale for several blasts.


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
    (building,) = (obstacle for obstacle in unprotected.obstacles if obstacle.protected)
    pa_s = unprotected.impulse(building.name).pa_s
    width_m = seen_width_m(building.rectangle_m, unprotected.blast.scene.charge.position_m)
    per_module = building.impulse * MODULE_SIDE_M / width_m
    assert unit.factor * per_module == pytest.approx(pa_s)
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
    both = (unprotected, protected)
    scale = LoadScale.of(both)
    figures = [heat_map(estimate, both) for estimate in both]
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
    (building,) = (obstacle for obstacle in protected.obstacles if obstacle.protected)
    assert shared.of_structure(building) == f"{protected.impulse('building').pa_s:,.0f} Pa s"
    assert unprotected.load_unit.of_structure(building) != shared.of_structure(building)
    assert (shared.factor, shared.label) == (
        unprotected.load_unit.factor,
        unprotected.load_unit.label,
    )
