"""Reading of maps in JSON: GeoJSON, and city models in CityJSON."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from blast_env.errors import BlastEnvError, reason_of, value_text
from blast_env.io.importing.cityjson import read_cityjson
from blast_env.io.importing.geojson import read_geojson
from blast_env.io.importing.site_map import MOST_VALUES, SiteMap, check_count


def read_json(site_map: SiteMap) -> None:
    """Read a file of GeoJSON or CityJSON into a map."""
    document = _parsed(site_map.path, site_map.content)
    if document.get("type") == "CityJSON":
        read_cityjson(site_map, [document])
    else:
        read_geojson(site_map, document)


def read_json_lines(site_map: SiteMap) -> None:
    """Read a text sequence of a CityJSON object and its features into a map."""
    _check_values(site_map.path, site_map.content)
    read_cityjson(site_map, _lines(site_map.path, site_map.content))


def _check_values(path: Path, content: bytes) -> None:
    """Refuse a document with more than `MOST_VALUES` values."""
    values = sum(content.count(sign) for sign in (b",", b"[", b"{"))
    check_count(path, values, MOST_VALUES, "commas and opening brackets")


def _parsed(path: Path, content: bytes) -> Mapping[str, Any]:
    _check_values(path, content)
    try:
        document = json.loads(content)
    except RecursionError as error:
        raise BlastEnvError(f"{path}: is nested too deeply") from error
    except ValueError as error:
        lines = "; if it has a feature in each line, convert it with ogr2ogr -f GeoJSON"
        hint = lines if str(error).startswith("Extra data") else ""
        raise BlastEnvError(f"{path}: is not JSON: {reason_of(error)}{hint}") from error
    if not isinstance(document, dict):
        raise BlastEnvError(f"{path}: is {type(document).__name__}, must be a GeoJSON object")
    return document


def _lines(path: Path, content: bytes) -> list[Any]:
    """Return the JSON documents of a text sequence, one a line."""
    documents: list[Any] = []
    for number, line in enumerate(content.splitlines()):
        if not line.strip():
            continue
        try:
            document = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise BlastEnvError(f"{path}: line {number + 1} is not JSON") from error
        expected = "CityJSONFeature" if documents else "CityJSON"
        kind = document.get("type") if isinstance(document, dict) else None
        if kind != expected:
            raise BlastEnvError(
                f"{path}: line {number + 1}: type is {value_text(kind)}, must be {expected!r}"
            )
        documents.append(document)
    if not documents:
        raise BlastEnvError(f"{path}: is empty, must have a CityJSON object in its first line")
    return documents
