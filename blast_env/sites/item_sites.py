"""Sites with heights, a catalogue, several buildings, and charges on roads or in vehicles."""

from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self

from pydantic import Field, StrictFloat, model_validator

from blast_env.errors import BlastEnvError
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
    WholeSpan,
    ZoneSide,
    draw_path,
    draw_place,
    ground,
    on_grid,
    source,
    structure,
    yard,
)
from blast_env.units import MODULE_SIDE_M


class ItemKind(NamedTuple):
    """An item of the catalogue that all sites of the family share, for equal action spaces.

    Attributes:
        length_modules: Modules along its length.
        thickness_modules: Modules across it.
        rotatable: Whether it may be turned.
        heights_m: Lowest and highest height, on the 0.5 m grid.
        pieces: Least and largest number of pieces, if the item is in stock.
    """

    name: str
    length_modules: int
    thickness_modules: int
    rotatable: bool
    heights_m: Span
    pieces: WholeSpan


ITEM_KINDS: Final = (
    ItemKind("low_wall", 6, 1, True, (1.0, 1.0), (4, 8)),
    ItemKind("wall", 3, 1, True, (2.0, 2.5), (4, 12)),
    ItemKind("high_wall", 3, 1, True, (3.0, 4.0), (3, 8)),
    ItemKind("basket", 4, 2, True, (1.5, 2.0), (4, 8)),
    ItemKind("post", 1, 1, False, (1.0, 1.0), (6, 12)),
)
"""The items: a road barrier, two T-walls, an earth-filled basket, a bollard."""

POST: Final = "post"


