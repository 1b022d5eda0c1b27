"""Edits of a scenario: each returns another valid scenario, or raises the library's reasons.

All positions snap to the grid of the modules. LayoutState rules are not repeated here: a changed
scenario goes through `Scenario.from_document`, which reports all its faults.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from math import hypot
from typing import Any, Final, NamedTuple

import shapely
from pydantic import TypeAdapter, ValidationError

from blast_env.bays import STOREY_M
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.sections import PointM
from blast_env.site import (
    SCHEMA_VERSION,
    AnySource,
    AnyStructure,
    RectangleSource,
    Scenario,
    VehicleSource,
)
from blast_env.site.sources import CHARGE_PRESETS, SegmentSource
from blast_env.site.structures import ground_below_m
from blast_env.site.zone import source_bounds_m
from blast_env.units import MODULE_SIDE_M

Document = dict[str, Any]
_HALF: Final = MODULE_SIDE_M / 2.0


class ThingKind(StrEnum):
    """The kinds of things on a site that can be selected."""

    SITE = "site"
    ZONE = "build zone"
    STRUCTURE = "structure"
    CHARGE = "charge"
    KEEP_OUT = "no-build area"
    COST_AREA = "cost area"
    GAUGE = "gauge"
    ITEM = "item"
    MEASURE = "measure"


class SiteThing(NamedTuple):
    """One thing on a site: its kind, and its number within the kind."""

    kind: ThingKind
    number: int = 0


_PATHS: Final[Mapping[ThingKind, tuple[str, ...]]] = {
    ThingKind.SITE: ("site",),
    ThingKind.ZONE: ("build_zone",),
    ThingKind.STRUCTURE: ("structures",),
    ThingKind.CHARGE: ("charge",),
    ThingKind.KEEP_OUT: ("build_zone", "keep_outs"),
    ThingKind.COST_AREA: ("build_zone", "cost_areas"),
    ThingKind.GAUGE: ("gauges",),
    ThingKind.ITEM: ("build_zone", "items"),
    ThingKind.MEASURE: ("build_zone", "hardening"),
}
"""Where each kind is in a scenario file."""

_SINGLE: Final = (ThingKind.SITE, ThingKind.ZONE)
NOWHERE: Final = (ThingKind.SITE, ThingKind.ITEM, ThingKind.MEASURE)
"""Kinds without a place on the plan."""

_DRAWN: Final = (
    *(ThingKind.GAUGE, ThingKind.CHARGE, ThingKind.STRUCTURE),
    *(ThingKind.KEEP_OUT, ThingKind.COST_AREA, ThingKind.ZONE),
)
"""The other kinds, topmost first."""

_OF_BUILDINGS: Final = ("facade", "protected")
"""Values that all structures of a building share."""

_ON_SIDE: Final = "an entry of a vehicle moves along its side of the border, not away from it"
_STRUCTURES: Final = TypeAdapter(tuple[AnyStructure, ...])
_BETTER_GLASS: Final = "window_laminated_6"


def snapped(value_m: float) -> float:
    """Return the nearest multiple of the side of a module."""
    return round(value_m / MODULE_SIDE_M) * MODULE_SIDE_M


def document_of(scenario: Scenario) -> Document:
    """Return a scenario as plain data, without empty fields and with the schema version."""
    document: Document = scenario.model_dump(mode="json", exclude_none=True)
    return {**document, "schema_version": SCHEMA_VERSION}


def changed(scenario: Scenario, edit: Callable[[Document], None]) -> Scenario:
    """Return a scenario with an edit of its document."""
    document = document_of(scenario)
    edit(document)
    zone = scenario.build_zone
    is_whole = zone is not None and zone.stock == sum(zone.catalogue.stocks)
    _fit_catalogue(document, zone.stock if zone is not None and is_whole else None)
    return Scenario.from_document(document, scenario.name)


def things(scenario: Scenario) -> Iterator[tuple[SiteThing, str]]:
    """Yield everything on the site with its label."""
    yield (
        SiteThing(ThingKind.SITE),
        f"site, {scenario.site.width_m:g} x {scenario.site.height_m:g} m",
    )
    for index, structure in enumerate(scenario.structures):
        role = ", protected" if structure.protected else ", terrace" if structure.carries else ""
        title = scenario.title_of(structure.building_name)
        part = "" if title in (structure.name, structure.title) else f"{title}: "
        name = structure.title or structure.name
        yield SiteThing(ThingKind.STRUCTURE, index), f"{part}{name}{role}"
    for index, source in enumerate(scenario.charge):
        called = source.threat or f"charge {index + 1}"
        yield SiteThing(ThingKind.CHARGE, index), f"{called}, {source.tnt_kg:g} kg"
    zone = scenario.build_zone
    if zone is not None:
        yield SiteThing(ThingKind.ZONE), "build zone"
        for index, area in enumerate(zone.keep_outs):
            yield SiteThing(ThingKind.KEEP_OUT, index), f"no-build area: {area.reason}"
        for index, cost_area in enumerate(zone.cost_areas):
            yield SiteThing(ThingKind.COST_AREA, index), f"cost area: {cost_area.reason}"
        for index, item in enumerate(zone.items):
            yield SiteThing(ThingKind.ITEM, index), f"item of the catalogue: {item.name}"
        for index, measure in enumerate(zone.hardening):
            yield SiteThing(ThingKind.MEASURE, index), f"hardening measure: {measure.name}"
    for index, gauge in enumerate(scenario.gauges):
        yield SiteThing(ThingKind.GAUGE, index), f"gauge {gauge.name}"


def has(scenario: Scenario, thing: SiteThing) -> bool:
    """Return whether a thing is (still) on the site."""
    return any(own == thing for own, _ in things(scenario))


def rectangle_of(scenario: Scenario, thing: SiteThing) -> Rectangle:
    """Return the smallest rectangle around a thing, m; around a point, one without extent.

    Items and measures have no place: theirs is the rectangle of the build zone.
    """
    if not has(scenario, thing):
        raise BlastEnvError(f"{scenario.name} has no {thing.kind} {thing.number}")
    kind, number = thing
    if kind is ThingKind.SITE:
        return scenario.site.rectangle_m
    if kind is ThingKind.STRUCTURE:
        return scenario.structures[number].rectangle_m
    if kind is ThingKind.CHARGE:
        return source_bounds_m(scenario.charge[number])
    if kind is ThingKind.GAUGE:
        x_m, y_m, _ = scenario.gauges[number].position_m
        return Rectangle(x_m, y_m, x_m, y_m)
    if kind is ThingKind.KEEP_OUT:
        return scenario.zone.keep_outs[number].rectangle_m
    if kind is ThingKind.COST_AREA:
        return scenario.zone.cost_areas[number].rectangle_m
    return scenario.zone.rectangle_m


def thing_at(scenario: Scenario, x_m: float, y_m: float, reach_m: float) -> SiteThing | None:
    """Return the topmost thing at a place, or `None`; the site itself does not count.

    Args:
        reach_m: Greatest distance from a point or a line that still selects it.
    """
    for thing in _from_the_top(scenario):
        grown_m = reach_m if thing.kind in (ThingKind.GAUGE, ThingKind.CHARGE) else 0.0
        left, bottom, right, top = rectangle_of(scenario, thing).grown(grown_m)
        if not (left <= x_m <= right and bottom <= y_m <= top):
            continue
        is_charge = thing.kind is ThingKind.CHARGE
        if is_charge and _beside(scenario.charge[thing.number], x_m, y_m) > reach_m:
            continue
        if thing.kind is ThingKind.STRUCTURE and not _is_on(
            scenario.structures[thing.number], x_m, y_m
        ):
            continue
        return thing
    return None


def _is_on(structure: AnyStructure, x_m: float, y_m: float) -> bool:
    """Return whether a place in the rectangle around a structure is on it: in no courtyard."""
    outline = structure.footprint
    return outline is None or bool(shapely.intersects_xy(outline.polygon, x_m, y_m))


def _from_the_top(scenario: Scenario) -> list[SiteThing]:
    """Return the things on the plan, topmost first; terraces last, below their structures."""

    def depth(thing: SiteThing) -> tuple[bool, int, int]:
        is_structure = thing.kind is ThingKind.STRUCTURE
        carries = is_structure and scenario.structures[thing.number].carries
        return carries, _DRAWN.index(thing.kind), -thing.number

    return sorted((own for own, _ in things(scenario) if own.kind in _DRAWN), key=depth)


def _beside(source: AnySource, x_m: float, y_m: float) -> float:
    """Return the distance of a place from a source's point or lines, m; 0 for an area."""
    if isinstance(source, RectangleSource):
        return 0.0
    lines_m = source.lines_m if isinstance(source, VehicleSource) else (source.segment_m,)
    return min(_from_line_m(line_m, x_m, y_m) for line_m in lines_m)


