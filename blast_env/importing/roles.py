"""Roles of the objects of a map: buildings, places of charges, build zone, keep-outs."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from fnmatch import fnmatchcase
from math import isfinite
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.errors import MAX_TEXT, BlastEnvError, import_extra, value_text
from blast_env.importing.site_map import DrawingCoordinates, MapFeature, SiteMap, Tags
from blast_env.values import typed_number

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry


class Role(StrEnum):
    """Role of an object of a map in a site."""

    SITE = "site"
    BUILDING = "building"
    CHARGE = "place of a charge"
    ZONE = "build zone"
    KEEP_OUT = "keep-out"
    NAME = "name"


@dataclass(frozen=True)
class Thing:
    """An object of a map with a role in the site.

    Attributes:
        role: Its role.
        geometry: Its outline, line or point, in the coordinates of the source.
        name: Its name in the source, or an empty string.
        place: Its place in the file.
        height_m: Its height, m, if the source has one.
        protected: Whether the source marks it as protected.
        tnt_kg: Mass of a charge there, if the source has one.
        part_of: Name of the building of which it is a rectangle, in files of blast-env.
        base_m: Height of its underside above the ground, m.
        diameter_m: Diameter of a point that is a round building, m: a silo, a tank, a column.
        carries: Whether the source marks it as a terrace.
    """

    role: Role
    geometry: BaseGeometry
    name: str
    place: str
    height_m: float | None = None
    protected: bool = False
    tnt_kg: float | None = None
    part_of: str = ""
    base_m: float = 0.0
    diameter_m: float | None = None
    carries: bool = False


@dataclass(frozen=True)
class Selector:
    """Selects objects by a tag: `building`, `usage=school`, `Layer=A-WALL*`; or by a layer.

    Attributes:
        key: Key of the tag.
        pattern: Pattern of its value with `*` and `?`, regardless of case; `None` for any value
            but `no`.
    """

    key: str
    pattern: str | None

    @classmethod
    def parsed(cls, text: str, is_drawing: bool) -> "Selector":
        """Return the selector of a text.

        Raises:
            BlastEnvError: If a part of it is empty.
        """
        key, sign, value = text.partition("=")
        if not key or (sign and not value):
            example = "a layer" if is_drawing else "KEY or KEY=VALUE"
            raise BlastEnvError(f"{text!r} chooses nothing, must be {example}")
        if sign:
            return cls(key, value)
        return cls("layer", text) if is_drawing else cls(key, None)

    def chooses(self, tags: Tags) -> bool:
        """Return whether it selects an object with these tags."""
        value = tags.get(self.key)
        if value is None or value is False:
            return False
        if self.pattern is None:
            return str(value).lower() != "no"
        return fnmatchcase(str(value).lower(), self.pattern.lower())


Selectors = Mapping[Role, tuple[Selector, ...]]
"""Selectors of the user by role; the usual tags decide for other roles."""

_OWN_STRUCTURES: Final = ("structure", "protected_structure", "terrace")

_KINDS: Final[Mapping[str, Role]] = MappingProxyType(
    {
        "site": Role.SITE,
        "structure": Role.BUILDING,
        "protected_structure": Role.BUILDING,
        "terrace": Role.BUILDING,
        "build_zone": Role.ZONE,
        "keep_out": Role.KEEP_OUT,
        "charge_place": Role.CHARGE,
    }
)
"""Roles of the kinds, and of the layers in lower case, in files of blast-env."""

_ROADS: Final = frozenset(
    f"{road}{link}"
    for road in ("motorway", "trunk", "primary", "secondary", "tertiary")
    for link in ("", "_link")
) | {"unclassified", "residential", "living_street", "service", "road", "track"}
"""Values of OpenStreetMap's `highway` for motor vehicles."""

_HEIGHT_KEYS: Final = ("height", "height_m", "building:height", "building_height")
_BASE_KEYS: Final = ("min_height", "building:min_height", "base_m")
_BASE_LEVEL_KEYS: Final = ("building:min_level", "min_level")
_LEVEL_KEYS: Final = ("building:levels", "levels", "storeys", "num_floors")
_DIAMETER_KEYS: Final = ("diameter", "diameter_m")
_ROUND: Final = frozenset({"chimney", "gasometer", "silo", "storage_tank", "water_tower"})
"""Values of OpenStreetMap's `man_made` of buildings, most of them round."""

_NAME_KEYS: Final = ("name", "addr:housename", "text")
_YES: Final = (True, "yes", "true")
_LENGTH: Final = re.compile(r"([0-9]+(?:[.,][0-9]*)?)\s*(m|ft|')?")
_FOOT_M: Final = 0.3048


def things_of(
    site_map: SiteMap, selectors: Selectors, level_height_m: float, height_key: str | None = None
) -> tuple[tuple[Thing, ...], tuple[str, ...]]:
    """Return the objects of a map with a role in a site, and notes on unclear ones.

    Args:
        site_map: The map.
        selectors: Selectors of the user.
        level_height_m: Height of a storey, m, for buildings with a number of storeys only.
        height_key: Key of the tag with the height; the usual keys unless given.
    """
    is_drawing = isinstance(site_map.coordinates, DrawingCoordinates)
    found: list[Thing] = []
    notes: list[str] = []
    for feature in site_map.features:
        role = _role(feature, selectors)
        if role is None:
            continue
        if is_drawing and role is not Role.NAME and feature.tags.get("text"):
            role = Role.NAME  # a text on the layer of the object that it names
        height_m, note = _height_m(feature, level_height_m, height_key)
        notes += [note] if note else []
        base_m = _base_m(feature, level_height_m)
        diameter_m = _diameter_m(feature) if role is Role.BUILDING else None
        thing = _thing(feature, role, height_m)
        found.append(replace(thing, base_m=base_m, diameter_m=diameter_m))
    if not any(each.role is Role.BUILDING for each in found) and Role.BUILDING not in selectors:
        found += _untagged_outlines(site_map)
    return tuple(_closed(found)), tuple(dict.fromkeys(notes))


