"""Formats that are not read, and the way to one that is."""

from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import Any, Final

from blast_env.errors import MAX_TEXT

_BY_GDAL: Final = "convert it: ogr2ogr -f GeoJSON map.geojson {name}"
_AS_DXF: Final = "save it as DXF in its program, or with dwg2dxf or the ODA File Converter"
_AS_MODEL: Final = "export it as IFC or DXF from its program"
_AS_OSM: Final = "convert it: osmium cat -o map.osm.pbf {name}"
_UNPACK: Final = "unpack it"
_TRACE: Final = "it has no outlines: trace the buildings, for example in QGIS, and save GeoJSON"

_WAYS: Final[Mapping[str, str]] = MappingProxyType(
    {
        **dict.fromkeys((".gml", ".kmz", ".gpx", ".tab", ".mif", ".sqlite", ".gdb"), _BY_GDAL),
        **dict.fromkeys((".geojsonl", ".geojsons", ".geojsonseq", ".ndjson"), _BY_GDAL),
        **dict.fromkeys((".topojson", ".esrijson"), _BY_GDAL),
        **dict.fromkeys((".shx", ".dbf", ".prj"), "name the file .shp beside it"),
        **dict.fromkeys((".dwg", ".dwf", ".dgn"), _AS_DXF),
        **dict.fromkeys((".rvt", ".pln", ".skp", ".3dm", ".nwd", ".nwc", ".ifcxml"), _AS_MODEL),
        **dict.fromkeys((".obj", ".stl", ".ply", ".glb", ".gltf", ".fbx", ".dae"), _AS_MODEL),
        **dict.fromkeys((".step", ".stp", ".blend"), _AS_MODEL),
        **dict.fromkeys((".o5m", ".osc", ".osh"), _AS_OSM),
        **dict.fromkeys((".zip", ".ifczip", ".7z", ".tar", ".tgz", ".gz", ".bz2", ".xz"), _UNPACK),
        **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".pdf", ".svg"), _TRACE),
        **dict.fromkeys((".las", ".laz"), _TRACE),
    }
)
"""Ways to a format that is read, by the suffix."""

_OVERPASS: Final = "ask Overpass for [out:xml], or convert it with osmtogeojson"


def way_of(path: Path) -> str:
    """Return the way for a file of an unknown suffix, after a semicolon; else nothing."""
    way = _WAYS.get(path.suffix.lower())
    return "" if way is None else f"; {way.format(name=_word(path.name))}"


def way_of_json(document: Mapping[str, Any], name: str) -> str:
    """Return the kind of a JSON document that is not GeoJSON, and the way to it; else nothing."""
    by_gdal = _BY_GDAL.format(name=_word(name))
    if document.get("type") == "Topology":
        return f"it is TopoJSON; {by_gdal}"
    if isinstance(document.get("elements"), list):
        return f"it is JSON of Overpass; {_OVERPASS}"
    if "geometryType" in document or "spatialReference" in document:
        return f"it is JSON of ArcGIS; {by_gdal}"
    return ""


def _word(name: str) -> str:
    """Return the name of a file as a word of a command; a long one is not repeated."""
    return quote(name) if len(name) <= MAX_TEXT else "FILE"
