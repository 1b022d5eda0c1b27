"""Checks of a build zone: its catalogue, its areas, and the existence of a legal place."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import TOLERANCE_M, Rectangle
from blast_env.problems import Problem, extent
from blast_env.sections import Area
from blast_env.site.content import Content
from blast_env.site.zone import BuildZone, EmptyZone, Surroundings, empty_zone
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.access_way import AccessWay, closing_places, is_open

MOST_PLACES: Final = 10_000_000
"""Most places: cells times variants, each of which takes some ten bytes."""


MOST_COVERED: Final = 1_000_000_000
"""Most cells under all pieces at all their places: each takes a nanosecond, several times."""


def place_count_problems(zone: BuildZone) -> Iterator[Problem]:
    """Yield the problems of a zone with too many places, which are counted but not made."""
    variants = zone.catalogue.variants
    places = zone.rows * zone.columns * len(variants)
    if places > MOST_PLACES:
        message = f"make {places:,} places of pieces in the zone, must make at most {MOST_PLACES:,}"
        yield Problem("build_zone.items", message)
    covered = sum(
        variant.rows * variant.columns * max(zone.rows - variant.rows + 1, 0) * right
        for variant in variants
        if (right := zone.columns - variant.columns + 1) > 0
    )
    if covered > MOST_COVERED:
        message = f"cover {covered:,} cells at all their places together, must cover at most"
        yield Problem("build_zone.items", f"{message} {MOST_COVERED:,}")


def build_zone_problems(surroundings: Surroundings) -> Iterator[Problem]:
    """Yield the problems of a build zone without `place_count_problems`."""
    zone = surroundings.zone
    yield from _area_problems(zone)
    yield from _key_problems(zone)
    cells = empty_zone(surroundings)
    if zone.items:
        yield from _item_problems(zone, cells)
    elif zone.stock > (usable := int(cells.usable.sum())):
        message = f"is {zone.stock}, must be at most {usable}, the number of usable cells"
        yield Problem("build_zone.stock", message)
    # What is left to build narrows down: in stock, then without closing the way, then within the
    # budget.
    in_stock = [cells.catalogue.stocks[variant.item] > 0 for variant in cells.catalogue.variants]
    available = cells.fits & np.array(in_stock)[:, np.newaxis, np.newaxis]
    if zone.access_way is not None:
        closing = _closing(zone, zone.access_way, cells)
        problem = _access_way_problem(zone, zone.access_way, cells.passable, available, closing)
        if problem is not None:
            yield problem
        else:
            available = available & ~closing
    if zone.budget is not None and available.any():
        cheapest = float(cells.costs[available].min())
        if cheapest > zone.cost_limit:
            what = "a module on the cheapest usable cell"
            if zone.items:
                what = "the cheapest piece at its cheapest place"
            message = f"is {zone.budget:.10g}, must be at least {cheapest:.10g}, the cost of {what}"
            yield Problem("build_zone.budget", message)


def _area_problems(zone: BuildZone) -> Iterator[Problem]:
    """Check that no-build areas and cost areas overlap the zone."""
    listed: dict[str, Sequence[Area]] = {"keep_outs": zone.keep_outs, "cost_areas": zone.cost_areas}
    for key, areas in listed.items():
        for index, area in enumerate(areas):
            if not area.rectangle_m.overlaps(zone.rectangle_m):
                where, bound = extent(area.rectangle_m), extent(zone.rectangle_m)
                message = f"covers {where}, must overlap the build zone ({bound})"
                yield Problem(f"build_zone.{key}[{index}]", message)


def _key_problems(zone: BuildZone) -> Iterator[Problem]:
    """Check that costs and heights are given for modules or for items, whichever the zone has."""
    for index, area in enumerate(zone.cost_areas):
        here = f"build_zone.cost_areas[{index}]"
        needed, other = ("module_cost", "cost_factor")[:: -1 if zone.items else 1]
        if getattr(area, needed) is None:
            yield Problem(f"{here}.{needed}", "missing")
        if getattr(area, other) is not None:
            instead = "with a catalogue" if zone.items else "without a catalogue"
            yield Problem(f"{here}.{other}", f"must be left out: {instead} there is {needed}")
    if not zone.items:
        for key in ("hardening", "removable"):
            if getattr(zone, key):
                message = "must be left out: there are no build_zone.items"
                yield Problem(f"build_zone.{key}", message)
        return
    for key in ("module_cost", "height_m"):
        if getattr(zone, key) != BuildZone.model_fields[key].default:
            what = "cost" if key == "module_cost" else "height"
            yield Problem(
                f"build_zone.{key}",
                f"is {getattr(zone, key):g}, must be left out: each item has its own {what}",
            )


def _item_problems(zone: BuildZone, cells: EmptyZone) -> Iterator[Problem]:
    """Check that items and measures have unique names, and that items are in stock and fit."""
    places = [f"build_zone.items[{index}]" for index in range(len(zone.items))]
    places += [f"build_zone.hardening[{index}]" for index in range(len(zone.hardening))]
    places += [f"build_zone.removable[{index}]" for index in range(len(zone.removable))]
    names = [item.name for item in (*zone.items, *zone.measures)]
    for index, name in enumerate(names):
        first = names.index(name)
        if first != index:
            message = f"is {name!r}, already the name of {places[first]}"
            yield Problem(f"{places[index]}.name", message)
    pieces = sum(item.stock for item in zone.items) + len(zone.measures)
    if pieces == 0:
        yield Problem("build_zone.items", "none is in stock, at least one must have stock above 0")
    elif zone.stock > pieces:
        message = f"is {zone.stock}, must be at most {pieces}, the number of pieces of all items"
        yield Problem("build_zone.stock", message)
    for index, item in enumerate(zone.items):
        own = [variant.item == index for variant in cells.catalogue.variants]
        if cells.fits[own].any():
            continue
        size = f"{item.length_modules} x {item.thickness_modules} modules"
        turned = "in either orientation" if len(item.orientations) > 1 else "without turning it"
        # Too large for the zone, or only for its usable cells.
        sizes = map(item.footprint, item.orientations)
        if any(rows <= zone.rows and columns <= zone.columns for rows, columns in sizes):
            message = f"{item.name!r} of {size} fits nowhere on usable cells {turned}"
        else:
            message = (
                f"{item.name!r} of {size} does not fit into the zone of {zone.columns} columns and"
                f" {zone.rows} rows {turned}"
            )
        yield Problem(f"build_zone.items[{index}]", message)


def _closing(zone: BuildZone, way: AccessWay, cells: EmptyZone) -> BoolArray:
    """Return whether each variant alone would close the way; none if the way is too wide."""
    if way.width_cells > min(zone.shape):
        return np.zeros_like(cells.fits)
    return np.stack([*closing_places(way, cells.passable, cells.catalogue.sizes)])


def _access_way_problem(
    zone: BuildZone, way: AccessWay, passable: BoolArray, available: BoolArray, closing: BoolArray
) -> Problem | None:
    """Return the problem between access way and zone, or `None`."""
    widest_m = min(zone.shape) * MODULE_SIDE_M
    if way.width_m > widest_m:
        message = f"is {way.width_m:g}, must be at most {widest_m:g}, the zone's shorter side"
        return Problem("build_zone.access_way.width_m", message)
    if way.gate is not None:
        fault = _gate_fault(zone, way, way.gate.rectangle_m)
        if fault is not None:
            return Problem("build_zone.access_way.gate", fault)
    if not is_open(way, passable):
        message = f"the structures leave no {way.description} through the empty zone"
        return Problem("build_zone.access_way", message)
    if available.any() and closing[available].all():
        what = "a piece at any place" if zone.items else "a module on any usable cell"
        return Problem("build_zone.access_way", f"{what} would close the {way.description}")
    return None


def _gate_fault(zone: BuildZone, way: AccessWay, gate: Rectangle) -> str | None:
    """Return the fault of an access way's gate, or `None`."""
    if not zone.rectangle_m.contains(gate):
        bound = extent(zone.rectangle_m)
        return f"the gate ({extent(gate)}) must lie inside the build zone ({bound})"
    left, bottom, right, top = gate
    opening_m = top - bottom if way.between == "left_right" else right - left
    if opening_m < way.width_m - TOLERANCE_M:
        return (
            f"the gate ({extent(gate)}) is {opening_m:g} m wide across the way, must be at least"
            f" {way.width_m:g} m, the way's width"
        )
    return None


def outside_site(
    scenario: Content, key: str, description: str, rectangle: Rectangle
) -> Iterator[Problem]:
    """Yield a problem if a rectangle is not inside the site."""
    if not scenario.site.rectangle_m.contains(rectangle):
        site = extent(scenario.site.rectangle_m)
        yield Problem(key, f"{description} must lie inside the site ({site})")
