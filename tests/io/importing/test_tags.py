"""The attributes of maps: each case is one form in which public maps have them."""

import json
from pathlib import Path
from typing import Any

import pytest
import shapely

from blast_env.io.importing import Fate, ImportOptions, SiteImport, import_site
from blast_env.site import PointSource, Scenario, SegmentSource
from tests.io.importing.found import entries, error_of, places
from tests.io.importing.maps import (
    DEGREE_M,
    Extract,
    charge,
    line,
    outline,
    rectangle,
    town,
    written,
)

CASES = Path(__file__).parent / "cases"
PLACE = charge(-5.0, 2.0)
HOUSE = outline(rectangle(0, 0, 20, 10), name="House", height=6.0, protected=True)
FOOT_M = 0.3048


def case(name: str, **options: Any) -> SiteImport:
    return import_site(CASES / name, ImportOptions(**{"protect": ("Court",)} | options))


def heights(site: SiteImport) -> dict[str, tuple[float, float | None]]:
    """Return underside and top of each building by its place in the file, m."""
    return {building.place: (building.base_m, building.height_m) for building in site.buildings}


def of_map(folder: Path, *features: dict[str, Any], **options: Any) -> SiteImport:
    """Import features beside a house, `features[0]`, and a place of a charge, `features[1]`."""
    return import_site(written(folder, HOUSE, PLACE, *features), ImportOptions(**options))


def beside(**tags: Any) -> dict[str, Any]:
    """Return a building of 20 m x 10 m beside the house, `features[2]`."""
    return outline(rectangle(30, 0, 20, 10), **{"height": 9.0} | tags)


def bare(**properties: Any) -> dict[str, Any]:
    """Return an outline beside the house with these properties and no others."""
    return beside() | {"properties": properties}


def segments(scenario: Scenario) -> list[SegmentSource]:
    return [source for source in scenario.charge if isinstance(source, SegmentSource)]


# The kind of a building comes from `building`.


@pytest.mark.parametrize("name", ["g_roof_layer.geojson", "g_roof_no_layer.geojson"])
def test_a_roof_is_open_below_whatever_its_layer(name: str) -> None:
    site = case(name)
    assert heights(site) == {"features[0]": (0.0, 12.0), "features[1]": (4.0, 4.5)}
    assert places(site, Fate.GUESSED, "roofs on posts") == ["features[1]"]


@pytest.mark.parametrize(
    "tags",
    [
        {"building": "Roof"},
        {"building": "carport"},
        {"building": "yes", "wall": "no"},
        {"building": "roof", "kind": "main"},
        {"building": "no", "building:part": "roof"},
    ],
)
def test_every_form_of_a_roof_is_open_below(tags: dict[str, str], tmp_path: Path) -> None:
    assert heights(of_map(tmp_path, beside(**tags)))["features[2]"] == (8.5, 9.0)


@pytest.mark.parametrize(
    "tags",
    [
        {"building": "demolished"},
        {"building": "proposed"},
        {"building": "construction"},
        {"building": "yes", "razed": "yes"},
        {"building": "yes", "demolished": True},
    ],
)
def test_what_does_not_stand_is_left_out_with_a_line(tags: dict[str, Any], tmp_path: Path) -> None:
    site = of_map(tmp_path, beside(**tags))
    assert places(site, Fate.LEFT_OUT, "planned, under construction or gone") == ["features[2]"]
    assert heights(site).keys() == {"features[0]"}


def test_prefixes_of_the_life_cycle_say_what_stands(tmp_path: Path) -> None:
    site = of_map(
        tmp_path,
        bare(**{"demolished:building": "yes", "height": 9.0}),
        bare(**{"disused:building": "yes", "height": 9.0}),
    )
    assert heights(site).keys() == {"features[0]", "features[3]"}
    assert places(site, Fate.PASSED, "demolished:building") == ["features[2]"]


@pytest.mark.parametrize(
    ("tags", "words"),
    [
        ({"location": "underground"}, "below the ground"),
        ({"layer": "-1"}, "below the ground"),
        ({"layer": -2}, "below the ground"),
        ({"location": "roof"}, "on or in others"),
    ],
)
def test_what_is_not_on_the_ground_is_left_out(
    tags: dict[str, Any], words: str, tmp_path: Path
) -> None:
    site = of_map(tmp_path, beside(**tags))
    assert places(site, Fate.LEFT_OUT, words) == ["features[2]"]


def test_a_bridge_of_a_building_without_an_underside_is_named(tmp_path: Path) -> None:
    site = of_map(tmp_path, beside(building="bridge"))
    assert places(site, Fate.GUESSED, "bridges, solid to the ground") == ["features[2]"]
    raised = of_map(tmp_path, beside(building="bridge", min_height="5"))
    assert heights(raised)["features[2]"] == (5.0, 9.0)
    assert not entries(raised, Fate.GUESSED, "bridges")


