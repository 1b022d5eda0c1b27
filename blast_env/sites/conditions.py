"""Drawing the conditions of building on a site; the threat is on the left."""

from typing import Final, Literal

from blast_env.geometry import Rectangle
from blast_env.scenario import AccessWay, BuildZone, CostArea, KeepOut
from blast_env.sites.draws import Draws, on_grid
from blast_env.sites.ground import Ground
from blast_env.sites.places import Apart, draw_place
from blast_env.sites.ranges import SiteRanges

HYDRANT_SIDE_M: Final = 1.5
"""Side of the square around a hydrant that must stay free."""


def draw_build_zone(draws: Draws, ranges: SiteRanges, ground: Ground) -> BuildZone:
    """Draw the conditions of the build zone."""
    stock = draws.count(ranges.stock)
    clearance_m = draws.length_m(ranges.clearance_m)
    keep_outs = _draw_keep_outs(draws, ranges, ground)
    access_way = None
    if draws.happens(ranges.access_way_probability):
        access_way = _draw_access_way(draws, ranges, ground)
    cost_areas: tuple[CostArea, ...] = ()
    budget = None
    if draws.happens(ranges.duct_probability):
        cost_areas = (_draw_duct(draws, ranges, ground.zone),)
        budget = round(draws.amount(ranges.budget_share, 2) * stock, 1)
    return BuildZone(
        corner_m=(ground.zone.left, ground.zone.bottom),
        rows=ranges.zone_cells,
        columns=ranges.zone_cells,
        stock=stock,
        keep_outs=keep_outs,
        clearance_m=clearance_m,
        cost_areas=cost_areas,
        budget=budget,
        access_way=access_way,
    )


def _draw_keep_outs(draws: Draws, ranges: SiteRanges, ground: Ground) -> tuple[KeepOut, ...]:
    keep_outs: list[KeepOut] = []
    if draws.happens(ranges.path_probability):
        keep_outs += _draw_path(draws, ranges, ground)
    squares = [("hydrant", HYDRANT_SIDE_M)] if draws.happens(ranges.hydrant_probability) else []
    trees = draws.count(ranges.trees)
    squares += [("tree", draws.length_m(ranges.tree_side_m)) for _ in range(trees)]
    for reason, side_m in squares:
        others = [Apart(each.rectangle_m, 0.0) for each in keep_outs]
        place = draw_place(draws, _yard(ground), (side_m, side_m), others)
        if place is not None:
            keep_outs.append(
                KeepOut(corner_m=(place.left, place.bottom), size_m=(side_m, side_m), reason=reason)
            )
    return tuple(keep_outs)


def _draw_path(draws: Draws, ranges: SiteRanges, ground: Ground) -> list[KeepOut]:
    """Draw the path to the door through the zone; none if no door leads there."""
    zone, building = ground.zone, ground.building
    width_m = draws.length_m(ranges.path_width_m)
    lowest = max(zone.bottom, building.bottom)
    highest = min(zone.top, building.top) - width_m
    if highest < lowest:
        return []
    bottom = draws.length_m((lowest, highest))
    return [
        KeepOut(
            corner_m=(zone.left, bottom),
            size_m=(_yard(ground).right - zone.left, width_m),
            reason="the path from the road to the door must stay open",
        )
    ]


def _draw_access_way(draws: Draws, ranges: SiteRanges, ground: Ground) -> AccessWay:
    """Draw a way along the facade, or, where the building leaves it room, one towards it."""
    along = draws.happens(0.5) or ground.zone.overlaps(ground.building)
    between: Literal["left_right", "bottom_top"] = "bottom_top" if along else "left_right"
    return AccessWay(width_m=draws.length_m(ranges.access_way_width_m), between=between)


def _draw_duct(draws: Draws, ranges: SiteRanges, zone: Rectangle) -> CostArea:
    """Draw a strip across the zone, along the facade or towards it."""
    width_m, side_m = draws.length_m(ranges.duct_width_m), ranges.zone_side_m
    start_m = draws.length_m((0.0, on_grid(side_m - width_m)))
    if draws.happens(0.5):
        corner_m, size_m = (zone.left + start_m, zone.bottom), (width_m, side_m)
    else:
        corner_m, size_m = (zone.left, zone.bottom + start_m), (side_m, width_m)
    return CostArea(
        corner_m=corner_m,
        size_m=size_m,
        module_cost=draws.amount(ranges.duct_module_cost, 1),
        reason="deep foundations over the duct",
    )


def _yard(ground: Ground) -> Rectangle:
    """Return the part of the zone before the building."""
    zone = ground.zone
    return Rectangle(zone.left, zone.bottom, min(zone.right, ground.building.left), zone.top)
