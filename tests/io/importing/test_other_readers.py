"""Area, height and base of random buildings against shapely, pyproj and osmium used directly."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import osmium
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer
from shapely.affinity import rotate, translate
from shapely.geometry.base import BaseGeometry

from blast_env.io.importing import ImportedSite, ImportOptions, import_site

GEOD = Geod(ellps="WGS84")
LOT_M = 60.0
TO_DEGREES = Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True)
CORNER = (565_000.0, 5_934_000.0)
"""A place in UTM zone 32."""


@st.composite
def buildings(draw: st.DrawFn) -> tuple[BaseGeometry, dict[str, str]]:
    """Return an outline of up to 40 m, with a yard or without, and its tags."""
    width, depth = draw(st.integers(6, 28)), draw(st.integers(6, 28))
    shape: BaseGeometry = shapely.box(0.0, 0.0, width, depth)
    if min(width, depth) > 12 and draw(st.booleans()):
        shape -= shapely.box(4.0, 4.0, width - 4.0, depth - 4.0)
    if draw(st.booleans()):
        shape -= shapely.box(0.0, 0.0, 2.0, 3.0)
    turned = rotate(shape, draw(st.integers(0, 89)), origin=(20.0, 20.0))
    top_m, base_m = draw(st.integers(7, 80)) / 2.0, draw(st.integers(0, 6)) / 2.0
    return turned, {"building": "yes", "height": f"{top_m:g}", "min_height": f"{base_m:g}"}


def placed(drawn: list[tuple[BaseGeometry, dict[str, str]]]) -> list[dict[str, Any]]:
    """Return features in degrees, each on a lot of its own."""
    found = []
    for number, (shape, tags) in enumerate(drawn):
        moved = translate(shape, CORNER[0] + LOT_M * number, CORNER[1])
        degrees = shapely.transform(
            moved, lambda places: np.stack(TO_DEGREES.transform(*places.T), axis=1)
        )
        geometry = json.loads(shapely.to_geojson(degrees))
        found.append({"type": "Feature", "properties": tags, "geometry": geometry})
    return found


def imported(path: Path, place: tuple[float, float]) -> ImportedSite:
    return import_site(path, ImportOptions(protect_near=place, charge_at=(place,), margin_m=60.0))


def area_m2(shape: BaseGeometry) -> float:
    """Return the area of a geometry in degrees on the ellipsoid."""
    area, _ = GEOD.geometry_area_perimeter(shapely.normalize(shape))
    return abs(float(area))


def check(site: ImportedSite, shapes: dict[str, tuple[BaseGeometry, dict[str, str]]]) -> None:
    assert {each.place for each in site.buildings} == shapes.keys()
    for each in site.buildings:
        shape, tags = shapes[each.place]
        assert each.outline.area == pytest.approx(area_m2(shape), rel=1e-4)
        assert each.height_m == float(tags["height"])
        assert each.base_m == float(tags["min_height"])
    bounds = shapely.union_all([each.outline for each in site.buildings])
    whole = shapely.union_all([shape for shape, _ in shapes.values()])
    hull_m2 = area_m2(shapely.convex_hull(whole))
    assert shapely.convex_hull(bounds).area == pytest.approx(hull_m2, rel=1e-3)


DRAWN = st.lists(buildings(), min_size=1, max_size=3)
BESIDE = (CORNER[0] + 20.0, CORNER[1] - 30.0)


@given(DRAWN)
@settings(deadline=None, derandomize=True, max_examples=15)
def test_buildings_of_geojson_are_those_of_shapely(
    tmp_path_factory: pytest.TempPathFactory, drawn: list[tuple[BaseGeometry, dict[str, str]]]
) -> None:
    path = tmp_path_factory.mktemp("maps") / "map.geojson"
    collection = {"type": "FeatureCollection", "features": placed(drawn)}
    path.write_text(json.dumps(collection))
    read = json.loads(path.read_text())["features"]
    shapes = {
        f"features[{k}]": (shapely.geometry.shape(each["geometry"]), each["properties"])
        for k, each in enumerate(read)
    }
    check(imported(path, TO_DEGREES.transform(*BESIDE)), shapes)


@given(DRAWN)
@settings(deadline=None, derandomize=True, max_examples=15)
def test_buildings_of_an_extract_are_those_of_osmium(
    tmp_path_factory: pytest.TempPathFactory, drawn: list[tuple[BaseGeometry, dict[str, str]]]
) -> None:
    path = tmp_path_factory.mktemp("maps") / "map.osm"
    write_osm(path, placed(drawn))
    check(imported(path, TO_DEGREES.transform(*BESIDE)), areas_of_osmium(path))


def write_osm(path: Path, features: list[dict[str, Any]]) -> None:
    """Write features with osmium: outlines as ways, those with yards as relations."""
    node = way = 0
    nodes, ways, relations = [], [], []
    for number, feature in enumerate(features, start=1):
        rings = []
        for ring in feature["geometry"]["coordinates"]:
            first = node + 1
            for place in ring[:-1]:
                node += 1
                nodes.append(osmium.osm.mutable.Node(id=node, location=tuple(place)))
            rings.append([*range(first, node + 1), first])
        tags = feature["properties"]
        members = []
        for k, ring in enumerate(rings):
            way += 1
            own = tags if len(rings) == 1 else {}
            ways.append(osmium.osm.mutable.Way(id=way, nodes=ring, tags=own))
            members.append(("w", way, "inner" if k else "outer"))
        if len(rings) > 1:
            marks = {"type": "multipolygon", **tags}
            relation = osmium.osm.mutable.Relation(id=number, members=members, tags=marks)
            relations.append(relation)
    with osmium.SimpleWriter(str(path)) as writer:
        for each in (*nodes, *ways, *relations):
            writer.add(each)


def areas_of_osmium(path: Path) -> dict[str, tuple[BaseGeometry, dict[str, str]]]:
    factory = osmium.geom.WKBFactory()
    found: dict[str, tuple[BaseGeometry, dict[str, str]]] = {}
    item: Any
    for item in osmium.FileProcessor(str(path)).with_areas():
        if item.is_area():
            tags = {tag.k: tag.v for tag in item.tags}
            kind = "way" if item.from_way() else "relation"
            shape = shapely.from_wkb(factory.create_multipolygon(item))
            found[f"{kind} {item.orig_id()}"] = shape, tags
    return found
