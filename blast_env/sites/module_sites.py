"""Sites of modules: a building, a road or parking area, and the conditions of the build zone."""

from dataclasses import dataclass
from typing import Any, ClassVar, Final, Self

from pydantic import model_validator

from blast_env.geometry import Rectangle
from blast_env.site import Problem, ScenarioError
from blast_env.sites.criterion import VisibilityCriterion
from blast_env.sites.ranges import (
    MARGIN_M,
    Amounts,
    Counts,
    Draws,
    Gaps,
    Lengths,
    Numbers,
    ObstacleSpace,
    Probability,
    Shifts,
    Side,
    SiteParts,
    Span,
    SquareRanges,
    ZoneSide,
    draw_path,
    draw_place,
    ground,
    on_grid,
    source,
    structure,
    yard,
)

NEIGHBOUR_DISTANCE_M: Final = 2.0
"""Least distance of the neighbouring building from the protected one and from the threat."""

HYDRANT_SIDE_M: Final = 1.5
"""Side of the square around a hydrant that must stay free."""


class SiteRanges(SquareRanges):
    """Ranges of generated sites for the particle model; see `Ranges`.

    Attributes:
        tnt_kg: TNT-equivalent mass of the charge, rounded to whole kg within the range.
        road_from_border_m: From the left border to road or parking area, m.
        road_length_m: Length of the stretch of road with the charge, m.
        parking_probability: Probability of a parking area instead of the road.
        parking_length_m: Length of a parking area along the road, m.
        threat_shift_m: From the middle of the site to that of road or parking area, m.
        stand_off_m: From road or parking area to the facade of the protected building, m; limited
            by the room on the site.
        depth_m: Depth of the protected building, m; limited by the room on the site.
        building_shift_m: From the middle of the site to that of the facade, m.
        neighbour_probability: Probability of an unprotected building, if there is room.
        neighbour_side_m: Its width, and its height, m.
        zone_from_threat_m: From road or parking area to the build zone, m.
        zone_shift_m: From midway between threat and facade to the zone's middle, along the
            road, m.
        path_probability: Probability of a path from the road to the door that is kept free.
        hydrant_probability: Probability of a hydrant, a no-build area 1.5 m square.
        trees: Number of trees, each a no-build area.
        tree_side_m: Side of the square of a tree, m.
        clearance_m: Least distance between a module and a building, m.
        access_way_probability: Probability of an access way that must stay open.
        stock: Number of modules.
        duct_probability: Probability of a budget, and of a duct with dearer modules above it.
        duct_width_m: Width of the strip above the duct, m.
        duct_module_cost: Cost of a module in it; elsewhere it is 1.
        budget_share: Budget divided by stock.
    """

    side_m: Side = 36.0
    zone_side_m: ZoneSide = 14.0
    tnt_kg: Amounts = (50.0, 300.0)
    road_from_border_m: Lengths = (2.0, 5.0)
    road_length_m: Lengths = (8.0, 20.0)
    parking_probability: Probability = 0.35
    parking_length_m: Lengths = (6.0, 14.0)
    parking_depth_m: Lengths = (2.5, 4.0)
    threat_shift_m: Shifts = (-4.0, 4.0)
    stand_off_m: Lengths = (12.0, 20.0)
    facade_m: Lengths = (6.0, 14.0)
    depth_m: Lengths = (4.0, 12.0)
    building_shift_m: Shifts = (-5.0, 5.0)
    neighbour_probability: Probability = 0.5
    neighbour_side_m: Lengths = (3.0, 6.0)
    zone_from_threat_m: Lengths = (3.0, 6.0)
    zone_shift_m: Shifts = (-1.5, 1.5)
    path_probability: Probability = 0.75
    path_width_m: Lengths = (1.5, 2.5)
    hydrant_probability: Probability = 0.5
    trees: Numbers = (0, 3)
    tree_side_m: Lengths = (1.0, 2.5)
    clearance_m: Gaps = (0.0, 2.0)
    access_way_probability: Probability = 0.35
    access_way_width_m: Lengths = (2.5, 4.0)
    stock: Counts = (8, 20)
    duct_probability: Probability = 0.35
    duct_width_m: Lengths = (1.5, 4.0)
    duct_module_cost: Amounts = (1.5, 4.0)
    budget_share: Amounts = (0.75, 1.5)

    criterion: ClassVar = VisibilityCriterion(most_open_share=1.0)

    @model_validator(mode="after")
    def _check_room(self) -> Self:
        """Refuse a site that is too small for the ranges."""
        parking_m = self.parking_depth_m[1] if self.parking_probability > 0.0 else 0.0
        before_m = self.road_from_border_m[1] + parking_m
        behind_m = self.stand_off_m[0] + self.depth_m[0] + MARGIN_M
        needs_m = {
            "threat, the least stand-off and the least depth": before_m + behind_m,
            "threat and build zone": before_m + self.zone_from_threat_m[1] + self.zone_side_m,
            "the longest road": self.road_length_m[1] + 2.0 * MARGIN_M,
            "the longest parking area": self.parking_length_m[1] + 2.0 * MARGIN_M,
            "the longest facade": self.facade_m[1] + 2.0 * MARGIN_M,
        }
        problems = list(self._without_room(needs_m))
        if self.zone_from_threat_m[1] >= self.stand_off_m[0]:
            message = (
                f"is {self.zone_from_threat_m}, must be less than {self.stand_off_m[0]:g}, the"
                " least stand_off_m: the zone begins before the building"
            )
            problems.append(Problem("zone_from_threat_m", message))
        if problems:
            raise ScenarioError("SiteRanges", problems)
        return self

    def drawn(self, draws: Draws) -> SiteParts:
        """Draw a site."""
        plan = _draw_plan(draws, self)
        charge = source(plan.threat, draws.amount(self.tnt_kg, 0))
        structures = [structure("building", plan.building, protected=True)]
        if plan.neighbour is not None:
            structures.append(structure("neighbour", plan.neighbour))
        sections = {
            "site": {"width_m": self.side_m, "height_m": self.side_m},
            "charge": [charge],
            "structures": structures,
            "build_zone": _draw_build_zone(draws, self, plan),
        }
        building, threat = plan.building, plan.threat
        description = (
            f"A generated site: a building with a facade of {building.top - building.bottom:g} m,"
            f" {building.left - threat.right:g} m from a"
            f" {'road' if threat.left == threat.right else 'parking area'} along the {{side}} side."
        )
        return SiteParts(description, sections)


