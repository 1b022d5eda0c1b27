"""The objects of a map that matter to a site: their roles, and what their tags say of them."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from fnmatch import fnmatchcase
from math import isfinite
from types import MappingProxyType
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.errors import MAX_TEXT, BlastEnvError, named, quoted, value_text
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.site_map import MapFeature, SiteMap, Tags
from blast_env.values import typed_number

_TO_KERB_M: Final = 1.0  # from the middle of a parked vehicle


class Role(StrEnum):
    """Role of an object of a map in a site."""

    SITE = "site"
    BUILDING = "building"
    CHARGE = "place of a charge"
    ZONE = "build zone"
    KEEP_OUT = "no-build area"
    NAME = "name"
    OTHER = "other"


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
        kind: The value of `building` or `man_made`, or the layer.
        part_of: The building of which it is a part: its place in the file, or its name in files of
            blast-env.
        base_m: Height of its underside above the ground, m.
        diameter_m: Diameter of a point that is a round building, m: a silo, a tank, a column.
        carries: Whether the source marks it as a terrace.
        width_m: Width of a street, m.
        is_part: Whether it is a part of a building with a height of its own.
        facade: Its storeys and windows, see `MapFeature`.
        fault: Why it cannot be used; an empty string if it can.
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
    kind: str = ""
    width_m: float | None = None
    is_part: bool = False
    facade: Mapping[str, float] = field(default_factory=dict)
    fault: str = ""

    @property
    def is_line(self) -> bool:
        """Whether it is a line, not an outline or a point."""
        return self.geometry.geom_type in ("LineString", "MultiLineString")

    @property
    def kerbs(self) -> Iterator[BaseGeometry]:
        """The lines of vehicles at both kerbs of a street; a line without a width itself."""
        aside_m = 0.0 if self.width_m is None else 0.5 * self.width_m - _TO_KERB_M
        if aside_m < _TO_KERB_M:  # too narrow for two rows of vehicles
            yield self.geometry
            return
        for side in (aside_m, -aside_m):
            yield from shapely.get_parts(
                shapely.offset_curve(self.geometry, side, join_style="mitre")
            )


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
            raise BlastEnvError(f"{quoted(text)} chooses nothing, must be {example}")
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

_DIAMETER_KEYS: Final = ("diameter", "diameter_m")
_ROUND: Final = frozenset({"chimney", "gasometer", "silo", "storage_tank", "water_tower"})
"""Values of OpenStreetMap's `man_made` of buildings, most of them round."""

_WALLS: Final = frozenset(
    {"wall", "city_wall", "retaining_wall", "gabion", "block", "jersey_barrier"}
)
"""Values of OpenStreetMap's `barrier` of solid obstacles, which an import does not make."""

_NAME_KEYS: Final = ("name", "addr:housename", "text")
_YES: Final = (True, "yes", "true")
_NO: Final = ("no", "false")
_BELOW: Final = ("underground", "subsurface")
_NOT_ON_GROUND: Final = (*_BELOW, "rooftop", "multi-storey", "sheds", "garage_boxes")
_CHIEF_KEYS: Final = (
    *("amenity", "shop", "office", "natural", "landuse", "leisure", "highway", "barrier"),
    *("power", "railway", "waterway", "boundary", "place", "historic", "tourism", "route"),
)
"""Tags that say the kind of an object, by which those without a role are counted."""

_LANE_M: Final = 3.0
_NARROW: Final = frozenset({"service", "track", "living_street"})
_WIDTHS: Final = "widths of streets not in the file"

_HEIGHT_KEYS: Final = ("height", "height_m", "building:height", "building_height")
_BASE_KEYS: Final = ("min_height", "building:min_height", "base_m")
_BASE_LEVEL_KEYS: Final = ("building:min_level", "min_level")
_LEVEL_KEYS: Final = ("building:levels", "levels", "storeys", "num_floors")

_LENGTH: Final = re.compile(r"([0-9]+(?:[.,][0-9]*)?)\s*(m|metres|meters|ft|feet|')?")
_FEET_AND_INCHES: Final = re.compile(r"([0-9]+)\s*(?:'|ft)\s*([0-9]+(?:\.[0-9]*)?)\s*(?:\"|''|in)?")
_SEVERAL: Final = re.compile(r"[0-9.]+(?:\s*[;/-]\s*[0-9.]+)+")
_FOOT_M: Final = 0.3048
_INCH_M: Final = 0.0254


