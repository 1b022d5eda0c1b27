"""From maps and drawings to scenarios and back."""

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import osmium
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from blast_env.errors import BlastEnvError
from blast_env.io.export import LayoutPlan, export_layout
from blast_env.io.importing import Fate, ImportOptions, Role, SiteImport, import_site
from blast_env.layout import usable_cells
from blast_env.sections import PointM
from blast_env.site import (
    AnySource,
    DrawingGeoreference,
    MapGeoreference,
    PolygonSection,
    RectangleSource,
    Scenario,
    load_scenario,
    save_scenario,
)
from tests import builders
from tests.io.importing.found import imported
from tests.io.importing.maps import BLOCK, LAYERS, charge, line, outline, rectangle, written

HALL = ImportOptions(protect=("Town Hall",))
MODULE_M = 0.5
TO_UTM = Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
"""Metres to measure with, which the import does not use."""


@pytest.fixture(scope="module")
def block() -> SiteImport:
    return import_site(BLOCK, HALL)


def comparable(scenario: Scenario) -> dict[str, Any]:
    return scenario.model_dump(
        exclude={"name", "description", "import_notes", "georeference", "charge"}
    )


def ends_m(source: AnySource) -> tuple[PointM, PointM]:
    assert not isinstance(source, RectangleSource)
    (line_m,) = source.lines_m
    return line_m


def in_utm(feature: dict[str, Any]) -> Any:
    """Return the geometry of a GeoJSON feature in metres."""
    geometry = shapely.geometry.shape(feature["geometry"])
    return shapely.transform(geometry, lambda lon_lat: np.stack(TO_UTM.transform(*lon_lat.T), 1))


# The block.


def test_block_is_turned_to_its_streets_and_fits_to_half_a_module(block: SiteImport) -> None:
    assert block.site.rotation_deg == pytest.approx(23.0, abs=0.01)
    assert [building.title for building in block.buildings if building.protected] == ["Town Hall"]
    for building in block.buildings:
        assert building.deviation.outline_m < 0.75 * MODULE_M
        assert building.area_m2 == pytest.approx(building.outline.area, rel=0.06)
    georeference = block.scenario.georeference
    assert isinstance(georeference, MapGeoreference)
    assert georeference.rotation_deg == pytest.approx(23.0, abs=0.01)
    assert georeference.crs == "EPSG:4326"


def test_heights_are_those_of_the_map_in_whole_modules(block: SiteImport) -> None:
    heights = {building.title: building.height_m for building in block.buildings}
    assert heights == {
        "Town Hall": 10.5,
        "Baker": 9.0,
        "Bookshop": 6.0,  # two storeys
        "Pharmacy": 9.0,
        "Library": 7.5,  # 7.4 m
        "Water Tower": 18.0,
        "Chapel": 9.0,  # the median of its neighbours
    }
    (guess,) = (entry for entry in block.ledger.of(Fate.GUESSED) if "heights" in entry.kind)
    assert (guess.place, guess.name) == ("features[6]", "Chapel")
    assert guess.detail.startswith("9.0 m as 7 neighbours, low ")


def test_streets_are_places_of_charges_as_likely_on_every_metre(block: SiteImport) -> None:
    sources = block.scenario.charge
    assert len(sources) == 4  # two straight pieces, at both kerbs
    for source in sources:
        (x0, y0), (x1, y1) = ends_m(source)
        assert source.weight == pytest.approx(np.hypot(x1 - x0, y1 - y0), abs=0.01)
    assert sum(source.weight for source in sources) == pytest.approx(2.0 * 84.0, abs=2.0)


def test_zone_and_what_must_stay_empty_are_those_of_the_map(block: SiteImport) -> None:
    zone = block.scenario.zone
    assert (zone.rows, zone.columns) == (8, 64)  # 4 m x 32 m
    assert [keep_out.reason for keep_out in zone.keep_outs] == ["monument"]
    covered = zone.keep_outs[0].rectangle_m
    (monument,) = block.site.of_role(Role.KEEP_OUT)
    assert shapely.covers(shapely.box(*covered).buffer(0.03), monument.geometry)


