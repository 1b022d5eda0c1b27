"""Random generation of a site: ground, structures, charges and conditions."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.site import (
    SCHEMA_VERSION,
    AccessWay,
    AnySource,
    BuildZone,
    CostArea,
    KeepOut,
    ModularObstacleSection,
    RectangleSource,
    Scenario,
    ScenarioError,
    SegmentSource,
    SimulationSection,
    Site,
)
from blast_env.sites.criterion import Objection, SiteCriterion, VisibilityCriterion
from blast_env.sites.item_sites import ItemSiteRanges, draw_item_site
from blast_env.sites.ranges import MARGIN_M, Apart, Draws, SiteRanges, Span, draw_place, on_grid
from blast_env.sites.turning import turned
from blast_env.units import MODULE_SIDE_M

NEIGHBOUR_DISTANCE_M: Final = 2.0
"""Least distance of the neighbouring building from the protected one and from the threat."""


@dataclass(frozen=True)
class SiteGround:
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


def draw_ground(draws: Draws, ranges: SiteRanges) -> SiteGround:
    """Draw the plan of a site."""
    threat = _draw_threat(draws, ranges)
    building = _draw_building(draws, ranges, threat)
    zone = _draw_zone(draws, ranges, threat, building)
    neighbour = None
    if draws.happens(ranges.neighbour_probability):
        neighbour = _draw_neighbour(draws, ranges, SiteGround(threat, building, zone, None))
    return SiteGround(threat, building, zone, neighbour)


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
    middle = (threat.centre[1] + building.centre[1]) / 2.0
    bottom = on_grid(middle - side_m / 2.0) + draws.length_m(ranges.zone_shift_m)
    bottom = min(max(bottom, 0.0), ranges.side_m - side_m)
    return Rectangle.from_corner((left, bottom), (side_m, side_m))


def _draw_neighbour(draws: Draws, ranges: SiteRanges, ground: SiteGround) -> Rectangle | None:
    """Draw a building beside or before the protected one, outside the zone, if there is room."""
    size_m = (draws.length_m(ranges.neighbour_side_m), draws.length_m(ranges.neighbour_side_m))
    area = Rectangle(MARGIN_M, MARGIN_M, ground.building.right, ranges.side_m - MARGIN_M)
    others = (
        Apart(ground.building, NEIGHBOUR_DISTANCE_M),
        Apart(ground.threat, NEIGHBOUR_DISTANCE_M),
        Apart(ground.zone, 0.0),
    )
    return draw_place(draws, area, size_m, others)


def _draw_bottom(draws: Draws, ranges: SiteRanges, shift_m: Span, length_m: float) -> float:
    """Draw the lower end of an object along the road, from the shift of its middle."""
    lowest = on_grid((ranges.side_m - length_m) / 2.0)
    bottom = lowest + draws.length_m(shift_m)
    return min(max(bottom, MARGIN_M), ranges.side_m - MARGIN_M - length_m)


def _at_most(span_m: Span, most_m: float) -> Span:
    return span_m[0], min(span_m[1], most_m)


HYDRANT_SIDE_M: Final = 1.5
"""Side of the square around a hydrant that must stay free."""


def draw_build_zone(draws: Draws, ranges: SiteRanges, ground: SiteGround) -> BuildZone:
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


def _draw_keep_outs(draws: Draws, ranges: SiteRanges, ground: SiteGround) -> tuple[KeepOut, ...]:
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


def _draw_path(draws: Draws, ranges: SiteRanges, ground: SiteGround) -> list[KeepOut]:
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


def _draw_access_way(draws: Draws, ranges: SiteRanges, ground: SiteGround) -> AccessWay:
    """Draw an access way along the facade or, if the building leaves room, towards it."""
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


def _yard(ground: SiteGround) -> Rectangle:
    """Return the part of the zone before the building."""
    zone = ground.zone
    return Rectangle(zone.left, zone.bottom, min(zone.right, ground.building.left), zone.top)


AnyRanges = SiteRanges | ItemSiteRanges
"""The ranges of a family of sites."""

RANGES: Final = SiteRanges()
"""The default ranges of sites."""

CRITERION: Final = VisibilityCriterion()
"""The default criterion of sites of `SiteRanges`."""

ITEM_CRITERION: Final = VisibilityCriterion(
    least_layout_share=0.5, most_layout_share=1.0, least_advantage=0.25
)
"""The same for `ItemSiteRanges`: a wall may cut all lines in plan, since blast passes over it."""


def criterion_of(ranges: AnyRanges) -> SiteCriterion:
    """Return the default criterion of a family of sites."""
    return ITEM_CRITERION if isinstance(ranges, ItemSiteRanges) else CRITERION


MOST_TRIES: Final = 200
"""Most sites that are drawn for a seed."""

MOST_SEED: Final = 2**63 - 1

PROTECTED: Final = "building"
"""Name of the protected structure."""

_SIDES: Final = ("left", "lower", "right", "upper")


def generate_site(
    seed: int, ranges: AnyRanges = RANGES, criterion: SiteCriterion | None = None
) -> Scenario:
    """Return the site of a seed: the first site of its random stream that the criterion accepts.

    It is a pure function of its arguments, in any process. The name is `site_` with the seed for
    all ranges and criteria; the content hash distinguishes sites.

    Args:
        seed: 0 to 2^63 - 1.
        ranges: Ranges of the site.
        criterion: Acceptance criterion; the family's default unless given (`criterion_of`).

    Raises:
        BlastEnvError: If the seed is out of bounds, or none of 200 sites is accepted.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise BlastEnvError(f"seed is {seed!r}, must be an integer")
    if not 0 <= seed <= MOST_SEED:
        raise BlastEnvError(f"seed is {seed}, must be 0 to {MOST_SEED}")
    rng = np.random.default_rng(int(seed))
    wanted = criterion or criterion_of(ranges)
    objections: list[Objection] = []
    for _ in range(MOST_TRIES):
        try:
            site = draw_site(rng, ranges, f"site_{seed}")
        except ScenarioError as error:
            problem = error.problems[0]
            objections.append(Objection(f"{problem.key}: must fit", problem.message))
            continue
        objection = wanted.objection(site)
        if objection is None:
            return site
        objections.append(objection)
    raise _nothing_accepted(int(seed), objections)


