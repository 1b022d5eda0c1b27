"""Reading of GeoParquet 1.0 and 1.1, such as extracts of Overture Maps, by pyarrow."""

import json
from collections.abc import Mapping
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
import shapely

from blast_env.errors import BlastEnvError, value_text
from blast_env.io.importing.geojson import LOCAL
from blast_env.io.importing.properties import tags_of
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MOST_VALUES,
    WGS84,
    MapFeature,
    SiteMap,
    check_count,
    code_of,
    errors_of,
)

_GEO: Final = b"geo"
"""Key of the metadata with the columns of geometries (geoparquet.org, version 1.1)."""

_BOX: Final = "bbox"
"""Column of bounding boxes, which say nothing that the geometry does not."""


def read_geoparquet(site_map: SiteMap) -> None:
    """Read a GeoParquet file into a map; nested columns are tags, as those of GeoJSON.

    Its coordinates are in the reference system of the options, else in that of the file, which is
    longitude and latitude unless it says another.
    """
    path = site_map.path
    site_map.options.refuse("GeoParquet, whose coordinates --crs is about", "units")
    with errors_of("pyarrow", path, "Parquet"):
        file = pq.ParquetFile(pa.BufferReader(site_map.content))
        check_count(path, file.metadata.num_rows, MOST_FEATURES, "outlines and lines")
        values = file.metadata.num_rows * file.metadata.num_columns
        check_count(path, values, MOST_VALUES, "values")
        meta = file.schema_arrow.metadata or {}
        name, column = _geometry_column(site_map, meta)
        names = [field for field in file.schema_arrow.names if field != _BOX]
        rows = file.read(columns=names).to_pylist(maps_as_pydicts="strict")
    for number, row in enumerate(rows):
        given, place = row.pop(name), f"features[{number}]"
        tags = tags_of({"properties": row, "id": row.get("id")})
        with errors_of("shapely", f"{path}: {place}", "a geometry in WKB"):
            geometry = shapely.Point() if given is None else shapely.from_wkb(given)
        fault = "features without a geometry" if geometry.is_empty else ""
        site_map.add(MapFeature(shapely.force_2d(geometry), tags, place, fault))
    crs = _system(site_map, column) if site_map.options.crs is None else site_map.options.crs
    site_map.crs = None if crs == LOCAL else crs


def _geometry_column(
    site_map: SiteMap, meta: Mapping[bytes, bytes]
) -> tuple[str, Mapping[str, Any]]:
    """Return the name and the description of the primary column of geometries."""
    path = site_map.path
    if _GEO not in meta:
        raise BlastEnvError(
            f"{path}: is Parquet without geometries: its metadata has no {_GEO.decode()!r}"
        )
    try:
        document = json.loads(meta[_GEO])
        name = document["primary_column"]
        column: Mapping[str, Any] = document["columns"][name]
        encoding = column["encoding"]
    except (ValueError, KeyError, TypeError) as error:
        raise BlastEnvError(f"{path}: its metadata 'geo' cannot be read: {error!r}") from error
    if encoding != "WKB":
        raise BlastEnvError(f"{path}: encoding is {value_text(encoding)}, must be 'WKB'")
    return str(name), column


def _system(site_map: SiteMap, column: Mapping[str, Any]) -> str:
    """Return the reference system of a column: PROJJSON; none says a plane without a place."""
    if "crs" not in column:
        return WGS84
    crs = column["crs"]
    return LOCAL if crs is None else code_of(site_map.path, json.dumps(crs))