@dataclass(frozen=True)
class _Plan:
    """The plan of a site, m.

    Attributes:
        threat: Area of possible centres of the charge; of width 0 if that is a line.
        building: The protected building.
        zone: The build zone.
        neighbour: The unprotected building, if there is one.
    """

    threat: Rectangle
    building: Rectangle
    zone: Rectangle
    neighbour: Rectangle | None


def _draw_plan(draws: Draws, ranges: SiteRanges) -> _Plan:
    """Draw the plan of a site."""
    threat = _draw_threat(draws, ranges)
    building = _draw_building(draws, ranges, threat)
    zone = _draw_zone(draws, ranges, threat, building)
    neighbour = None
    if draws.happens(ranges.neighbour_probability):
        neighbour = _draw_neighbour(draws, ranges, _Plan(threat, building, zone, None))
    return _Plan(threat, building, zone, neighbour)


def _draw_threat(draws: Draws, ranges: SiteRanges) -> Rectangle:
    left = draws.length_m(ranges.road_from_border_m)
    if draws.happens(ranges.parking_probability):
        depth_m = draws.length_m(ranges.parking_depth_m)
        length_m = draws.length_m(ranges.parking_length_m)
    else:
        depth_m = 0.0
        length_m = draws.length_m(ranges.road_length_m)
    bottom = _draw_bottom(draws, ranges, ranges.threat_shift_m, length_m)
    return Rectangle.from_corner((left, bottom), (depth_m, length_m))


def _draw_building(draws: Draws, ranges: SiteRanges, threat: Rectangle) -> Rectangle:
    # A stand-off leaves room for the least depth, and the depth what the stand-off left.
    room_m = ranges.side_m - MARGIN_M - threat.right
    stand_off_m = draws.length_m(_at_most(ranges.stand_off_m, room_m - ranges.depth_m[0]))
    depth_m = draws.length_m(_at_most(ranges.depth_m, room_m - stand_off_m))
    facade_m = draws.length_m(ranges.facade_m)
    bottom = _draw_bottom(draws, ranges, ranges.building_shift_m, facade_m)
    return Rectangle.from_corner((threat.right + stand_off_m, bottom), (depth_m, facade_m))


def _draw_zone(
    draws: Draws, ranges: SiteRanges, threat: Rectangle, building: Rectangle
) -> Rectangle:
    side_m = ranges.zone_side_m
    left = threat.right + draws.length_m(ranges.zone_from_threat_m)
    # The zone is midway between threat and facade, where a wall crosses the line of sight.
    middle = (threat.centre[1] + building.centre[1]) / 2.0
    bottom = on_grid(middle - side_m / 2.0) + draws.length_m(ranges.zone_shift_m)
    bottom = min(max(bottom, 0.0), ranges.side_m - side_m)
    return Rectangle.from_corner((left, bottom), (side_m, side_m))


