"""City models in CityJSON: heights of surfaces, ground, parts, levels of detail, coordinates."""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from blast_env.errors import BlastEnvError
from blast_env.io.importing import FATES, Fate, ImportOptions, SiteImport, import_site
from tests.io.importing.cities import ORIGIN, City, Face, block, box, gable
from tests.io.importing.found import boxes
from tests.io.importing.maps import BLOCK

X, Y = ORIGIN
AT: dict[str, Any] = {"charge_at": ((X - 6.0, Y + 3.0),), "protect_near": ORIGIN}
LOW_M = -1.9
"""Ground below the sea, as in a polder."""


def imported(path: Path, **options: Any) -> SiteImport:
    return import_site(path, ImportOptions(**AT | options))


def town(faces: list[Face], kind: str = "Solid", **how: Any) -> City:
    city = City()
    city.add("hall", "Building", city.geometry(kind, faces, **how), attributes={"name": "Hall"})
    return city


def message(path: Path, **options: Any) -> str:
    with pytest.raises(BlastEnvError) as caught:
        imported(path, **options)
    return str(caught.value)


# Geometry.


@pytest.mark.parametrize(
    "kind", ["MultiSurface", "CompositeSurface", "Solid", "MultiSolid", "CompositeSolid"]
)
@pytest.mark.parametrize("version", ["1.1", "2.0"])
def test_each_geometry_gives_the_area_and_height_of_its_surfaces(
    kind: str, version: str, tmp_path: Path
) -> None:
    city = town(gable(0, 0, 12, 8, LOW_M, LOW_M + 6, LOW_M + 10), kind)
    city.document["version"] = version
    site = imported(city.write(tmp_path), protect=("Hall",), protect_near=None)
    assert boxes(site) == [(96.0, 0.0, 10.0)]
    assert site.ledger.lines((Fate.GUESSED, Fate.LEFT_OUT)) == ()
    assert any("eaves 4.0 m lower" in line for line in site.ledger.lines((Fate.NOTED,)))


def test_the_buildings_of_a_map_are_the_same_as_blocks_of_a_model(tmp_path: Path) -> None:
    """The areas and heights of the block of a town, read independently by shapely."""
    features = json.loads(BLOCK.read_text(encoding="utf-8"))["features"]
    to_plane = Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
    houses = [
        (shapely.Polygon([to_plane.transform(*place) for place in rings[0]]), float(tags["height"]))
        for feature in features
        if (tags := feature["properties"]).get("building") and "height" in tags
        for rings in (feature["geometry"]["coordinates"],)
    ]
    around = shapely.total_bounds([plan for plan, _ in houses])
    origin = (round(around[[0, 2]].mean()), round(around[[1, 3]].mean()))
    city = City(origin=origin, system="http://www.opengis.net/def/crs/EPSG/0/25832")
    for number, (plan, height_m) in enumerate(houses):
        corners = [(x - origin[0], y - origin[1]) for x, y in plan.exterior.coords[:-1]]
        if not plan.exterior.is_ccw:
            corners.reverse()
        faces = block(corners, 31.0, 31.0 + height_m)
        city.add(f"house_{number}", "Building", city.geometry("Solid", faces, "1.2"))
    options = {
        "charge_at": ((around[0] - 8.0, around[1] - 8.0),),
        "margin_m": 30.0,
        "least_area_m2": 1.0,
    }
    site = imported(city.write(tmp_path), protect_near=origin, **options)
    expected = sorted((round(plan.area, 1), height_m) for plan, height_m in houses)
    found = sorted((area, float(top or 0.0)) for area, _, top in boxes(site))
    assert np.allclose(found, expected, rtol=2e-3, atol=0.26)  # modules are 0.5 m high