@pytest.mark.parametrize("suffix", [".osm", ".osm.pbf", ".dxf"])
def test_every_format_gives_the_same_buildings(
    suffix: str, block: SiteImport, tmp_path: Path
) -> None:
    path = BLOCK.with_suffix(suffix)
    if suffix == ".osm.pbf":
        path = tmp_path / "block.osm.pbf"
        with osmium.SimpleWriter(str(path)) as writer:
            for item in osmium.FileProcessor(str(BLOCK.with_suffix(".osm"))):
                writer.add(item)
    other = import_site(path, replace(HALL, **LAYERS) if suffix == ".dxf" else HALL)
    for mine, its in zip(block.buildings, other.buildings, strict=True):
        assert (mine.name, mine.height_m, mine.protected) == (its.name, its.height_m, its.protected)
        assert mine.area_m2 == pytest.approx(its.area_m2, rel=0.03)
        assert mine.outline.centroid.distance(its.outline.centroid) < MODULE_M
    if suffix == ".dxf":
        assert isinstance(other.scenario.georeference, DrawingGeoreference)
        assert comparable(other.scenario)["build_zone"]["rows"] == 8
    else:
        assert any("no build zone" in note for note in other.notes)


# The way back.


def test_layout_lands_on_the_map_where_it_belongs(block: SiteImport, tmp_path: Path) -> None:
    """Buildings lie over those of the extract, a module on the piece of ground that it is for."""
    save_scenario(block.scenario, tmp_path / "block.toml")
    scenario = load_scenario(tmp_path / "block.toml")
    cell = tuple(np.argwhere(usable_cells(scenario))[7])
    layout = ((int(cell[0]), int(cell[1])),)
    content = json.loads(
        export_layout(LayoutPlan(scenario, layout), tmp_path / "layout.geojson").read_text()
    )
    assert "crs" not in content
    originals = {
        feature["properties"].get("name"): in_utm(feature)
        for feature in json.loads(BLOCK.read_text())["features"]
        if "building" in feature["properties"]
    }
    parts: dict[str, list[Any]] = {}
    for feature in content["features"]:
        if "structure" in feature["properties"]["kind"]:
            name = feature["properties"].get("building", feature["properties"]["name"])
            parts.setdefault(name.replace("_", " "), []).append(in_utm(feature))
    assert parts.keys() == originals.keys() - {None}
    for name, pieces in parts.items():
        modules = shapely.union_all(pieces, grid_size=0.01)
        assert shapely.hausdorff_distance(modules, originals[name]) < MODULE_M
    (module,) = (
        feature for feature in content["features"] if feature["properties"]["kind"] == "barrier"
    )
    square = in_utm(module)
    assert square.area == pytest.approx(0.25, rel=0.002)
    zone = in_utm(json.loads(BLOCK.read_text())["features"][-2])
    assert shapely.covers(zone.buffer(0.3), square)


def test_what_is_exported_can_be_imported_again(block: SiteImport, tmp_path: Path) -> None:
    path = export_layout(LayoutPlan(block.scenario, ()), tmp_path / "block.geojson")
    again = import_site(path)
    mine, new = (comparable(scenario) for scenario in (block.scenario, again.scenario))
    for one, other in zip(mine.pop("structures"), new.pop("structures"), strict=True):
        own, again_m = (shapely.Polygon(part.pop("outline_m")) for part in (one, other))
        assert shapely.hausdorff_distance(own, again_m) < 0.01
        assert one == other
    assert mine == new
    there, here = block.scenario.georeference, again.scenario.georeference
    assert isinstance(there, MapGeoreference)
    assert isinstance(here, MapGeoreference)
    for key in ("longitude_deg", "latitude_deg"):
        assert getattr(here, key) == pytest.approx(getattr(there, key), abs=1e-8)  # a millimetre