def test_open_ground_of_a_map_that_marks_nothing_is_no_building(tmp_path: Path) -> None:
    lawn = bare(landuse="grass")
    path = written(tmp_path, bare(height=12.0), lawn)
    site = import_site(path, ImportOptions(protect_near=(31.0, 1.0), charge_at=((25.0, 2.0),)))
    assert heights(site) == {"features[0]": (0.0, 12.0)}
    assert places(site, Fate.PASSED, "landuse") == ["features[1]"]


@pytest.mark.parametrize("name", ["g_facade_tag.geojson", "g_facade_number.geojson"])
def test_tags_of_facades_are_no_windows_of_a_model(name: str) -> None:
    (court,) = case(name).buildings
    assert (court.height_m, court.facade) == (12.0, {})


# Units and forms of heights.


def test_heights_of_a_map_in_feet_are_in_feet_as_a_guess() -> None:
    options: dict[str, Any] = {"charge_at": ((985_100.0, 200_016.0),), "margin_m": 20.0}
    site = case("g_2263_ft.geojson", **options)
    (court,) = site.buildings
    assert court.height_m == 12.0
    assert court.area_m2 == pytest.approx(200.0, rel=0.03)
    (guess,) = entries(site, Fate.GUESSED, "feet, as the coordinates of the file (--height-unit)")
    assert (guess.place, guess.detail) == ("features[0]", "height is 39.4: 12.01 m")
    assert any("--height-unit" in note for note in site.notes)
    told = case("g_2263_ft.geojson", height_unit="ft", **options)
    assert told.buildings[0].height_m == 12.0
    assert not entries(told, Fate.GUESSED, "feet")
    assert case("g_2263_ft.geojson", height_unit="m", **options).buildings[0].height_m == 39.5


def test_heights_of_roofs_of_new_york_are_in_feet_as_a_guess() -> None:
    site = case("g_heightroof_ft.geojson")
    assert heights(site) == {"features[0]": (0.0, 12.0), "features[1]": (0.0, 30.5)}
    assert places(site, Fate.GUESSED, "feet") == ["features[0]", "features[1]"]
    metres = case("g_heightroof_ft.geojson", height_unit="m")
    assert heights(metres)["features[0]"] == (0.0, 39.5)


@pytest.mark.parametrize(
    ("code", "base_m"), [(2100, 0.0), (1001, 8.5), (5100, None), (2110.0, 0.0)]
)
def test_footprints_of_new_york_have_a_code_for_their_kind(
    code: float, base_m: float | None, tmp_path: Path
) -> None:
    site = of_map(tmp_path, bare(HEIGHT_ROOF=29.53, FEATURE_CODE=code))
    expected = None if base_m is None else (base_m, 9.0)
    assert heights(site).get("features[2]") == expected


@pytest.mark.parametrize(
    ("height", "expected_m"),
    [
        ("40'", 12.0),
        ("40\u2032", 12.0),
        ("39'4\"", 12.0),
        ("39 ft 4 in", 12.0),
        ("39.4 feet", 12.0),
        ("39.4ft", 12.0),
        ("12 m", 12.0),
        ("12M", 12.0),
        ("12m.", 12.0),
        ("12,0", 12.0),
        ("12,04 m", 12.0),
        ("1200 cm", 12.0),
        (" 12 metres ", 12.0),
        (12, 12.0),
    ],
)
@pytest.mark.parametrize("height_unit", [None, "m"])
def test_forms_of_a_height(
    height: str | float, expected_m: float, height_unit: str | None, tmp_path: Path
) -> None:
    site = of_map(tmp_path, beside(height=height), height_unit=height_unit)
    assert heights(site)["features[2]"] == (0.0, expected_m)
    assert not site.ledger.of(Fate.GUESSED)


def test_a_unit_of_heights_is_that_of_numbers_without_one(tmp_path: Path) -> None:
    tank = charge(70.0, 5.0)
    tank["properties"] = {"man_made": "storage_tank", "diameter": 33, "height": "39.4"}
    features = (beside(height="39.4", min_height=10), beside(height="12 m", min_height="3 m"), tank)
    site = of_map(tmp_path, features[0], tank, height_unit="ft")
    assert heights(site)["features[2]"] == (3.0, 12.0)
    assert site.buildings[-1].outline.bounds[2] > 0.0
    (round_one,) = (building for building in site.buildings if building.place == "features[3]")
    assert round_one.outline.area == pytest.approx(3.14 * (16.5 * FOOT_M) ** 2, rel=0.05)
    assert heights(of_map(tmp_path, features[1], height_unit="ft"))["features[2]"] == (3.0, 12.0)
    assert "--height-unit is 'yards', must be one of m, mm, cm, dm, km, in, ft" in error_of(
        Path("a.geojson"), height_unit="yards"
    )