def draw_site(rng: np.random.Generator, ranges: AnyRanges, name: str) -> Scenario:
    """Draw a site without applying a criterion.

    Args:
        rng: The random stream.
        ranges: Ranges of the site.
        name: Name of the site.

    Raises:
        ScenarioError: If the drawn objects are inconsistent, which does not happen with the
            default ranges.
    """
    if isinstance(ranges, ItemSiteRanges):
        return draw_item_site(rng, ranges, name)
    draws = Draws(rng)
    ground = draw_ground(draws, ranges)
    source = _source(ground.threat, draws.amount(ranges.tnt_kg, 0))
    structures = [_structure("building", ground.building)]
    if ground.neighbour is not None:
        structures.append(_structure("neighbour", ground.neighbour))
    zone = draw_build_zone(draws, ranges, ground)
    quarter_turns = draws.count((0, 3))
    document = {
        "schema_version": SCHEMA_VERSION,
        "name": name,
        "description": _description(ground, _SIDES[quarter_turns]),
        "calibration": ranges.calibration,
        "site": Site(width_m=ranges.side_m, height_m=ranges.side_m),
        "charge": (source,),
        "structures": tuple(structures),
        "build_zone": zone,
        "simulation": SimulationSection(preset=ranges.preset),
    }
    site = Scenario.from_document(document, name)
    return turned(site, quarter_turns)


def _source(threat: Rectangle, tnt_kg: float) -> AnySource:
    """Return the charge on a stretch of road or a parking area."""
    left, bottom, right, top = threat
    if left == right:
        return SegmentSource(
            kind="segment", start_m=(left, bottom), end_m=(right, top), tnt_kg=tnt_kg
        )
    size_m = (right - left, top - bottom)
    return RectangleSource(kind="rectangle", corner_m=(left, bottom), size_m=size_m, tnt_kg=tnt_kg)


def _structure(name: str, rectangle: Rectangle) -> ModularObstacleSection:
    left, bottom, right, top = rectangle
    return ModularObstacleSection(
        kind="ModularObstacle",
        name=name,
        corner_m=(left, bottom),
        rows=round((top - bottom) / MODULE_SIDE_M),
        columns=round((right - left) / MODULE_SIDE_M),
        protected=name == PROTECTED,
    )


def _description(ground: SiteGround, side: str) -> str:
    building, threat = ground.building, ground.threat
    return (
        f"A generated site: a building with a facade of {building.top - building.bottom:g} m,"
        f" {building.left - threat.right:g} m from a"
        f" {'road' if threat.left == threat.right else 'parking area'} along the {side} side."
    )


def _nothing_accepted(seed: int, objections: Sequence[Objection]) -> BlastEnvError:
    """Return the error with the count and the last value of each violated rule."""
    counted = Counter(objection.rule for objection in objections)
    last = {objection.rule: objection.found for objection in objections}
    reasons = "; ".join(
        f"{rule} ({count} times, the last one {last[rule]})"
        for rule, count in counted.most_common()
    )
    return BlastEnvError(
        f"site of seed {seed}: none of {len(objections)} sites drawn is accepted: {reasons};"
        " change the ranges or the criterion"
    )
