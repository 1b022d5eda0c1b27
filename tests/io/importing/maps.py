"""Small maps for tests, in metres of a plane of their own unless they say otherwise."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[3]
BLOCK = REPOSITORY / "docs" / "data" / "market_street.geojson"
"""An invented block of a town; `.osm` and `.dxf` of it lie beside it."""

LAYERS: dict[str, Any] = {
    "buildings_from": ("BUILDINGS",),
    "charges_from": ("STREETS",),
    "zone_from": ("ZONE",),
    "keep_outs_from": ("KEEP_CLEAR",),
}
"""What is what in the drawing of the block."""

DEGREE_M = 111_195.0
"""Length of a degree on the equator, where the extracts of these tests lie."""

Places = Sequence[tuple[float, float]]


def rectangle(left: float, bottom: float, width: float, height: float) -> Places:
    right, top = left + width, bottom + height
    return [(left, bottom), (right, bottom), (right, top), (left, top)]


def outline(places: Places, **tags: Any) -> dict[str, Any]:
    """Return a feature with an outline, a building unless its tags say what it is."""
    properties = tags if "kind" in tags else {"building": "yes", **tags}
    geometry = {"type": "Polygon", "coordinates": [[*places, places[0]]]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def line(places: Sequence[Sequence[float]], **tags: Any) -> dict[str, Any]:
    geometry = {"type": "LineString", "coordinates": [list(place_m) for place_m in places]}
    return {"type": "Feature", "properties": tags, "geometry": geometry}


def charge(x: float, y: float) -> dict[str, Any]:
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "properties": {"kind": "charge_place"}, "geometry": geometry}


def written(folder: Path, *features: dict[str, Any], **members: Any) -> Path:
    """Write a collection of features in local metres, and return the file."""
    path = folder / "map.geojson"
    own = {"coordinate_system": "local site metres"} if "crs" not in members else {}
    collection = {"type": "FeatureCollection", **own, **members, "features": list(features)}
    path.write_text(json.dumps(collection))
    return path


class Extract:
    """An extract in metres around (0, 0) on the equator, written in the order of its objects."""

    def __init__(self) -> None:
        self.nodes: list[str] = []
        self.others: list[str] = []

    def node(self, x: float, y: float) -> int:
        number = len(self.nodes) + 1
        lon, lat = x / DEGREE_M, y / DEGREE_M
        self.nodes.append(f'<node id="{number}" lat="{lat:.9f}" lon="{lon:.9f}"/>')
        return number

    def way(self, number: int, outline: Places, marks: str = "", **tags: str) -> list[int]:
        """Add a closed way; return its nodes."""
        nodes = [self.node(*place) for place in outline]
        self.way_of(number, [*nodes, nodes[0]], marks, **tags)
        return nodes

    def way_of(self, number: int, nodes: Sequence[int], marks: str = "", **tags: str) -> None:
        sides = "".join(f'<nd ref="{node}"/>' for node in nodes)
        self.others.append(f'<way id="{number}" {marks}>{sides}{_tags(tags)}</way>')

    def street(self) -> None:
        """Add a street, way 2, south of what is at the origin."""
        ends = [self.node(x, -12.0) for x in (-20.0, 30.0)]
        self.way_of(2, ends, highway="residential", width="8")

    def relation(self, number: int, members: Sequence[tuple[int, str]], **tags: str) -> None:
        ways = "".join(f'<member type="way" ref="{way}" role="{role}"/>' for way, role in members)
        tags = {"type": "multipolygon", **tags}
        self.others.append(f'<relation id="{number}">{ways}{_tags(tags)}</relation>')

    def write(self, folder: Path, backwards: bool = False, negative: bool = False) -> Path:
        objects = [*self.nodes, *self.others]
        text = "\n".join(objects[::-1] if backwards else objects)
        if negative:
            text = text.replace(' id="', ' id="-').replace('ref="', 'ref="-')
        path = folder / "town.osm"
        path.write_text(f'<osm version="0.6">\n{text}\n</osm>')
        return path


def _tags(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())


def town(**tags: str) -> Extract:
    """Return an extract with a house, way 1, and a street beside it, way 2."""
    extract = Extract()
    extract.way(1, rectangle(0, 0, 10, 8), building="yes", height="6", name="House", **tags)
    extract.street()
    return extract