@pytest.mark.parametrize("height", ["-4", "tall", "1,200", "12 parsec", "", True, 1e999, "9" * 90])
def test_a_height_that_is_none_is_said(height: Any, tmp_path: Path) -> None:
    site = of_map(tmp_path, beside(height=height))
    assert places(site, Fate.GUESSED, "cannot be read") == ["features[2]"]
    assert places(site, Fate.GUESSED, "heights not in the file") == ["features[2]"]


@pytest.mark.parametrize(
    ("tags", "expected_m"),
    [
        ({"building:levels": "3", "roof:levels": "1"}, (0.0, 12.0)),
        ({"building:levels": "0", "roof:levels": "2"}, (0.0, 6.0)),
        ({"building:levels": "3", "roof:height": "2.5"}, (0.0, 11.5)),
        ({"building:levels": "3", "roof:levels": "1", "roof:height": "2.5"}, (0.0, 11.5)),
        ({"building:levels": "4", "building:min_level": "1"}, (3.0, 12.0)),
        ({"building:levels": "4", "min_level": 2}, (6.0, 12.0)),
        ({"levels": 4, "minLevel": 1}, (3.0, 12.0)),
        ({"height": "12", "minHeight": 4.5}, (4.5, 12.0)),
        ({"height": "12", "building:levels": "9", "roof:height": "5"}, (0.0, 12.0)),
        ({"height_ft": 39.4}, (0.0, 12.0)),
    ],
)
def test_storeys_and_undersides(
    tags: dict[str, Any], expected_m: tuple[float, float], tmp_path: Path
) -> None:
    site = of_map(tmp_path, bare(building="yes", **tags))
    assert heights(site)["features[2]"] == expected_m
    assert not site.ledger.of(Fate.GUESSED)


def test_storeys_of_a_roof_alone_are_no_height_of_a_building(tmp_path: Path) -> None:
    """An office with two storeys in its roof had been 6 m high, without a word."""
    site = of_map(tmp_path, bare(building="office", **{"roof:levels": "2"}))
    assert heights(site)["features[2]"] == (0.0, 12.0)
    assert places(site, Fate.GUESSED, "heights not in the file") == ["features[2]"]


def test_a_height_below_the_underside_is_the_distance_from_it(tmp_path: Path) -> None:
    site = of_map(tmp_path, beside(height="3", min_height="6"))
    assert heights(site)["features[2]"] == (6.0, 9.0)
    assert places(site, Fate.GUESSED, "not above the underside") == ["features[2]"]


def test_a_house_of_a_kilometre_is_named() -> None:
    site = case("g_huge.geojson")
    assert places(site, Fate.GUESSED, "hardly any building has") == ["features[1]"]
    assert "features[1]" in error_of(CASES / "g_huge.geojson", protect=("Court",), strict=True)


@pytest.mark.parametrize(
    ("building", "height", "said"),
    [
        ("house", 29.0, False),
        ("house", 120.0, True),
        ("garage", 31.0, True),
        ("office", 400.0, False),
        ("yes", 599.0, False),
        ("yes", 601.0, True),
    ],
)
def test_heights_that_hardly_any_building_of_a_kind_has(
    building: str, height: float, said: bool, tmp_path: Path
) -> None:
    site = of_map(tmp_path, beside(building=building, height=height))
    assert bool(entries(site, Fate.GUESSED, "hardly any building has")) is said


def test_an_underside_at_the_top_leaves_the_storeys_their_height(tmp_path: Path) -> None:
    found = of_map(tmp_path, beside(height="6", min_height="6"))
    assert heights(found)["features[2]"] == (6.0, 12.0)
    assert places(found, Fate.GUESSED, "not above the underside") == ["features[2]"]


def test_a_building_on_a_terrace_stands_on_its_top(tmp_path: Path) -> None:
    terrace = outline(rectangle(30, 0, 30, 20), height=1.0, carries="yes", name="Terrace")
    hall = outline(rectangle(35, 5, 10, 10), height=6.0, name="Hall")
    raised = outline(rectangle(50, 5, 5, 5), height=7.0, min_height=4.0, name="Canopy")
    found = of_map(tmp_path, terrace, hall, raised)
    assert heights(found)["features[3]"] == (1.0, 7.0)
    assert heights(found)["features[4]"] == (4.0, 7.0)
    assert places(found, Fate.GUESSED, "on terraces without an underside") == ["features[3]"]