def test_a_courtyard_is_a_hole_of_roof_and_ground(tmp_path: Path) -> None:
    outer, yard = box(0, 0, 20, 20, 0, 9), box(5, 5, 10, 10, 0, 9)
    city = City()
    surfaces = [[city.ring(outer[k][1]), city.ring(yard[k][1][::-1])] for k in (0, 1)] + [
        [city.ring(face)] for _, face in outer[2:]
    ]
    surfaces += [[city.ring(face[::-1])] for _, face in yard[2:]]
    geometry = {"type": "Solid", "lod": "2.2", "boundaries": [surfaces]}
    city.add("ring", "Building", geometry)
    site = imported(city.write(tmp_path), protect_near=(X + 1.0, Y + 1.0))
    assert boxes(site) == [(300.0, 0.0, 9.0)]


def test_a_template_stands_where_its_instance_has_it(tmp_path: Path) -> None:
    city = City()
    faces = box(0, 0, 4, 3, 0, 2)
    template = city.geometry("Solid", faces)
    city.document["geometry-templates"] = {
        "templates": [template],
        "vertices-templates": [[x / 1000.0 for x in v] for v in city.document["vertices"]],
    }
    city.document["vertices"] = [[10_000, 2_000, 7_000]]
    quarter_turn_of_twice_the_size = [0, -2, 0, 1, 2, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 1]
    instance = {
        "type": "GeometryInstance",
        "template": 0,
        "boundaries": [0],
        "transformationMatrix": quarter_turn_of_twice_the_size,
    }
    city.add("shed", "Building", instance)
    site = imported(city.write(tmp_path), margin_m=20.0)
    assert boxes(site) == [(48.0, 0.0, 6.0)]
    corners = shapely.box(*shapely.total_bounds([b.outline for b in site.buildings]))
    left, bottom = site.site.to_site(np.array([(X + 10 + 1 - 6, Y + 2)]))[0]
    assert corners.buffer(0.01).covers(shapely.Point(left, bottom))


# Ground.


@pytest.mark.parametrize("low_m", [-6.5, -1.9, 0.0, 2.0, 410.0])
@pytest.mark.parametrize("is_known", [True, False])
def test_heights_count_from_the_ground_of_the_model_not_from_the_sea(
    low_m: float, is_known: bool, tmp_path: Path
) -> None:
    city = town(box(0, 0, 12, 8, low_m, low_m + 7.0), is_known=is_known)
    faces = box(20, 0, 10, 8, low_m + 1.0, low_m + 5.0)  # on a slope
    city.add("barn", "Building", city.geometry("Solid", faces, is_known=is_known))
    site = imported(city.write(tmp_path))
    assert boxes(site) == [(96.0, 0.0, 7.0), (80.0, 0.0, 4.0)]
    kinds = {entry.kind for entry in site.ledger.of(Fate.GUESSED)}
    assert kinds == (set() if is_known else {"ground under buildings, not at the zero of the file"})


def test_a_tower_on_a_podium_and_a_bridge_between_houses(tmp_path: Path) -> None:
    """What stands on a part begins there, and what two houses carry stays in the air."""
    city = City()
    city.add("whole", "Building", children=["podium", "tower"])
    for key, faces in (
        ("podium", box(0, 0, 20, 20, 3, 9)),
        (
            "tower",
            [
                ("OuterFloorSurface", f) if n == 0 else (s, f)
                for n, (s, f) in enumerate(box(5, 5, 10, 10, 9, 30))
            ],
        ),
    ):
        city.add(key, "BuildingPart", city.geometry("Solid", faces), parents=["whole"])
    city.add("house", "Building", city.geometry("Solid", box(26, 0, 8, 20, 3, 15)))
    walk = city.geometry("Solid", box(20, 8, 6, 4, 7.5, 10.5), is_known=False)
    city.add("walk", "Building", walk)
    site = imported(city.write(tmp_path))
    by_place: dict[str, list[tuple[float, float]]] = {}
    for building in site.buildings:
        by_place.setdefault(building.place, []).append((building.base_m, building.height_m or 0.0))
    assert by_place["Building walk"] == [(4.5, 7.5)]
    assert max(top for _, top in by_place["BuildingPart tower"]) == 27.0
    assert min(base for base, _ in by_place["BuildingPart tower"]) == 0.0
    assert by_place["BuildingPart podium"][0] == (0.0, 6.0)
    tower = [b for b in site.buildings if b.place.startswith("BuildingPart")]
    assert len({b.group for b in tower}) == 1
    (entry,) = [e for e in site.ledger.of(Fate.MERGED) if e.place == "Building whole"]
    assert entry.kind == "buildings, read by their parts"