def _from_line_m(line_m: tuple[PointM, PointM], x_m: float, y_m: float) -> float:
    """Return the distance of a place from a line, m."""
    (x0, y0), (x1, y1) = line_m
    square = (x1 - x0) ** 2 + (y1 - y0) ** 2
    along = ((x_m - x0) * (x1 - x0) + (y_m - y0) * (y1 - y0)) / (square or 1.0)
    share = min(max(along, 0.0), 1.0)
    return hypot(x_m - x0 - share * (x1 - x0), y_m - y0 - share * (y1 - y0))


def moved(
    scenario: Scenario, thing: SiteThing, by_m: PointM, at_m: PointM | None = None
) -> Scenario:
    """Return the scenario with a thing moved by about `by_m`, onto the grid.

    A vehicle moves by its entries, along their sides of the border; its ground stays.

    Args:
        at_m: Where it is held. Of a vehicle, only the entry nearest to it moves; all without one.
    """
    if thing.kind in NOWHERE:
        return scenario
    vehicle = vehicle_of(scenario, thing)
    if vehicle is not None:
        return _with_entries(scenario, thing, vehicle, by_m, at_m)
    corner = rectangle_of(scenario, thing)
    shift = _HALF if thing.kind is ThingKind.GAUGE else 0.0  # gauges are in the middle of cells
    step = [
        snapped(start + by - shift) + shift - start
        for start, by in zip((corner.left, corner.bottom), by_m, strict=True)
    ]

    def edit(document: Document) -> None:
        own = _own(document, thing)
        for key in ("corner_m", "position_m", "start_m", "end_m"):
            if key in own:
                x_m, y_m, *rest = own[key]
                own[key] = [_plain(x_m + step[0]), _plain(y_m + step[1]), *rest]
        for ring in (own.get("outline_m", []), *own.get("courtyards_m", [])):
            ring[:] = [[_plain(x_m + step[0]), _plain(y_m + step[1])] for x_m, y_m in ring]

    return _settled(scenario, edit)


