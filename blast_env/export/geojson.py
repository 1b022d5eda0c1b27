"""A layout on its site as GeoJSON, in local metres.

RFC 7946 says that coordinates are longitude and latitude unless those who exchange a file have
agreed on others. A site has no place on the globe, so these are others; the file says so itself.
"""

import json
from pathlib import Path
from typing import Any, Final

from blast_env.atomic import write_atomically
from blast_env.export.plan import Feature, LayoutPlan

COORDINATES: Final = (
    "local site metres: x to the right and y upwards from the lower left corner of the site; "
    "not longitude and latitude (not WGS 84)"
)
"""Stands in the collection and in every feature, because many programs read features alone."""


def feature_collection(plan: LayoutPlan) -> dict[str, Any]:
    """Return a FeatureCollection of everything on the site, as plain data."""
    return {
        "type": "FeatureCollection",
        "name": plan.scenario.name,
        "coordinate_system": COORDINATES,
        "scenario_hash": plan.scenario.content_hash,
        "features": [_feature(feature) for feature in plan.features],
    }


def write_geojson(plan: LayoutPlan, path: Path) -> None:
    """Write the collection, a feature a line.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    collection = feature_collection(plan)
    features = ",\n".join(json.dumps(each, allow_nan=False) for each in collection["features"])
    others = {key: value for key, value in collection.items() if key != "features"}
    head = json.dumps(others, indent=0, allow_nan=False).removesuffix("\n}")
    with write_atomically(path) as temporary:
        temporary.write_text(f'{head},\n"features": [\n{features}\n]\n}}\n', encoding="utf-8")


def _feature(feature: Feature) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {
            "kind": feature.kind.value,
            "name": feature.name,
            **feature.properties,
            "coordinate_system": COORDINATES,
        },
        "geometry": _geometry(feature),
    }


def _geometry(feature: Feature) -> dict[str, Any]:
    """Return a point, a line or a polygon, its ring closed and counterclockwise."""
    places = [list(place) for place in feature.places_m]
    if len(places) == 1:
        return {"type": "Point", "coordinates": places[0]}
    if len(places) == 2:
        return {"type": "LineString", "coordinates": places}
    return {"type": "Polygon", "coordinates": [[*places, places[0]]]}