def test_a_passage_without_walls_is_open_below(tmp_path: Path) -> None:
    faces: list[Face] = [
        *box(0, 0, 8, 10, 0, 12),
        *box(14, 0, 8, 10, 0, 12),
        *[("OuterCeilingSurface", face) for _, face in box(8, 0, 6, 10, 4, 12)],
    ]
    site = imported(town(faces, "MultiSurface").write(tmp_path))
    assert boxes(site) == [(160.0, 0.0, 12.0), (60.0, 4.0, 12.0)]


# Levels of detail and parts.


def test_the_highest_level_below_three_is_read(tmp_path: Path) -> None:
    city = City()
    levels = {
        "0": [box(0, 0, 12, 8, 0, 0)[1]],
        "1.2": box(0, 0, 12, 8, 0, 9),
        "2.2": box(0, 0, 12, 8, 0, 8),
        "3": box(0, 0, 12, 8, 0, 5),
    }
    for number in range(1, 5):
        chosen = [*levels.items()][:number]
        geometries = [city.geometry("MultiSurface", faces, lod) for lod, faces in chosen]
        city.add("hall", "Building", *geometries, attributes={"measuredHeight": 6.0})
        site = imported(city.write(tmp_path))
        assert boxes(site)[0][2] == (6.0, 9.0, 8.0, 8.0)[number - 1]
    city.add("hall", "Building", city.geometry("MultiSurface", levels["3"], "3.1"))
    site = imported(city.write(tmp_path))
    assert boxes(site)[0][2] == 5.0
    assert any("in no facade" in entry.kind for entry in site.ledger.of(Fate.NOTED))


def test_a_footprint_without_a_height_is_a_guess(tmp_path: Path) -> None:
    site = imported(town([box(0, 0, 12, 8, 4, 4)[1]], "MultiSurface", lod="0").write(tmp_path))
    assert any("heights not in the file" in entry.kind for entry in site.ledger.of(Fate.GUESSED))


def test_a_coarse_body_of_a_building_with_fine_parts_is_not_built_twice(tmp_path: Path) -> None:
    city = City()
    coarse = city.geometry("Solid", box(0, 0, 12, 8, 0, 20), "1")
    city.add("hall", "Building", coarse, children=["a"], attributes={"name": "Hall"})
    fine = city.geometry("Solid", box(0, 0, 12, 8, 0, 7), "2")
    city.add("a", "BuildingPart", fine, parents=["hall"])
    site = imported(city.write(tmp_path), protect=("Hall",), protect_near=None)
    assert boxes(site) == [(96.0, 0.0, 7.0)]