class ItemSiteRanges(SquareRanges):
    """Ranges of generated sites with a catalogue.

    See `Ranges`. With the default sizes a gas blast with cells of 0.5 m takes a fraction of a
    second. All sites have the items of `ITEM_KINDS`, some of them not in stock. So they share
    action and observation space, which includes the planes and values of vehicles for sites
    without one.

    Attributes:
        tnt_kg: TNT-equivalent mass of the charge.
        vehicle_probability: Probability that a vehicle carries the charge.
        parking_probability: Probability, without a vehicle, of a charge on a parking area instead
            of a road.
        road_length_m: Length of the road or parking area along the border, m.
        entry_m: Length of the vehicle's entry along the border, m.
        forecourt_m: Extent of the drivable ground along the border, m; it lies within the build
            zone's extent, so that barriers can close it.
        kerb_m: Distance from the end of that ground to the building, m.
        zone_from_border_m: From the left border to the build zone, m.
        stand_off_m: From road, parking area or border to the nearest building, m.
        facade_m: Length of the facades of the protected buildings, m.
        storeys: Their number of storeys, 3 m each.
        second_probability: Probability of a second protected building beside the first.
        second_weight: Weight of its load; that of the first is 1.
        shed_probability: Probability of an unprotected shed, if there is room.
        shift_m: From the middle of the site to that of road, entry and building, m.
        path_probability: Probability of a path to the door that is kept free.
        trees: Number of trees, each a no-build area.
        tree_side_m: Side of the square of a tree, m.
        clearance_m: Least distance between a piece and a building, m.
        access_way_probability: Probability of an access way that must stay open; with a vehicle it
            has a gate.
        duct_probability: Probability of a strip with higher costs.
        duct_factor: Factor of the costs there.
        item_probability: Probability that an item is in stock; one of the two T-walls always is,
            and posts exactly if there is a vehicle.
        price_of_height: Exponent p in the cost of a piece, length times height to the power p.
        budget: Budget, in the cost of 1 m of a wall 1 m high.
        cvar_probability: Probability that the objective is the CVaR over charges, not the mean.
    """

    side_m: Side = 26.0
    air_height_m: Annotated[StrictFloat, Field(ge=2.0, le=2000.0)] = 9.0
    zone_side_m: ZoneSide = 13.0
    tnt_kg: Amounts = (100.0, 140.0)
    vehicle_probability: Probability = 0.5
    parking_probability: Probability = 0.4
    road_length_m: Lengths = (6.0, 12.0)
    entry_m: Lengths = (4.0, 6.0)
    vehicle_width_m: Lengths = (2.0, 2.5)
    forecourt_m: Lengths = (6.0, 11.0)
    kerb_m: Lengths = (6.5, 7.5)
    zone_from_border_m: Lengths = (4.0, 4.5)
    stand_off_m: Lengths = (11.0, 15.0)
    facade_m: Lengths = (5.0, 9.0)
    depth_m: Lengths = (3.0, 5.0)
    storeys: Counts = (1, 2)
    second_probability: Probability = 0.4
    second_weight: Amounts = (0.5, 2.0)
    shed_probability: Probability = 0.4
    shed_side_m: Lengths = (2.0, 4.0)
    shift_m: Shifts = (-2.0, 2.0)
    path_probability: Probability = 0.5
    path_width_m: Lengths = (1.5, 2.0)
    trees: Numbers = (0, 2)
    tree_side_m: Lengths = (1.0, 2.0)
    clearance_m: Gaps = (0.5, 1.5)
    access_way_probability: Probability = 0.35
    access_way_width_m: Lengths = (3.0, 3.5)
    duct_probability: Probability = 0.35
    duct_factor: Amounts = (1.5, 3.0)
    item_probability: Probability = 0.7
    price_of_height: Amounts = (0.8, 1.4)
    budget: Amounts = (16.0, 34.0)
    cvar_probability: Probability = 0.25

    criterion: ClassVar = VisibilityCriterion(
        least_layout_share=0.5, most_layout_share=1.0, least_advantage=0.25, most_open_share=1.0
    )
    """A wall may cut all lines in plan, since blast passes over it."""

    @model_validator(mode="after")
    def _check_room(self) -> Self:
        """Refuse a site that is too small for the ranges."""
        needs_m = {
            "stand-off, the largest depth and the road": (
                _ROAD_M + self.stand_off_m[0] + self.depth_m[0] + MARGIN_M
            ),
            "the build zone": self.zone_from_border_m[1] + self.zone_side_m,
            "two facades": 2.0 * self.facade_m[0] + _BETWEEN_M + 2.0 * MARGIN_M,
        }
        problems = list(self._without_room(needs_m))
        if self.forecourt_m[1] > self.zone_side_m:
            message = (
                f"is {self.forecourt_m}, must be at most {self.zone_side_m:g}, zone_side_m: else"
                " nothing could stop a vehicle"
            )
            problems.append(Problem("forecourt_m", message))
        if STOREY_M * self.storeys[1] > self.air_height_m:
            message = (
                f"is {self.storeys}, of {STOREY_M:g} m each, must be at most"
                f" {self.air_height_m:g} m in all, air_height_m"
            )
            problems.append(Problem("storeys", message))
        if problems:
            raise ScenarioError("ItemSiteRanges", problems)
        return self

    def drawn(self, draws: Draws) -> SiteParts:
        """Draw a site."""
        has_vehicle = draws.happens(self.vehicle_probability)
        plan = _draw_plan(draws, self)
        charge = (_vehicle if has_vehicle else _place)(draws, self, plan)
        sections: dict[str, Any] = {
            "site": {
                "width_m": self.side_m,
                "height_m": self.side_m,
                "air_height_m": self.air_height_m,
            },
            "charge": [charge],
            "structures": _structures(draws, self, plan),
            "build_zone": _zone(draws, self, plan, has_vehicle),
        }
        if draws.happens(self.cvar_probability):
            sections["objective"] = {"charges": "cvar"}
        front_m = plan.front_m - (0.0 if has_vehicle else _ROAD_M)
        what = {"vehicle": "a vehicle", "segment": "a car"}.get(charge["kind"], "parked cars")
        description = f"A generated site: {what}, at most {front_m:g} m from what is protected."
        return SiteParts(description, sections)


LARGE_SIDE_M: Final = 60.0
"""Default side of the sites of `large_ranges`."""

CLOSE_SIDES_M: Final = (16.0, 24.0)
"""Least and largest side of a site of `close_ranges`."""

_LARGE_SIDES_M: Final = (40.0, 100.0)