def test_a_building_that_reaches_into_a_terrace_keeps_its_ground(tmp_path: Path) -> None:
    terrace = outline(rectangle(30, 0, 30, 20), height=1.0, carries="yes", name="Terrace")
    hall = outline(rectangle(55, 5, 20, 10), height=6.0, name="Hall")
    deck = outline(rectangle(80, 0, 10, 10), height=3.0, min_height=2.5, carries="yes", name="Deck")
    found = of_map(tmp_path, terrace, hall, deck)
    assert heights(found)["features[3]"] == (0.0, 6.0)
    assert heights(found)["features[4]"] == (2.5, 3.0)
    areas = {own.place: own.outline.area for own in found.buildings}
    assert areas["features[2]"] == pytest.approx(550.0, abs=1.0)
    assert places(found, Fate.CUT, "into which buildings reach") == ["features[2]"]
    assert places(found, Fate.GUESSED, "open below, on which nothing") == ["features[4]"]


@pytest.mark.parametrize(("height", "is_podium"), [(4.0, True), (12.0, False), (None, False)])
def test_a_raised_part_that_its_building_fills_is_named_but_for_a_tower_on_a_podium(
    height: float | None, is_podium: bool, tmp_path: Path
) -> None:
    tags = {} if height is None else {"height": height}
    whole = outline(rectangle(30, 0, 20, 10), name="Arcade", **tags)
    key = "building:part"
    raised = {key: "yes", "height": 12.0, "min_height": 4.0}
    part = outline(rectangle(30, 0, 10, 10)) | {"properties": raised}
    other = outline(rectangle(40, 0, 10, 10)) | {"properties": {key: "yes", "height": 9.0}}
    found = of_map(tmp_path, whole, part, other)
    named = places(found, Fate.GUESSED, "raised parts, solid to the ground")
    assert named == ([] if is_podium else ["features[3]"])


@pytest.mark.parametrize(
    ("tags", "count"),
    [
        ({"highway": "busway"}, 2),
        ({"highway": "residential;service"}, 2),
        ({"highway": "footway", "motor_vehicle": "yes"}, 1),
        ({"highway": "pedestrian", "vehicle": "delivery"}, 2),
        ({"highway": "footway", "motor_vehicle": "no"}, 0),
        ({"highway": "cycleway"}, 0),
    ],
)
def test_ways_that_motor_vehicles_may_use_are_places_of_charges(
    tags: dict[str, str], count: int, tmp_path: Path
) -> None:
    street = line([(-10.0, -6.0), (30.0, -6.0)], **tags)
    assert len(segments(of_map(tmp_path, street).scenario)) == count


def test_a_pedestrian_street_without_a_charge_is_named(tmp_path: Path) -> None:
    street = line([(-10.0, -6.0), (30.0, -6.0)], highway="pedestrian")
    found = of_map(tmp_path, street)
    assert places(found, Fate.LEFT_OUT, "pedestrian streets") == ["features[2]"]


def test_car_parks_of_every_form_have_a_charge_or_a_line(tmp_path: Path) -> None:
    point = charge(40.0, -5.0) | {"properties": {"amenity": "parking"}}
    roof = beside(building="roof", amenity="parking")
    found = of_map(tmp_path, point, roof)
    assert places(found, Fate.GUESSED, "without an outline, with a charge") == ["features[2]"]
    assert places(found, Fate.GUESSED, "car parks in or below buildings") == ["features[3]"]
    sources = [own for own in found.scenario.charge if isinstance(own, PointSource)]
    assert len(sources) == 2


def test_a_mass_in_a_text_is_that_mass(tmp_path: Path) -> None:
    for mass, expected_kg in (("50", 50.0), (True, 100.0), ("much", 100.0), (80, 80.0)):
        place = charge(25.0, 5.0)
        place["properties"]["tnt_kg"] = mass
        site = import_site(written(tmp_path, HOUSE, place))
        assert [source.tnt_kg for source in site.scenario.charge] == [expected_kg]
        said = entries(site, Fate.GUESSED, "masses that cannot be read")
        assert bool(said) is (mass in (True, "much"))


# Schemas of GeoJSON.


def test_overture_has_its_own_names_for_buildings_parts_and_roads() -> None:
    site = case("g_overture.geojson")
    assert heights(site) == {"features[0]": (0.0, 12.0), "features[2]": (0.0, 20.0)}
    areas = {building.place: building.outline.area for building in site.buildings}
    assert areas == pytest.approx({"features[0]": 175.0, "features[2]": 25.0}, rel=0.01)
    assert {building.title for building in site.buildings} == {"Court"}
    assert all(building.protected for building in site.buildings)
    assert len({structure.building for structure in site.scenario.structures}) == 1
    assert places(site, Fate.LEFT_OUT, "below the ground") == ["features[1]"]
    assert places(site, Fate.READ, "place of a charge") == ["features[3]"]