def test_every_object_has_one_fate(tmp_path: Path) -> None:
    city = town(box(0, 0, 12, 8, 0, 7))
    balcony = city.geometry("MultiSurface", box(12, 2, 1, 2, 3, 3.2))
    city.add("balcony", "BuildingInstallation", balcony, parents=["hall"])
    city.add(
        "room", "BuildingRoom", city.geometry("Solid", box(1, 1, 3, 3, 0, 3)), parents=["hall"]
    )
    street = [("TrafficArea", box(-20, -12, 50, 6, 0, 0)[1][1])]
    city.add("street", "Road", city.geometry("MultiSurface", street))
    city.add("lawn", "PlantCover", city.geometry("MultiSurface", [box(0, 12, 9, 9, 0, 0)[1]]))
    city.add("deck", "Bridge", city.geometry("MultiSurface", box(0, 24, 20, 4, 4, 5)))
    city.add("noise", "+NoiseWall", city.geometry("MultiSurface", box(0, 30, 20, 1, 0, 3)))
    city.add("gone", "Building", attributes={"conditionOfConstruction": "demolished"})
    city.add("way", "Road", children=["street"])
    site = imported(city.write(tmp_path), charge_at=())
    fates = {entry.place: (entry.fate, entry.kind) for entry in site.ledger.of(*FATES)}
    assert {place: fate for place, (fate, _) in fates.items()} == {
        "Building hall": Fate.READ,
        "BuildingInstallation balcony": Fate.MERGED,
        "BuildingRoom room": Fate.PASSED,
        "Road street": Fate.READ,
        "PlantCover lawn": Fate.PASSED,
        "Bridge deck": Fate.LEFT_OUT,
        "'+NoiseWall' noise": Fate.PASSED,
        "Building gone": Fate.LEFT_OUT,
        "Road way": Fate.PASSED,
    }
    assert fates["Road street"][1] == "place of a charge"
    assert site.ledger.objects == len(city.document["CityObjects"])
    wall = imported(city.write(tmp_path), charge_at=(), buildings_from=("cityjson=Bridge",))
    assert boxes(wall) == [(80.0, 0.0, 1.0)]


def test_what_is_far_from_the_site_asked_for_is_outside(tmp_path: Path) -> None:
    city = town(box(0, 0, 12, 8, 0, 7))
    city.add("whole", "Building", children=["part"])
    far = city.geometry("Solid", box(900, 0, 12, 8, 0, 7))
    city.add("part", "BuildingPart", far, parents=["whole"])
    site = imported(city.write(tmp_path), centre=(X + 5.0, Y + 5.0), size_m=(40.0, 40.0))
    fates = {entry.place: entry.kind for entry in site.ledger.of(Fate.PASSED)}
    assert fates == dict.fromkeys(("Building whole", "BuildingPart part"), "outside the site")
    assert site.ledger.lines((Fate.GUESSED, Fate.LEFT_OUT)) == ()


# Coordinates.


def in_system(
    name: str, to_source: Callable[[float, float], tuple[float, float]], unit: float, folder: Path
) -> Path:
    """Write a house of 12 x 8 m with corners in another system."""
    city = City(origin=(0.0, 0.0), system=name, unit=unit)
    faces = [
        (kind, [(*to_source(x, y), z) for x, y, z in corners])
        for kind, corners in box(0, 0, 12, 8, 5, 12)
    ]
    city.add("hall", "Building", city.geometry("Solid", faces))
    return city.write(folder)


@pytest.mark.parametrize("is_swapped", [False, True])
@pytest.mark.parametrize("code", ["4979", "4326", "2180"])
def test_axes_may_be_in_either_order(code: str, is_swapped: bool, tmp_path: Path) -> None:
    """Writers differ in systems that list northing first; a mirrored body tells which it is."""
    longitude, latitude = 19.03, 50.02
    to_metres = Transformer.from_crs("EPSG:4326", "EPSG:2180", always_xy=True)
    x0, y0 = to_metres.transform(longitude, latitude)
    back = Transformer.from_crs("EPSG:2180", f"EPSG:{code}", always_xy=True)

    def to_source(x: float, y: float) -> tuple[float, float]:
        east, north = back.transform(x0 + x, y0 + y)[:2]
        return (north, east) if is_swapped else (east, north)

    name = f"https://www.opengis.net/def/crs/EPSG/0/{code}"
    path = in_system(name, to_source, 1e-3 if code == "2180" else 1e-9, tmp_path)
    place = back.transform(x0 - 6.0, y0 + 3.0)[:2]
    site = imported(path, charge_at=(place,), protect_near=place)
    ((area_m2, *heights_m),) = boxes(site)
    assert area_m2 == pytest.approx(96.0, rel=2e-3)  # the plane of the map is a little smaller
    assert heights_m == [0.0, 7.0]
    words = "northing or latitude" if is_swapped else "easting or longitude"
    (entry,) = [entry for entry in site.ledger.of(Fate.NOTED) if "axes" in entry.kind]
    assert words in entry.detail


