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
    geometry = {"type": "LineString", "coordinates": [list(each) for each in places]}
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