def close_ranges(side_m: float) -> ItemSiteRanges:
    """Return the ranges of sites with a threat as close as on the small bundled sites.

    Stand-offs, build zone, roads and facades grow with the site.

    Args:
        side_m: Width and height of the site, 16 to 24 m in whole modules.

    Raises:
        BlastEnvError: If the side is out of bounds.
    """
    _check_side(side_m, CLOSE_SIDES_M)
    return ItemSiteRanges(
        side_m=side_m,
        air_height_m=12.0,
        zone_side_m=on_grid(0.6 * side_m),
        tnt_kg=(80.0, 140.0),
        road_length_m=_shares_m(side_m, (0.3, 0.6)),
        entry_m=(3.5, 5.0),
        forecourt_m=_shares_m(side_m, (0.3, 0.5)),
        kerb_m=(3.0, 5.0),
        zone_from_border_m=(3.0, 4.0),
        stand_off_m=_shares_m(side_m, (0.35, 0.5)),
        facade_m=_shares_m(side_m, (0.28, 0.55)),
        depth_m=(2.0, 4.0),
        storeys=(1, 3),
        shift_m=(-1.5, 1.5),
        budget=(14.0, 40.0),
    )


def large_ranges(side_m: float = LARGE_SIDE_M) -> ItemSiteRanges:
    """Return the ranges of sites of real size.

    Stand-offs, buildings and roads grow with the site. Pieces and the build zone do not.

    Args:
        side_m: Width and height of the site, 40 to 100 m in whole modules.

    Raises:
        BlastEnvError: If the side is out of bounds.
    """
    _check_side(side_m, _LARGE_SIDES_M)
    return ItemSiteRanges(
        side_m=side_m,
        air_height_m=18.0,
        zone_side_m=18.0,
        tnt_kg=(50.0, 500.0),
        vehicle_probability=0.7,
        road_length_m=_shares_m(side_m, (0.25, 0.6)),
        entry_m=(6.0, 10.0),
        forecourt_m=(7.0, 16.0),
        kerb_m=(8.0, 14.0),
        zone_from_border_m=_shares_m(side_m, (0.1, 0.14)),
        stand_off_m=_shares_m(side_m, (0.4, 0.6)),
        facade_m=_shares_m(side_m, (0.22, 0.34)),
        depth_m=_shares_m(side_m, (0.13, 0.23)),
        storeys=(1, 4),
        second_probability=0.5,
        shed_side_m=(3.0, 8.0),
        shift_m=_shares_m(side_m, (-0.1, 0.1)),
        path_width_m=(2.0, 3.0),
        trees=(0, 4),
        tree_side_m=(1.0, 3.0),
        clearance_m=(1.0, 3.0),
        access_way_width_m=(3.5, 4.5),
        budget=(20.0, 60.0),
    )


def _check_side(side_m: float, bounds_m: Span) -> None:
    low_m, high_m = bounds_m
    if not low_m <= side_m <= high_m:
        raise BlastEnvError(f"side_m is {side_m:g}, must be {low_m:g} to {high_m:g}")


def _shares_m(side_m: float, shares: Span) -> Span:
    """Return a span in m that grows with the site."""
    low, high = shares
    return on_grid(low * side_m), on_grid(high * side_m)


_ROAD_M: Final = 2.0
"""Distance from the left border to a road, and depth of a parking area."""

_BETWEEN_M: Final = 2.0
"""Distance between two buildings."""

STOREY_M: Final = 3.0


class ItemSitePlan(NamedTuple):
    """The plan of a site, m.

    Attributes:
        buildings: The protected buildings.
        zone: The build zone.
        front_m: x of the nearest facade.
        middle_m: y of the middle of road or entry.
    """

    buildings: tuple[Rectangle, ...]
    zone: Rectangle
    front_m: float
    middle_m: float


