"""The objects of a map that matter to a site: their roles, and what their tags say of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, named, quoted, value_text
from blast_env.io.importing.heights import HeightReader
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.options import CHARGE_KEYS, VEHICLE_KEY, length_m
from blast_env.io.importing.site_map import MapFeature, SiteMap, Tags

_TO_KERB_M: Final = 1.0  # from the middle of a parked vehicle
_MITRE: Final = 1.5
"""Farthest corner of a kerb over its distance from the street's line: a right angle has 1.41."""


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
        geometry: Its outline, line or point, in the coordinates of the source.
        name: Its name in the source, or an empty string.
        place: Its place in the file.
        height_m: Its height, m, if the source has one.
        protected: Whether the source marks it as protected.
        tnt_kg: Mass of a charge there, if the source has one.
        above_m: Its height above the ground, m, in files of blast-env.
        weight: Its weight among all places, in files of blast-env; `None` without one.
        kind: The value of `building` or `man_made`, in files of blast-env its kind, or the layer of
            a drawing; `roof` of a building without walls.
        part_of: The building of which it is a part: its place in the file, or its name in files of
            blast-env.
        base_m: Height of its underside above the ground, m.
        diameter_m: Diameter of a point that is a round building, m: a silo, a tank, a column.
        carries: Whether the source marks it as a terrace.
        width_m: Width of a street, m.
        is_part: Whether it is a part of a building with a height of its own.
        facade: Its storeys and windows, see `MapFeature`.
        has_z: Whether its heights are coordinates of a drawing or model, from the file's zero.
        is_levelled: Whether that zero is no ground, but the sea or the like.
        ground_m: Height of the ground under it in those coordinates, m, if the source states it.
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
    has_z: bool = False
    is_levelled: bool = False
    ground_m: float | None = None
    fault: str = ""
    above_m: float = 0.0
    weight: float | None = None

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
                shapely.offset_curve(self.geometry, side, join_style="mitre", mitre_limit=_MITRE)
            )


@dataclass(frozen=True)
class Selector:
    """Selects objects by a tag: `building`, `usage=school`, `Layer=A-WALL*`; or by a layer.

    Attributes:
        pattern: Pattern of its value with `*` and `?`, regardless of case; `None` for any value
            but `no`.
    """

    key: str
    pattern: str | None

    @classmethod
    def parsed(cls, text: str, is_drawing: bool) -> "Selector":
        """Return the selector of a text."""
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


_CHARGE_PLACE: Final = "charge_place"
_OWN_STRUCTURES: Final = ("structure", "protected_structure", "terrace")

_KINDS: Final[Mapping[str, Role]] = MappingProxyType(
    {
        "site": Role.SITE,
        "structure": Role.BUILDING,
        "protected_structure": Role.BUILDING,
        "terrace": Role.BUILDING,
        "build_zone": Role.ZONE,
        "keep_out": Role.KEEP_OUT,
        _CHARGE_PLACE: Role.CHARGE,
    }
)
"""Roles of the kinds, and of the layers in lower case, in files of blast-env."""

_ROADS: Final = frozenset(
    f"{road}{link}"
    for road in ("motorway", "trunk", "primary", "secondary", "tertiary")
    for link in ("", "_link")
) | {
    *("unclassified", "residential", "living_street", "service", "road", "track"),
    *("busway", "bus_guideway", "escape", "raceway"),
}
"""Values of OpenStreetMap's `highway` for motor vehicles."""

_WAYS: Final = frozenset({"pedestrian", "footway", "path", "cycleway", "bridleway"})
"""Values of `highway` of ways that are no streets, unless they let motor vehicles in."""

_ENTRY_KEYS: Final = ("motor_vehicle", "motorcar", "vehicle", "hgv", "goods")
_ALL_WALLS: Final = "structures of which some walls counted: all walls do (faces)"
_NO_WEIGHT: Final = "weights of structures, which are not read"
VEHICLES: Final = "entries of vehicles, which an import does not make (a [[charge]] of the site)"
_ON_FOOT: Final = "pedestrian streets, on which no charge is placed (--charges-from)"
_PARKED_IN: Final = "car parks in or below buildings, with no charge there (--charge-at)"
_PARKED_AT: Final = "car parks without an outline, with a charge at their point"