def vehicle_of(scenario: Scenario, thing: SiteThing) -> VehicleSource | None:
    """Return the vehicle that a thing is, or `None`."""
    source = scenario.charge[thing.number] if thing.kind is ThingKind.CHARGE else None
    return source if isinstance(source, VehicleSource) else None


def held_m(scenario: Scenario, thing: SiteThing, at_m: PointM) -> Rectangle:
    """Return the rectangle of what moves if a thing is held there: of a vehicle, an entry."""
    vehicle = vehicle_of(scenario, thing)
    if vehicle is None:
        return rectangle_of(scenario, thing)
    return vehicle.entries[_entry_at(vehicle, at_m)].bounds_m


def has_size(scenario: Scenario, thing: SiteThing) -> bool:
    """Return whether `resized` changes a thing: not gauges, points, vehicles and polygons."""
    if thing.kind is ThingKind.GAUGE or thing.kind in NOWHERE:
        return False
    if thing.kind is ThingKind.STRUCTURE:
        return scenario.structures[thing.number].footprint is None
    box = rectangle_of(scenario, thing)
    return vehicle_of(scenario, thing) is None and box[:2] != box[2:]


def _entry_at(vehicle: VehicleSource, at_m: PointM) -> int:
    """Return the number of the entry nearest to a place."""
    return min(range(len(vehicle.entries)), key=lambda k: _from_line_m(vehicle.lines_m[k], *at_m))