def test_feet_of_a_reference_system_are_those_of_heights(tmp_path: Path) -> None:
    """EPSG:6360 has heights in feet of the United States."""
    foot_m = 1200.0 / 3937.0
    city = City(origin=(1_000_000.0, 200_000.0), system=None)
    faces = [
        (kind, [(x / foot_m, y / foot_m, z / foot_m) for x, y, z in corners])
        for kind, corners in box(0, 0, 12, 8, 5, 12)
    ]
    city.add("hall", "Building", city.geometry("Solid", faces))
    place = (1_000_000.0 - 20.0, 200_000.0 + 10.0)
    path, at = city.write(tmp_path), {"charge_at": (place,), "protect_near": place}
    assert boxes(imported(path, crs="EPSG:2263+6360", **at)) == [(96.0, 0.0, 7.0)]
    site = imported(path, crs="EPSG:2263", **at)
    assert boxes(site) == [(96.0, 0.0, 7.0)]
    assert "heights in feet" in site.ledger.lines((Fate.GUESSED,))[0]
    assert "--height-unit is not for a model in EPSG:2263+6360" in message(
        path, crs="EPSG:2263+6360", height_unit="m", **at
    )


def test_reference_systems_that_do_not_serve(tmp_path: Path) -> None:
    city = town(box(0, 0, 12, 8, 0, 7))
    del city.document["metadata"]
    path = city.write(tmp_path)
    assert "metadata has no referenceSystem: say --crs" in message(path)
    assert boxes(imported(path, crs="local")) == [(96.0, 0.0, 7.0)]
    assert boxes(imported(path, crs="EPSG:28992")) == [(96.0, 0.0, 7.0)]
    assert "must be geographic or projected" in message(path, crs="EPSG:4978")
    assert "--units is not for CityJSON" in message(path, units="m")


def test_a_text_sequence_of_features_is_the_model(tmp_path: Path) -> None:
    one, two = town(box(0, 0, 12, 8, 0, 7)), City()
    two.add("barn", "Building", two.geometry("Solid", box(20, 0, 10, 8, 0, 4)))
    head = {**one.document, "CityObjects": {}, "vertices": []}
    features = [
        {"type": "CityJSONFeature", "id": key, **{k: city.document[k] for k in parts}}
        for key, city in (("hall", one), ("barn", two))
        for parts in (("CityObjects", "vertices"),)
    ]
    path = tmp_path / "town.city.jsonl"
    path.write_text("\n".join(json.dumps(line) for line in (head, *features)) + "\n")
    assert boxes(imported(path)) == [(96.0, 0.0, 7.0), (80.0, 0.0, 4.0)]
    path.write_text(json.dumps(features[0]))
    assert "line 1: type is 'CityJSONFeature', must be 'CityJSON'" in message(path)
    path.write_text(json.dumps(head) + "\n" + "{")
    assert "line 2 is not JSON" in message(path)


