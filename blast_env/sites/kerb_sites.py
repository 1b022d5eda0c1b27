"""Sites like the small bundled ones: fronts along a kerb, walls opposite, charges of 15 to 200 kg.

No two need have one size, catalogue or build zone, so an environment of a fixed action space takes
one size of them at a time. Studies draw the size with the seed (`kerb_site`).
"""

from collections.abc import Sequence
from math import exp, log
from typing import Annotated, Any, ClassVar, Final, NamedTuple

import numpy as np
from pydantic import Field, StrictFloat

from blast_env.geometry import Rectangle
from blast_env.site import Scenario
from blast_env.sites.criterion import VisibilityCriterion
from blast_env.sites.generate import generate_site
from blast_env.sites.ranges import (
    Amounts,
    Counts,
    Draws,
    Gaps,
    Lengths,
    ObstacleSpace,
    Probability,
    Ranges,
    Side,
    SiteParts,
    Span,
    draw_path,
    draw_place,
    ground,
    on_grid,
    structure,
)
from blast_env.units import MODULE_SIDE_M
from blast_env.values import checked_seed

ACROSS_M: Final[Span] = (13.0, 34.0)
"""Least and largest size of a site from the kerb to behind the front, m."""

ALONG_M: Final[Span] = (10.0, 24.0)
"""Least and largest size along the kerb, m."""

STREET_ACROSS_M: Final[Span] = (9.0, 18.0)
"""Least and largest size of a street from behind one front to behind the other, m."""

STREET_ALONG_M: Final[Span] = (10.0, 26.0)
"""Least and largest size along the street, m."""

COURT_ACROSS_M: Final[Span] = (13.0, 24.0)
"""Least and largest size of a court from the kerb to behind the front, m."""

COURT_ALONG_M: Final[Span] = (12.0, 24.0)
"""Least and largest size across that, m."""

SQUARE_ACROSS_M: Final[Span] = (10.0, 20.0)
"""Least and largest size of a square from the kerb to behind the front, m."""

SQUARE_ALONG_M: Final[Span] = (14.0, 26.0)
"""Least and largest size across that, m."""

LOW_ACROSS_M: Final[Span] = (11.0, 18.0)
"""Least and largest size of a site of low buildings from the kerb to behind the front, m."""

LOW_ALONG_M: Final[Span] = (12.0, 22.0)
"""Least and largest size across that, m."""

LANE_ACROSS_M: Final[Span] = (9.0, 13.0)
"""Least and largest size of a lane from behind one front to behind the other, m."""

LANE_ALONG_M: Final[Span] = (16.0, 26.0)
"""Least and largest size along the lane, m."""

_HEIGHTS_M: Final = (0.8, 1.0, 1.0, 1.4, 2.0, 2.0, 2.5, 3.0, 3.6, 3.6, 4.0)
"""Heights of pieces of the catalogue and of T-walls."""

_FREE_M: Final = 0.5
"""Least distance of a front from the border along the kerb."""