_DIAMETER_KEYS: Final = ("diameter", "diameter_m")
_ROUND: Final = frozenset({"chimney", "gasometer", "silo", "storage_tank", "water_tower"})
"""Values of OpenStreetMap's `man_made` of buildings, most of them round."""

_WALLS: Final = frozenset(
    {"wall", "city_wall", "retaining_wall", "gabion", "block", "jersey_barrier"}
)
"""Values of OpenStreetMap's `barrier` of solid obstacles, which an import does not make."""

_CONSTRUCTIONS: Final = ("Bridge", "BridgePart", "OtherConstruction")
"""Types of CityJSON of other constructions than buildings."""

_NAME_KEYS: Final = ("name", "addr:housename", "text")
_YES: Final = ("yes", "true", "1")
_NO: Final = ("no", "false", "none", "0", "")
_BELOW: Final = ("underground", "subsurface")
_ABOVE: Final = ("roof", "rooftop", "indoor")
_PASSAGE: Final = "building_passage"

_BUILDING_KEYS: Final = ("building", "building:part", "disused:building", "abandoned:building")
"""Keys of what stands. Other prefixes of the life cycle, as in `demolished:building`, do not."""

_NOT_STANDING: Final = frozenset(
    ("proposed", "planned", "construction", "demolished", "razed", "removed", "destroyed")
)
"""Values of `building`, and keys of a building, of what does not stand."""

_OPEN_GROUND: Final = (
    *("natural", "landuse", "leisure", "waterway", "boundary", "place", "railway", "barrier"),
    *("power", "route", "aeroway"),
)
"""Keys of outlines that are no buildings, even if a map marks none."""

_NOT_ON_GROUND: Final = (*_BELOW, "rooftop", "multi-storey", "sheds", "garage_boxes")
_CHIEF_KEYS: Final = (
    *("amenity", "shop", "office", "natural", "landuse", "leisure", "highway", "barrier"),
    *("power", "railway", "waterway", "boundary", "place", "historic", "tourism", "route"),
)
"""Tags that say the kind of an object, by which those without a role are counted."""

_LANE_M: Final = 3.0
_NARROW: Final = _WAYS - {"pedestrian"} | {"service", "track", "living_street"}
_WIDTHS: Final = "widths of streets not in the file"


def things_of(site_map: SiteMap) -> tuple[Thing, ...]:
    """Return the objects of a map with a role in a site, also those with a fault.

    The user's selectors decide, and the usual tags for roles without any. All outlines of a map
    that marks nothing are buildings. The ledger gets the other objects, and unclear heights and
    widths.
    """
    selectors, reader = _selectors(site_map), HeightReader.of(site_map)
    roles = [_role(feature, selectors, site_map) for feature in site_map.features]
    known = ("kind", "highway", "layer", *_BUILDING_KEYS)
    # A map that marks nothing is a plain layer of outlines: buildings.
    if not selectors and not any(
        key in feature.tags for feature in site_map.features for key in known
    ):
        roles = [
            Role.BUILDING if _may_be_building(feature) else None for feature in site_map.features
        ]
    # Parts may name their building by its id.
    wholes = {
        str(feature.tags["id"]): feature.place
        for feature, role in zip(site_map.features, roles, strict=True)
        if role is Role.BUILDING and "id" in feature.tags and not _is_part(feature.tags)
    }
    found = []
    for feature, role in zip(site_map.features, roles, strict=True):
        if role is not None:
            whole = wholes.get(str(feature.tags.get("building_id", "")), "")
            found.append(_thing(feature, role, reader, whole))
        elif fault := _missed(feature.tags):
            found.append(Thing(Role.OTHER, feature.geometry, "", feature.place, fault=fault))
        else:
            chief = next((key for key in (*_CHIEF_KEYS, *feature.tags) if key in feature.tags), "")
            kind = named(chief) if chief else "no tag"
            if site_map.has_layers:
                kind = f"layer {named(str(feature.tags['layer']))}"
            elif "cityjson" in feature.tags:
                kind = named(str(feature.tags["cityjson"]))
            site_map.ledger.add(Fate.PASSED, f"without a role: {kind}", feature.place)
    return tuple(found)


