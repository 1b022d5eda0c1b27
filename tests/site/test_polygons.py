"""Buildings as polygons: errors with their places, and all that a site does with them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import readfile

from blast_env.app.edits import SiteThing, ThingKind, moved, resized, section_of
from blast_env.app.page.fields import fields_of, value_of
from blast_env.app.solids import boxes
from blast_env.calibration import load_calibration
from blast_env.envs.display import placing_text
from blast_env.evaluation.engines import Blast, find_engine
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.geometry import Layout
from blast_env.io.export import LayoutPlan, clearance_outlines, export_layout
from blast_env.layout import LayoutState, usable_cells, vehicle_reach, worst_places
from blast_env.particles import build_scene
from blast_env.plots import Kinds, site_features
from blast_env.plots.site_picture import site_picture
from blast_env.site import Charge, Scenario, ScenarioError
from blast_env.sites import turned
from blast_env.vehicles import stand_off_m
from tests.builders import block
from tests.gas_sites import site_document
from tests.vehicle_sites import gate_site, vehicle_of

OUTLINE = [(6.0, 3.0), (8.9, 2.2), (9.4, 5.0), (8.0, 5.0), (8.0, 6.2), (6.6, 6.0)]
COURT = [(7.0, 3.6), (8.0, 3.6), (8.0, 4.6), (7.0, 4.6)]


def with_polygon(**changes: Any) -> dict[str, Any]:
    document = site_document()
    section = {
        "kind": "polygon",
        "name": "museum",
        "outline_m": OUTLINE,
        "height_m": 2.0,
        "protected": True,
    }
    document["structures"] = [section | changes]
    return document


def museum(**changes: Any) -> Scenario:
    return Scenario.from_document(with_polygon(**changes), "museum")


CORNERS = "structures[0].outline_m"


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"outline_m": [(6, 3), (9, 5), (9, 3), (6, 5)]}, CORNERS, "touches itself at (7.5, 4) m"),
        (
            {"outline_m": [(6, 3), (11, 3), (9, 5)]},
            "structures[0]",
            "must lie inside the site (x 0",
        ),
        ({"outline_m": [(6.3, 3.3), (6.4, 3.3), (6.4, 3.4)]}, CORNERS, "encloses 0.005 m2 and the"),
        ({"courtyards_m": [[(1, 1), (2, 1), (2, 2)]]}, CORNERS, "must lie inside the outline"),
        ({"outline_m": [(1, 3), (9, 3), (9, 5), (1, 5)]}, "charge[0]", "museum"),
    ],
)
def test_errors_name_value_bound_and_place(changes: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        museum(**changes)
    found = [problem for problem in caught.value.problems if problem.key == key]
    assert found, caught.value
    assert any(words in problem.message for problem in found), caught.value


def test_overlaps_are_of_modules_not_of_rectangles_around() -> None:
    """A hut in the corner of an L-shaped building stands free."""
    document = with_polygon(outline_m=[(6, 2), (9, 2), (9, 3), (7, 3), (7, 6), (6, 6)])
    document["structures"].append(block("hut", 8.0, 4.0, 2, 2, height_m=2.0))
    Scenario.from_document(document, "free")
    document["structures"][1]["corner_m"] = [6.5, 4.0]
    with pytest.raises(ScenarioError, match="overlaps"):
        Scenario.from_document(document, "not free")


def test_legality_and_clearance_keep_to_the_walls() -> None:
    """Cells in the notch of an L are free; the rectangle around it would close them."""
    ell = [(4.5, 2.5), (8.0, 2.5), (8.0, 5.5), (6.0, 5.5), (6.0, 3.5), (4.5, 3.5)]
    document = with_polygon(outline_m=ell)
    document["build_zone"]["stock"] = 2
    scenario = Scenario.from_document(document, "notch")
    assert usable_cells(scenario).sum() == 12 - 2
    document["build_zone"]["clearance_m"] = 0.6
    assert usable_cells(Scenario.from_document(document, "clearance")).sum() < 12 - 2


def test_a_vehicle_reaches_the_wall_itself() -> None:
    """The stand-off is to the slanting wall, not to the rectangle around it."""
    building = {
        "kind": "polygon",
        "name": "wedge",
        "outline_m": [(13.0, 1.0), (13.0, 7.0), (10.0, 7.0)],
        "height_m": 2.0,
        "protected": True,
    }
    scenario = gate_site(structures=[building])
    source = vehicle_of(scenario)
    places = worst_places(scenario, source)
    assert vehicle_reach(scenario, source).enters
    assert places.stand_off_m == pytest.approx(1.0, abs=0.45)
    assert stand_off_m(scenario.loaded_walls, (10.0, 1.0)) == pytest.approx(3.0 * 6.0 / 45**0.5)


def test_particles_hit_its_modules() -> None:
    scenario = museum(courtyards_m=[COURT])
    (structure,) = scenario.structures
    scene = build_scene(scenario)
    (obstacle,) = scene.obstacles()
    assert len(obstacle.parts) == structure.modules
    result = Blast(scenario, charge=Charge((2.0, 4.0), 5.0), engine="event").run()
    loads = result.loads(load_calibration("ballistic_ufc", "event"))
    assert loads.are_for(scenario)
    assert (loads.protected_impulse_sim or 0.0) > 0.0


def test_gas_loads_every_wall_and_the_courtyard() -> None:
    scenario = museum(courtyards_m=[COURT])
    result = GasBlast(scenario, engine=GasEngine(border_m=0.0, until=0.02)).run()
    loads = result.loads()
    assert loads.are_for(scenario)
    footprint = scenario.structures[0].footprint
    assert footprint is not None
    perimeter_m = footprint.polygon.length
    assert loads.structures[0].area_m2 == pytest.approx(2.0 * perimeter_m, rel=0.08)
    walls = result.run.table.wall[result.run.table.structure == 0]
    assert set(range(len(footprint.walls))) <= set(walls.tolist())
    by_face = result.walls.set_index("face")["impulse_pa_s"]
    assert by_face["west"] > by_face["east"]


def test_the_surrogate_knows_its_walls() -> None:
    """A slanted wall has the load of points along it; the area is that of the walls."""
    loads = find_engine("surrogate").loads(museum(), (), Charge((2.0, 4.0), 5.0), 0)
    plain = find_engine("surrogate").loads(
        museum(outline_m=[(6.0, 3.0), (9.0, 3.0), (9.0, 6.0), (6.0, 6.0)]),
        (),
        Charge((2.0, 4.0), 5.0),
        0,
    )
    assert loads.protected_impulse_pa_s == pytest.approx(plain.protected_impulse_pa_s, rel=0.5)


def test_pictures_and_drawings_show_the_outline(tmp_path: Path) -> None:
    scenario = museum(courtyards_m=[COURT], facade={"wall": "brick_215", "bay_m": 1.0})
    (feature,) = (
        site_feature
        for site_feature in site_features(scenario)
        if site_feature.kind is Kinds.PROTECTED_STRUCTURE
    )
    assert set(feature.places_m) == set(OUTLINE)
    assert {place for hole in feature.holes_m for place in hole} == set(COURT)
    layout: Layout = ((0, 0),)
    site_picture(scenario, layout)
    assert "P" in placing_text(LayoutState.of(scenario, layout), scenario.charge)
    assert len([box for box in boxes(scenario, layout) if box.name == "museum"]) > 1
    path = tmp_path / "museum.dxf"
    export_layout(LayoutPlan(scenario, layout), path)
    lines = readfile(path).modelspace().query("LWPOLYLINE[layer=='PROTECTED_STRUCTURE']")
    assert sorted(len(list(line.vertices())) for line in lines if isinstance(line, LWPolyline)) == [
        4,
        6,
    ]


def test_drawings_have_the_clearance_around_its_modules_and_in_courtyards() -> None:
    document = with_polygon(courtyards_m=[[(7.0, 3.6), (8.6, 3.6), (8.6, 4.9), (7.0, 4.9)]])
    document["build_zone"]["clearance_m"] = 0.3
    scenario = Scenario.from_document(document, "clear")
    rings = [shapely.LinearRing(ring) for ring in clearance_outlines(LayoutPlan(scenario, ()))]
    modules = shapely.union_all([shapely.box(*box) for box in scenario.structures[0].boxes_m])
    assert len(rings) == 2
    for ring in rings:
        places = shapely.points(shapely.get_coordinates(ring))
        assert shapely.distance(places, modules) == pytest.approx(0.3, abs=0.01)


def test_a_facade_is_set_once_for_all_walls() -> None:
    scenario = museum(facade={"wall": "brick_215", "bay_m": 1.0})
    names = [bay.bay.name for bay in scenario.bays]
    assert len(names) == len(set(names))
    assert {bay.bay.wall for bay in scenario.bays} == {"west", "east", "south", "north"}
    result = GasBlast(scenario, engine=GasEngine(border_m=0.0, until=0.02)).run()
    assert not result.unjudged
    assert len(result.bays)


def test_the_page_edits_what_a_polygon_has() -> None:
    scenario, thing = museum(), SiteThing(ThingKind.STRUCTURE, 0)
    section = section_of(scenario, thing)
    values = {field.label: value_of(section, field) for field in fields_of(scenario, thing)}
    assert values["height (m)"] == 2.0
    assert "left (m)" not in values
    assert resized(scenario, thing, (9.0, 7.0)) == scenario


def test_turning_and_moving_keep_its_modules() -> None:
    scenario = museum(courtyards_m=[COURT])
    modules = scenario.structures[0].modules
    assert turned(scenario, 1).structures[0].modules == pytest.approx(modules, abs=2)
    assert turned(scenario, 4).structures[0].modules == modules
    aside = moved(scenario, SiteThing(ThingKind.STRUCTURE, 0), (-0.5, 0.5))
    assert aside.structures[0].modules == modules
    assert np.subtract(aside.structures[0].corner_m, scenario.structures[0].corner_m).tolist() == [
        -0.5,
        0.5,
    ]
