"""Properties of GeoJSON features as tags of OpenStreetMap, whatever schema they are in."""

import json
import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

from blast_env.io.importing.heights import ROOF_KEYS
from blast_env.io.importing.site_map import Tags

_TAG_TABLES: Final = ("tags", "other_tags", "all_tags", "osm_tags", "attributes")
"""Properties with a table of tags: of osmtogeojson and osm2geojson, ogr2ogr and others."""

_MOST_DEEP: Final = 4
_MOST_TEXT: Final = 20_000  # letters of a table that is written as a text
_HSTORE: Final = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*"((?:[^"\\]|\\.)*)"')
_ESCAPED: Final = re.compile(r"\\(.)")

_OVERTURE_BUILDING: Final = ("has_parts", "is_underground")
"""Properties that each building and part of Overture Maps has, and nothing else."""

_OVERTURE_ROADS: Final[Mapping[str, str]] = MappingProxyType(
    {
        **dict.fromkeys(("parking_aisle", "driveway", "alley"), "service"),
        **dict.fromkeys(("sidewalk", "crosswalk"), "footway"),
        **dict.fromkeys(("unknown", "none", ""), "road"),
    }
)
"""Values of `class` of Overture's road segments that `highway` has by another name."""

_CITY_KINDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "1001": "roof",  # canopy of a petrol station
        "1003": "planned",  # placeholder
        "2110": "bridge",
        "5100": "construction",
        "5110": "garage",
    }
)
"""Values of `building` by the code of a feature in the footprints of New York City."""

_CITY_CODES: Final = ("feature_code", "feat_code")


def tags_of(item: Mapping[str, Any]) -> Tags:
    """Return the tags of a feature: plain properties, those of tables in them, and its `id`.

    Tables of tags are tags, those of other properties have dotted keys: `names.primary`. Buildings
    and roads of Overture Maps, and footprints of New York City, have the tags of OpenStreetMap.

    Sources: docs.overturemaps.org/schema; the metadata of New York City's building footprints.
    """
    properties = item.get("properties")
    tags: dict[str, str | float | bool] = {}
    if isinstance(properties, dict):
        tags |= dict(_flat(properties, "", 0))
        tags |= _nested(properties)
        _add(tags, _overture(properties, tags))
        _add(tags, _city(tags))
    own = item.get("id")
    if isinstance(own, str | int | float):
        tags.setdefault("id", own)
    return tags


def _add(tags: dict[str, str | float | bool], more: Mapping[str, str]) -> None:
    """Add tags that are not there."""
    for key, value in more.items():
        tags.setdefault(key, value)


def _flat(
    table: Mapping[str, Any], prefix: str, depth: int
) -> Iterator[tuple[str, str | float | bool]]:
    """Yield the plain values of a table, and those of tables in it by dotted keys."""
    for key, given in table.items():
        value = _read(given)
        if isinstance(value, dict) and depth < _MOST_DEEP:
            yield from _flat(value, f"{prefix}{key}.", depth + 1)
        elif isinstance(given, str | int | float):
            yield f"{prefix}{key}", given


def _nested(properties: Mapping[str, Any]) -> dict[str, str | float | bool]:
    """Return the tags of the tables of tags."""
    found: dict[str, str | float | bool] = {}
    for key, given in properties.items():
        value = _read(given)
        if str(key).lower() not in _TAG_TABLES:
            is_table = isinstance(value, dict) and ("building" in value or "highway" in value)
            if not is_table:
                continue
        if isinstance(value, str):
            pairs = _HSTORE.findall(value[:_MOST_TEXT])
            value = {_ESCAPED.sub(r"\1", k): _ESCAPED.sub(r"\1", v) for k, v in pairs}
        elif isinstance(value, list):
            value = dict(filter(None, map(_pair, value)))
        if isinstance(value, dict):
            found |= {str(k): v for k, v in value.items() if isinstance(v, str | int | float)}
    return found


def _pair(item: Any) -> tuple[str, Any] | None:
    """Return a pair of key and value in one of the forms of a list of tags."""
    if isinstance(item, dict) and {"key", "value"} <= item.keys():
        return str(item["key"]), item["value"]
    if isinstance(item, list) and len(item) == 2:
        return str(item[0]), item[1]
    return None


def _read(value: Any) -> Any:
    """Return a table or list that is written as a text of JSON; other values as they are."""
    if isinstance(value, str) and value[:1] in ("{", "[") and len(value) <= _MOST_TEXT:
        try:
            return json.loads(value)
        except (ValueError, RecursionError):
            return value
    return value


def _overture(properties: Mapping[str, Any], tags: Tags) -> dict[str, str]:
    """Return the tags of a building, part or road of Overture Maps."""
    found: dict[str, str] = {}
    if name := tags.get("names.primary"):
        found["name"] = str(name)
    kind, is_own = str(tags.get("type", "")), any(key in properties for key in _OVERTURE_BUILDING)
    if kind == "building_part" or (is_own and "building_id" in tags):
        found["building:part"] = "yes"
    elif kind == "building" or is_own:
        found["building"] = next(
            (str(tags[key]) for key in ("class", "subtype") if tags.get(key)), "yes"
        )
    if tags.get("is_underground") is True:
        found["location"] = "underground"
    if tags.get("subtype") == "road":
        found |= _road(properties, tags)
    return found


def _road(properties: Mapping[str, Any], tags: Tags) -> dict[str, str]:
    """Return the tags of a road segment of Overture Maps; flags and width of all its length."""
    given = str(tags.get("class", tags.get("road.class", "")))
    road = _OVERTURE_ROADS.get(given, given)
    flags = {
        flag
        for rule in _rules(properties.get("road_flags"))
        for flag in rule.get("values") or ()
        if isinstance(flag, str)
    }
    if tags.get("subclass") == "link" or "is_link" in flags:
        road = f"{road}_link"
    if flags & {"is_under_construction", "is_abandoned"}:
        road = "construction"
    found = {"highway": road}
    if "is_tunnel" in flags:
        found["tunnel"] = "yes"
    widths = [rule.get("value") for rule in _rules(properties.get("width_rules"))]
    if len(widths) == 1 and isinstance(widths[0], int | float):
        found["width"] = f"{widths[0]} m"
    return found


def _rules(given: Any) -> Iterator[Mapping[str, Any]]:
    """Yield the rules of a property that hold on all of a segment."""
    value = _read(given)
    for rule in value if isinstance(value, list) else ():
        if isinstance(rule, dict) and rule.get("between") is None:
            yield rule


def _city(tags: Tags) -> dict[str, str]:
    """Return the kind of a footprint of New York City."""
    lower = {key.lower(): value for key, value in tags.items()}
    if not any(key in lower for key in ROOF_KEYS):
        return {}
    code = next((str(lower[key]) for key in _CITY_CODES if key in lower), "")
    return {"building": _CITY_KINDS.get(code.removesuffix(".0"), "yes")}