def _missed(tags: Tags) -> str:
    """Return what an object is that an import does not make, though it may matter; else nothing."""
    if _word(tags, "barrier") in _WALLS:
        return "walls of the map, which shield"
    if tags.get("cityjson") in _CONSTRUCTIONS:
        return "constructions that are no buildings, which shield"
    return _ON_FOOT if _word(tags, "highway") == "pedestrian" else ""


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
    usual = _usual_role(feature, site_map.has_layers)
    return None if usual in selectors else usual


def _usual_role(feature: MapFeature, has_layers: bool) -> Role | None:
    tags = feature.tags
    own = _own_kind(tags, has_layers)
    if own in _KINDS:
        return Role.NAME if tags.get("text") else _KINDS[own]
    if any(_says(tags, key) for key in _BUILDING_KEYS):
        return Role.BUILDING
    if _word(tags, "man_made") in _ROUND:
        return Role.BUILDING
    is_passage = _word(tags, "tunnel") == _PASSAGE
    if _road_of(tags) and (is_passage or not _says(tags, "tunnel")):
        return Role.CHARGE
    if _is_car_park(tags) and not feature.geometry.is_empty:
        return Role.CHARGE
    return Role.NAME if tags.get("text") else None


def _road_of(tags: Tags) -> str:
    """Return the value of `highway` of a way for motor vehicles; an empty text for others."""
    kinds = [kind.strip() for kind in _word(tags, "highway").split(";")]
    is_open = any(_word(tags, key) not in ("", *_NO) for key in _ENTRY_KEYS)
    roads = [kind for kind in kinds if kind in _ROADS or (is_open and kind in _WAYS)]
    return roads[0] if roads else ""


def _is_car_park(tags: Tags) -> bool:
    return _word(tags, "amenity") == "parking"


def _own_kind(tags: Tags, has_layers: bool) -> str:
    """Return the kind in a file of blast-env, or the layer of a drawing.

    The tag `layer` of a map says only what is above what.
    """
    return _word(tags, "layer" if has_layers else "kind")


def _word(tags: Tags, key: str) -> str:
    return str(tags.get(key, "")).lower()


def _says(tags: Tags, key: str) -> bool:
    return _word(tags, key) not in _NO


def _is_part(tags: Tags) -> bool:
    return "building:part" in tags and not _says(tags, "building")


def _may_be_building(feature: MapFeature) -> bool:
    """Return whether an object of a map that marks nothing may be a building."""
    return _is_outline(feature.geometry) and not any(key in feature.tags for key in _OPEN_GROUND)


def _kind(tags: Tags, own: str) -> str:
    """Return the kind of a building; see `Thing`."""
    if own in _KINDS:
        return own
    if _word(tags, "wall") == "no" or _word(tags, "walls") == "no":
        return "roof"
    keys = (*_BUILDING_KEYS, "man_made")
    return next((_word(tags, key) for key in keys if _says(tags, key)), own)


def _thing(feature: MapFeature, role: Role, reader: HeightReader, whole: str) -> Thing:
    tags, ledger, has_layers = feature.tags, reader.site_map.ledger, reader.site_map.has_layers
    own = _own_kind(tags, has_layers)
    name_keys = ("title", *_NAME_KEYS) if own in _OWN_STRUCTURES else _NAME_KEYS
    is_building = role is Role.BUILDING
    top_m, base_m = None, 0.0
    # Bodies of models and drawings have heights of their own; for outlines tags are read.
    if is_building and feature.extent_m is not None:
        base_m, top_m = feature.extent_m
    elif is_building:
        top_m, base_m = reader.heights_m(feature)
    if _is_car_park(tags) and is_building:
        ledger.add(Fate.GUESSED, _PARKED_IN, feature.place)
    elif _is_car_park(tags) and not feature.geometry.area:
        ledger.add(Fate.GUESSED, _PARKED_AT, feature.place)
    if own in _OWN_STRUCTURES:
        _note_lost(tags, feature.place, ledger)
    part_of = feature.part_of or whole
    tnt_kg = length_m(tags["tnt_kg"]) if "tnt_kg" in tags else None
    if "tnt_kg" in tags and role is Role.CHARGE and not tnt_kg:
        kind, detail = "masses that cannot be read, --tnt-kg", value_text(tags["tnt_kg"])
        ledger.add(Fate.GUESSED, kind, feature.place, detail=f"tnt_kg is {detail}")
    above_m, weight = (
        length_m(tags.get(key, "")) if role is Role.CHARGE and own == _CHARGE_PLACE else None
        for key in CHARGE_KEYS[1:]
    )
    return Thing(
        role=role,
        geometry=feature.geometry,
        name=next((str(tags[key]) for key in name_keys if tags.get(key)), ""),
        place=feature.place,
        height_m=top_m,
        base_m=base_m,
        diameter_m=_diameter_m(feature, reader.unit_m) if is_building else None,
        protected=own == "protected_structure" or _word(tags, "protected") in _YES,
        part_of=str(tags.get("building", "")) if own in _OWN_STRUCTURES else part_of,
        carries=own == "terrace" or _word(tags, "carries") in _YES,
        tnt_kg=tnt_kg or None,
        kind=_kind(tags, own) if is_building else own,
        width_m=_width_m(feature, reader) if role is Role.CHARGE else None,
        facade=feature.facade,
        has_z=feature.extent_m is not None,
        is_levelled=feature.is_levelled,
        ground_m=feature.ground_m,
        is_part=_is_part(tags),
        fault=_fault(feature, role, has_layers),
        above_m=above_m or 0.0,
        weight=weight or None,
    )


