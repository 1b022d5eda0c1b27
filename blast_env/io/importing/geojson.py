"""Reading of GeoJSON, RFC 7946 or the older form with a `crs` member."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, value_text
from blast_env.io.importing.formats import way_of_json
from blast_env.io.importing.properties import tags_of
from blast_env.io.importing.site_map import WGS84, MapFeature, SiteMap, errors_of

LOCAL: Final = "local"
"""Reference system of coordinates in metres without a place on the Earth."""

_LOCAL_WORDS: Final = "local site metres"  # in exports of a site without a georeference
_DRAWING_UNIT: Final = re.compile(r"of the drawing .* in units of (\d[\d.e+-]*) m\b")
"""The coordinates of exports of a site from a drawing."""

_KINDS: Final = (
    *("Point", "MultiPoint", "LineString", "MultiLineString"),
    *("Polygon", "MultiPolygon", "GeometryCollection"),
)


def read_geojson(site_map: SiteMap, document: Mapping[str, Any]) -> None:
    """Read a GeoJSON document into a map.

    Its coordinates are in the reference system of the options, `local` for metres without a place
    on the Earth; that of the file unless given, or longitude and latitude (EPSG:4326) if it has
    none.
    """
    path, options = site_map.path, site_map.options
    options.refuse("GeoJSON, whose coordinates --crs is about", "units")
    listed = _listed_features(path, document)
    for index in range(len(listed)):
        item, listed[index] = listed[index], None  # free it: it takes more memory than its feature
        site_map.add(_feature(path, f"features[{index}]", item))
    unit = _DRAWING_UNIT.search(str(document.get("coordinate_system", "")))
    if unit is not None and options.crs is None:
        site_map.unit_m = float(unit[1])
    crs = _crs(path, document) if options.crs is None else options.crs
    site_map.crs = None if crs == LOCAL else crs


def _listed_features(path: Path, document: Mapping[str, Any]) -> list[Any]:
    """Return the features of a collection, a single feature, or a bare geometry."""
    kind = document.get("type")
    if kind == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list):
            raise BlastEnvError(f"{path}: features is missing or no array")
        return features
    if kind == "Feature":
        return [document]
    if kind in _KINDS:
        return [{"type": "Feature", "geometry": document, "properties": {}}]
    what = way_of_json(document, path.name) or "is it GeoJSON?"
    raise BlastEnvError(
        f"{path}: type is {value_text(kind)}, must be 'FeatureCollection', 'Feature' or that of a "
        f"geometry: {what}"
    )


def _feature(path: Path, place: str, item: Any) -> MapFeature:
    """Return a feature; one without a geometry, which GeoJSON allows, is lost."""
    if not isinstance(item, dict) or item.get("type") != "Feature":
        raise BlastEnvError(f"{path}: {place}: is not a Feature")
    given = item.get("geometry")
    geometry = shapely.Point() if given is None else _geometry(path, place, given)
    if geometry.is_empty:
        return MapFeature(geometry, tags_of(item), place, "features without a geometry")
    return MapFeature(geometry, tags_of(item), place)


def _geometry(path: Path, place: str, document: Any) -> BaseGeometry:
    if not isinstance(document, dict) or document.get("type") not in _KINDS:
        kind = document.get("type") if isinstance(document, dict) else document
        raise BlastEnvError(
            f"{path}: {place}.geometry: type is {value_text(kind)}, must be one of "
            f"{', '.join(_KINDS)}"
        )
    with errors_of("shapely", f"{path}: {place}.geometry", "a geometry"):
        return shapely.force_2d(shape(document))


def _crs(path: Path, document: Mapping[str, Any]) -> str:
    """Return the reference system of a file: that of the older form of GeoJSON, or the usual one.

    Exports of a site without a place on the Earth are `local`.
    """
    words = str(document.get("coordinate_system", ""))
    if _LOCAL_WORDS in words or _DRAWING_UNIT.search(words):
        return LOCAL
    member = document.get("crs")
    if member is None:
        return WGS84
    properties = member.get("properties") if isinstance(member, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        raise BlastEnvError(f"{path}: crs: has no properties.name; say --crs instead")
    return name
