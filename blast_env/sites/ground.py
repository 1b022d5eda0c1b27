"""Drawing where threat, buildings and build zone lie; the threat is on the left."""

from dataclasses import dataclass
from typing import Final

from blast_env.geometry import Rectangle
from blast_env.sites.draws import Draws, on_grid
from blast_env.sites.places import Apart, draw_place
from blast_env.sites.range_checks import Span
from blast_env.sites.ranges import MARGIN_M, SiteRanges

NEIGHBOUR_DISTANCE_M: Final = 2.0
"""Least distance of the neighbouring building from the protected one and from the threat."""


@dataclass(frozen=True)
class Ground:
    """Where things lie on a site, m.

    Attributes:
        threat: Where the centre of the charge may be; of no width if that is a line.
        building: The protected building.
        zone: The build zone.
        neighbour: The unprotected building, if there is one.
    """

    threat: Rectangle
    building: Rectangle
    zone: Rectangle
    neighbour: Rectangle | None


def draw_ground(draws: Draws, ranges: SiteRanges) -> Ground:
    """Draw where things lie."""
    threat = _draw_threat(draws, ranges)
    building = _draw_building(draws, ranges, threat)
    zone = _draw_zone(draws, ranges, threat, building)
    neighbour = None
    if draws.happens(ranges.neighbour_probability):
        neighbour = _draw_neighbour(draws, ranges, Ground(threat, building, zone, None))
    return Ground(threat, building, zone, neighbour)


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


def _draw_neighbour(draws: Draws, ranges: SiteRanges, ground: Ground) -> Rectangle | None:
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
    """Draw the lower end of a thing along the road from how far its middle is from the site's."""
    lowest = on_grid((ranges.side_m - length_m) / 2.0)
    bottom = lowest + draws.length_m(shift_m)
    return min(max(bottom, MARGIN_M), ranges.side_m - MARGIN_M - length_m)


def _at_most(span_m: Span, most_m: float) -> Span:
    return span_m[0], min(span_m[1], most_m)