def _with_entries(
    scenario: Scenario,
    thing: SiteThing,
    vehicle: VehicleSource,
    by_m: PointM,
    at_m: PointM | None,
) -> Scenario:
    """Return the scenario with entries of a vehicle moved along their sides of the border."""
    chosen = range(len(vehicle.entries)) if at_m is None else (_entry_at(vehicle, at_m),)
    steps = {}
    for number in chosen:
        left, bottom, right, top = vehicle.entries[number].bounds_m
        along = (right > left, top > bottom)
        step = [
            snapped(start + by) - start if is_along else 0.0
            for start, by, is_along in zip((left, bottom), by_m, along, strict=True)
        ]
        if any(step):
            steps[number] = step
    if not steps and any(snapped(by) for by in by_m):
        raise BlastEnvError(_ON_SIDE)

    def edit(document: Document) -> None:
        entries = _own(document, thing)["entries"]
        for number, step in steps.items():
            for key in ("start_m", "end_m"):
                pairs = zip(entries[number][key], step, strict=True)
                entries[number][key] = [_plain(at + by) for at, by in pairs]

    return changed(scenario, edit)


def settled_names(before: Scenario, after: Scenario) -> tuple[str, ...]:
    """Return the structures that an edit took onto other ground, with the change of their base."""
    bases_m = {structure.name: structure.base_m for structure in before.structures}
    return tuple(
        f"{own.name} stands on the ground below it, from {own.base_m:g} m"
        f" (before: {bases_m[own.name]:g} m)"
        for own in after.structures
        if own.base_m != bases_m.get(own.name, own.base_m)
    )


def _settled(before: Scenario, edit: Callable[[Document], None]) -> Scenario:
    """Return a changed site on which what stood on the ground below it still does.

    A structure that left its terrace, or whose terrace went, would hang in the air. Structures keep
    their names and their heights above the ground.
    """
    stood_m = {
        own.name: own.base_m
        for own in before.structures
        if not own.carries and own.base_m == ground_below_m(before.structures, own.rectangle_m)
    }

    def settle(document: Document) -> None:
        edit(document)
        try:
            after = _STRUCTURES.validate_python(document["structures"])
        except (ValidationError, BlastEnvError):
            return  # `changed` says what is wrong with them
        for own, section in zip(after, document["structures"], strict=True):
            is_same = own.base_m == stood_m.get(own.name) and not own.carries
            if is_same and not _is_carried(own, after):
                rise_m = ground_below_m(after, own.rectangle_m) - own.base_m
                section["base_m"] = _plain(own.base_m + rise_m)
                if own.height_m is not None:
                    section["height_m"] = _plain(own.height_m + rise_m)

    return changed(before, settle)


def _is_carried(structure: AnyStructure, others: Iterable[AnyStructure]) -> bool:
    """Return whether a structure stands on another one, be that a terrace or not."""
    return structure.base_m > 0.0 and any(
        other.height_m == structure.base_m and other.rectangle_m.overlaps(structure.rectangle_m)
        for other in others
    )


def resized(scenario: Scenario, thing: SiteThing, corner_m: PointM) -> Scenario:
    """Return the scenario with the upper right corner of a thing at another point of the grid.

    Of a line, the end moves there; a thing without extent does not change.
    """
    old = rectangle_of(scenario, thing)
    width_m = max(snapped(corner_m[0] - old.left), MODULE_SIDE_M)
    height_m = max(snapped(corner_m[1] - old.bottom), MODULE_SIDE_M)
    columns, rows = round(width_m / MODULE_SIDE_M), round(height_m / MODULE_SIDE_M)

    def edit(document: Document) -> None:
        own = _own(document, thing)
        if thing.kind is ThingKind.SITE:
            own.update(width_m=_plain(width_m), height_m=_plain(height_m))
        elif "side_modules" in own:
            own["side_modules"] = max(rows, columns)
        elif "rows" in own:
            own.update(rows=rows, columns=columns)
        elif "size_m" in own:
            own["size_m"] = [_plain(width_m), _plain(height_m)]
        elif "end_m" in own:
            own["end_m"] = [_plain(snapped(value)) for value in corner_m]

    return _settled(scenario, edit)