def _draw_neighbour(draws: Draws, ranges: SiteRanges, plan: _Plan) -> Rectangle | None:
    """Draw a building beside or before the protected one, outside the zone, if there is room."""
    size_m = (draws.length_m(ranges.neighbour_side_m), draws.length_m(ranges.neighbour_side_m))
    area = Rectangle(MARGIN_M, MARGIN_M, plan.building.right, ranges.side_m - MARGIN_M)
    others = (
        ObstacleSpace(plan.building, NEIGHBOUR_DISTANCE_M),
        ObstacleSpace(plan.threat, NEIGHBOUR_DISTANCE_M),
        ObstacleSpace(plan.zone, 0.0),
    )
    return draw_place(draws, area, size_m, others)


def _draw_bottom(draws: Draws, ranges: SiteRanges, shift_m: Span, length_m: float) -> float:
    """Draw the lower end of an object along the road, from the shift of its middle."""
    lowest = on_grid((ranges.side_m - length_m) / 2.0)
    bottom = lowest + draws.length_m(shift_m)
    return min(max(bottom, MARGIN_M), ranges.side_m - MARGIN_M - length_m)


def _at_most(span_m: Span, most_m: float) -> Span:
    return span_m[0], min(span_m[1], most_m)


def _draw_build_zone(draws: Draws, ranges: SiteRanges, plan: _Plan) -> dict[str, Any]:
    """Draw the conditions of the build zone."""
    zone = plan.zone
    document: dict[str, Any] = {
        "corner_m": (zone.left, zone.bottom),
        "rows": ranges.zone_cells,
        "columns": ranges.zone_cells,
        "stock": draws.count(ranges.stock),
        "clearance_m": draws.length_m(ranges.clearance_m),
        "keep_outs": _draw_keep_outs(draws, ranges, plan),
    }
    if draws.happens(ranges.access_way_probability):
        along = draws.happens(0.5) or zone.overlaps(plan.building)  # else the building blocks it
        width_m = draws.length_m(ranges.access_way_width_m)
        between = "bottom_top" if along else "left_right"
        document["access_way"] = {"width_m": width_m, "between": between}
    if draws.happens(ranges.duct_probability):
        document["cost_areas"] = [_draw_duct(draws, ranges, zone)]
        share = draws.amount(ranges.budget_share, 2)
        document["budget"] = round(share * document["stock"], 1)
    return document


def _draw_keep_outs(draws: Draws, ranges: SiteRanges, plan: _Plan) -> list[dict[str, Any]]:
    places: list[tuple[str, Rectangle]] = []
    if draws.happens(ranges.path_probability):
        width_m = draws.length_m(ranges.path_width_m)
        path = draw_path(draws, plan.zone, plan.building, width_m)
        if path is not None:
            places.append(("the path from the road to the door must stay open", path))
    squares = [("hydrant", HYDRANT_SIDE_M)] if draws.happens(ranges.hydrant_probability) else []
    trees = draws.count(ranges.trees)
    squares += [("tree", draws.length_m(ranges.tree_side_m)) for _ in range(trees)]
    # One after the other, each clear of those before; one without room is left out.
    for reason, side_m in squares:
        others = [ObstacleSpace(place, 0.0) for _, place in places]
        place = draw_place(draws, yard(plan.zone, plan.building), (side_m, side_m), others)
        if place is not None:
            places.append((reason, place))
    return [ground(place, reason=reason) for reason, place in places]


def _draw_duct(draws: Draws, ranges: SiteRanges, zone: Rectangle) -> dict[str, Any]:
    """Draw a strip across the zone, along the facade or towards it."""
    width_m, side_m = draws.length_m(ranges.duct_width_m), ranges.zone_side_m
    start_m = draws.length_m((0.0, on_grid(side_m - width_m)))
    if draws.happens(0.5):
        corner_m, size_m = (zone.left + start_m, zone.bottom), (width_m, side_m)
    else:
        corner_m, size_m = (zone.left, zone.bottom + start_m), (side_m, width_m)
    return {
        "corner_m": corner_m,
        "size_m": size_m,
        "module_cost": draws.amount(ranges.duct_module_cost, 1),
        "reason": "deep foundations over the duct",
    }