KILOGRAMS = st.floats(0.01, 1e4)
HEIGHTS_M = st.sampled_from([0.0, 1.5, 2.25])
PLACES = [
    {"kind": "point", "position_m": [3.0, 3.0]},
    {"kind": "segment", "start_m": [5.0, 3.0], "end_m": [30.0, 3.0]},
    {"kind": "rectangle", "corner_m": [5.0, 5.0], "size_m": [20.0, 2.0]},
]


@pytest.mark.parametrize("suffix", [".geojson", ".dxf"])
@settings(max_examples=10)
@given(data=st.data())
def test_charges_and_courtyards_that_are_exported_can_be_imported_again(
    suffix: str, data: st.DataObject
) -> None:
    charges = [
        place
        | {
            "tnt_kg": data.draw(KILOGRAMS),
            "height_m": data.draw(HEIGHTS_M),
            "weight": data.draw(st.floats(0.01, 100.0)),
        }
        for place in PLACES
    ]
    yard = [[16.0, 14.0], [24.0, 14.0], [24.0, 22.0], [16.0, 22.0]]
    court = {
        "kind": "polygon",
        "name": "court",
        "outline_m": [[12.0, 10.0], [28.0, 10.0], [28.0, 26.0], [12.0, 26.0]],
        "courtyards_m": [yard],
        "height_m": 6.0,
        "protected": data.draw(st.booleans()),
    }
    lodge = builders.block("lodge", 30.0, 10.0, 8, 8, height_m=3.0, protected=True)
    site = builders.site("s", (40.0, 30.0), charges, court, lodge)
    with TemporaryDirectory() as folder:
        path = export_layout(LayoutPlan(site, ()), Path(folder, f"site{suffix}"))
        again = import_site(path).scenario
    for key in ("tnt_kg", "height_m", "weight"):
        mine, new = ([getattr(source, key) for source in own.charge] for own in (site, again))
        assert new == pytest.approx(mine, rel=1e-9)
    areas = {structure.name: 0.25 * structure.modules for structure in again.structures}
    assert areas == {"court": 16.0**2 - 8.0**2, "lodge": 16.0}


@pytest.mark.usefixtures("apart")
def test_map_in_another_reference_system_goes_back_to_it(tmp_path: Path) -> None:
    """The older form of GeoJSON says which in its member crs; so does what is written."""
    collection = json.loads(BLOCK.read_text())
    for feature in collection["features"]:
        places = feature["geometry"]["coordinates"]
        ring = places[0] if feature["geometry"]["type"] == "Polygon" else places
        ring[:] = np.stack(TO_UTM.transform(*np.array(ring).T), axis=1).tolist()
    name = "urn:ogc:def:crs:EPSG::25832"
    collection["crs"] = {"type": "name", "properties": {"name": name}}
    path = tmp_path / "utm.geojson"
    path.write_text(json.dumps(collection))
    site = import_site(path, HALL)
    assert isinstance(site.scenario.georeference, MapGeoreference)
    assert site.scenario.georeference.rotation_deg == pytest.approx(23.0, abs=0.02)  # true north
    content = json.loads(
        export_layout(LayoutPlan(site.scenario, ()), tmp_path / "layout.geojson").read_text()
    )
    assert content["crs"]["properties"]["name"] == name
    zone = next(
        feature for feature in content["features"] if feature["properties"]["kind"] == "build_zone"
    )
    original = shapely.geometry.shape(collection["features"][-2]["geometry"])
    assert shapely.hausdorff_distance(
        shapely.geometry.shape(zone["geometry"]), original
    ) == pytest.approx(0.0, abs=MODULE_M)


