"""Area, height and base of random buildings, as other libraries read them from the same file.

Used directly: shapely and pyproj for GeoJSON, osmium for OpenStreetMap, ezdxf for DXF, ifcopenshell
for IFC.
"""

import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import osmium
import pytest
import shapely
from ezdxf.disassemble import recursive_decompose
from ezdxf.filemanagement import new, readfile
from ezdxf.render.mesh import MeshBuilder
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer
from shapely.affinity import rotate, scale, translate
from shapely.geometry.base import BaseGeometry

from blast_env.io.importing import ImportOptions, SiteImport, import_site
from blast_env.io.importing.bodies import LEAST_STOREY_M
from tests.io.importing.models import LOT_M, MIDDLE, TURNS_DEG, UNITS, WALL_M, WAYS, Model

GEOD = Geod(ellps="WGS84")
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


def imported(path: Path, place: tuple[float, float]) -> SiteImport:
    return import_site(path, ImportOptions(protect_near=place, charge_at=(place,), margin_m=60.0))


def area_m2(shape: BaseGeometry) -> float:
    """Return the area of a geometry in degrees on the ellipsoid."""
    area, _ = GEOD.geometry_area_perimeter(shapely.normalize(shape))
    return abs(float(area))


def check(site: SiteImport, shapes: dict[str, tuple[BaseGeometry, dict[str, str]]]) -> None:
    assert {building.place for building in site.buildings} == shapes.keys()
    for building in site.buildings:
        shape, tags = shapes[building.place]
        assert building.outline.area == pytest.approx(area_m2(shape), rel=1e-4)
        assert building.height_m == float(tags["height"])
        assert building.base_m == float(tags["min_height"])
    bounds = shapely.union_all([building.outline for building in site.buildings])
    whole = shapely.union_all([shape for shape, _ in shapes.values()])
    hull_m2 = area_m2(shapely.convex_hull(whole))
    assert shapely.convex_hull(bounds).area == pytest.approx(hull_m2, rel=1e-3)


DRAWN = st.lists(buildings(), min_size=1, max_size=3)
BESIDE = (CORNER[0] + 20.0, CORNER[1] - 30.0)


@given(DRAWN)
def test_buildings_of_geojson_are_those_of_shapely(
    tmp_path_factory: pytest.TempPathFactory, drawn: list[tuple[BaseGeometry, dict[str, str]]]
) -> None:
    path = tmp_path_factory.mktemp("maps") / "map.geojson"
    collection = {"type": "FeatureCollection", "features": placed(drawn)}
    path.write_text(json.dumps(collection))
    read = json.loads(path.read_text())["features"]
    shapes = {
        f"features[{k}]": (shapely.geometry.shape(feature["geometry"]), feature["properties"])
        for k, feature in enumerate(read)
    }
    check(imported(path, TO_DEGREES.transform(*BESIDE)), shapes)


@given(DRAWN)
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
        for element in (*nodes, *ways, *relations):
            writer.add(element)


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


Solid = tuple[float, float, float]
"""Area, m2, underside and top above the ground, m."""


def same(site: SiteImport, expected: list[Solid]) -> None:
    """Hold the buildings of a site against solids."""
    own = [
        (building.outline.area, building.base_m, building.height_m) for building in site.buildings
    ]
    assert len(own) == len(expected)
    for found, wanted in zip(sorted(own), sorted(expected), strict=True):
        assert found == pytest.approx(wanted, rel=1e-3, abs=1e-6)


def solid_of(corners: np.ndarray[Any, Any], faces: list[list[int]]) -> Solid:
    """Return what faces cover, and the heights of their corners (n, 3), m."""
    plans = [shapely.Polygon(corners[face, :2]) for face in faces]
    shadow = shapely.union_all([plan for plan in plans if plan.area > 1e-6], grid_size=1e-5)
    return shadow.area, float(corners[:, 2].min()), float(corners[:, 2].max())


@given(DRAWN, st.data())
def test_buildings_of_a_drawing_are_those_of_ezdxf(
    tmp_path_factory: pytest.TempPathFactory,
    drawn: list[tuple[BaseGeometry, dict[str, str]]],
    data: st.DataObject,
) -> None:
    """Draw outlines that are extruded, in blocks, or as meshes, and read them with ezdxf."""
    code, unit = data.draw(st.sampled_from(((6, 1.0), (4, 1000.0), (2, 1.0 / 0.3048))))
    zero_m = data.draw(st.sampled_from((0.0, 431.0)))
    document = new(units=code)
    for number, (shape, tags) in enumerate(drawn):
        extent = zero_m + float(tags["min_height"]), zero_m + float(tags["height"])
        draw_prism(document, shape, extent, unit, (LOT_M * number, data.draw(st.sampled_from(HOW))))
    path = tmp_path_factory.mktemp("drawn") / "drawing.dxf"
    document.saveas(path)
    place = (20.0 * unit, -30.0 * unit)
    options = ImportOptions(
        buildings_from=("BLD",), protect_near=place, charge_at=(place,), margin_m=60.0
    )
    solids = list(solids_of_ezdxf(path, unit))
    if zero_m:  # each stands on the ground below it
        solids = [(area, 0.0, high - low) for area, low, high in solids]
    same(import_site(path, options), solids)


HOW = ("up", "down", "mirrored", "block", "mesh")


