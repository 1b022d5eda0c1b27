"""Any attribute of a map is read, or refused with the name of the file: never a traceback."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.io.importing import ImportOptions, import_site
from blast_env.site import load_scenario, save_scenario
from tests.io.importing.maps import charge, outline, rectangle

HOUSE = outline(rectangle(0, 0, 12, 8), name="House", height=6.0, protected=True)
PLACE = charge(-5.0, 2.0)
KEYS = st.sampled_from(
    (
        *("building", "building:part", "kind", "layer", "height", "min_height", "heightroof"),
        *("building:levels", "roof:levels", "roof:height", "num_floors", "building:min_level"),
        *("name", "names", "title", "id", "building_id", "type", "class", "subtype", "tags"),
        *("other_tags", "has_parts", "is_underground", "road_flags", "width_rules", "feature_code"),
        *("highway", "tunnel", "width", "lanes", "amenity", "parking", "location", "man_made"),
        *(
            "diameter",
            "carries",
            "protected",
            "tnt_kg",
            "barrier",
            "text",
            "facade:storeys",
            "wall",
        ),
    )
)
WORDS = st.sampled_from(
    (
        *("yes", "no", "roof", "house", "structure", "protected_structure", "terrace", "site"),
        *("keep_out", "build_zone", "charge_place", "residential", "service", "building_passage"),
        *("storage_tank", "parking", "wall", "road", "12", "12'", "-3", "1e308", "9" * 400, "0"),
        *('"height"=>"12"', '{"building": "yes"}', "[1, 2]", "[" * 300, "nan", "\x00", "\ud800"),
    )
)
PLAIN = st.one_of(WORDS, st.text(max_size=8), st.integers(), st.floats(), st.booleans(), st.none())
NUMBERS = st.sampled_from((0, -1, 1e308, 1e-320, 10**400, float("nan"), float("inf"), 1e9, 2.5))
VALUES = st.recursive(
    st.one_of(PLAIN, NUMBERS),
    lambda values: st.one_of(
        st.lists(values, max_size=3),
        st.dictionaries(st.one_of(KEYS, st.sampled_from(("value", "values", "key"))), values),
    ),
    max_leaves=6,
)
PROPERTIES = st.one_of(
    st.dictionaries(KEYS, st.one_of(PLAIN, NUMBERS), max_size=6),
    st.dictionaries(st.one_of(KEYS, st.text(max_size=4)), VALUES, max_size=6),
    VALUES,
)
RING = [[20.0, 0.0], [30.0, 0.0], [30.0, 8.0], [20.0, 8.0], [20.0, 0.0]]
GEOMETRIES = st.sampled_from(
    (
        {"type": "Polygon", "coordinates": [RING]},
        {"type": "MultiPolygon", "coordinates": [[RING]]},
        {"type": "LineString", "coordinates": RING[:3]},
        {"type": "LineString", "coordinates": RING},
        {"type": "MultiLineString", "coordinates": [RING[:2], RING[1:3]]},
        {"type": "Point", "coordinates": RING[0]},
        {"type": "MultiPoint", "coordinates": RING[:2]},
        {"type": "LineString", "coordinates": [[-20.0, 4.0], [40.0, 4.0]]},
        {
            "type": "GeometryCollection",
            "geometries": [
                {"type": "Polygon", "coordinates": [RING]},
                {"type": "Point", "coordinates": RING[0]},
            ],
        },
        None,
    )
)
OPTIONS = st.sampled_from(
    (
        ImportOptions(protect=("House",)),
        ImportOptions(protect=("House",), height_from="height", repair=True),
        ImportOptions(protect=("House",), zone_around_m=4.0, low_heights=True),
        ImportOptions(protect=("House",), height_unit="ft", margin_m=30.0),
    )
)


def check(path: Path, options: ImportOptions) -> None:
    """Import a file and write what it gives, or hold the refusal to be one of the package."""
    with suppress(BlastEnvError):
        site = import_site(path, options)
        saved = path.with_suffix(".toml")
        save_scenario(site.scenario, saved)
        site.ledger.save(path.with_suffix(".ledger.json"))
        site.ledger.save(path.with_suffix(".txt"))
        assert load_scenario(saved).content_hash == site.scenario.content_hash


@given(st.lists(st.tuples(GEOMETRIES, PROPERTIES), min_size=1, max_size=3), OPTIONS)
def test_any_property_of_geojson(
    tmp_path_factory: pytest.TempPathFactory,
    drawn: list[tuple[dict[str, Any] | None, Any]],
    options: ImportOptions,
) -> None:
    features = [
        {"type": "Feature", "properties": properties, "geometry": geometry}
        for geometry, properties in drawn
    ]
    collection = {
        "type": "FeatureCollection",
        "coordinate_system": "local site metres",
        "features": [HOUSE, PLACE, *features],
    }
    path = tmp_path_factory.mktemp("maps") / "map.geojson"
    path.write_text(json.dumps(collection))
    check(path, options)


@given(VALUES, VALUES, VALUES, OPTIONS)
def test_any_member_of_geojson(
    tmp_path_factory: pytest.TempPathFactory,
    crs: Any,
    identifier: Any,
    system: Any,
    options: ImportOptions,
) -> None:
    house = HOUSE | {"id": identifier}
    collection = {
        "type": "FeatureCollection",
        "crs": crs,
        "coordinate_system": system,
        "features": [house, PLACE],
    }
    path = tmp_path_factory.mktemp("maps") / "map.geojson"
    path.write_text(json.dumps(collection))
    check(path, options)


XML_WORDS = st.one_of(
    st.sampled_from(
        ("", "0", "-1", "1", "10", "11", "999", "9" * 30, "x", "nan", "1e400", "false")
    ),
    st.sampled_from(("way", "node", "outer", "inner", "delete", "modify", "90.1", "-0.0001")),
    st.text("abc0.-é<&'", max_size=6),
)
ATTRIBUTES = st.dictionaries(
    st.sampled_from(
        ("id", "ref", "lat", "lon", "version", "visible", "action", "role", "type", "k", "v")
    ),
    XML_WORDS,
    max_size=4,
)
TAGS = st.dictionaries(
    KEYS, st.one_of(WORDS.filter(lambda word: word.isprintable()), st.text("0.,'m ft", max_size=6))
)


def element(kind: str, attributes: Mapping[str, str], content: str = "") -> str:
    words = " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items())
    return f"<{kind} {words}>{content}</{kind}>"


@given(
    st.lists(st.tuples(st.sampled_from(("node", "way", "relation")), ATTRIBUTES, TAGS), max_size=3),
    st.lists(st.tuples(st.sampled_from(("nd", "member", "tag", "center")), ATTRIBUTES), max_size=4),
    OPTIONS,
)
@example([("relation", {}, {})], [("member", {"type": "way"})], ImportOptions(protect=("House",)))
def test_any_attribute_of_an_extract(
    tmp_path_factory: pytest.TempPathFactory,
    objects: list[tuple[str, dict[str, str], dict[str, str]]],
    inside: list[tuple[str, dict[str, str]]],
    options: ImportOptions,
) -> None:
    corners = [(0.0, 0.0), (1e-4, 0.0), (1e-4, 1e-4), (0.0, 1e-4)]
    nodes = "".join(
        element("node", {"id": f"{k}", "lat": f"{y:.7f}", "lon": f"{x:.7f}"})
        for k, (x, y) in enumerate(corners, start=1)
    )
    sides = "".join(element("nd", {"ref": f"{k}"}) for k in (1, 2, 3, 4, 1))
    tags = {"building": "yes", "name": "House", "height": "6"}
    house = element("way", {"id": "1"}, sides + _tags(tags))
    place = element(
        "node", {"id": "9", "lat": "0.0002", "lon": "0"}, _tags({"kind": "charge_place"})
    )
    within = "".join(element(kind, attributes) for kind, attributes in inside)
    others = "".join(
        element(
            kind,
            {"id": f"{20 + k}"} | attributes,
            (within if kind == "relation" else sides if kind == "way" else "") + _tags(more),
        )
        for k, (kind, attributes, more) in enumerate(objects)
    )
    path = tmp_path_factory.mktemp("maps") / "map.osm"
    text = f'<osm version="0.6">{nodes}{house}{place}{others}</osm>'
    path.write_text(text, encoding="utf-8")
    check(path, options)


def _tags(tags: Mapping[str, str]) -> str:
    return "".join(element("tag", {"k": key, "v": value}) for key, value in tags.items())