def _note_lost(tags: Tags, place: str, ledger: Ledger) -> None:
    """Enter what a file of blast-env says of a structure, and an import does not read."""
    faces, weight = tags.get("faces"), length_m(tags.get("weight", 1.0))
    if faces:
        ledger.add(Fate.GUESSED, _ALL_WALLS, place, detail=f"only {value_text(faces)} counted")
    if weight not in (None, 1.0):
        ledger.add(Fate.GUESSED, _NO_WEIGHT, place, detail=f"{weight:g}")


def _fault(feature: MapFeature, role: Role, has_layers: bool) -> str:
    """Return why an object cannot be used; an empty string if it can."""
    tags = feature.tags
    if feature.fault:
        return feature.fault
    is_below = _word(tags, "location") in _BELOW
    # In OpenStreetMap `layer` says what is above what; in drawings it is a name.
    if not has_layers and _own_kind(tags, has_layers) not in _KINDS:
        is_below = is_below or _word(tags, "layer").startswith("-")
    is_point = feature.geometry.geom_type in ("Point", "MultiPoint")
    if role in (Role.ZONE, Role.KEEP_OUT) and is_point:
        return "build zones and no-build areas without an outline"
    if role is Role.BUILDING:
        if is_below:
            return "buildings below the ground"
        if _word(tags, "location") in _ABOVE:
            return "buildings on or in others"
        gone = {key for key in (*_NOT_STANDING, "ruins:building") if _says(tags, key)}
        if gone or _word(tags, "building") in _NOT_STANDING:
            return "buildings that are planned, under construction or gone"
        if is_point and _diameter_m(feature, 1.0) is None:
            return "buildings without an outline or a diameter"
    if role is Role.CHARGE:
        if _own_kind(tags, has_layers) == _CHARGE_PLACE and VEHICLE_KEY in tags:
            return VEHICLES
        if is_below:
            return "streets and car parks below the ground"
        if _word(tags, "parking") in _NOT_ON_GROUND:
            return "car parks that are not on the ground"
    return ""


def _diameter_m(feature: MapFeature, unit_m: float) -> float | None:
    """Return the diameter of a point, m, if the source has one."""
    if feature.geometry.geom_type != "Point":
        return None
    key = next((key for key in _DIAMETER_KEYS if key in feature.tags), None)
    if key is None:
        return None
    return length_m(feature.tags[key], 1.0 if key.endswith("_m") else unit_m) or None


def _width_m(feature: MapFeature, reader: HeightReader) -> float | None:
    """Return the width of a street, m; `None` for other places of charges."""
    road = _road_of(feature.tags)
    if not road or _is_outline(feature.geometry):
        return None
    width_m = length_m(feature.tags.get("width", ""), reader.unit_m)
    if width_m:
        return width_m
    lanes = length_m(feature.tags.get("lanes", ""))
    width_m = _LANE_M * (lanes or (1 if road in _NARROW else 2))
    if not lanes:
        detail = f"{width_m:g} m as {named(road)}"
        reader.site_map.ledger.add(Fate.GUESSED, _WIDTHS, feature.place, detail=detail)
    return width_m


def _is_outline(geometry: BaseGeometry) -> bool:
    return geometry.geom_type in ("Polygon", "MultiPolygon")