def _draw_plan(draws: Draws, ranges: ItemSiteRanges) -> ItemSitePlan:
    # 1. Where the road or the entry is, and how far the facades are.
    middle_m = ranges.side_m / 2.0 + draws.length_m(ranges.shift_m)
    front_m = _ROAD_M + draws.length_m(ranges.stand_off_m)
    rows = 2 if draws.happens(ranges.second_probability) else 1
    most_m = (ranges.side_m - 2.0 * MARGIN_M - (rows - 1) * _BETWEEN_M) / rows
    # Two are drawn in any case, so that later draws do not depend on the number of buildings.
    facades_m = [draws.length_m((ranges.facade_m[0], min(ranges.facade_m[1], on_grid(most_m))))]
    facades_m += [draws.length_m((ranges.facade_m[0], min(ranges.facade_m[1], on_grid(most_m))))]
    facades_m = facades_m[:rows]
    # 2. The buildings one above the other, inside the margins.
    together_m = sum(facades_m) + (rows - 1) * _BETWEEN_M
    bottom = on_grid(ranges.side_m / 2.0 + draws.length_m(ranges.shift_m) - together_m / 2.0)
    bottom = min(max(bottom, MARGIN_M), ranges.side_m - MARGIN_M - together_m)
    buildings = []
    for number, facade_m in enumerate(facades_m):
        room_m = ranges.side_m - MARGIN_M - front_m
        back_m = draws.length_m((0.0, 2.0)) if number else 0.0
        depth_m = draws.length_m((ranges.depth_m[0], min(ranges.depth_m[1], room_m - back_m)))
        corner_m = (front_m + back_m, bottom)
        buildings.append(Rectangle.from_corner(corner_m, (depth_m, facade_m)))
        bottom += facade_m + _BETWEEN_M
    # 3. The zone between road and buildings, midway between their middles.
    left = draws.length_m(ranges.zone_from_border_m)
    middles = (middle_m + sum(building.centre[1] for building in buildings) / len(buildings)) / 2.0
    low = on_grid(middles - ranges.zone_side_m / 2.0)
    low = min(max(low, 0.0), ranges.side_m - ranges.zone_side_m)
    zone = Rectangle.from_corner((left, low), (ranges.zone_side_m,) * 2)
    return ItemSitePlan(tuple(buildings), zone, front_m, on_grid(middle_m))


def _place(draws: Draws, ranges: ItemSiteRanges, plan: ItemSitePlan) -> dict[str, Any]:
    """Return the source of a charge on a stretch of road or a parking area."""
    length_m = draws.length_m(ranges.road_length_m)
    bottom = on_grid(plan.middle_m - length_m / 2.0)
    bottom = min(max(bottom, MARGIN_M), ranges.side_m - MARGIN_M - length_m)
    tnt_kg = draws.amount(ranges.tnt_kg, 0)
    left, right = _ROAD_M, _ROAD_M
    if draws.happens(ranges.parking_probability):
        left, right = MARGIN_M, _ROAD_M + 1.0
    return source(Rectangle(left, bottom, right, bottom + length_m), tnt_kg)


def _vehicle(draws: Draws, ranges: ItemSiteRanges, plan: ItemSitePlan) -> dict[str, Any]:
    """Return a vehicle that enters on the left and drives up to the kerb before the buildings."""
    # The forecourt lies abreast of the zone, so that its pieces can bar all of it.
    width_m = draws.length_m(ranges.vehicle_width_m)
    court_m = draws.length_m(ranges.forecourt_m)
    entry_m = min(draws.length_m(ranges.entry_m), court_m)
    zone = plan.zone
    bottom = min(max(on_grid(plan.middle_m - court_m / 2.0), zone.bottom), zone.top - court_m)
    start_m = bottom + draws.length_m((0.0, on_grid(court_m - entry_m)))
    kerb_m = draws.length_m(ranges.kerb_m)
    return {
        "kind": "vehicle",
        "tnt_kg": draws.amount(ranges.tnt_kg, 0),
        "width_m": width_m,
        "entries": [{"start_m": [0.0, start_m], "end_m": [0.0, start_m + entry_m]}],
        "drivable": [{"corner_m": [0.0, bottom], "size_m": [plan.front_m - kerb_m, court_m]}],
    }


def _structures(draws: Draws, ranges: ItemSiteRanges, plan: ItemSitePlan) -> list[dict[str, Any]]:
    """Return the protected buildings, and perhaps a shed if there is room."""
    structures: list[dict[str, Any]] = []
    for number, building in enumerate(plan.buildings):
        weight = round(draws.amount(ranges.second_weight, 1), 1) if number else 1.0
        name, height_m = "annexe" if number else "building", STOREY_M * draws.count(ranges.storeys)
        own = {"protected": True, "weight": weight, "height_m": height_m}
        structures.append(structure(name, building, **own))
    if draws.happens(ranges.shed_probability):
        size_m = (draws.length_m(ranges.shed_side_m), draws.length_m(ranges.shed_side_m))
        far_m = ranges.side_m - MARGIN_M
        area = Rectangle(2.0 * _ROAD_M, MARGIN_M, far_m, far_m)
        others = [ObstacleSpace(building, _BETWEEN_M) for building in plan.buildings]
        shed = draw_place(draws, area, size_m, [*others, ObstacleSpace(plan.zone, 0.0)])
        if shed is not None:
            structures.append(structure("shed", shed, height_m=STOREY_M))
    return structures