def overture(**properties: Any) -> dict[str, Any]:
    return bare(**{"has_parts": False, "is_underground": False, "height": 9.0, **properties})


@pytest.mark.parametrize(
    "properties",
    [
        {"names": {"primary": "Mill"}},
        {"names": json.dumps({"primary": "Mill", "common": None})},
        {"names": {"primary": "Mill"}, "class": "industrial", "level": -1},
    ],
)
def test_names_of_overture_may_be_a_table_or_its_text(
    properties: dict[str, Any], tmp_path: Path
) -> None:
    site = of_map(tmp_path, overture(**properties))
    (mill,) = (building for building in site.buildings if building.place == "features[2]")
    assert (mill.title, mill.base_m, mill.height_m) == ("Mill", 0.0, 9.0)


def test_floors_of_overture(tmp_path: Path) -> None:
    site = of_map(tmp_path, overture(height=None, num_floors=4, min_floor=1, **{"class": "roof"}))
    assert heights(site)["features[2]"] == (3.0, 12.0)


def test_a_part_of_overture_belongs_to_the_building_that_it_names(tmp_path: Path) -> None:
    """The part lies mostly beside its own building, and not in the other."""
    own = overture(id="a", names={"primary": "Own"})
    shape = rectangle(48, 2, 6, 6)
    part = outline(shape) | {
        "properties": {"id": "c", "building_id": "a", "is_underground": False, "height": 15.0}
    }
    site = of_map(tmp_path, own, part)
    assert {building.title for building in site.buildings} == {"House", "Own"}
    groups = {building.place: building.group for building in site.buildings}
    assert groups["features[3]"] == groups["features[2]"] == "features[2]"
    alone = of_map(tmp_path, part)
    assert heights(alone)["features[2]"] == (0.0, 15.0)


@pytest.mark.parametrize(
    ("properties", "is_street"),
    [
        ({"class": "residential"}, True),
        ({"class": "driveway"}, True),
        ({"class": "unknown"}, True),
        ({"class": "primary", "subclass": "link"}, True),
        ({"road": json.dumps({"class": "secondary"})}, True),
        ({"class": "sidewalk"}, False),
        ({"class": "residential", "road_flags": [{"values": ["is_tunnel"]}]}, False),
        ({"class": "residential", "road_flags": [{"values": ["is_under_construction"]}]}, False),
    ],
)
def test_roads_of_overture(properties: dict[str, Any], is_street: bool, tmp_path: Path) -> None:
    road = line([(-20, -6), (60, -6)], subtype="road", **properties)
    site = of_map(tmp_path, road)
    assert bool(places(site, Fate.READ, "place of a charge")[1:]) is is_street


def test_width_of_a_road_of_overture(tmp_path: Path) -> None:
    road = line([(-20, -6), (60, -6)], subtype="road", width_rules=[{"value": 7.0}])
    site = of_map(tmp_path, road | {"properties": {**road["properties"], "class": "trunk"}})
    assert not entries(site, Fate.GUESSED, "widths")


def test_tags_may_be_nested() -> None:
    site = case("g_nested_tags.geojson")
    assert heights(site) == {"features[0]": (0.0, 12.0)}
    assert places(site, Fate.PASSED, "landuse") == ["features[1]"]
    assert places(site, Fate.READ, "place of a charge") == ["features[2]"]


TAGS = {"building": "yes", "height": "12", "name": 'Mill "A"'}


@pytest.mark.parametrize(
    "properties",
    [
        {"tags": TAGS},
        {"tags": json.dumps(TAGS)},
        {"tags": [{"key": key, "value": value} for key, value in TAGS.items()]},
        {"tags": [list(tag) for tag in TAGS.items()]},
        {"building": "yes", "other_tags": r'"height"=>"12","name"=>"Mill \"A\""'},
        {"osm": TAGS},
        {"Tags": TAGS, "height": 3.0},
    ],
)
def test_every_form_of_nested_tags(properties: dict[str, Any], tmp_path: Path) -> None:
    site = of_map(tmp_path, bare(**properties))
    (mill,) = (building for building in site.buildings if building.place == "features[2]")
    assert (mill.height_m, mill.title) == (12.0, 'Mill "A"')


def test_a_value_in_a_table_has_a_dotted_key(tmp_path: Path) -> None:
    site = of_map(tmp_path, bare(building="yes", roof={"top": 7.0}), height_from="roof.top")
    assert heights(site)["features[2]"] == (0.0, 7.0)


# One building, two objects.