def things_of(site_map: SiteMap) -> tuple[Thing, ...]:
    """Return the objects of a map with a role in a site, also those with a fault.

    The user's selectors decide, and the usual tags for roles without any. All outlines of a map
    that marks nothing are buildings. The ledger gets the other objects, and unclear heights and
    widths.

    Raises:
        BlastEnvError: If a selector chooses nothing.
    """
    selectors = _selectors(site_map)
    roles = [_role(each, selectors, site_map) for each in site_map.features]
    known = ("kind", "building", "highway", "layer")
    if not selectors and not any(key in each.tags for each in site_map.features for key in known):
        outlines = (_is_outline(each.geometry) for each in site_map.features)
        roles = [Role.BUILDING if is_outline else None for is_outline in outlines]
    found = []
    for feature, role in zip(site_map.features, roles, strict=True):
        if role is not None:
            found.append(_thing(feature, role, site_map))
        elif str(feature.tags.get("barrier", "")).lower() in _WALLS:
            fault = "walls of the map, which shield"
            found.append(Thing(Role.OTHER, feature.geometry, "", feature.place, fault=fault))
        else:
            chief = next((key for key in (*_CHIEF_KEYS, *feature.tags) if key in feature.tags), "")
            kind = named(chief) if chief else "no tag"
            if site_map.has_layers:
                kind = f"layer {named(str(feature.tags['layer']))}"
            site_map.ledger.add(Fate.PASSED, f"without a role: {kind}", feature.place)
    return tuple(found)


def _selectors(site_map: SiteMap) -> dict[Role, tuple[Selector, ...]]:
    """Return the selectors of the user by role."""
    options = site_map.options
    chosen = {
        Role.ZONE: options.zone_from,
        Role.KEEP_OUT: options.keep_outs_from,
        Role.CHARGE: options.charges_from,
        Role.BUILDING: options.buildings_from,
    }
    return {
        role: tuple(Selector.parsed(text, site_map.has_layers) for text in texts)
        for role, texts in chosen.items()
        if texts
    }


def _role(
    feature: MapFeature, selectors: Mapping[Role, Sequence[Selector]], site_map: SiteMap
) -> Role | None:
    """Return the role of a feature, by the selectors or else by its tags."""
    for role, chosen in selectors.items():
        if any(selector.chooses(feature.tags) for selector in chosen):
            if site_map.has_layers and feature.tags.get("text"):
                return Role.NAME  # a text on the layer of the object that it names
            return role
    usual = _usual_role(feature)
    return None if usual in selectors else usual


def _usual_role(feature: MapFeature) -> Role | None:
    tags = feature.tags
    own = str(tags.get("kind", tags.get("layer", ""))).lower()
    if own in _KINDS:
        return Role.NAME if tags.get("text") else _KINDS[own]
    if _says(tags, "building") or _says(tags, "building:part"):
        return Role.BUILDING
    if str(tags.get("man_made", "")).lower() in _ROUND:
        return Role.BUILDING
    if str(tags.get("highway", "")).lower() in _ROADS and not _says(tags, "tunnel"):
        return Role.CHARGE
    if str(tags.get("amenity", "")).lower() == "parking" and feature.geometry.area > 0.0:
        return Role.CHARGE
    return Role.NAME if tags.get("text") else None


def _says(tags: Tags, key: str) -> bool:
    return str(tags.get(key, "no")).lower() not in _NO


def _thing(feature: MapFeature, role: Role, site_map: SiteMap) -> Thing:
    tags = feature.tags
    own = str(tags.get("kind", tags.get("layer", ""))).lower()
    tnt_kg = tags.get("tnt_kg")
    name_keys = ("title", *_NAME_KEYS) if own in _OWN_STRUCTURES else _NAME_KEYS
    is_building = role is Role.BUILDING
    top_m, base_m = _heights_m(feature, site_map) if is_building else (None, 0.0)
    building = str(tags.get("building", tags.get("building:part", "")))
    kind = building if is_building and not own else own
    if is_building and not building:
        kind = str(tags.get("man_made", own)).lower()
    return Thing(
        role=role,
        geometry=feature.geometry,
        name=next((str(tags[key]) for key in name_keys if tags.get(key)), ""),
        place=feature.place,
        height_m=top_m,
        base_m=base_m,
        diameter_m=_diameter_m(feature) if is_building else None,
        protected=own == "protected_structure" or tags.get("protected") in _YES,
        part_of=str(tags.get("building", "")) if own in _OWN_STRUCTURES else "",
        carries=own == "terrace" or tags.get("carries") in _YES,
        tnt_kg=float(tnt_kg) if isinstance(tnt_kg, int | float) and tnt_kg > 0.0 else None,
        kind=kind.lower(),
        width_m=_width_m(feature, site_map.ledger) if role is Role.CHARGE else None,
        facade=feature.facade,
        is_part="building:part" in tags and not _says(tags, "building"),
        fault=_fault(feature, role),
    )