def with_values(scenario: Scenario, thing: SiteThing | None, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario with other values of a thing.

    Args:
        thing: The thing; `None` is the scenario itself.
        values: New values by key of the scenario file; `None` removes a key. The facade of a
            structure, and whether it is protected, are those of its whole building. A charge takes
            the mass of the preset that its new `threat` names.
    """

    def edit(document: Document) -> None:
        own = document if thing is None else _own(document, thing)
        for key, value in values.items():
            for table in _parts_of(document, thing, own) if key in _OF_BUILDINGS else (own,):
                if value is None:
                    table.pop(key, None)
                else:
                    table[key] = value
        if values.get("threat") in CHARGE_PRESETS:
            own["tnt_kg"] = CHARGE_PRESETS[values["threat"]][0]

    return changed(scenario, edit) if "base_m" in values else _settled(scenario, edit)


def _parts_of(document: Document, thing: SiteThing | None, own: Document) -> list[Document]:
    """Return the structures of a structure's building."""
    if thing is None or thing.kind is not ThingKind.STRUCTURE or "building" not in own:
        return [own]
    return [part for part in document["structures"] if part.get("building") == own["building"]]


def removed(scenario: Scenario, thing: SiteThing) -> Scenario:
    """Return the scenario without a thing."""
    if thing.kind is ThingKind.SITE:
        raise BlastEnvError("the site itself cannot be deleted: open another one")

    def edit(document: Document) -> None:
        table, key = _place_of(document, thing.kind)
        if thing.kind in _SINGLE:
            del table[key]
        else:
            del table[key][thing.number]

    return _settled(scenario, edit)


def added(
    scenario: Scenario,
    kind: ThingKind,
    start_m: PointM,
    end_m: PointM,
    height_m: float | None = STOREY_M,
    is_area: bool = False,
) -> tuple[Scenario, SiteThing]:
    """Return the scenario with a new thing, drawn from one place of the grid to another, and it.

    A charge is a point if both places coincide, else a line; with `is_area` it may be anywhere in
    the rectangle between them. A build zone replaces the old one and keeps its other values. A
    structure is `height_m` high, one storey by default, `None` for the height of the air; it stands
    on the terrace below it.
    """
    start = (snapped(start_m[0]), snapped(start_m[1]))
    end = (snapped(end_m[0]), snapped(end_m[1]))
    area = Rectangle(
        _plain(min(start[0], end[0])),
        _plain(min(start[1], end[1])),
        _plain(max(start[0], end[0])),
        _plain(max(start[1], end[1])),
    )
    section = {
        ThingKind.STRUCTURE: lambda: _structure(scenario, area, height_m),
        ThingKind.CHARGE: lambda: (
            {"kind": "rectangle", "tnt_kg": _usual_tnt_kg(scenario), **_sized(area)}
            if is_area
            else _charge(scenario, start, end)
        ),
        ThingKind.KEEP_OUT: lambda: {**_sized(area), "reason": "must stay free"},
        ThingKind.COST_AREA: lambda: {
            **_sized(area),
            "reason": "costly ground",
            **(
                {"cost_factor": 2.0}
                if scenario.zone.items
                else {"module_cost": 2.0 * scenario.zone.module_cost}
            ),
        },
        ThingKind.ITEM: lambda: _item(scenario),
        ThingKind.MEASURE: lambda: _measure(scenario),
        ThingKind.GAUGE: lambda: _gauge(scenario, start_m),
        ThingKind.ZONE: lambda: _zone(scenario, area),
    }[kind]()

    def edit(document: Document) -> None:
        table, key = _place_of(document, kind)
        if kind is ThingKind.ZONE:
            table[key] = {**table.get(key, {}), **section}
        else:
            table[key] = [*table.get(key, []), section]

    if kind in (ThingKind.KEEP_OUT, ThingKind.COST_AREA, ThingKind.ITEM, ThingKind.MEASURE):
        _ = scenario.zone  # refuses a site without one
    after = changed(scenario, edit)
    last = max(own.number for own, _ in things(after) if own.kind is kind)
    return after, SiteThing(kind, last)


def has_road_in_zone(scenario: Scenario) -> bool:
    """Return whether a line on which a charge may be crosses the build zone."""
    zone = scenario.build_zone
    roads = (source for source in scenario.charge if isinstance(source, SegmentSource))
    return zone is not None and any(
        zone.rectangle_m.intersects_segment(*x.segment_m) for x in roads
    )


def _fit_catalogue(document: Document, whole: int | None) -> None:
    """Limit the stock of a zone to the pieces of its catalogue; remove an empty catalogue.

    Args:
        document: The scenario.
        whole: The former stock if it was the whole catalogue, and so remains; else `None`.
    """
    zone = document.get("build_zone") or {}
    if "items" not in zone:
        return
    if not zone["items"]:
        del zone["items"]
        return
    pieces = sum(item["stock"] for item in zone["items"])
    pieces += sum(len(zone.get(key, ())) for key in ("hardening", "removable"))
    if zone.get("stock", 0) > pieces or zone.get("stock") == whole:
        zone.pop("stock", None)


def _place_of(document: Document, kind: ThingKind) -> tuple[Document, str]:
    """Return the table that holds a kind, and its key there."""
    *above, key = _PATHS[kind]
    table = document
    for part in above:
        table = table[part]
    return table, key


def section_of(scenario: Scenario, thing: SiteThing) -> Document:
    """Return the section of the scenario file on a thing."""
    return _own(document_of(scenario), thing)


def _own(document: Document, thing: SiteThing) -> Document:
    table, key = _place_of(document, thing.kind)
    own: Document = table[key] if thing.kind in _SINGLE else table[key][thing.number]
    return own


def _free_name(word: str, things: Iterable[Any]) -> str:
    """Return an unused name: the word and a number."""
    names = {thing.name for thing in things}
    return next(name for name in (f"{word}{n}" for n in range(1, 200)) if name not in names)


def _structure(scenario: Scenario, area: Rectangle, height_m: float | None) -> Document:
    base_m = ground_below_m(scenario.structures, area)
    return {
        "kind": "ModularObstacle",
        "name": _free_name("structure", scenario.structures),
        "corner_m": [area.left, area.bottom],
        "rows": max(round((area.top - area.bottom) / MODULE_SIDE_M), 1),
        "columns": max(round((area.right - area.left) / MODULE_SIDE_M), 1),
        "protected": not any(structure.protected for structure in scenario.structures),
        **({"base_m": base_m} if base_m else {}),
        **({} if height_m is None else {"height_m": base_m + height_m}),
    }


def _charge(scenario: Scenario, start: PointM, end: PointM) -> Document:
    tnt_kg = _usual_tnt_kg(scenario)
    if start == end:
        return {"kind": "point", "position_m": [*start], "tnt_kg": tnt_kg}
    return {"kind": "segment", "start_m": [*start], "end_m": [*end], "tnt_kg": tnt_kg}


def _usual_tnt_kg(scenario: Scenario) -> float:
    return scenario.charge[0].tnt_kg


def _gauge(scenario: Scenario, at_m: PointM) -> Document:
    place = [_plain(snapped(value - _HALF) + _HALF) for value in at_m]
    return {"name": _free_name("gauge", scenario.gauges), "position_m": [*place, 1.25]}


def _item(scenario: Scenario) -> Document:
    return {
        "name": _free_name("wall", scenario.zone.items),
        "length_modules": 4,
        "thickness_modules": 1,
        "height_m": scenario.zone.height_m or 3.0,
        "cost": 4.0 * scenario.zone.module_cost,
        "stock": max(scenario.zone.stock // 4, 1),
    }


def _measure(scenario: Scenario) -> Document:
    return {
        "name": _free_name("glass", scenario.zone.hardening),
        "glazing": _BETTER_GLASS,
        "cost": 1000.0,
    }


def _zone(scenario: Scenario, area: Rectangle) -> Document:
    rows = max(round((area.top - area.bottom) / MODULE_SIDE_M), 1)
    columns = max(round((area.right - area.left) / MODULE_SIDE_M), 1)
    section: Document = {"corner_m": [area.left, area.bottom], "rows": rows, "columns": columns}
    if scenario.build_zone is None:
        section["stock"] = max(min(rows * columns // 4, 16), 1)
    return section


def _sized(area: Rectangle) -> Document:
    width_m = max(area.right - area.left, MODULE_SIDE_M)
    height_m = max(area.top - area.bottom, MODULE_SIDE_M)
    return {"corner_m": [area.left, area.bottom], "size_m": [width_m, height_m]}


def _plain(value: float) -> float:
    """Return a length without rounding errors and negative zero."""
    return round(value, 9) + 0.0