class KerbSiteRanges(Ranges):
    """Ranges of sites with a front along a kerb.

    See `Ranges`. The kerb is on the left, the fronts on the right.

    Attributes:
        across_m: Width of the site, from the kerb to behind the front, m.
        along_m: Its height, along the kerb, m.
        tnt_kg: TNT-equivalent mass of the charge; its logarithm is uniform.
        depth_m: Depth of the buildings on the site, m.
        front_height_m: Height of the protected buildings, m.
        behind_m: From the back of the buildings to the border, m.
        front_share: Length of the front as a share of `along_m`.
        second_probability: Probability of a second protected building beside the first, if there
            is room.
        second_weight: Weight of its load.
        opposite_probability: Probability of buildings behind the charge.
        opposite_m: Their depth, m.
        wing_probability: Probability of a wall at right angles to the front, which makes a court.
        all_faces_probability: Probability that all sides of the buildings count, not the front.
        places: Number of places of a charge that does not move.
        vehicle_probability: Probability of a vehicle instead.
        entry_m: Length of its entry along the border, m.
        kerb_m: Least distance between vehicle and front, m.
        zone_from_charge_m: From the charge to the build zone, m.
        clearance_m: Least distance between a piece and a building, m.
        strip_probability: Probability of a strip along the front where nothing may stand.
        path_probability: Probability of a path to the door.
        items: Number of items of the catalogue.
        length_modules: Modules along a piece.
        thick_probability: Probability of a piece of two modules across.
        pieces: Pieces of an item in stock.
        price_of_height: Exponent p in the cost of a piece, length times height to the power p.
        budget_share: Budget, as a share of the cost of a wall of 2 m along the whole front.
        air_above_m: Air above the tallest building, m.
    """

    across_m: Side
    along_m: Side
    tnt_kg: Amounts = (15.0, 200.0)
    depth_m: Lengths = (2.0, 4.0)
    front_height_m: Lengths = (3.0, 10.0)
    behind_m: Gaps = (0.0, 2.0)
    front_share: Amounts = (0.4, 0.95)
    second_probability: Probability = 0.3
    second_weight: Amounts = (0.5, 2.0)
    opposite_probability: Probability = 0.35
    opposite_m: Lengths = (1.5, 2.5)
    wing_probability: Probability = 0.15
    all_faces_probability: Probability = 0.2
    places: Counts = (1, 3)
    vehicle_probability: Probability = 0.3
    entry_m: Lengths = (4.0, 7.0)
    kerb_m: Gaps = (3.0, 10.0)
    zone_from_charge_m: Lengths = (1.0, 2.5)
    clearance_m: Gaps = (0.0, 1.0)
    strip_probability: Probability = 0.3
    path_probability: Probability = 0.4
    items: Counts = (2, 4)
    length_modules: Counts = (1, 9)
    thick_probability: Probability = 0.25
    pieces: Counts = (2, 10)
    price_of_height: Amounts = (0.8, 1.6)
    budget_share: Amounts = (0.4, 2.0)
    air_above_m: Annotated[StrictFloat, Field(ge=0.5, le=50.0)] = 3.0

    criterion: ClassVar = VisibilityCriterion(
        least_layout_share=0.2, most_layout_share=1.0, least_advantage=0.05, most_open_share=1.0
    )

    def drawn(self, draws: Draws) -> SiteParts:
        """Draw a site."""
        plan = _draw_plan(draws, self)
        has_vehicle = draws.happens(self.vehicle_probability)
        charge = _vehicle(draws, self, plan) if has_vehicle else _places(draws, self, plan)
        buildings = _buildings(draws, self, plan)
        tallest_m = max(building["height_m"] for building in buildings)
        sections = {
            "site": {
                "width_m": self.across_m,
                "height_m": self.along_m,
                "air_height_m": tallest_m + self.air_above_m,
            },
            "charge": charge,
            "structures": buildings,
            "build_zone": _zone(draws, self, plan, has_vehicle),
        }
        what = "a vehicle" if has_vehicle else f"{len(charge)} places of a car"
        return SiteParts(f"A generated site: {what} before a front on the far side.", sections)


class KerbSitePlan(NamedTuple):
    """The plan of a site, m.

    Attributes:
        fronts: The protected buildings.
        opposite: The building behind the charge, if there is one.
        wing: The wall at right angles to the front, if there is one.
        charge_x_m: Where charges lie.
        front_x_m: x of the nearest front.
        zone: The build zone.
    """

    fronts: tuple[Rectangle, ...]
    opposite: Rectangle | None
    wing: Rectangle | None
    charge_x_m: float
    front_x_m: float
    zone: Rectangle


def kerb_site(seed: int) -> Scenario:
    """Return the site of a seed, of a size that the seed draws.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    draws = Draws(np.random.default_rng((checked_seed(seed), len(_HEIGHTS_M))))
    across_m, along_m = draws.length_m(ACROSS_M), draws.length_m(ALONG_M)
    return generate_site(seed, KerbSiteRanges(across_m=across_m, along_m=along_m))


def street_site(seed: int) -> Scenario:
    """Return the site of a seed where a vehicle drives along the fronts, to within 2 m of them.

    It is a street between the protected fronts and a building opposite, open at both ends.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    return _site_of_kind(
        seed,
        1,
        (STREET_ACROSS_M, STREET_ALONG_M),
        opposite_probability=1.0,
        wing_probability=0.0,
        vehicle_probability=1.0,
        kerb_m=(0.0, 2.0),
        zone_from_charge_m=(0.5, 1.0),
    )