def _role(feature: MapFeature, selectors: Selectors) -> Role | None:
    """Return the role of a feature, by the selectors or else by its tags."""
    for role, chosen in selectors.items():
        if any(selector.chooses(feature.tags) for selector in chosen):
            return role
    usual = _usual_role(feature)
    return None if usual in selectors else usual


def _usual_role(feature: MapFeature) -> Role | None:
    tags = feature.tags
    own = str(tags.get("kind", tags.get("layer", ""))).lower()
    if own in _KINDS:
        return _KINDS[own]
    if str(tags.get("building", "no")).lower() not in ("no", "false"):
        return Role.BUILDING
    if str(tags.get("man_made", "")).lower() in _ROUND:
        return Role.BUILDING
    is_tunnel = str(tags.get("tunnel", "no")).lower() not in ("no", "false")
    if str(tags.get("highway", "")).lower() in _ROADS and not is_tunnel:
        return Role.CHARGE
    if str(tags.get("amenity", "")).lower() == "parking" and feature.geometry.area > 0.0:
        return Role.CHARGE
    return Role.NAME if tags.get("text") else None


def _thing(feature: MapFeature, role: Role, height_m: float | None) -> Thing:
    tags = feature.tags
    own = str(tags.get("kind", tags.get("layer", ""))).lower()
    tnt_kg = tags.get("tnt_kg")
    return Thing(
        role=role,
        geometry=feature.geometry,
        name=next((str(tags[key]) for key in _NAME_KEYS if tags.get(key)), ""),
        place=feature.place,
        height_m=height_m,
        protected=own == "protected_structure" or tags.get("protected") in _YES,
        part_of=str(tags.get("building", "")) if own in _OWN_STRUCTURES else "",
        carries=own == "terrace" or tags.get("carries") in _YES,
        tnt_kg=float(tnt_kg) if isinstance(tnt_kg, int | float) and tnt_kg > 0.0 else None,
    )


def _height_m(
    feature: MapFeature, level_height_m: float, key: str | None
) -> tuple[float | None, str | None]:
    """Return the height of a feature, m, and a note if its height cannot be read."""
    lower = {str(name).lower(): value for name, value in feature.tags.items()}
    keys = _HEIGHT_KEYS if key is None else (key.lower(),)
    given = next((lower[name] for name in keys if name in lower), None)
    if given is not None:
        height_m = _length_m(given)
        if height_m is not None:
            return height_m, None
        return None, f"{feature.place}: the height {value_text(given)} is no length in m or ft"
    levels = next((lower[name] for name in _LEVEL_KEYS if name in lower), None)
    number = None if levels is None or key is not None else _length_m(levels)
    return (None if number is None else number * level_height_m), None


def _base_m(feature: MapFeature, level_height_m: float) -> float:
    """Return the base of a feature, m; 0 if it has none."""
    lower = {str(name).lower(): value for name, value in feature.tags.items()}
    for keys, unit_m in ((_BASE_KEYS, 1.0), (_BASE_LEVEL_KEYS, level_height_m)):
        given = next((lower[name] for name in keys if name in lower), None)
        number = None if given is None else _length_m(given)
        if number is not None:
            return number * unit_m
    return 0.0


def _diameter_m(feature: MapFeature) -> float | None:
    """Return the diameter of a point, m, if the source has one."""
    if feature.geometry.geom_type != "Point":
        return None
    given = next((feature.tags[key] for key in _DIAMETER_KEYS if key in feature.tags), None)
    return None if given is None else _length_m(given)


def _length_m(value: str | float | bool) -> float | None:
    """Return a length above 0 in metres, or `None` if the value is not one."""
    if isinstance(value, str):
        match = _LENGTH.fullmatch(value[:MAX_TEXT].strip())
        try:
            number = typed_number("a length", match[1] if match else "")
        except BlastEnvError:
            return None
        value = number * (1.0 if match is None or match[2] in (None, "m") else _FOOT_M)
    return float(value) if isfinite(value) and value > 0.0 else None


def _untagged_outlines(site_map: SiteMap) -> list[Thing]:
    """Return all outlines as buildings, for a map without any tag of a role."""
    known = ("kind", "building", "highway", "layer")
    if any(key in feature.tags for feature in site_map.features for key in known):
        return []
    return [
        _thing(feature, Role.BUILDING, _height_m(feature, 1.0, None)[0])
        for feature in site_map.features
        if feature.geometry.geom_type in ("Polygon", "MultiPolygon")
    ]


def _closed(things: Iterable[Thing]) -> Iterator[Thing]:
    """Yield things, with outlines drawn as separate open lines joined.

    Places of charges may be lines, and remain so.
    """
    loose: dict[Role, list[Thing]] = {}
    for thing in things:
        is_line = thing.geometry.geom_type in ("LineString", "MultiLineString")
        if is_line and thing.role not in (Role.CHARGE, Role.NAME):
            loose.setdefault(thing.role, []).append(thing)
        else:
            yield thing
    for role, lines in loose.items():
        geometries = [each.geometry for each in lines]
        outlines = shapely.get_parts(shapely.polygonize(geometries))
        pairs = shapely.STRtree(geometries).query(outlines, "intersects")
        first = np.full(len(outlines), len(lines))
        np.minimum.at(first, *pairs)
        for outline, index in zip(outlines, first, strict=True):
            near = lines[index]
            yield Thing(role, outline, near.name, near.place, near.height_m, near.protected)
