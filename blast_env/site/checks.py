"""Checks of the consistency between the sections of a scenario."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import TOLERANCE_M, Rectangle
from blast_env.problems import Problem, extent, unknown_name
from blast_env.sections import MOST_MODULES, Area, GaugeSection
from blast_env.site.content import Content, highest_grounds_m, outside_site
from blast_env.site.facade import bay_count_problems, facade_problems, hardening_problems
from blast_env.site.parameters import for_charge
from blast_env.site.sources import PlaceSource, VehicleSource
from blast_env.site.structures import (
    BARRIER_NAME,
    AnyStructure,
    depth_inside_m,
    is_over_or_below,
    solids_around,
    terrace_problems,
)
from blast_env.site.zone import BuildZone, EmptyZone, distance_m, empty_zone, source_bounds_m
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.vehicle import AccessWay, closing_places, is_open

MOST_AIR_BALLS: Final = 1_000_000
"""Most air balls, by the memory of a common computer."""

MOST_PLACES: Final = 10_000_000
"""Most places: cells times variants, each of which takes some ten bytes."""

MOST_COVERED: Final = 1_000_000_000
"""Most cells under all pieces at all their places: each takes a nanosecond, several times."""


def check_sections(scenario: Content) -> tuple[Problem, ...]:
    """Return all problems between the sections of a scenario, each of which is valid by itself.

    Whatever takes memory or time is counted first; too much of it is the only problem then.
    """
    # What would take memory or minutes is refused before it is made.
    counted = tuple(_count_problems(scenario))
    return counted or (
        *_name_problems(scenario),
        *_structure_problems(scenario),
        *_charge_problems(scenario),
        *_build_zone_problems(scenario),
        *_simulation_problems(scenario),
        *_height_problems(scenario),
        *_gauge_problems(scenario),
        *_facade_problems(scenario),
        *_removable_problems(scenario),
        *terrace_problems(scenario.structures),
        *_objective_problems(scenario),
    )


def _count_problems(scenario: Content) -> Iterator[Problem]:
    """Yield the problems of products of counts: bays, places of pieces, places of vehicles."""
    yield from bay_count_problems(scenario.structures)
    if scenario.build_zone is not None:
        yield from _place_count_problems(scenario.build_zone)
    yield from _vehicle_count_problems(scenario)


def _place_count_problems(zone: BuildZone) -> Iterator[Problem]:
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


def _vehicle_count_problems(scenario: Content) -> Iterator[Problem]:
    if scenario.vehicles:
        from blast_env.site.vehicle_checks import vehicle_count_problems

        yield from vehicle_count_problems(scenario.site, scenario.vehicles)


def _facade_problems(scenario: Content) -> Iterator[Problem]:
    """Check facades and the measures that harden them, if the sections that they use are valid."""
    problems = list(facade_problems(scenario.structures, scenario.components))
    yield from problems
    zone = scenario.build_zone
    if zone is not None and zone.hardening and not problems:
        yield from hardening_problems(scenario.structures, scenario.components, zone.hardening)


def _removable_problems(scenario: Content) -> Iterator[Problem]:
    """Check that removable structures exist, and are neither protected nor otherwise needed."""
    if scenario.build_zone is None or not scenario.build_zone.removable:
        return
    structures = {structure.name: structure for structure in scenario.structures}
    # A structure can be taken away once: the first measure that names it has it.
    first_use: dict[str, str] = {}
    for number, removable in enumerate(scenario.build_zone.removable):
        for place, name in enumerate(removable.structures):
            where = f"build_zone.removable[{number}].structures[{place}]"
            used = first_use.setdefault(name, where)
            if name not in structures:
                yield Problem(where, unknown_name("structure", name, structures))
            elif structures[name].protected:
                yield Problem(where, f"is {name!r}, which is protected: it cannot be removed")
            elif structures[name].facade is not None:
                yield Problem(where, f"is {name!r}, which has a facade: it cannot be removed")
            elif structures[name].carries:
                yield Problem(where, f"is {name!r}, a terrace: it cannot be removed")
            elif used != where:
                yield Problem(where, f"is {name!r}, which {used} removes already")


def _objective_problems(scenario: Content) -> Iterator[Problem]:
    """Check that a response objective has facades, and a target has a budget."""
    objective, zone = scenario.objective, scenario.build_zone
    if not objective.is_response:
        return
    facades = [structure.facade for structure in scenario.structures if structure.protected]
    keys = [key for facade in facades if facade is not None for key, _ in facade.names()]
    wanted = "glazing" if objective.measure == "glazing" else ""
    if not any(key.endswith(wanted) for key in keys):
        what = "facade with glazing" if wanted else "facade"
        message = f"is 'response', but no protected structure has a {what}"
        yield Problem("objective.kind", message)
    if objective.target is not None and zone is not None and zone.budget is None:
        message = f"missing: objective.target is {objective.target!r}, costs are shares of a budget"
        yield Problem("build_zone.budget", message)


def check_sources(scenario: Content) -> tuple[Problem, ...]:
    """Return the problems between the sources of the charge and the other sections.

    They are the result of `check_sections` if the other sections are consistent.
    """
    counted = tuple(_vehicle_count_problems(scenario))
    return counted or (*_charge_problems(scenario), *_build_zone_problems(scenario))


def _name_problems(scenario: Content) -> Iterator[Problem]:
    """Check the names of the structures, and that at least one is protected."""
    for index, structure in enumerate(scenario.structures):
        if structure.name == BARRIER_NAME:
            message = f"is {BARRIER_NAME!r}, the name of the modules of a layout"
            yield Problem(f"structures[{index}].name", message)
    yield from _repeated_names("structures", scenario.structures)
    protected = any(structure.protected for structure in scenario.structures)
    if not protected:
        yield Problem("structures", "none is protected, at least one must have protected = true")


def _repeated_names(
    key: str, items: Sequence[AnyStructure] | Sequence[GaugeSection]
) -> Iterator[Problem]:
    """Yield the problems of names that an earlier item of the array has."""
    first_use: dict[str, int] = {}
    for index, item in enumerate(items):
        used = first_use.setdefault(item.name, index)
        if used != index:
            message = f"is {item.name!r}, already the name of {key}[{used}]"
            yield Problem(f"{key}[{index}].name", message)


def _structure_problems(scenario: Content) -> Iterator[Problem]:
    """Check that structures lie inside the site without overlaps, and their number of modules."""
    stock = 0 if scenario.build_zone is None else scenario.build_zone.stock
    modules = sum(structure.modules for structure in scenario.structures) + stock
    if modules > MOST_MODULES:
        with_stock = f", the stock of {stock:,} among them" if stock else ""
        message = f"have {modules:,} modules together{with_stock}, must have at most"
        yield Problem("structures", f"{message} {MOST_MODULES:,}")
    for index, structure in enumerate(scenario.structures):
        plans_m = [structure.rectangle_m]
        if structure.footprint is not None:
            plans_m.append(Rectangle(*structure.footprint.polygon.bounds))
        described = _described(structure)
        yield from outside_site(
            scenario, f"structures[{index}]", described, Rectangle.around(plans_m)
        )
    # Structures may stand above each other, but not in each other.
    for (i, one), (j, other) in combinations(enumerate(scenario.structures), 2):
        if _overlap(one, other) and not _are_stacked(one, other):
            message = f"{_described(other)} overlaps structures[{i}], {_described(one)}"
            yield Problem(f"structures[{j}]", message)


def _overlap(one: AnyStructure, other: AnyStructure) -> bool:
    """Return whether modules of two structures overlap."""
    return one.rectangle_m.overlaps(other.rectangle_m) and any(
        own.overlaps(box) for own in one.boxes_m for box in other.boxes_m
    )


def _are_stacked(one: AnyStructure, other: AnyStructure) -> bool:
    """Return whether one of two structures begins at or above the top of the other."""
    return any(
        low.height_m is not None and high.base_m >= low.height_m - TOLERANCE_M
        for low, high in ((one, other), (other, one))
    )


def _charge_problems(scenario: Content) -> Iterator[Problem]:
    """Check that every place of the charge is clear of structures and border."""
    for index, source in enumerate(scenario.charge):
        if isinstance(source, VehicleSource):
            from blast_env.site.vehicle_checks import vehicle_problems

            yield from vehicle_problems(scenario, f"charge[{index}]", source)
        else:
            yield from _place_problems(scenario, f"charge[{index}]", source)
        yield from _above_the_air(scenario, f"charge[{index}].height_m", source.height_m)


def _place_problems(scenario: Content, key: str, source: PlaceSource) -> Iterator[Problem]:
    """Check a charge whose places do not depend on the layout."""
    radius = scenario.charge_radius_m
    words = f" by {radius:g} m, the charge's radius"
    bounds = source_bounds_m(source)
    if not scenario.site.rectangle_m.contains(bounds.grown(radius)):
        where, site = extent(bounds), extent(scenario.site.rectangle_m)
        message = f"its centre may be at {where}, must lie inside the site ({site}){words}"
        yield Problem(key, message)
    for j, structure in enumerate(scenario.structures):
        distance = min(distance_m(source, box) for box in structure.boxes_m)
        if distance < radius - TOLERANCE_M and not is_over_or_below(source.height_m, structure):
            message = (
                f"its centre comes as near as {distance:g} m to structures[{j}],"
                f" {_described(structure)}, must keep clear of it{words}"
            )
            if structure.height_m is not None:
                message += f", or be higher than its {structure.height_m:g} m"
            if structure.base_m > 0.0:
                message += f", or be lower than its base_m of {structure.base_m:g} m"
            yield Problem(key, message)


def _build_zone_problems(scenario: Content) -> Iterator[Problem]:
    """Check that the build zone lies inside the site, and that barriers can be built in it."""
    zone = scenario.build_zone
    if zone is None:
        return
    yield from outside_site(
        scenario, "build_zone", f"the zone ({extent(zone.rectangle_m)})", zone.rectangle_m
    )
    yield from _area_problems(zone)
    yield from _key_problems(zone)
    cells = empty_zone(scenario.surroundings(zone))
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


def _height_problems(scenario: Content) -> Iterator[Problem]:
    """Check that structures and barriers do not exceed the height of the air."""
    for index, structure in enumerate(scenario.structures):
        yield from _above_the_air(scenario, f"structures[{index}].height_m", structure.height_m)
        top_m = scenario.air_height_m if structure.height_m is None else structure.height_m
        if structure.base_m > max(top_m - MODULE_SIDE_M, 0.0) + TOLERANCE_M:
            what = "the air" if structure.height_m is None else "height_m"
            message = (
                f"is {structure.base_m:g}, must be at least {MODULE_SIDE_M:g} below {what}"
                f" ({top_m:g})"
            )
            yield Problem(f"structures[{index}].base_m", message)
    if scenario.build_zone is not None:
        zone = scenario.build_zone
        grounds_m = highest_grounds_m(zone, scenario.structures)
        yield from _above_the_air(scenario, "build_zone.height_m", zone.height_m, grounds_m[0])
        for index, item in enumerate(zone.items):
            where = f"build_zone.items[{index}].height_m"
            yield from _above_the_air(scenario, where, item.height_m, grounds_m[index])


def _gauge_problems(scenario: Content) -> Iterator[Problem]:
    """Check that gauges have unique names, and lie in the air or at most a module inside."""
    yield from _repeated_names("gauges", scenario.gauges)
    for index, gauge in enumerate(scenario.gauges):
        key, (x_m, y_m, z_m) = f"gauges[{index}].position_m", gauge.position_m
        yield from outside_site(scenario, key, f"({x_m:g}, {y_m:g})", Rectangle(x_m, y_m, x_m, y_m))
        yield from _above_the_air(scenario, f"{key}[2]", z_m)
        yield from _depth_problems(scenario, key, gauge)


def _depth_problems(scenario: Content, key: str, gauge: GaugeSection) -> Iterator[Problem]:
    """Check that a gauge lies in the air or at most a module inside structures."""
    x_m, y_m, z_m = gauge.position_m
    place, is_deep = f"({x_m:g}, {y_m:g}), {z_m:g} m high", False
    for j, structure in enumerate(scenario.structures):
        depth_m = depth_inside_m(gauge.position_m, structure)
        if depth_m > MODULE_SIDE_M + TOLERANCE_M:
            is_deep = True
            top = "" if structure.height_m is None else f", {structure.height_m:g} m high"
            message = (
                f"{place}, is {depth_m:g} m deep inside structures[{j}],"
                f" {_described(structure)}{top}, must be at most {MODULE_SIDE_M:g} m deep"
            )
            yield Problem(key, message)
    # Structures that touch have less air around them than each by itself.
    near, has_air = solids_around(gauge.position_m, MODULE_SIDE_M, scenario.structures)
    if not (is_deep or has_air) and len(near) > 1:
        together = " and ".join(
            f"structures[{j}], {_described(scenario.structures[j])}" for j in near
        )
        message = (
            f"{place}, is where {together} meet, must be at most {MODULE_SIDE_M:g} m from the air"
        )
        yield Problem(key, message)


def _above_the_air(
    scenario: Content, key: str, height_m: float | None, ground_m: float = 0.0
) -> Iterator[Problem]:
    """Yield a problem if a height above its ground, such as a terrace, exceeds the air."""
    if height_m is not None and ground_m + height_m > scenario.air_height_m + TOLERANCE_M:
        terrace = f" on a terrace of {ground_m:g}" if ground_m > 0.0 else ""
        message = (
            f"is {height_m:g}{terrace}, must be at most {scenario.air_height_m:g}, the height of"
            " the air (which site.air_height_m can raise)"
        )
        yield Problem(key, message)


def _simulation_problems(scenario: Content) -> Iterator[Problem]:
    """Check that no balls overlap at the start, and the number of air balls, by memory."""
    air, explosive = scenario.parameters.air, scenario.parameters.explosive
    if 0.0 < air.spacing_units < 2.0 * air.radius_units:
        yield Problem(
            "simulation.overrides.air.spacing_units",
            f"is {air.spacing_units:g}, must be 0 (no air) or at least"
            f" {2.0 * air.radius_units:g}, twice radius_units: the balls would overlap",
        )
    elif (balls := air.most_balls(scenario.site.rectangle_m)) > MOST_AIR_BALLS:
        site = scenario.site
        yield Problem(
            "simulation.overrides.air.spacing_units",
            f"is {air.spacing_units:g}, which makes {balls:,} air balls on a site of"
            f" {site.width_m:g} x {site.height_m:g} m, must make at most {MOST_AIR_BALLS:,}",
        )
    if explosive.collide_within_charge and explosive.ball_count > 1:
        sine = math.sin(math.pi / explosive.ball_count)
        if 2.0 * explosive.offset_units * sine < 2.0 * explosive.radius_units - TOLERANCE_M:
            least = explosive.radius_units / sine
            yield Problem(
                "simulation.overrides.explosive.offset_units",
                f"is {explosive.offset_units:g}, must be at least {least:g} for"
                f" {explosive.ball_count} balls of one charge that collide with each other"
                " (collide_within_charge): they would overlap",
            )


def particle_problems(scenario: Content) -> Iterator[Problem]:
    """Yield the features of a scenario that particles cannot simulate, unlike gas dynamics.

    All structures must stand on the ground, and none be a terrace; the parameters of the particle
    model bound the mass of every charge.
    """
    for index, structure in enumerate(scenario.structures):
        if structure.base_m > 0.0:
            message = (
                f"is {structure.base_m:g}, must be 0 for particles: they know no heights, and"
                f" nothing would pass below {structure.name!r}; engine 'gas' takes it"
            )
            yield Problem(f"structures[{index}].base_m", message)
        if structure.carries:
            message = (
                "is true, must be false for particles: they know no heights, and nothing would"
                f" stand on {structure.name!r}; engine 'gas' takes it"
            )
            yield Problem(f"structures[{index}].carries", message)
    for index, source in enumerate(scenario.charge):
        try:
            for_charge(scenario.parameters, source.tnt_kg)
        except BlastEnvError as error:
            yield Problem(f"charge[{index}].tnt_kg", str(error).removeprefix("tnt_kg "))


def _described(structure: AnyStructure) -> str:
    """Return the name and the extent of a structure."""
    return f"{structure.name!r} ({extent(structure.rectangle_m)})"