def _zone(
    draws: Draws, ranges: ItemSiteRanges, plan: ItemSitePlan, has_vehicle: bool
) -> dict[str, Any]:
    """Return the build zone with its conditions, catalogue and budget."""
    zone = plan.zone
    keep_outs = _keep_outs(draws, ranges, plan)
    document: dict[str, Any] = {
        "corner_m": [zone.left, zone.bottom],
        "rows": ranges.zone_cells,
        "columns": ranges.zone_cells,
        "clearance_m": draws.length_m(ranges.clearance_m),
        "items": _items(draws, ranges, has_vehicle),
        "budget": draws.amount(ranges.budget, 0),
        "keep_outs": keep_outs,
    }
    if draws.happens(ranges.access_way_probability):
        document["access_way"] = _access_way(draws, ranges, zone, has_vehicle)
    if draws.happens(ranges.duct_probability):
        start_m = draws.length_m((0.0, on_grid(ranges.zone_side_m - 2.0)))
        document["cost_areas"] = [
            {
                "corner_m": [zone.left + start_m, zone.bottom],
                "size_m": [2.0, ranges.zone_side_m],
                "cost_factor": draws.amount(ranges.duct_factor, 1),
                "reason": "deep foundations over the duct",
            }
        ]
    return document


def _items(draws: Draws, ranges: ItemSiteRanges, has_vehicle: bool) -> list[dict[str, Any]]:
    """Return the catalogue: the same items for all sites, some of them not in stock."""
    # One power of the height for all items of a site: what height costs differs by site.
    power = draws.amount(ranges.price_of_height, 1)
    always = draws.count((1, 2))  # one of the two kinds of T-walls
    items = []
    for number, kind in enumerate(ITEM_KINDS):
        height_m, pieces = draws.length_m(kind.heights_m), draws.count(kind.pieces)
        is_there = draws.happens(ranges.item_probability) or number == always
        if kind.name == POST:
            is_there = has_vehicle
        length_m = kind.length_modules * MODULE_SIDE_M
        items.append(
            {
                "name": kind.name,
                "length_modules": kind.length_modules,
                "thickness_modules": kind.thickness_modules,
                "height_m": height_m,
                "cost": round(max(length_m * height_m**power, 1.0), 1),
                "stock": pieces if is_there else 0,
                "rotatable": kind.rotatable,
            }
        )
    return items


def _keep_outs(draws: Draws, ranges: ItemSiteRanges, plan: ItemSitePlan) -> list[dict[str, Any]]:
    """Return a path to the door and trees, within the zone before the buildings."""
    zone, building = plan.zone, plan.buildings[0]
    places: list[tuple[str, Rectangle]] = []
    width_m = draws.length_m(ranges.path_width_m)
    if draws.happens(ranges.path_probability):
        path = draw_path(draws, zone, building, width_m)
        if path is not None:
            places.append(("the path to the door must stay open", path))
    for _ in range(draws.count(ranges.trees)):
        side_m = draws.length_m(ranges.tree_side_m)
        others = [ObstacleSpace(place, 0.0) for _, place in places]
        tree = draw_place(draws, yard(zone, building), (side_m, side_m), others)
        if tree is not None:
            places.append(("tree", tree))
    return [ground(place, reason=reason) for reason, place in places]


def _access_way(
    draws: Draws, ranges: ItemSiteRanges, zone: Rectangle, has_vehicle: bool
) -> dict[str, Any]:
    """Return an access way along the buildings or, with a vehicle, towards them with a gate."""
    width_m = draws.length_m(ranges.access_way_width_m)
    if not has_vehicle:
        return {"width_m": width_m, "between": "bottom_top"}
    low = zone.bottom + draws.length_m((0.0, on_grid(ranges.zone_side_m - width_m)))
    gate = {"corner_m": [zone.left, low], "size_m": [MODULE_SIDE_M, width_m]}
    return {"width_m": width_m, "between": "left_right", "gate": gate}
