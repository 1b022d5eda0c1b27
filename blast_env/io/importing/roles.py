"""Roles of the objects of a map: buildings, places of charges, build zone, no-build areas."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Final

from blast_env.errors import BlastEnvError, import_extra
from blast_env.io.importing.heights import length_m, tagged_heights
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.site_map import (
    LostFeature,
    MapFeature,
    SiteMap,
    Tags,
)
from blast_env.io.importing.things import Role, Thing

with import_extra("maps", "maps and drawings"):
    from shapely.geometry.base import BaseGeometry


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


def things_of(
    site_map: SiteMap, selectors: Selectors, options: ImportOptions, ledger: Ledger
) -> tuple[Thing, ...]:
    """Return the objects of a map with a role in a site, also those with a fault.

    The ledger gets the others, and unclear heights and widths.

    Args:
        site_map: The map.
        selectors: Selectors of the user.
        options: Options of the import.
        ledger: The ledger of the import.
    """
    for kind, place, detail in site_map.remarks:
        ledger.add(Deed.GUESSED, kind, place, detail=detail)
    for kind, place, detail in site_map.merged:
        ledger.add(Deed.MERGED, kind, place, detail=detail)
    features = (*site_map.features, *site_map.lost)
    roles = [_role(each, selectors, site_map.is_drawing) for each in features]
    known = ("kind", "building", "highway", "layer")
    if not any(key in each.tags for each in features for key in known) and not selectors:
        roles = [Role.BUILDING if _is_outline(each.geometry) else None for each in features]
    found = []
    for feature, role in zip(features, roles, strict=True):
        if role is not None:
            found.append(_thing(feature, role, options, ledger))
        elif str(feature.tags.get("barrier", "")).lower() in _WALLS:
            fault = "walls of the map, which shield"
            found.append(Thing(Role.OTHER, feature.geometry, "", feature.place, fault=fault))
        else:
            ledger.add(
                Deed.PASSED,
                f"without a role: {_kind(feature.tags, site_map.is_drawing)}",
                feature.place,
            )
    return tuple(found)


def _kind(tags: Tags, is_drawing: bool) -> str:
    """Return the kind of an object without a role: the layer, or the key of its chief tag."""
    if is_drawing:
        return f"layer {tags['layer']}"
    return next((key for key in (*_CHIEF_KEYS, *tags) if key in tags), "no tag")


def _role(feature: MapFeature, selectors: Selectors, is_drawing: bool) -> Role | None:
    """Return the role of a feature, by the selectors or else by its tags."""
    for role, chosen in selectors.items():
        if any(selector.chooses(feature.tags) for selector in chosen):
            if is_drawing and feature.tags.get("text"):
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


def _thing(feature: MapFeature, role: Role, options: ImportOptions, ledger: Ledger) -> Thing:
    tags = feature.tags
    own = str(tags.get("kind", tags.get("layer", ""))).lower()
    tnt_kg = tags.get("tnt_kg")
    name_keys = ("title", *_NAME_KEYS) if own in _OWN_STRUCTURES else _NAME_KEYS
    is_building = role is Role.BUILDING
    top_m, base_m = tagged_heights(feature, options, ledger) if is_building else (None, 0.0)
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
        width_m=_width_m(feature, ledger) if role is Role.CHARGE else None,
        facade={
            key.removeprefix("facade:"): float(value)
            for key, value in tags.items()
            if key.startswith("facade:")
        },
        is_part="building:part" in tags and not _says(tags, "building"),
        fault=_fault(feature, role),
    )


def _fault(feature: MapFeature, role: Role) -> str:
    """Return why an object cannot be used; an empty string if it can."""
    tags = feature.tags
    if isinstance(feature, LostFeature):
        return feature.reason
    is_below = str(tags.get("location", "")).lower() in _BELOW
    if role in (Role.BUILDING, Role.CHARGE) and "kind" not in tags:
        with suppress(ValueError):  # the layer of a drawing is a name
            is_below = is_below or float(str(tags.get("layer", "0"))) < 0.0
    if role is Role.BUILDING:
        if is_below:
            return "buildings below the ground"
        is_point = feature.geometry.geom_type in ("Point", "MultiPoint")
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
        ledger.add(Deed.GUESSED, _WIDTHS, feature.place, detail=f"{width_m:g} m as {road}")
    return width_m


def _is_outline(geometry: BaseGeometry) -> bool:
    return geometry.geom_type in ("Polygon", "MultiPolygon")