def test_of_a_way_and_a_relation_the_one_with_the_courtyard_stands() -> None:
    site = case("g_both_court.geojson")
    (court,) = site.buildings
    assert court.outline.area == pytest.approx(1200.0, rel=0.01)
    assert court.area_m2 == pytest.approx(1200.0, rel=0.04)
    assert places(site, Fate.MERGED, "drawn twice") == ["features[1]"]


def court(folder: Path, relation: dict[str, str], **way: str) -> SiteImport:
    """Import a house, and a court of 20 m x 20 m with a yard of 10 m x 10 m as a relation."""
    extract = town()
    extract.way(10, rectangle(30, 0, 20, 20), **way)
    extract.way(11, rectangle(35, 5, 10, 10))
    extract.relation(5, [(10, "outer"), (11, "inner")], **relation)
    return import_site(extract.write(folder), ImportOptions(protect=("House",)))


@pytest.mark.parametrize(
    ("relation", "way", "height_m", "read"),
    [
        ({"building": "yes", "height": "12"}, {"building": "yes"}, 12.0, "relation 5"),
        ({"building": "yes"}, {"building": "yes", "height": "12"}, 12.0, "relation 5"),
        ({}, {"building": "yes", "height": "12"}, 12.0, "relation 5"),
        ({"building": "yes", "height": "12"}, {}, 12.0, "relation 5"),
    ],
)
def test_a_court_stands_once_whichever_of_its_objects_have_tags(
    relation: dict[str, str], way: dict[str, str], height_m: float, read: str, tmp_path: Path
) -> None:
    site = court(tmp_path, relation, **way)
    found = {building.place: building for building in site.buildings}
    assert found.keys() == {"way 1", read}
    assert found[read].outline.area == pytest.approx(300.0, rel=0.01)
    assert found[read].height_m == height_m
    assert places(site, Fate.MERGED, "drawn twice") == (["way 10"] if way else [])


def test_a_tower_on_a_podium_is_no_double(tmp_path: Path) -> None:
    """A ring of 12 m around a hall of 6 m: the map says so."""
    site = court(tmp_path, {"building": "yes", "height": "12"}, building="yes", height="6")
    areas = {building.place: building.outline.area for building in site.buildings}
    assert areas["relation 5"] == pytest.approx(300.0, rel=0.01)
    assert areas["way 10"] == pytest.approx(100.0, rel=0.01)


def test_the_same_outline_twice_is_one_building_with_the_words_of_both(tmp_path: Path) -> None:
    site = of_map(tmp_path, bare(building="yes"), beside(name="Mill", building="industrial"))
    (mill,) = (building for building in site.buildings if building.place == "features[2]")
    assert (mill.title, mill.height_m) == ("Mill", 9.0)
    assert places(site, Fate.MERGED, "drawn twice") == ["features[3]"]
    assert not site.ledger.of(Fate.GUESSED)


def test_rings_in_several_ways_and_relations_without_a_type(tmp_path: Path) -> None:
    extract = town()
    corners = [extract.node(*place) for place in rectangle(30, 0, 20, 20)]
    extract.way_of(10, corners[:3])
    extract.way_of(11, [*corners[2:], corners[0]])
    extract.way(12, rectangle(35, 5, 10, 10))
    members = [(10, "outer"), (11, "outer"), (12, "inner")]
    extract.relation(5, members, building="yes", height="12")
    extract.way(13, rectangle(60, 0, 9, 9))
    extract.relation(6, [(13, "outer")], type="", building="yes", height="12")
    extract.relation(7, [(13, "inner")], building="yes", height="12")
    site = import_site(extract.write(tmp_path), ImportOptions(protect=("House",)))
    areas = {building.place: building.outline.area for building in site.buildings}
    assert areas["relation 5"] == pytest.approx(300.0, rel=0.01)
    assert places(site, Fate.LEFT_OUT, "no outlines") == ["relation 6"]
    assert places(site, Fate.LEFT_OUT, "without an outer ring") == ["relation 7"]


def test_a_part_beyond_its_building_is_whole(tmp_path: Path) -> None:
    part = outline(rectangle(45, 2, 8, 6)) | {
        "properties": {"building:part": "yes", "height": 15.0}
    }
    site = of_map(tmp_path, beside(name="Mill"), part)
    areas = {building.place: building.outline.area for building in site.buildings}
    assert areas == {"features[0]": 200.0, "features[2]": 170.0, "features[3]": 48.0}