def _fault(feature: MapFeature, role: Role) -> str:
    """Return why an object cannot be used; an empty string if it can."""
    tags = feature.tags
    if feature.fault:
        return feature.fault
    is_below = str(tags.get("location", "")).lower() in _BELOW
    if role in (Role.BUILDING, Role.CHARGE) and "kind" not in tags:
        with suppress(ValueError):  # the layer of a drawing is a name
            is_below = is_below or float(str(tags.get("layer", "0"))) < 0.0
    is_point = feature.geometry.geom_type in ("Point", "MultiPoint")
    if role in (Role.ZONE, Role.KEEP_OUT) and is_point:
        return "build zones and no-build areas without an outline"
    if role is Role.BUILDING:
        if is_below:
            return "buildings below the ground"
        if is_point and _diameter_m(feature) is None:
            return "buildings without an outline or a diameter"
    if role is Role.CHARGE:
        if is_below:
            return "streets and car parks below the ground"
        if str(tags.get("parking", "")).lower() in _NOT_ON_GROUND:
            return "car parks that are not on the ground"
    return ""


def _diameter_m(feature: MapFeature) -> float | None:
    """Return the diameter of a point, m, if the source has one."""
    if feature.geometry.geom_type != "Point":
        return None
    given = next((feature.tags[key] for key in _DIAMETER_KEYS if key in feature.tags), None)
    return None if given is None else length_m(given)


def _width_m(feature: MapFeature, ledger: Ledger) -> float | None:
    """Return the width of a street, m; `None` for other places of charges."""
    road = str(feature.tags.get("highway", "")).lower()
    if not road or _is_outline(feature.geometry):
        return None
    width_m = length_m(feature.tags.get("width", ""))
    if width_m is not None:
        return width_m
    lanes = length_m(feature.tags.get("lanes", ""))
    width_m = _LANE_M * (lanes or (1 if road in _NARROW else 2))
    if lanes is None:
        ledger.add(Fate.GUESSED, _WIDTHS, feature.place, detail=f"{width_m:g} m as {named(road)}")
    return width_m


def _is_outline(geometry: BaseGeometry) -> bool:
    return geometry.geom_type in ("Polygon", "MultiPolygon")


def _heights_m(feature: MapFeature, site_map: SiteMap) -> tuple[float | None, float]:
    """Return the heights of top and underside in the tags of an object, m.

    The top is `None` if it is not known. The ledger gets heights that are unclear. An unreadable
    height does not hide a number of storeys. Of several numbers the largest counts.
    """
    own, level_m = site_map.options.height_from, site_map.options.level_height_m
    tags = {str(name).lower(): value for name, value in feature.tags.items()}
    lower, ledger = replace(feature, tags=tags), site_map.ledger
    if own is not None:
        top_m = _first_m(lower, (own.lower(),), 1.0, ledger)
    else:
        top_m = _first_m(lower, _HEIGHT_KEYS, 1.0, ledger)
        top_m = top_m or _first_m(lower, _LEVEL_KEYS, level_m, ledger)
    base_m = _first_m(lower, _BASE_KEYS, 1.0, ledger)
    return top_m, base_m or _first_m(lower, _BASE_LEVEL_KEYS, level_m, ledger) or 0.0


def _first_m(
    feature: MapFeature, keys: Sequence[str], unit_m: float, ledger: Ledger
) -> float | None:
    """Return the first readable height of some tags, which are in lower case, m."""
    for key in keys:
        if key not in feature.tags:
            continue
        value = feature.tags[key]
        number = length_m(value)
        if number is None and isinstance(value, str) and _SEVERAL.fullmatch(value.strip()):
            numbers = [length_m(each) for each in re.split(r"[;/-]", value[:MAX_TEXT])]
            number = max((each for each in numbers if each), default=None)
            detail = f"{key} is {value_text(value)}, the largest counts"
            ledger.add(Fate.GUESSED, "heights of several numbers", feature.place, detail=detail)
        if number is not None:
            return number * unit_m
        is_base = key in (*_BASE_KEYS, *_BASE_LEVEL_KEYS)
        if not is_base or str(value) not in ("0", "0.0", "0 m"):
            detail = f"{key} is {value_text(value)}, which is no length in m or ft"
            ledger.add(Fate.GUESSED, "heights that cannot be read", feature.place, detail=detail)
    return None


def length_m(value: str | float | bool) -> float | None:
    """Return a length above 0 in metres, or `None` if the value is not one."""
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        text = value[:MAX_TEXT].strip()
        parts = _FEET_AND_INCHES.fullmatch(text)
        match = _LENGTH.fullmatch(text)
        try:
            if parts is not None:
                feet, inches = (typed_number("a length", parts[k]) for k in (1, 2))
                value = feet * _FOOT_M + inches * _INCH_M
            elif match is not None:
                metric = match[2] is None or match[2].startswith("m")
                value = typed_number("a length", match[1]) * (1.0 if metric else _FOOT_M)
            else:
                return None
        except BlastEnvError:
            return None
    return float(value) if isfinite(value) and value > 0.0 else None