def draw_prism(
    document: Any,
    shape: Any,
    extent_m: tuple[float, float],
    unit: float,
    how: tuple[float, str],
) -> None:
    """Draw a prism on a lot; all but a mesh are without the yard."""
    (low, high), (left_m, way) = (unit * length_m for length_m in extent_m), how
    space, rise = document.modelspace(), high - low
    shape = scale(translate(shape, left_m), unit, unit, origin=(0.0, 0.0))
    if way == "mesh":
        prism(shape, low, high).render_mesh(space, dxfattribs={"layer": "BLD"})
        return
    given: dict[str, Any] = {"layer": "BLD", "elevation": low, "thickness": rise}
    if way == "down":
        given |= {"elevation": high, "thickness": -rise}
    elif way == "mirrored":  # the x axis of the entity goes west, and its z axis down
        shape = scale(shape, -1.0, 1.0, origin=(0.0, 0.0))
        given |= {"elevation": -low, "thickness": -rise, "extrusion": (0.0, 0.0, -1.0)}
    elif way == "block":
        space = document.blocks.new(f"HOUSE{left_m:g}")
        turned = rotate(shape, -40.0, origin=(0.0, 0.0))
        shape = scale(turned, 0.5, 0.5, origin=(0.0, 0.0))
        given |= {"elevation": 0.0, "thickness": rise / 4.0, "layer": "0"}
        place = {"rotation": 40.0, "xscale": 2.0, "yscale": 2.0, "zscale": 4.0, "layer": "BLD"}
        document.modelspace().add_blockref(space.name, (0.0, 0.0, low), dxfattribs=place)
    space.add_lwpolyline(list(shape.exterior.coords)[:-1], close=True, dxfattribs=given)


def prism(shape: Any, low: float, high: float) -> MeshBuilder:
    """Return the faces of a prism: triangles below and above, and walls."""
    mesh = MeshBuilder()
    for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(shape)):
        for z in (low, high):
            mesh.add_face([(x, y, z) for x, y in list(triangle.exterior.coords)[:-1]])
    for ring in (shape.exterior, *shape.interiors):
        for (a, b), (c, d) in pairwise(ring.coords):
            mesh.add_face([(a, b, low), (c, d, low), (c, d, high), (a, b, high)])
    return mesh


def solids_of_ezdxf(path: Path, unit: float) -> Iterator[Solid]:
    entity: Any
    for entity in recursive_decompose(readfile(path).modelspace()):
        if entity.dxftype() == "MESH":
            mesh = MeshBuilder.from_mesh(entity)
            corners = np.array([tuple(corner_m) for corner_m in mesh.vertices])
            yield solid_of(corners / unit, [list(face) for face in mesh.faces])
        else:
            places = np.array([tuple(corner_m) for corner_m in entity.vertices_in_wcs()])
            rise = np.array(tuple(entity.dxf.extrusion)) * entity.dxf.thickness
            corners = np.concatenate([places, places + rise])
            yield solid_of(corners / unit, [list(range(len(places)))])


@given(DRAWN, st.data())
def test_buildings_of_a_model_are_those_of_ifcopenshell(
    tmp_path_factory: pytest.TempPathFactory,
    drawn: list[tuple[BaseGeometry, dict[str, str]]],
    data: st.DataObject,
) -> None:
    """Build walls around outlines and roofs on them, and place their corners by ifcopenshell."""
    ways = data.draw(st.lists(st.sampled_from(WAYS), min_size=1, max_size=5))
    schema = data.draw(st.sampled_from(("IFC2X3", "IFC4", "IFC4X3")))
    unit, site_m = data.draw(st.sampled_from(sorted(UNITS))), data.draw(st.sampled_from((0, 431)))
    model = Model(unit, site_m, 0.0, schema, ways)
    for shape, tags in drawn:
        low_m, high_m = float(tags["min_height"]), float(tags["height"])
        (level,) = model.building([0.0], turn_deg=data.draw(st.sampled_from(TURNS_DEG)))
        rooms = shapely.buffer(shape, -WALL_M, join_style="mitre")
        walls: Any = shapely.get_parts(shapely.difference(shape, rooms))
        roof: Any = shape
        for wall in walls:
            model.prism("IfcWall", level, wall, low_m, high_m)
        model.prism("IfcSlab", level, roof, high_m - 0.2, high_m)
    path = model.write(tmp_path_factory.mktemp("models"))
    place = (MIDDLE[0], MIDDLE[1] - 45.0)
    options = ImportOptions(protect=("House 0",), charge_at=(place,), margin_m=60.0)
    same(import_site(path, options), list(solids_of_ifcopenshell(path, model.scale)))


def solids_of_ifcopenshell(path: Path, unit: float) -> Iterator[Solid]:
    """Yield the solid of each building; what begins lower than a storey is on the ground."""
    import ifcopenshell.geom
    from ifcopenshell.util.placement import get_local_placement

    read: Any = ifcopenshell.open(str(path))
    settings_ = ifcopenshell.geom.settings()
    settings_.set("use-world-coords", True)
    for building in read.by_type("IfcBuilding"):
        (levels,) = (link.RelatedObjects for link in building.IsDecomposedBy)
        links = [link for level in levels for link in level.ContainsElements]
        corners, faces, count = [], [], 0
        for element in (part for link in links for part in link.RelatedElements):
            shape = ifcopenshell.geom.create_shape(settings_, element)
            corners.append(np.reshape(shape.geometry.verts, (-1, 3)))
            faces += (np.reshape(shape.geometry.faces, (-1, 3)) + count).tolist()
            count += len(corners[-1])
        area, low_m, high_m = solid_of(np.concatenate(corners), faces)
        ground_m = get_local_placement(building.ObjectPlacement)[2, 3] / unit
        base_m = low_m - ground_m
        yield area, base_m if base_m > LEAST_STOREY_M else 0.0, high_m - ground_m