def test_a_tower_on_a_building_of_parts_stands(tmp_path: Path) -> None:
    """It is no part of the building, whose own parts are lower: it had been lost in them."""
    part = {"building": "no", "building:part": "yes"}
    podium = outline(rectangle(30, 0, 20, 10), **part, height=6.0)
    tower = outline(rectangle(34, 2, 6, 6), name="Tower", height=40.0)
    tops = {
        building.place: (building.height_m, building.outline.area)
        for building in of_map(tmp_path, beside(), podium, tower).buildings
    }
    assert tops == {
        "features[0]": (6.0, 200.0),
        "features[3]": (6.0, 200.0 - 36.0),
        "features[4]": (40.0, 36.0),
    }


# Extracts.


def test_positions_in_ways_are_read() -> None:
    site = case("o_outgeom.osm")
    (house,) = site.buildings
    assert house.height_m == 12.0
    assert house.outline.area == pytest.approx(200.0, rel=0.01)
    assert places(site, Fate.READ, "place of a charge") == ["way 11"]


def nd(x: float, y: float, ref: str = "") -> str:
    return f'<nd {ref} lat="{y / DEGREE_M:.9f}" lon="{x / DEGREE_M:.9f}"/>'


@pytest.mark.parametrize("separate", [True, False])
def test_positions_in_members_of_relations_are_read(separate: bool, tmp_path: Path) -> None:
    """As Overpass writes them: with bounds, and without the ways themselves."""
    rings = {10: rectangle(30, 0, 20, 20), 11: rectangle(35, 5, 10, 10)}
    sides = {way: "".join(nd(*place) for place in (*ring, ring[0])) for way, ring in rings.items()}
    bounds = '<bounds minlat="0" minlon="0" maxlat="1" maxlon="1"/>'
    extract = town()
    members = "".join(
        f'<member type="way" ref="{way}" role="{role}">{"" if separate else sides[way]}</member>'
        for way, role in ((10, "outer"), (11, "inner"))
    )
    if separate:
        extract.others += [f'<way id="{way}">{bounds}{side}</way>' for way, side in sides.items()]
    tags = "".join(
        f'<tag k="{key}" v="{value}"/>'
        for key, value in {"type": "multipolygon", "building": "yes", "height": "12"}.items()
    )
    node = '<member type="node" ref="1" role="label" lat="0" lon="0"/>'
    extract.others.append(f'<relation id="5">{bounds}{node}{members}{tags}</relation>')
    extract.others.append('<way id="20"><center lat="0" lon="0"/><tag k="building" v="yes"/></way>')
    site = import_site(extract.write(tmp_path), ImportOptions(protect=("House",)))
    areas = {building.place: building.outline.area for building in site.buildings}
    assert areas["relation 5"] == pytest.approx(300.0, rel=0.01)
    assert places(site, Fate.LEFT_OUT, "fewer than two nodes") == ["way 20"]


def test_a_relation_with_a_cut_member_is_left_out(tmp_path: Path) -> None:
    """A corner outside the extract must not become a slanting wall."""
    extract = town()
    corners = [extract.node(*place) for place in rectangle(30, 0, 20, 20)]
    extract.way_of(10, [*corners[:2], 999, *corners[2:], corners[0]])
    extract.relation(5, [(10, "outer")], building="yes", height="12", name="Mill")
    site = import_site(extract.write(tmp_path), ImportOptions(protect=("House",)))
    assert places(site, Fate.LEFT_OUT, "does not have all ways") == ["relation 5"]


def test_objects_that_are_not_visible_are_not_there(tmp_path: Path) -> None:
    extract = town()
    extract.way(3, rectangle(30, 0, 8, 6), 'visible="false"', building="yes", height="9")
    site = import_site(extract.write(tmp_path), ImportOptions(protect=("House",)))
    assert [building.place for building in site.buildings] == ["way 1"]


# Streets through buildings.


def mouths_m(site: SiteImport) -> list[shapely.Point]:
    """Return the ends of all places of charges."""
    found = [
        shapely.Point(end) for segment in segments(site.scenario) for end in segment.lines_m[0]
    ]
    found += [
        shapely.Point(source.position_m)
        for source in site.scenario.charge
        if isinstance(source, PointSource)
    ]
    return found


def test_a_passage_has_a_line_and_a_place_at_both_mouths() -> None:
    site = case("g_passage.geojson", rotation_deg=0.0)
    (guess,) = entries(site, Fate.GUESSED, "streets through buildings")
    assert (guess.place, guess.name, guess.detail) == ("features[1]", "Arch", "through Court")
    assert places(site, Fate.READ, "place of a charge") == ["features[1]", "features[2]"]
    left, bottom, right, top = site.buildings[0].outline.bounds
    middle_m = 0.5 * (left + right)
    for y in (bottom, top):
        gaps = [place.distance(shapely.Point(middle_m, y)) for place in mouths_m(site)]
        assert 0.0 < min(gaps) < 1.0