# Wrong files.


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": "1.0"}, "version is '1.0', must be one of 1.1, 2.0; convert it: cjio"),
        ({"version": None}, "version is nothing, must be one of 1.1, 2.0"),
        ({"transform": None}, "transform.scale is missing or not of three numbers"),
        ({"vertices": [[1, 2]]}, "vertices is missing or no array of arrays of three numbers"),
        ({"vertices": [[1, 2, "3"]]}, "vertices is missing or no array of arrays"),
        ({"vertices": []}, "boundaries has the vertex 3, must be 0 to -1"),
        ({"CityObjects": []}, "CityObjects is missing or no object"),
        ({"CityObjects": {}}, "has no object with a geometry"),
        ({"CityObjects": {"a b": 4}}, "CityObjects.'a b': is no object with a type"),
        ({"CityObjects": {"a": {"type": "Building", "geometry": 3}}}, "a: geometry is int, must"),
    ],
)
def test_a_model_that_is_none(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    city = town(gable(0, 0, 12, 8, 0, 6, 10))
    city.document |= changes
    assert words in message(city.write(tmp_path))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"type": "Sphere"}, "geometry[0]: type is 'Sphere', must be one of MultiSurface"),
        ({"lod": "high"}, "lod is 'high', must be '0' to '4'"),
        ({"boundaries": None}, "boundaries is missing or no array"),
        ({"boundaries": [[0, 1, 2]]}, "boundaries has 0 instead of an array"),
        ({"boundaries": [[[[0, 1, 99]]]]}, "boundaries has the vertex 99, must be 0 to 33"),
        ({"boundaries": [[[[0, 1, -1]]]]}, "boundaries has the vertex -1, must be 0 to"),
        ({"boundaries": [[[[0, 1, 0.5]]]]}, "no array of whole numbers where one must be"),
        ({"type": "GeometryInstance", "template": 2}, "template is 2, but the file has 0"),
    ],
)
def test_a_geometry_that_is_none(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    city = town(gable(0, 0, 12, 8, 0, 6, 10))
    city.document["CityObjects"]["hall"]["geometry"][0] |= changes
    assert words in message(city.write(tmp_path))


PLACES = (
    ("version",), ("transform",), ("transform", "scale"), ("transform", "scale", 0), ("vertices",),
    ("vertices", 3), ("vertices", 3, 2), ("CityObjects",), ("CityObjects", "a"),
    ("CityObjects", "a", "type"), ("CityObjects", "a", "parents"), ("CityObjects", "a", "geometry"),
    ("CityObjects", "a", "geometry", 0), ("CityObjects", "a", "geometry", 0, "lod"),
    ("CityObjects", "a", "geometry", 0, "type"), ("CityObjects", "a", "geometry", 0, "boundaries"),
    ("CityObjects", "a", "geometry", 0, "boundaries", 0),
    ("CityObjects", "a", "geometry", 0, "boundaries", 0, 1),
    ("CityObjects", "a", "geometry", 0, "boundaries", 0, 1, 0),
    ("CityObjects", "a", "geometry", 0, "semantics"),
    ("CityObjects", "a", "geometry", 0, "semantics", "values"),
    ("CityObjects", "a", "geometry", 0, "semantics", "values", 0),
    ("CityObjects", "a", "geometry", 0, "semantics", "surfaces"), ("metadata", "referenceSystem"),
    ("CityObjects", "a", "attributes"), ("CityObjects", "hall", "parents"),
)  # fmt: skip
VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 40), st.just(10**30), st.floats(),
    st.text(max_size=3),
    st.lists(st.one_of(st.integers(-1, 9), st.lists(st.integers(0, 40), max_size=5)), max_size=5),
    st.sampled_from((["a"], ["hall"], [[[0, 1, 2]]], [[[[0, 1, 2, 3]]]], {}, "Road", "MultiPoint")),
)  # fmt: skip


@given(st.lists(st.tuples(st.sampled_from(PLACES), VALUES), min_size=1, max_size=3))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_any_value_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[tuple[Any, ...], Any]]
) -> None:
    city = City()
    city.add("hall", "Building", children=["a"])
    geometry = city.geometry("Solid", gable(0, 0, 12, 8, 1, 6, 10))
    city.add("a", "BuildingPart", geometry, parents=["hall"], attributes={"name": "A"})
    city.add("b", "Building", city.geometry("Solid", box(20, 0, 9, 9, 0, 6)))
    for place, value in changes:
        with suppress(TypeError, KeyError, IndexError):
            item: Any = city.document
            for step in place[:-1]:
                item = item[step]
            item[place[-1]] = value
    path = city.write(tmp_path_factory.mktemp("any"))
    with suppress(BlastEnvError):
        imported(path)
