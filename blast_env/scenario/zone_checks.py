"""Checks of a build zone against what stands around it: whether anything can be built at all."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from blast_env.scenario.access_way import closing_cells, is_open
from blast_env.scenario.build_zone import AccessWay, Area, BuildZone
from blast_env.scenario.problems import Problem
from blast_env.scenario.usability import Surroundings, empty_zone
from blast_env.scenario.wording import extent
from blast_env.units import MODULE_SIDE_M


def build_zone_problems(surroundings: Surroundings) -> Iterator[Problem]:
    """Yield what is wrong between a build zone, its areas and what stands around it."""
    zone = surroundings.zone
    yield from _area_problems(zone)
    cells = empty_zone(surroundings)
    usable = int(cells.usable.sum())
    if zone.stock > usable:
        message = f"is {zone.stock}, must be at most {usable}, the number of usable cells"
        yield Problem("build_zone.stock", message)
    available = cells.usable
    if zone.access_way is not None:
        problem = _access_way_problem(zone, zone.access_way, cells.passable, available)
        if problem is not None:
            yield problem
        else:
            available = available & ~closing_cells(zone.access_way, cells.passable)
    if zone.budget is not None and available.any():
        cheapest = float(cells.module_costs[available].min())
        if cheapest > zone.cost_limit:
            yield Problem(
                "build_zone.budget",
                f"is {zone.budget:.10g}, must be at least {cheapest:.10g},"
                " the cost of a module on the cheapest usable cell",
            )


def _area_problems(zone: BuildZone) -> Iterator[Problem]:
    """Check that keep-outs and cost areas have something to do with the zone."""
    listed: dict[str, Sequence[Area]] = {"keep_outs": zone.keep_outs, "cost_areas": zone.cost_areas}
    for key, areas in listed.items():
        for index, area in enumerate(areas):
            if not area.rectangle_m.overlaps(zone.rectangle_m):
                where, bound = extent(area.rectangle_m), extent(zone.rectangle_m)
                message = f"covers {where}, must overlap the build zone ({bound})"
                yield Problem(f"build_zone.{key}[{index}]", message)


def _access_way_problem(
    zone: BuildZone, way: AccessWay, passable: NDArray[np.bool_], usable: NDArray[np.bool_]
) -> Problem | None:
    """Return why the access way and the zone do not fit each other, or `None` if they do."""
    widest_m = min(zone.rows, zone.columns) * MODULE_SIDE_M
    if way.width_m > widest_m:
        message = f"is {way.width_m:g}, must be at most {widest_m:g}, the zone's shorter side"
        return Problem("build_zone.access_way.width_m", message)
    if not is_open(way, passable):
        message = f"the structures leave no {way.description} through the empty zone"
        return Problem("build_zone.access_way", message)
    if usable.any() and closing_cells(way, passable)[usable].all():
        message = f"a module on any usable cell would close the {way.description}"
        return Problem("build_zone.access_way", message)
    return None