def court_site(seed: int) -> Scenario:
    """Return the site of a seed where a charge lies in a court between several buildings.

    A wing at right angles to the front makes a re-entrant corner, if there is room for it.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    return _site_of_kind(
        seed,
        2,
        (COURT_ACROSS_M, COURT_ALONG_M),
        tnt_kg=(30.0, 150.0),
        depth_m=(2.0, 6.0),
        front_share=(0.35, 0.75),
        second_probability=0.7,
        opposite_probability=0.6,
        wing_probability=1.0,
        all_faces_probability=0.5,
        vehicle_probability=0.2,
    )


def square_site(seed: int) -> Scenario:
    """Return the site of a seed with short fronts, past whose ends charges may go off.

    Two of them compete for the budget, or a vehicle is kept away to the open ends of a street.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    return _site_of_kind(
        seed,
        3,
        (SQUARE_ACROSS_M, SQUARE_ALONG_M),
        tnt_kg=(50.0, 150.0),
        front_share=(0.2, 0.5),
        second_probability=0.6,
        opposite_probability=0.5,
        places=(2, 3),
        vehicle_probability=0.5,
        kerb_m=(0.0, 4.0),
        zone_from_charge_m=(0.5, 2.0),
    )


def low_site(seed: int) -> Scenario:
    """Return the site of a seed with buildings of one storey, as low as the walls before them.

    A wall close to such a front shuts it off, and the blast comes round the ends of both.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    return _site_of_kind(
        seed,
        4,
        (LOW_ACROSS_M, LOW_ALONG_M),
        tnt_kg=(40.0, 150.0),
        front_height_m=(2.5, 4.5),
        front_share=(0.25, 0.6),
        second_probability=0.7,
        opposite_probability=0.25,
        wing_probability=0.0,
        places=(2, 3),
        vehicle_probability=0.2,
        kerb_m=(2.0, 6.0),
    )


def lane_site(seed: int) -> Scenario:
    """Return the site of a seed where a vehicle drives along a lane between two short fronts.

    Who keeps it away from the front has it before the mouth of the lane, with a wall between.

    Args:
        seed: As for `generate_site`.

    Raises:
        BlastEnvError: As `generate_site`.
    """
    return _site_of_kind(
        seed,
        5,
        (LANE_ACROSS_M, LANE_ALONG_M),
        tnt_kg=(40.0, 150.0),
        depth_m=(2.0, 3.0),
        front_share=(0.2, 0.45),
        second_probability=0.2,
        opposite_probability=1.0,
        opposite_m=(2.0, 3.0),
        wing_probability=0.0,
        vehicle_probability=1.0,
        kerb_m=(0.0, 2.0),
        zone_from_charge_m=(0.5, 1.0),
    )


def _site_of_kind(seed: int, kind: int, size_m: tuple[Span, Span], **values: Any) -> Scenario:
    """Return a site of a size that the seed draws.

    Args:
        seed: As for `generate_site`.
        kind: Number of the kind, so that no two kinds draw the same sizes.
        size_m: Ranges of its size across and along, m.
        **values: Ranges in which it differs from sites along a kerb.
    """
    draws = Draws(np.random.default_rng((checked_seed(seed), len(_HEIGHTS_M), kind)))
    across_m, along_m = map(draws.length_m, size_m)
    return generate_site(seed, KerbSiteRanges(across_m=across_m, along_m=along_m, **values))


def _draw_plan(draws: Draws, ranges: KerbSiteRanges) -> KerbSitePlan:
    # (1) The building behind the charge, and the charge before it.
    opposite, charge_x_m = None, draws.length_m((0.5, 3.0))
    if draws.happens(ranges.opposite_probability):
        length_m = _share_of(draws, ranges.along_m, ranges.front_share)
        corner_m = (0.0, draws.length_m((0.0, ranges.along_m - length_m)))
        opposite = Rectangle.from_corner(corner_m, (draws.length_m(ranges.opposite_m), length_m))
        charge_x_m = opposite.right + draws.length_m((0.5, 3.0))
    # (2) The fronts: the first one anywhere along the kerb, the second where there is room left.
    fronts = [_front(draws, ranges, _FREE_M, ranges.along_m - _FREE_M)]
    if draws.happens(ranges.second_probability):
        (first,) = fronts
        low_m, high_m = first.top + 1.0, ranges.along_m - _FREE_M
        if first.bottom - _FREE_M > high_m - first.top:
            low_m, high_m = _FREE_M, first.bottom - 1.0
        if high_m - low_m >= 3.0:
            fronts.append(_front(draws, ranges, low_m, high_m))
    front_x_m = min(front.left for front in fronts)
    # (3) A wing beside the first front, which reaches towards the kerb.
    wing = None
    if draws.happens(ranges.wing_probability):
        reach_m = on_grid(0.5 * (front_x_m - charge_x_m))
        bottom = fronts[0].top if draws.happens(0.5) else fronts[0].bottom - 1.0
        is_free = all(front.top <= bottom or front.bottom >= bottom + 1.0 for front in fronts)
        if is_free and 0.0 <= bottom <= ranges.along_m - 1.0 and reach_m >= 1.0:
            wing = Rectangle.from_corner((fronts[0].left - reach_m, bottom), (reach_m, 1.0))
    # (4) The build zone between charge and fronts.
    left = charge_x_m + draws.length_m(ranges.zone_from_charge_m)
    margin_m = draws.length_m((0.0, 1.0))
    zone = Rectangle(left, margin_m, max(front_x_m, left + 2.0), ranges.along_m - margin_m)
    return KerbSitePlan(tuple(fronts), opposite, wing, charge_x_m, front_x_m, zone)


def _front(draws: Draws, ranges: KerbSiteRanges, low_m: float, high_m: float) -> Rectangle:
    """Draw a protected building between two places along the kerb."""
    length_m = min(_share_of(draws, ranges.along_m, ranges.front_share), high_m - low_m)
    bottom = draws.length_m((low_m, high_m - length_m))
    right = ranges.across_m - draws.length_m(ranges.behind_m)
    depth_m = draws.length_m(ranges.depth_m)
    return Rectangle(right - depth_m, bottom, right, bottom + length_m)


def _share_of(draws: Draws, length_m: float, share: Span) -> float:
    low, high = share
    return max(draws.length_m((low * length_m, high * length_m)), 2.0)


def _places(draws: Draws, ranges: KerbSiteRanges, plan: KerbSitePlan) -> list[dict[str, Any]]:
    """Return charges at the kerb, of one mass."""
    mass_kg = _mass_kg(draws, ranges)
    count = draws.count(ranges.places)
    places_m = {draws.length_m((1.0, ranges.along_m - 1.0)) for _ in range(count)}
    return [
        {"kind": "point", "position_m": [plan.charge_x_m, y_m], "tnt_kg": mass_kg}
        for y_m in sorted(places_m)
    ]


def _vehicle(draws: Draws, ranges: KerbSiteRanges, plan: KerbSitePlan) -> list[dict[str, Any]]:
    """Return a vehicle that drives up to the fronts, from the kerb or along the street."""
    entry_m, kerb_m = draws.length_m(ranges.entry_m), draws.length_m(ranges.kerb_m)
    end_m = max(plan.front_x_m - kerb_m, plan.charge_x_m + 1.0)
    if plan.opposite is None:
        bottom = draws.length_m((0.0, ranges.along_m - entry_m))
        lines_m = [([0.0, bottom], [0.0, bottom + entry_m])]
        drivable = Rectangle(0.0, bottom, end_m, bottom + entry_m)
    else:
        start_m = plan.opposite.right
        drivable = Rectangle(start_m, 0.0, max(end_m, start_m + 3.0), ranges.along_m)
        ends_m = (drivable.left, drivable.right)
        lines_m = [([ends_m[0], y_m], [ends_m[1], y_m]) for y_m in (0.0, ranges.along_m)]
    return [
        {
            "kind": "vehicle",
            "tnt_kg": _mass_kg(draws, ranges),
            "width_m": 2.0,
            "entries": [{"start_m": start_m, "end_m": end_m} for start_m, end_m in lines_m],
            "drivable": [ground(drivable)],
        }
    ]


def _mass_kg(draws: Draws, ranges: KerbSiteRanges) -> float:
    low_kg, high_kg = ranges.tnt_kg
    return round(exp(draws.amount((log(low_kg), log(high_kg)), 6)), 0)


def _buildings(draws: Draws, ranges: KerbSiteRanges, plan: KerbSitePlan) -> list[dict[str, Any]]:
    found = []
    faces = {} if draws.happens(ranges.all_faces_probability) else {"faces": ["west"]}
    for number, front in enumerate(plan.fronts):
        weight = round(draws.amount(ranges.second_weight, 1), 1) if number else 1.0
        height_m = draws.length_m(ranges.front_height_m)
        own = {"protected": True, "weight": weight, "height_m": height_m, **faces}
        found.append(structure("annexe" if number else "building", front, **own))
    for name, rectangle in (("opposite", plan.opposite), ("wing", plan.wing)):
        height_m = draws.length_m(ranges.front_height_m)
        if rectangle is not None:
            found.append(structure(name, rectangle, height_m=height_m))
    return found


def _zone(
    draws: Draws, ranges: KerbSiteRanges, plan: KerbSitePlan, has_vehicle: bool
) -> dict[str, Any]:
    zone = plan.zone
    power = draws.amount(ranges.price_of_height, 1)
    along_m = zone.top - zone.bottom
    share = draws.amount(ranges.budget_share, 2)
    return {
        "corner_m": [zone.left, zone.bottom],
        "rows": round(along_m / MODULE_SIDE_M),
        "columns": round((zone.right - zone.left) / MODULE_SIDE_M),
        "clearance_m": draws.length_m(ranges.clearance_m),
        "items": _items(draws, ranges, power, has_vehicle),
        "budget": round(share * along_m * 2.0**power, 0) + 1.0,
        "keep_outs": _keep_outs(draws, ranges, plan),
    }


def _items(
    draws: Draws, ranges: KerbSiteRanges, power: float, has_vehicle: bool
) -> list[dict[str, Any]]:
    """Return the catalogue; where a vehicle drives, posts stand first."""
    items = []
    for number in range(draws.count(ranges.items)):
        is_post = has_vehicle and number == 0
        length = 1 if is_post else draws.count(ranges.length_modules)
        thickness = 2 if draws.happens(ranges.thick_probability) and not is_post else 1
        height_m = 1.0 if is_post else _HEIGHTS_M[draws.count((0, len(_HEIGHTS_M) - 1))]
        items.append(
            {
                "name": "post" if is_post else f"wall_{number}",
                "length_modules": length,
                "thickness_modules": min(thickness, length),
                "height_m": height_m,
                "cost": round(max(length * MODULE_SIDE_M * height_m**power, 1.0), 1),
                "stock": draws.count(ranges.pieces),
                "rotatable": length > 1,
            }
        )
    return items


def _keep_outs(draws: Draws, ranges: KerbSiteRanges, plan: KerbSitePlan) -> list[dict[str, Any]]:
    """Return a strip along the front and a path to the door, where nothing may stand."""
    zone = plan.zone
    found: list[tuple[str, Rectangle]] = []
    if draws.happens(ranges.strip_probability) and zone.right - zone.left > 3.0:
        width_m = draws.length_m((0.5, 1.5))
        left = draws.length_m((zone.left + 0.5, zone.right - width_m - 0.5))
        found.append(("gas main", Rectangle(left, zone.bottom, left + width_m, zone.top)))
    if draws.happens(ranges.path_probability):
        path = draw_path(draws, zone, plan.fronts[0], draws.length_m((1.5, 2.0)))
        if path is not None:
            found.append(("the path to the door must stay open", path))
    spaces: Sequence[ObstacleSpace] = [ObstacleSpace(rectangle, 0.0) for _, rectangle in found]
    if draws.happens(0.3):
        tree = draw_place(draws, zone, (1.0, 1.0), spaces)
        if tree is not None:
            found.append(("tree", tree))
    return [ground(rectangle, reason=reason) for reason, rectangle in found]