def test_drawing_goes_back_to_its_own_millimetres(tmp_path: Path) -> None:
    site = import_site(BLOCK.with_suffix(".dxf"), replace(HALL, **LAYERS))
    path = export_layout(LayoutPlan(site.scenario, ()), tmp_path / "layout.geojson")
    content = json.loads(path.read_text())
    again = import_site(path).scenario
    assert again.site == site.scenario.site
    assert len(again.structures) == len(site.scenario.structures)
    assert isinstance(again.georeference, DrawingGeoreference)
    assert again.georeference.metres_per_unit == 0.001
    assert "units of 0.001 m" in content["coordinate_system"]
    zone = next(
        feature for feature in content["features"] if feature["properties"]["kind"] == "build_zone"
    )
    ring = np.array(zone["geometry"]["coordinates"][0]) / 1000.0 - [5000.0, 3000.0]
    turned = shapely.affinity.rotate(shapely.Polygon(ring), -23.0, origin=(0, 0))
    assert shapely.hausdorff_distance(turned, shapely.box(36, 27, 68, 31)) < MODULE_M


# Places, sizes, choices.


def test_origin_and_size_say_what_is_on_the_site(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        outline(rectangle(10, 10, 8, 6), name="A"),
        outline(rectangle(30, 10, 8, 6), name="B"),
        charge(12.0, 25.0),
    )
    site = imported(path, protect=("a",), origin=(5.1, 4.0), size_m=(29.0, 30.0))
    assert site.site.size_m == (29.0, 30.0)
    assert site.site.corner_m == (5.0, 4.0)  # moved onto the grid of the walls
    first, second = site.buildings
    assert (first.name, first.is_cut, first.boxes_m) == ("A", False, ((5.0, 6.0, 13.0, 12.0),))
    assert (second.name, second.is_cut) == ("B", True)
    assert second.boxes_m == ((25.0, 6.0, 29.0, 12.0),)
    centred = imported(path, protect=("a",), centre=(19.5, 19.0), size_m=(29.0, 30.0))
    assert comparable(centred.scenario) == comparable(site.scenario)


def test_site_is_put_around_everything_with_a_margin(tmp_path: Path) -> None:
    path = written(tmp_path, outline(rectangle(0, 0, 6, 4)), charge(12.0, 2.0))
    site = imported(path, protect_near=(1.0, 1.0), margin_m=3.0, rotation_deg=0.0)
    assert site.site.size_m == (18.0, 10.0)
    assert site.buildings[0].name == "building_1"
    assert ends_m(site.scenario.charge[0])[0] == (15.0, 5.0)


def test_protected_is_what_is_named_near_or_marked(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        outline(rectangle(0, 0, 6, 4), name="Nord Schule"),
        outline(rectangle(10, 0, 5, 4), name="Straße 5", protected="yes"),
        charge(8.0, 12.0),
    )

    def protected(**options: Any) -> list[str]:
        return [
            building.name for building in imported(path, **options).buildings if building.protected
        ]

    assert protected() == ["Strasse_5"]
    assert protected(protect=("nord schule",)) == ["Nord_Schule"]
    assert protected(protect_near=(0.0, 9.0)) == ["Nord_Schule"]
    assert protected(protect=("Strasse_5",), protect_near=(0, 0)) == ["Nord_Schule", "Strasse_5"]


def test_all_houses_of_a_name_are_protected(tmp_path: Path) -> None:
    blocks = [outline(rectangle(x, 0, 6, 4), name="School") for x in (0, 10)]
    hall = outline(rectangle(20, 0, 6, 4), name="Hall")
    site = imported(written(tmp_path, *blocks, hall, charge(8.0, 12.0)), protect=("School",))
    marks = {building.place: building.protected for building in site.buildings}
    assert marks == {"features[0]": True, "features[1]": True, "features[2]": False}


