"""The features of a site, as one list for all pictures, drawings and maps.

A kind of feature defines its name in legends and its look once. The back ends (matplotlib,
the page's SVG, DXF and GeoJSON) draw any kind by its geometry and its look; none of them lists the
kinds again. So a new condition of the build zone is one more feature in `zone_features`.

Coordinates are local: x to the right and y upwards from the lower left corner of the site.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from textwrap import wrap
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import WALLS, Element, Piece, Rectangle, Wall, stacked_runs, standing
from blast_env.layout.build_site import barrier_outline, vehicle_drive, vehicle_reach, worst_places
from blast_env.particles.objects import Colour
from blast_env.sections import PointM
from blast_env.site import (
    AnySource,
    AnyStructure,
    BuildZone,
    PointSource,
    RectangleSource,
    Scenario,
    VehicleSource,
)
from blast_env.site.blast_site import Charge
from blast_env.site.structures import buildings_of, ground_below_m, is_open_below, levels_of
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.drive import Impact
from blast_env.vehicles.driving import WayPoint
from blast_env.vehicles.worst_places import nearest_point_m

PAGE: Final[Colour] = (255, 255, 255)
SITE: Final[Colour] = (245, 247, 250)
INK: Final[Colour] = (30, 34, 42)
QUIET_INK: Final[Colour] = (92, 99, 110)
FAINT: Final[Colour] = (206, 211, 219)
EXPLOSIVE: Final[Colour] = (226, 28, 36)
BORDER: Final[Colour] = (200, 20, 40)
STRUCTURE: Final[Colour] = (104, 98, 88)
PROTECTED: Final[Colour] = (0, 128, 112)
BARRIER: Final[Colour] = (12, 12, 14)
_DEARER: Final[Colour] = (253, 214, 122)
_WAY: Final[Colour] = (26, 89, 217)
_GAUGE: Final[Colour] = (123, 45, 139)

_ITEMS: Final[tuple[Colour, ...]] = (
    *((0, 114, 178), (230, 159, 0), (204, 121, 167), (86, 180, 233)),
    *((240, 228, 66), (140, 86, 41), (107, 79, 168), (250, 168, 140)),
)
"""Colours of Okabe and Ito without the red of charges and the green of protected structures, and
three others."""

_DARKER: Final = 0.6  # factor for a ninth item, which has the colour of the first one, darker
_DIGITS: Final = 9  # decimals of a metre; further digits are rounding errors
_WAY_PLACES: Final = (0.5, 0.75, 0.25, 0.875, 0.125, *((k + 0.5) / 32 for k in range(32)))


@dataclass(frozen=True)
class Look:
    """The look of features of a kind.

    Attributes:
        line: Colour of outlines, lines and signs; without one, areas have no outline.
        width: Width of lines, points.
        dashed: Whether lines are dashed.
        arrows: Whether a line has an arrow at both ends.
        fill: Colour of an area; without one, it is open.
        opacity: Opacity of the fill, 0 to 1.
        hatched: Whether an area is filled with slanted lines.
        sign: Marker of a single point.
        drawn_dashed: Whether drawings, which have no fills, show it with dashes: a condition
            rather than an object.
        cad_colour: Its colour in drawings, from AutoCAD's colour index.
    """

    line: Colour | None = None
    width: float = 1.0
    dashed: bool = False
    arrows: bool = False
    fill: Colour | None = None
    opacity: float = 1.0
    hatched: bool = False
    sign: Literal["star", "ring"] = "star"
    drawn_dashed: bool = False
    cad_colour: int = 7


@dataclass(frozen=True)
class FeatureKind:
    """A kind of feature.

    Attributes:
        name: Name of its layer in drawings and of its `kind` in maps.
        words: Name in legends.
        level: Order of drawing; kinds of a higher level lie on top.
        named: Place of its name in drawings: inside it, explained by a letter beside it, or none.
    """

    name: str
    words: str
    level: float
    look: Look
    named: Literal["inside", "letter", ""] = "letter"


class Kinds:
    """All kinds of features."""

    SITE: Final = FeatureKind(
        "site", "site border", 1.0, Look(BORDER, 1.8, fill=SITE, cad_colour=8), named=""
    )
    COST_AREA: Final = FeatureKind(
        "cost_area",
        "building has another cost",
        1.2,
        Look(fill=_DEARER, drawn_dashed=True, cad_colour=6),
    )
    REACHED: Final = FeatureKind(
        "reached",
        "ground that a vehicle reaches",
        1.4,
        Look(fill=EXPLOSIVE, opacity=0.16, cad_colour=11),
        named="",
    )
    KEEP_OUT: Final = FeatureKind(
        "keep_out", "no-build area", 1.5, Look(hatched=True, drawn_dashed=True, cad_colour=30)
    )
    BUILD_ZONE: Final = FeatureKind(
        "build_zone",
        "build zone",
        1.6,
        Look(QUIET_INK, 0.9, dashed=True, drawn_dashed=True, cad_colour=3),
    )
    GATE: Final = FeatureKind(
        "gate",
        "gate of the access way",
        1.7,
        Look(_WAY, fill=_WAY, opacity=0.3, drawn_dashed=True, cad_colour=5),
    )
    CHARGE_PLACE: Final = FeatureKind(
        "charge_place",
        "charge",
        2.0,
        Look(EXPLOSIVE, 2.6, fill=EXPLOSIVE, opacity=0.35, drawn_dashed=True, cad_colour=1),
    )
    ACCESS_WAY: Final = FeatureKind(
        "access_way",
        "access way that stays open",
        2.2,
        Look(_WAY, 1.8, arrows=True, drawn_dashed=True, cad_colour=5),
    )
    TERRACE: Final = FeatureKind(
        "terrace",
        "terrace that carries barriers",
        1.3,
        Look(STRUCTURE, 1.6, fill=STRUCTURE, opacity=0.15, cad_colour=34),
        named="inside",
    )
    TAKEN_AWAY: Final = FeatureKind(
        "taken_away",
        "structure that is taken away",
        2.9,
        Look(STRUCTURE, 1.2, dashed=True, fill=FAINT, opacity=0.7, drawn_dashed=True, cad_colour=9),
        named="inside",
    )
    STRUCTURE: Final = FeatureKind(
        "structure",
        "other structure",
        3.0,
        Look(STRUCTURE, 1.6, fill=STRUCTURE, opacity=0.15, cad_colour=7),
        named="inside",
    )
    PROTECTED_STRUCTURE: Final = FeatureKind(
        "protected_structure",
        "protected structure",
        3.1,
        Look(PROTECTED, 2.4, fill=PROTECTED, opacity=0.2, cad_colour=132),
        named="inside",
    )
    BARRIER: Final = FeatureKind(
        "barrier",
        "barrier module",
        4.0,
        Look(PAGE, 0.4, fill=_ITEMS[0], cad_colour=140),
        named="",
    )
    STAND_OFF: Final = FeatureKind(
        "stand_off", "stand-off", 4.8, Look(INK, 1.4, dashed=True, cad_colour=7), named=""
    )
    VEHICLE_WAY: Final = FeatureKind(
        "vehicle_way",
        "way of a vehicle, with the largest speeds",
        4.7,
        Look(EXPLOSIVE, 1.6, cad_colour=1),
        named="",
    )
    GAUGE: Final = FeatureKind(
        "gauge", "gauge", 4.9, Look(_GAUGE, 1.6, sign="ring", cad_colour=200)
    )
    CHARGE: Final = FeatureKind("charge", "charge", 5.0, Look(EXPLOSIVE, 2.2, cad_colour=1))


STANDING: Final = (Kinds.TERRACE, Kinds.STRUCTURE, Kinds.PROTECTED_STRUCTURE, Kinds.BARRIER)
"""Kinds that stand on the ground and have a height."""

_ON_LEVELS: Final = (Kinds.COST_AREA, Kinds.KEEP_OUT, Kinds.BUILD_ZONE)
"""Kinds that lie on the ground or on terraces."""

SITE_KINDS: Final = tuple(var for var in vars(Kinds).values() if isinstance(var, FeatureKind))
"""All kinds, the lowest first."""

FREE_CELL: Final = FeatureKind("free_cell", "free cell", 1.12, Look(fill=(214, 238, 219)))
NO_CELL: Final = FeatureKind(
    "no_cell", "cell not available", 1.1, Look(fill=(226, 228, 232), hatched=True)
)
"""Kinds of cells, shown in pictures of a layout in progress only, not in maps and drawings."""


@dataclass(frozen=True)
class Feature:
    """One feature of the site.

    Attributes:
        places_m: (x, y) of a point, of the two ends of a line, or of the corners of an area,
            counterclockwise, for a rectangle from the lower left one.
        name: For people: a structure's name, the reason of a no-build area, a module's identifier.
        properties: Further properties; plain values, units in the keys.
        words: Name in legends, if it differs from that of its kind.
        label: Text beside it in pictures.
        fill: The colour of its area, if it differs from that of its kind.
        is_raised: Whether there is air below it.
        holes_m: Corners of the holes of an area, clockwise.
        boxes_m: The modules of a polygon in rectangles; empty for other areas.
    """

    kind: FeatureKind
    places_m: tuple[PointM, ...]
    name: str
    properties: Mapping[str, str | float | bool] = field(default_factory=dict)
    words: str = ""
    label: str = ""
    fill: Colour | None = None
    is_raised: bool = False
    holes_m: tuple[tuple[PointM, ...], ...] = ()
    boxes_m: tuple[Rectangle, ...] = ()

    @property
    def look(self) -> Look:
        """Its look: that of its kind, with dashes if there is air below it."""
        look = self.kind.look
        return replace(look, dashed=True, drawn_dashed=True) if self.is_raised else look

    @property
    def title(self) -> str:
        """Its name in legends."""
        return self.words or self.kind.words

    @property
    def colour(self) -> Colour | None:
        """The colour of its area."""
        return self.fill or self.kind.look.fill

    @property
    def rings_m(self) -> tuple[tuple[PointM, ...], ...]:
        """The corners of an area, and those of its holes."""
        return self.places_m, *self.holes_m

    @property
    def bounds_m(self) -> Rectangle:
        """The smallest rectangle around it."""
        x, y = zip(*self.places_m, strict=True)
        return Rectangle(min(x), min(y), max(x), max(y))

    @property
    def above_ground_m(self) -> float:
        """Height of a point above the ground, m; 0 if not given."""
        return self._metres("above_ground_m")

    @property
    def base_m(self) -> float:
        """Height of its base above the ground, m; 0 if not given."""
        return self._metres("base_m")

    def _metres(self, key: str) -> float:
        value_m = self.properties.get(key, 0.0)
        assert isinstance(value_m, float)
        return value_m


def site_features(
    scenario: Scenario, layout: Sequence[Element] = (), charge: Charge | None = None
) -> tuple[Feature, ...]:
    """Return the features of a scenario with a layout, the lowest first.

    Args:
        layout: The layout of the build zone; it must fit there.
        charge: The charge, if known.
    """
    zone, there = scenario.build_zone, scenario.structures_with(layout)
    found = [area_feature(Kinds.SITE, scenario.site.rectangle_m, scenario.name)]
    if zone is not None:
        barriers = [*barrier_features(scenario, layout)]
        # Cells that may be built on end where structures and pieces stand.
        found += zone_features(
            zone,
            [box for structure in there for box in structure.boxes_m],
            [barrier.bounds_m for barrier in barriers],
        )
        found += barriers
    found += structure_features(there)
    found += (
        _structure_feature(Kinds.TAKEN_AWAY, structure)
        for structure in scenario.structures
        if structure not in there
    )
    found += source_features(scenario.charge)
    if charge is not None:
        found.append(charge_feature(charge, f"charge of {charge.tnt_kg:g} kg TNT"))
    for gauge in scenario.gauges:
        x_m, y_m, z_m = gauge.position_m
        above = {"above_ground_m": z_m}
        place = (rounded_m(x_m, y_m),)
        found.append(Feature(Kinds.GAUGE, place, gauge.name, above, label=gauge.name))
    return in_order(found)


def blast_features(
    scenario: Scenario, layout: Sequence[Element], charge: Charge
) -> tuple[Feature, ...]:
    """Return the features of a site with one charge, without the possible places of charges."""
    return without(site_features(scenario, layout, charge), Kinds.CHARGE_PLACE)


def in_order(features: Iterable[Feature]) -> tuple[Feature, ...]:
    """Return features in the order of drawing: the topmost last."""
    return tuple(sorted(features, key=lambda feature: feature.kind.level))


def without(features: Iterable[Feature], *kinds: FeatureKind) -> tuple[Feature, ...]:
    """Return the features of all but the given kinds."""
    return tuple(feature for feature in features if feature.kind not in kinds)


def in_boxes(features: Iterable[Feature]) -> Iterator[Feature]:
    """Yield features, polygons as the rectangles of their modules."""
    for feature in features:
        if not feature.boxes_m:
            yield feature
        for number, box in enumerate(feature.boxes_m):
            area = area_feature(feature.kind, box, feature.name)
            label = "" if number else feature.label
            yield replace(feature, places_m=area.places_m, holes_m=(), boxes_m=(), label=label)


def on_levels(features: Iterable[Feature], structures: Sequence[AnyStructure]) -> Iterator[Feature]:
    """Yield features, those of the build zone cut where the ground changes its height.

    Parts on a terrace have its height as their `base_m`.

    Args:
        structures: Those of the site, terraces among them.
    """
    for feature in features:
        if feature.kind not in _ON_LEVELS:
            yield feature
            continue
        for height_m, parts in levels_of(structures, feature.bounds_m).items():
            said = {**feature.properties, **({"base_m": height_m} if height_m else {})}
            for part in parts:
                area = area_feature(feature.kind, part, feature.name, **said)
                yield replace(area, label=feature.label)


def without_counts(features: Iterable[Feature]) -> tuple[Feature, ...]:
    """Return features whose legends do not count pieces, for pictures of several layouts."""
    return tuple(replace(feature, words=feature.words.split(":")[0]) for feature in features)


def area_feature(
    kind: FeatureKind, rectangle_m: Rectangle, name: str, **properties: str | float | bool
) -> Feature:
    """Return a rectangle as a feature."""
    left, bottom, right, top = rectangle_m
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return Feature(kind, tuple(rounded_m(x, y) for x, y in corners), name, properties)


def charge_feature(charge: Charge, name: str, label: str = "") -> Feature:
    """Return a charge at its place."""
    said = {"tnt_kg": charge.tnt_kg, "above_ground_m": charge.height_m}
    return Feature(Kinds.CHARGE, (rounded_m(*charge.position_m),), name, said, label=label)


# The build zone.


def zone_features(
    zone: BuildZone, structures_m: Sequence[Rectangle], barriers_m: Sequence[Rectangle] = ()
) -> list[Feature]:
    """Return the build zone and every condition of it that has a place.

    Args:
        structures_m: Rectangles of the structures, which the drawn access way avoids.
        barriers_m: Rectangles of the barriers, which it avoids where a straight way is left.
    """
    conditions: dict[str, str | float] = {"stock": zone.stock, "clearance_m": zone.clearance_m}
    if zone.items:
        conditions["items"] = ", ".join(f"{item.stock} {item.name}" for item in zone.items)
    else:
        conditions["module_cost"] = zone.module_cost
    if zone.budget is not None:
        conditions["budget"] = zone.budget
    if zone.access_way is not None:
        conditions["access_way"] = zone.access_way.description
    found = [area_feature(Kinds.BUILD_ZONE, zone.rectangle_m, "build zone", **conditions)]
    for area in zone.cost_areas:
        costs = area.model_dump(include={"module_cost", "cost_factor"}, exclude_none=True)
        found.append(area_feature(Kinds.COST_AREA, area.rectangle_m, area.reason, **costs))
    found += (
        area_feature(Kinds.KEEP_OUT, keep_out.rectangle_m, keep_out.reason)
        for keep_out in zone.keep_outs
    )
    return [*found, *_way_features(zone, structures_m, barriers_m)]


def _way_features(
    zone: BuildZone, structures_m: Sequence[Rectangle], barriers_m: Sequence[Rectangle]
) -> Iterator[Feature]:
    """Yield the access way of a zone and its gate.

    A scenario does not fix the course of the way. Its arrow is straight, through the gate: it
    avoids structures and barriers, else only structures, as where the way that is left is winding.
    """
    way = zone.access_way
    if way is None:
        return
    across_m = zone.rectangle_m if way.gate is None else way.gate.rectangle_m
    if way.gate is not None:
        yield area_feature(Kinds.GATE, across_m, "gate of the access way")
    arrows = [_arrow(zone, across_m, share) for share in _WAY_PLACES]
    beside_m = way.width_m / 2.0 - MODULE_SIDE_M / 4.0  # whole modules are left beside its middle
    grown_m = [barrier_m.grown(beside_m) for barrier_m in barriers_m]
    for avoided_m in ([*structures_m, *grown_m], structures_m):
        free = (
            arrow
            for arrow in arrows
            if not any(box.intersects_segment(*arrow) for box in avoided_m)
        )
        if arrow := next(free, None):
            break
    ends = arrow or arrows[0]
    yield Feature(Kinds.ACCESS_WAY, tuple(rounded_m(*end) for end in ends), way.description)


def _arrow(zone: BuildZone, across_m: Rectangle, share: float) -> tuple[PointM, PointM]:
    """Return a straight access way through a zone, at a share of a gate or of the zone."""
    assert zone.access_way is not None
    left, bottom, right, top = zone.rectangle_m
    if zone.access_way.between == "left_right":
        y = across_m.bottom + share * (across_m.top - across_m.bottom)
        return (left, y), (right, y)
    x = across_m.left + share * (across_m.right - across_m.left)
    return (x, bottom), (x, top)


def cell_features(zone: BuildZone, cells: BoolArray) -> Iterator[Feature]:
    """Yield areas of free and of other cells; `cells` (rows, columns) is true for free ones."""
    for kind, chosen in ((NO_CELL, ~cells), (FREE_CELL, cells)):
        for rectangle in rectangles_of(chosen, zone.corner_m):
            yield area_feature(kind, rectangle, kind.words)


def item_colours(zone: BuildZone | None) -> Mapping[str, Colour]:
    """Return the colour of each item of a catalogue; single modules have the name `""`."""
    names = [""] if zone is None or not zone.items else [item.name for item in zone.items]
    colours: dict[str, Colour] = {}
    for number, name in enumerate(names):
        darker = _DARKER ** (number // len(_ITEMS))
        red, green, blue = (round(darker * part) for part in _ITEMS[number % len(_ITEMS)])
        colours[name] = (red, green, blue)
    return MappingProxyType(colours)


def item_words(zone: BuildZone, layout: Sequence[Element]) -> Mapping[str, str]:
    """Return the name of each item in legends, with its height and the placed part of the stock."""
    placed = Counter(element.item if isinstance(element, Piece) else "" for element in layout)
    heights = {item.name: f"{item.height_m:g} m" for item in zone.items}
    stocks = {item.name: item.stock for item in zone.items}
    if not zone.items:
        heights[""] = "as high as the air" if zone.height_m is None else f"{zone.height_m:g} m"
        stocks[""] = zone.stock
    return {
        name: f"{name or 'barrier module'}, {height}: {placed[name]} of {stocks[name]}"
        for name, height in heights.items()
    }


def barrier_features(scenario: Scenario, layout: Sequence[Element]) -> Iterator[Feature]:
    """Yield the modules of a layout, or its pieces as wholes, with the names of the tables.

    Heights are those of the top above the ground; barriers on a terrace have a `base_m`, too.
    """
    zone = scenario.zone
    colours, words = item_colours(zone), item_words(zone, layout)
    if zone.items:
        items = {item.name: item for item in zone.items}
        for piece in standing(layout):
            assert isinstance(piece, Piece)
            item = items[piece.item]
            rectangle_m = zone.element_rectangle_m(piece)
            feature = area_feature(
                Kinds.BARRIER,
                rectangle_m,
                zone.piece_name(piece),
                **piece._asdict(),
                **_ends_of(scenario, rectangle_m, item.height_m),
                unit_cost=item.cost,
                stops_vehicles=item.stops_vehicles,
            )
            yield replace(feature, fill=colours[piece.item], words=words[piece.item])
        return
    # Single modules, one feature each.
    outline = barrier_outline(scenario, tuple(layout))
    for row, column in outline.filled:
        rectangle_m = zone.element_rectangle_m((row, column))
        ends = _ends_of(scenario, rectangle_m, zone.height_m)
        name, cell = outline.module_name(row, column), {"row": row, "column": column}
        feature = area_feature(Kinds.BARRIER, rectangle_m, name, **cell, **ends)
        yield replace(feature, fill=colours[""], words=words[""])


def _ends_of(
    scenario: Scenario, rectangle_m: Rectangle, height_m: float | None
) -> dict[str, float]:
    """Return the top of a barrier above the ground, m, and its base if it is on a terrace."""
    base_m = ground_below_m(scenario.structures, rectangle_m)
    top = {} if height_m is None else {"height_m": base_m + height_m}
    return {**top, "base_m": base_m} if base_m else top


# Structures and charges.


_MOST_LABELS: Final = 4  # of charges that are alike
_LINE: Final = 20
_MOST_LINES: Final = 3


def wrapped(title: str) -> str:
    """Return a title for a picture: in lines of at most 20 characters, three at most."""
    return "\n".join(wrap(title, _LINE, max_lines=_MOST_LINES, placeholder=" ..."))


def structure_features(structures: Iterable[AnyStructure]) -> Iterator[Feature]:
    """Yield the structures; the largest part of a building in several parts has the label."""
    structures = tuple(structures)
    for name, parts in buildings_of(structures).items():
        largest = max(parts, key=lambda part: part.modules)
        heights = [part.height_m for part in parts if part.height_m is not None]
        words = wrapped(largest.title) or name
        label = f"{words}\n{max(heights):g} m" if len(heights) == len(parts) else words
        for part in parts:
            kind = Kinds.TERRACE if part.carries else Kinds.STRUCTURE
            kind = Kinds.PROTECTED_STRUCTURE if part.protected else kind
            outline = _structure_feature(kind, part)
            is_raised = is_open_below(part, structures)
            words = f"{kind.words} above the ground" if is_raised else ""
            label_here = label if part is largest else ""
            yield replace(outline, label=label_here, words=words, is_raised=is_raised)


def _structure_feature(kind: FeatureKind, structure: AnyStructure) -> Feature:
    said = _said_of(structure)
    feature = area_feature(kind, structure.rectangle_m, structure.name, **said)
    if structure.footprint is not None:
        outline, *courtyards = (
            tuple(rounded_m(*place) for place in ring) for ring in structure.footprint.rings
        )
        return replace(
            feature, places_m=outline, holes_m=tuple(courtyards), boxes_m=structure.boxes_m
        )
    return feature


def _said_of(structure: AnyStructure) -> dict[str, str | float | bool]:
    """Return the properties of a structure, without those that are None or a base of 0."""
    said = {
        "weight": structure.weight,
        "height_m": structure.height_m,
        "base_m": structure.base_m or None,
        "building": structure.building,
        "title": structure.title or None,
        "carries": structure.carries or None,
        "faces": None if structure.faces == WALLS else ",".join(structure.faces),
    }
    return {key: item for key, item in said.items() if item is not None}


def source_features(sources: Iterable[AnySource]) -> Iterator[Feature]:
    """Yield the possible places of charges: points, lines or areas, or the entries of vehicles.

    Of many that are alike only the first has a label, for all.
    """
    sources = tuple(sources)
    groups = Counter(map(_charge_of, sources))
    begun = set()
    for number, source in enumerate(sources, start=1):
        own = _charge_of(source)
        count = groups[own] if groups[own] > _MOST_LABELS else 0
        for feature in _places_of(source, number, count):
            yield replace(feature, label="") if own in begun else feature
        if count:
            begun.add(own)


def _charge_of(source: AnySource) -> tuple[bool, float, float]:
    return isinstance(source, VehicleSource), source.tnt_kg, source.height_m


def _places_of(source: AnySource, number: int, count: int) -> Iterator[Feature]:
    """Yield the places of a source; of one of `count` alike, labelled with their number."""
    name = f"charge of {source.tnt_kg:g} kg TNT may be here"
    raised = f", {source.height_m:g} m up" if source.height_m > 0.0 else ""
    said: dict[str, str | float | bool] = {"tnt_kg": source.tnt_kg, "weight": source.weight}
    said |= {"above_ground_m": source.height_m}
    label = f"{count} charges" if count else f"charge {number}"
    label, words, kind = f"{label}: {source.tnt_kg:g} kg{raised}", "", Kinds.CHARGE_PLACE
    if isinstance(source, RectangleSource):
        area, words = area_feature(kind, source.rectangle_m, name), "area in which a charge may be"
        yield Feature(kind, area.places_m, name, said, words, label)
        return
    if isinstance(source, VehicleSource):
        name, words = f"vehicle with {source.tnt_kg:g} kg TNT enters here", "entry of a vehicle"
        label = label.replace("charge", "vehicle")
        said |= {"width_m": source.width_m}
    elif not isinstance(source, PointSource):
        words = "road on which a charge may be"
    for ends_m in source.lines_m:
        line_m = ends_m[:1] if isinstance(source, PointSource) else ends_m
        yield Feature(kind, tuple(rounded_m(*end) for end in line_m), name, said, words, label)
        label = ""  # once for all entries


# Vehicles: their features follow from a layout, not from the scenario alone.


def vehicle_features(scenario: Scenario, layout: Sequence[Element] = ()) -> tuple[Feature, ...]:
    """Return the ground that vehicles reach, their worst places and ways, and the stand-offs.

    A stand-off is a line from a vehicle's worst place to the nearest assessed wall, with its
    length in metres.

    Args:
        scenario: The scenario; without a vehicle there are no features.
        layout: The layout of the build zone.
    """
    found: list[Feature] = []
    for source in scenario.vehicles:
        ground = vehicle_reach(scenario, source, layout).ground(*scenario.site.squares)
        found += (
            area_feature(Kinds.REACHED, rectangle, Kinds.REACHED.words)
            for rectangle in rectangles_of(ground)
        )
        place_m = worst_places(scenario, source, layout).places_m[0]
        found.append(stand_off_feature(scenario.loaded_walls, place_m))
        said = {"tnt_kg": source.tnt_kg, "above_ground_m": source.height_m}
        words = "worst place of a vehicle"
        found.append(Feature(Kinds.CHARGE, (place_m,), words, said, words))
        found += _way_of_vehicle(*vehicle_drive(scenario, source, layout).weakest_way)
    return in_order(found)


def stand_off_feature(walls: Sequence[Wall], place_m: PointM) -> Feature:
    """Return the line from a place to the nearest assessed wall, with its length in metres."""
    wall_m = nearest_point_m(walls, place_m)
    length = f"stand-off {np.hypot(*np.subtract(place_m, wall_m)):.1f} m"
    return Feature(Kinds.STAND_OFF, (place_m, wall_m), "stand-off", label=length)


def _way_of_vehicle(way: Sequence[WayPoint], through: Sequence[Impact]) -> Iterator[Feature]:
    """Yield the straight parts of a vehicle's way, its speed at the entry, and its impacts.

    Args:
        way: Its places and speeds.
        through: The pieces that it breaks through, with its speed at each.
    """
    if len(way) < 2:
        return
    bends = [way[0]]
    for one, here, other in zip(way, way[1:], way[2:], strict=False):
        before, after = (np.subtract(b.place_m, a.place_m) for a, b in ((one, here), (here, other)))
        if abs(before[0] * after[1] - before[1] * after[0]) > 1e-9:
            bends.append(here)
    bends.append(way[-1])
    labels = {bends[0].place_m: f"{bends[0].speed_km_h:.0f} km/h"}
    for start, end in pairwise(bends):
        said = {"speed_km_h": round(end.speed_km_h, 1)}
        label = labels.get(start.place_m, "")
        yield Feature(Kinds.VEHICLE_WAY, (start.place_m, end.place_m), "way", said, label=label)
    for impact in through:
        words = f"{impact.piece.name} gives way"
        middle = rounded_m(*impact.piece.rectangle.centre)
        said = {"speed_km_h": round(impact.speed_km_h, 1)}
        label = f"{impact.speed_km_h:.0f} km/h"
        yield Feature(Kinds.VEHICLE_WAY, (middle, middle), words, said, label=label)


def stand_off_text(scenario: Scenario, layout: Sequence[Element]) -> str:
    """Return the least stand-off with a layout and without, as text; empty without vehicles."""
    if not scenario.vehicles:
        return ""
    with_layout, unprotected = (
        min(
            worst_places(scenario, source, layout_tried).stand_off_m for source in scenario.vehicles
        )
        for layout_tried in (layout, ())
    )
    if not layout:
        return f"stand-off {unprotected:.1f} m"
    return f"stand-off {with_layout:.1f} m, {unprotected:.1f} m without the barrier"


def rectangles_of(
    squares: BoolArray, corner_m: PointM = (0.0, 0.0), side_m: float = MODULE_SIDE_M
) -> list[Rectangle]:
    """Return few rectangles that together cover the given squares of a grid exactly.

    Args:
        squares: Mask of the squares (rows, columns), the lowest row first.
        corner_m: Lower left corner of the grid.
    """
    x_m, y_m = corner_m
    return [
        Rectangle(
            side_m * column + x_m,
            side_m * row + y_m,
            side_m * (column + columns) + x_m,
            side_m * (row + rows) + y_m,
        )
        for row, column, rows, columns in stacked_runs(squares).tolist()
    ]


def rounded_m(x_m: float, y_m: float) -> PointM:
    """Return a place, in metres, without rounding errors."""
    return round(x_m, _DIGITS), round(y_m, _DIGITS)