@pytest.mark.parametrize("tags", [{"tunnel": "building_passage"}, {"covered": "yes"}, {}])
@pytest.mark.parametrize("beyond_m", [0.0, 30.0])
def test_a_passage_may_end_where_the_building_does(
    tags: dict[str, str], beyond_m: float, tmp_path: Path
) -> None:
    way = line([(10, -beyond_m), (10, 10 + beyond_m)], highway="service", width="2", **tags)
    site = of_map(tmp_path, way, margin_m=40.0, rotation_deg=0.0)
    (house,) = site.buildings
    left, bottom, _, top = house.outline.bounds
    for y in (bottom, top):
        gaps = [place.distance(shapely.Point(left + 10.0, y)) for place in mouths_m(site)]
        assert 0.0 < min(gaps) < 1.0
    assert all(
        place.distance(house.outline) >= site.scenario.charge_radius_m for place in mouths_m(site)
    )


def test_a_drive_into_a_building_has_one_mouth(tmp_path: Path) -> None:
    drive = line([(10, 5), (10, 0)], highway="service", width="2", tunnel="building_passage")
    site = of_map(tmp_path, drive, rotation_deg=0.0)
    (mouth,) = (source for source in site.scenario.charge[1:] if isinstance(source, PointSource))
    _, bottom, _, _ = site.buildings[0].outline.bounds
    assert bottom - 1.0 < mouth.position_m[1] < bottom


def test_streets_in_tunnels_and_beside_buildings_are_no_passages(tmp_path: Path) -> None:
    tunnel = line([(10, -30), (10, 40)], highway="service", tunnel="yes")
    along = line([(-10, 0.2), (0.5, 0.2), (0.5, -9)], highway="service", width="2")
    site = of_map(tmp_path, tunnel, along)
    assert places(site, Fate.PASSED, "highway") == ["features[2]"]
    assert not entries(site, Fate.GUESSED, "streets through")


def test_a_street_below_a_raised_building_is_named(tmp_path: Path) -> None:
    way = line([(40, -20), (40, 30)], highway="service", width="2")
    site = of_map(tmp_path, beside(min_height=5.0), way)
    assert places(site, Fate.GUESSED, "below raised buildings") == ["features[3]"]


# Formats that are not read.


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.gml", "convert it: ogr2ogr -f GeoJSON map.geojson a.gml"),
        ("my town.tab", "convert it: ogr2ogr -f GeoJSON map.geojson 'my town.tab'"),
        ("a.KMZ", "ogr2ogr -f GeoJSON"),
        ("a.sqlite", "ogr2ogr -f GeoJSON"),
        ("a.geojsonl", "ogr2ogr -f GeoJSON"),
        ("a.dwg", "save it as DXF"),
        ("a.rvt", "export it as IFC"),
        ("a.ifczip", "unpack it"),
        ("a.o5m", "osmium cat -o map.osm.pbf a.o5m"),
        ("a.png", "trace the buildings"),
    ],
)
def test_formats_that_are_not_read_name_the_way(name: str, words: str, tmp_path: Path) -> None:
    message = error_of(tmp_path / name)
    assert "must be one of .geojson, .json, .cityjson" in message
    assert words in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"type": "Topology", "objects": {}}', "it is TopoJSON; convert it: ogr2ogr -f GeoJSON"),
        ('{"version": 0.6, "elements": []}', "it is JSON of Overpass; ask Overpass for [out:xml]"),
        ('{"geometryType": "esriGeometryPolygon", "features": []}', "it is JSON of ArcGIS"),
        ('{"type": "Feature"}\n{"type": "Feature"}', "convert it with ogr2ogr -f GeoJSON"),
    ],
)
def test_json_of_other_kinds_names_the_way(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "map.json"
    path.write_text(text)
    assert words in error_of(path)


def test_drawings_have_their_own_unit_of_heights() -> None:
    path = CASES.parents[3] / "docs" / "data" / "market_street.dxf"
    assert "--height-unit is not for a drawing" in error_of(path, height_unit="ft")


def test_ids_of_overpass_are_those_of_the_extract(tmp_path: Path) -> None:
    """Nodes without an id, as in a relation's ways, close a ring by their places."""
    extract = Extract()
    ring = rectangle(0, 0, 20, 10)
    sides = "".join(nd(*place) for place in (*ring, ring[0]))
    tags = '<tag k="building" v="yes"/><tag k="name" v="House"/><tag k="height" v="6"/>'
    extract.others.append(f'<way id="1">{sides}{tags}</way>')
    extract.street()
    site = import_site(extract.write(tmp_path), ImportOptions(protect=("House",)))
    assert site.buildings[0].outline.area == pytest.approx(200.0, rel=0.01)