def test_a_marked_building_that_is_lost_is_refused_not_dropped(tmp_path: Path) -> None:
    """Another building with a mark would count alone, without a word."""
    own = outline(rectangle(20, 0, 6, 4), name="Hall", protected="yes")
    hidden = outline(rectangle(0, 0, 6, 4), name="Post", protected="yes", height=3.0)
    above = outline(rectangle(-1, -1, 9, 9), name="Shed", height=9.0)
    path = written(tmp_path, own, hidden, above, charge(8.0, 12.0))
    with pytest.raises(BlastEnvError, match=r"protected that is merged: .* 'Post': by features"):
        import_site(path)
    small = outline(rectangle(0, 0, 1, 1), name="Box", protected="yes")
    path = written(tmp_path, own, small, charge(8.0, 12.0))
    with pytest.raises(BlastEnvError, match=r"protected that is left out: .* 'Box'"):
        import_site(path)
    hall, *_ = (building for building in imported(path, protect=("Hall",)).buildings)
    assert hall.protected


def test_the_mark_of_a_part_protects_its_building(tmp_path: Path) -> None:
    whole = outline(rectangle(0, 0, 20, 10), name="Hall", height=6.0)
    part = {"building": "no", "building:part": "yes", "height": 12.0, "protected": "yes"}
    wing = outline(rectangle(0, 0, 10, 10), **part)
    site = imported(written(tmp_path, whole, wing, charge(8.0, 22.0)))
    assert [building.protected for building in site.buildings] == [True, True]


def test_properties_say_what_is_what_where_the_user_says_which(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        outline(rectangle(0, 0, 6, 4), kind="house", z_top=7.1),
        outline(rectangle(10, 0, 6, 4), kind="shed"),
        outline(rectangle(0, 8, 6, 3), kind="lawn"),
        outline(rectangle(0, 8, 2, 1), kind="pond", name="pond"),
        outline(rectangle(20, 0, 4, 8), kind="parking lot", tnt_kg=20.0),
    )
    site = imported(
        path,
        buildings_from=("kind=HOUSE",),
        zone_from=("kind=lawn",),
        keep_outs_from=("kind=p?nd",),
        charges_from=("kind=parking*",),
        height_from="Z_top",
        protect_near=(0.0, 0.0),
        stock=4,
    )
    (house,) = site.buildings
    assert house.height_m == 7.0
    assert (site.scenario.zone.rows, site.scenario.zone.columns) == (6, 12)
    assert [keep_out.rectangle_m for keep_out in site.scenario.zone.keep_outs] == [(10, 18, 12, 19)]
    (area,) = site.scenario.charge
    assert (area.kind, area.tnt_kg, area.weight) == ("rectangle", 20.0, 32.0)


def test_zone_in_site_metres_or_around_what_is_protected(tmp_path: Path) -> None:
    path = written(tmp_path, outline(rectangle(0, 0, 6, 4), protected=True), charge(14.0, 2.0))
    given = imported(path, zone_m=(17.0, 8.0, 2.0, 9.0)).scenario.zone
    assert given.rectangle_m == (17.0, 8.0, 19.0, 17.0)
    around = imported(path, zone_around_m=4.0, wall_height_m=2.5).scenario.zone
    assert around.rectangle_m == (6.0, 6.0, 20.0, 18.0)
    assert (around.height_m, around.clearance_m) == (2.5, 1.0)


def test_zone_that_is_no_rectangle_is_closed_outside_its_outline(tmp_path: Path) -> None:
    zone = [(10, 0), (14, 0), (14, 2), (12, 2), (12, 4), (10, 4)]
    path = written(
        tmp_path,
        outline(rectangle(0, 0, 6, 4), protected=True),
        outline(zone, kind="build_zone"),
        charge(20.0, 2.0),
    )
    scenario = imported(path).scenario
    assert scenario.zone.rectangle_m == (20.0, 10.0, 24.0, 14.0)
    assert [keep_out.rectangle_m for keep_out in scenario.zone.keep_outs] == [
        (22.0, 12.0, 24.0, 14.0)
    ]
    assert int(usable_cells(scenario).sum()) == 48


# One building is one polygon.

ELL = [(6.0, 3.0), (9.0, 3.0), (9.0, 5.0), (7.5, 5.0), (7.5, 7.0), (6.0, 7.0)]


@pytest.fixture(scope="module")
def ell(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """A house of 3 m height with two wings, beside one of 1.5 m."""
    path = written(
        tmp_path_factory.mktemp("maps"),
        outline(rectangle(0, 0, 12, 10), kind="site"),
        outline(ELL, name="House 7", height=3.0, protected=True),
        outline(rectangle(9.0, 3.0, 2.0, 2.0), name="annexe", height="1.5 m"),
        charge(2.0, 5.0),
    )
    return imported(path, tnt_kg=5.0).scenario


def test_a_building_is_one_structure_with_the_outline_of_the_map(ell: Scenario) -> None:
    house, annexe = ell.structures
    assert (house.name, annexe.name) == ("House_7", "annexe")
    assert (house.building, house.weight, house.modules) == (None, 1.0, 4 * 9)
    assert isinstance(house, PolygonSection)
    assert set(house.outline_m) == set(ELL)


def arc(radius_m: float, turns_deg: np.ndarray) -> list[tuple[float, float]]:
    turns = np.radians(turns_deg)
    places = np.stack((40.0 + radius_m * np.cos(turns), radius_m * np.sin(turns)), axis=1)
    return [(float(x), float(y)) for x, y in places]


def test_a_curved_museum_is_one_structure(tmp_path: Path) -> None:
    """Some thirty rectangles, which were refused."""
    turns_deg = np.linspace(20.0, 160.0, 71)
    ring = [*arc(30.0, turns_deg), *arc(22.0, turns_deg[::-1])]
    path = written(
        tmp_path, outline(ring, name="Museum", height=9.0, protected=True), charge(40, 5)
    )
    site = imported(path, rotation_deg=0.0)
    (museum,) = site.scenario.structures
    assert museum.modules * 0.25 == pytest.approx(shapely.Polygon(ring).area, rel=0.02)
    assert len(museum.boxes_m) > 30
    assert museum.footprint is not None
    assert 10 < len(museum.footprint.walls) < 40
    assert site.buildings[0].deviation.outline_m < 0.75 * MODULE_M


def test_a_courtyard_stays_open(tmp_path: Path) -> None:
    house = outline(rectangle(0, 0, 20, 16), name="Block", protected=True)
    house["geometry"]["coordinates"].append([*rectangle(6, 5, 8, 6), (6, 5)])
    path = written(tmp_path, house, charge(30.0, 8.0))
    (block,) = imported(path, rotation_deg=0.0).scenario.structures
    assert isinstance(block, PolygonSection)
    assert len(block.courtyards_m) == 1
    assert block.modules == 4 * (20 * 16 - 8 * 6)


@pytest.mark.parametrize("gap_m", [-0.03, 0.0, 0.004, 0.04])
@pytest.mark.parametrize("lean_m", [0.0, 1.3])
def test_houses_wall_to_wall_leave_no_gap(gap_m: float, lean_m: float, tmp_path: Path) -> None:
    """Nor do their modules overlap, with a common wall along centres of modules too."""
    west = [(0.0, 0.0), (6.25, 0.0), (6.25 + lean_m, 8.0), (0.0, 8.0)]
    east = [(6.25 + gap_m, 0.0), (12.0, 0.0), (12.0, 8.0), (6.25 + lean_m + gap_m, 8.0)]
    path = written(
        tmp_path,
        outline(west, name="W", protected=True),
        outline(east, name="E"),
        charge(25.0, 4.0),
    )
    structures = imported(path, rotation_deg=0.0).scenario.structures
    assert sum(structure.modules for structure in structures) == 4 * 12 * 8


def test_a_building_that_the_border_cuts_apart_has_two_structures(tmp_path: Path) -> None:
    ring = [(0, 0), (12, 0), (12, 8), (8, 8), (8, 3), (4, 3), (4, 8), (0, 8)]
    path = written(
        tmp_path, outline([(float(x), float(y)) for x, y in ring], name="U", protected=True)
    )
    options = {"origin": (-8.0, 4.0), "size_m": (26.0, 12.0), "rotation_deg": 0.0}
    site = imported(path, charge_at=((-5.0, 10.0),), **options)
    assert [entry.detail for entry in site.ledger.of(Fate.CUT)] == ["32.0 of 76.0 m2"]
    assert [building.is_cut for building in site.buildings] == [True]
    scenario = site.scenario
    assert [structure.name for structure in scenario.structures] == ["Ua", "Ub"] or [
        structure.name for structure in scenario.structures
    ] == ["U_a", "U_b"]
    assert {structure.building for structure in scenario.structures} == {"U"}
    assert sum(structure.weight for structure in scenario.structures) == pytest.approx(1.0)


def test_a_building_that_ends_at_the_border_is_not_cut(tmp_path: Path) -> None:
    site = outline(rectangle(0, 0, 40, 30), kind="site")
    house = outline(rectangle(0, 0, 12, 8), name="House")
    imported_site = imported(written(tmp_path, site, house, charge(30, 20)), protect=("House",))
    assert [building.is_cut for building in imported_site.buildings] == [False]
    assert not imported_site.ledger.of(Fate.CUT)


def test_streets_keep_clear_of_buildings_and_border(tmp_path: Path) -> None:
    """A street under a house is cut there: no charge may be inside it."""
    path = written(
        tmp_path,
        outline(rectangle(10, 0, 6, 10), protected=True),
        line([(-40, 5), (60, 5)], highway="service"),
    )
    scenario = imported(path).scenario
    gap_m = scenario.charge_radius_m
    west, east = scenario.charge  # a lane is too narrow for two rows of vehicles
    assert ends_m(west)[0][0] == pytest.approx(gap_m, abs=0.02)
    assert ends_m(west)[1][0] == pytest.approx(10.0 - gap_m, abs=0.02)
    assert ends_m(east)[0][0] == pytest.approx(16.0 + gap_m, abs=0.02)
    assert ends_m(east)[1][0] == pytest.approx(26.0 - gap_m, abs=0.02)


def test_the_bundled_car_park_is_what_the_page_s_command_imports() -> None:
    options = ImportOptions(
        origin=(26.943884, 60.521887),
        size_m=(96.0, 96.0),
        protect_near=(26.944, 60.5227),
        default_height_m=5.0,
    )
    made = import_site(BLOCK.parent / "car_park.osm", options).scenario
    bundled = load_scenario("car_park")
    its, found = (
        shapely.union_all(
            [shapely.box(*box) for structure in site.structures for box in structure.boxes_m]
        )
        for site in (bundled, made)
    )
    assert shapely.symmetric_difference(its, found).area < 0.01 * its.area
    assert bundled.georeference == made.georeference


def test_a_point_with_a_diameter_is_a_circle(tmp_path: Path) -> None:
    tank = charge(30.0, 30.0)
    tank["properties"] = {"man_made": "storage_tank", "diameter": "10 m", "height": "6"}
    unprotected = charge(45.0, 30.0)
    unprotected["properties"] = {"man_made": "silo"}
    house = outline(rectangle(5.0, 5.0, 10.0, 8.0), name="House")
    path = written(tmp_path, house, tank, unprotected, charge(40.0, 5.0))
    found = imported(path, protect=("House",), rotation_deg=0.0)
    (_, circle) = sorted(found.buildings, key=lambda building: building.protected, reverse=True)
    assert circle.area_m2 == pytest.approx(0.25 * np.pi * 10.0**2, rel=0.04)
    assert circle.deviation.outline_m < MODULE_M
    assert circle.height_m == 6.0
    assert any("left out" in note for note in found.notes)
