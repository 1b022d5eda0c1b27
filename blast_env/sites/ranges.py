"""Bounds of a dataclass's values as annotations, their checks, and draws within bounds."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import ceil, floor
from typing import Annotated, Any, ClassVar, Final, NamedTuple, TypeGuard, get_type_hints

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.site.boxes import box_distances_m
from blast_env.site.parameters import preset
from blast_env.units import MODULE_SIDE_M

Span = tuple[float, float]
"""Lowest and highest value, both possible."""

WholeSpan = tuple[int, int]
"""Lowest and highest whole number, both possible."""

_TOLERANCE: Final = 1e-9  # of a module


@dataclass(frozen=True)
class Bounds:
    """A number within bounds.

    Attributes:
        least: Lower bound.
        most: Upper bound.
    """

    least: float
    most: float

    words: ClassVar[str] = "a number"

    def __str__(self) -> str:
        return f"{self.words} from {self.least:.10g} to {self.most:.10g}"

    def allow(self, value: object) -> bool:
        """Return whether a value has the right form and is within bounds."""
        return self._is_within(value)

    def _is_within(self, value: object) -> TypeGuard[float]:
        if not isinstance(value, int | float) or isinstance(value, bool):
            return False
        return self.least <= value <= self.most


class PairBounds(Bounds):
    """A pair (lowest, highest) of numbers within bounds."""

    words = "a pair (lowest, highest) of numbers"

    def allow(self, value: object) -> bool:
        """Return whether a value has the right form and is within bounds."""
        return self._is_pair(value)

    def _is_pair(self, value: object) -> TypeGuard[Span]:
        if not (isinstance(value, tuple) and len(value) == 2):
            return False
        return all(map(self._is_within, value)) and value[0] <= value[1]


class CountsBounds(PairBounds):
    """A pair of whole numbers within bounds."""

    words = "a pair (lowest, highest) of whole numbers"

    def allow(self, value: object) -> bool:
        """Return whether a value has the right form and is within bounds."""
        return self._is_pair(value) and all(isinstance(each, int) for each in value)


class LengthBounds(Bounds):
    """A length of whole modules within bounds, m."""

    words = f"a multiple of {MODULE_SIDE_M:g} m"

    def allow(self, value: object) -> bool:
        """Return whether a value has the right form and is within bounds."""
        return self._is_within(value) and _has_grid((value, value))


class LengthsBounds(PairBounds):
    """A pair of lengths within bounds, m, with whole modules between them."""

    words = f"a pair (lowest, highest) with a multiple of {MODULE_SIDE_M:g} m between,"

    def allow(self, value: object) -> bool:
        """Return whether a value has the right form and is within bounds."""
        return self._is_pair(value) and _has_grid(value)


def check_bounds(instance: Any) -> None:
    """Check the fields of a dataclass that are annotated with bounds.

    Raises:
        BlastEnvError: If a value is out of bounds; the message names field, value and bound.
    """
    hints = get_type_hints(type(instance), include_extras=True)
    for each in fields(instance):
        value = getattr(instance, each.name)
        for bounds in getattr(hints[each.name], "__metadata__", ()):
            if not bounds.allow(value):
                owner = type(instance).__name__
                raise BlastEnvError(f"{owner}: {each.name} is {value!r}, must be {bounds}")


def modules_within(span_m: Span) -> tuple[int, int]:
    """Return the least and the largest whole number of modules in a range of lengths."""
    low_m, high_m = span_m
    return ceil(low_m / MODULE_SIDE_M - _TOLERANCE), floor(high_m / MODULE_SIDE_M + _TOLERANCE)


def _has_grid(span_m: Span) -> bool:
    first, last = modules_within(span_m)
    return first <= last


Probability = Annotated[float, Bounds(0.0, 1.0)]

MARGIN_M: Final = 1.0
"""Width of the free strip along the border of a site."""


@dataclass(frozen=True)
class SiteRanges:
    """Ranges of generated sites.

    A pair is the lowest and the highest value, both included, of a uniform distribution; lengths
    are drawn on the 0.5 m grid of the modules. Descriptions assume the threat on the left;
    `generate_site` turns the site by right angles.

    Sites of the same ranges have one size, and build zones of one size.

    Attributes:
        side_m: Width and height of the site, m.
        zone_side_m: Width and height of the build zone, m.
        tnt_kg: TNT-equivalent mass of the charge, rounded to whole kg within the range.
        road_from_border_m: From the left border to road or parking area, m.
        road_length_m: Length of the stretch of road with the charge, m.
        parking_probability: Probability of a parking area instead of the road.
        parking_length_m: Length of a parking area along the road, m.
        parking_depth_m: Its depth, m.
        threat_shift_m: From the middle of the site to that of road or parking area, m.
        stand_off_m: From road or parking area to the facade of the protected building, m; limited
            by the room on the site.
        facade_m: Length of that facade, m.
        depth_m: Depth of the protected building, m; limited by the room on the site.
        building_shift_m: From the middle of the site to that of the facade, m.
        neighbour_probability: Probability of an unprotected building, if there is room.
        neighbour_side_m: Its width, and its height, m.
        zone_from_threat_m: From road or parking area to the build zone, m.
        zone_shift_m: From midway between threat and facade to the zone's middle, along the
            road, m.
        path_probability: Probability of a path from the road to the door that is kept free.
        path_width_m: Its width, m.
        hydrant_probability: Probability of a hydrant, a no-build area 1.5 m square.
        trees: Number of trees, each a no-build area.
        tree_side_m: Side of the square of a tree, m.
        clearance_m: Least distance between a module and a building, m.
        access_way_probability: Probability of an access way that must stay open.
        access_way_width_m: Its width, m.
        stock: Number of modules.
        duct_probability: Probability of a budget, and of a duct with dearer modules above it.
        duct_width_m: Width of the strip above the duct, m.
        duct_module_cost: Cost of a module in it; elsewhere it is 1.
        budget_share: Budget divided by stock.
        preset: Preset of the particle model.
        calibration: Name of the calibration for the particle engines.

    Raises:
        BlastEnvError: If a value is out of bounds, or the site is too small for these ranges.
        UnknownNameError: If there is no such preset.
    """

    side_m: Annotated[float, LengthBounds(2.0, 2000.0)] = 36.0
    zone_side_m: Annotated[float, LengthBounds(0.5, 500.0)] = 14.0
    tnt_kg: Annotated[Span, PairBounds(0.1, 100_000.0)] = (50.0, 300.0)
    road_from_border_m: Annotated[Span, LengthsBounds(MARGIN_M, 2000.0)] = (2.0, 5.0)
    road_length_m: Annotated[Span, LengthsBounds(0.5, 2000.0)] = (8.0, 20.0)
    parking_probability: Probability = 0.35
    parking_length_m: Annotated[Span, LengthsBounds(0.5, 2000.0)] = (6.0, 14.0)
    parking_depth_m: Annotated[Span, LengthsBounds(0.5, 2000.0)] = (2.5, 4.0)
    threat_shift_m: Annotated[Span, LengthsBounds(-2000.0, 2000.0)] = (-4.0, 4.0)
    stand_off_m: Annotated[Span, LengthsBounds(1.0, 2000.0)] = (12.0, 20.0)
    facade_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (6.0, 14.0)
    depth_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (4.0, 12.0)
    building_shift_m: Annotated[Span, LengthsBounds(-2000.0, 2000.0)] = (-5.0, 5.0)
    neighbour_probability: Probability = 0.5
    neighbour_side_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (3.0, 6.0)
    zone_from_threat_m: Annotated[Span, LengthsBounds(0.5, 2000.0)] = (3.0, 6.0)
    zone_shift_m: Annotated[Span, LengthsBounds(-2000.0, 2000.0)] = (-1.5, 1.5)
    path_probability: Probability = 0.75
    path_width_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (1.5, 2.5)
    hydrant_probability: Probability = 0.5
    trees: Annotated[WholeSpan, CountsBounds(0, 90)] = (0, 3)
    tree_side_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (1.0, 2.5)
    clearance_m: Annotated[Span, LengthsBounds(0.0, 2000.0)] = (0.0, 2.0)
    access_way_probability: Probability = 0.35
    access_way_width_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (2.5, 4.0)
    stock: Annotated[WholeSpan, CountsBounds(1, 10_000)] = (8, 20)
    duct_probability: Probability = 0.35
    duct_width_m: Annotated[Span, LengthsBounds(0.5, 500.0)] = (1.5, 4.0)
    duct_module_cost: Annotated[Span, PairBounds(0.1, 1e9)] = (1.5, 4.0)
    budget_share: Annotated[Span, PairBounds(0.1, 1e6)] = (0.75, 1.5)
    preset: str = "collisional"
    calibration: str = "collisional_kb"

    def __post_init__(self) -> None:
        """Check the values; see the class for the errors."""
        check_bounds(self)
        preset(self.preset)
        self._check_room()

    @property
    def zone_cells(self) -> int:
        """Number of rows and of columns of the build zone."""
        return round(self.zone_side_m / MODULE_SIDE_M)

    def _check_room(self) -> None:
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
        for what, need_m in needs_m.items():
            if need_m > self.side_m:
                raise BlastEnvError(
                    f"SiteRanges: side_m is {self.side_m:g}, must be at least {need_m:g},"
                    f" to have room for {what}"
                )
        if self.zone_from_threat_m[1] >= self.stand_off_m[0]:
            raise BlastEnvError(
                f"SiteRanges: zone_from_threat_m is {self.zone_from_threat_m}, must be less than"
                f" {self.stand_off_m[0]:g}, the least stand_off_m: the zone begins before the"
                " building"
            )


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of random values; each method takes one number from the stream.

    Attributes:
        rng: The random stream.
    """

    rng: np.random.Generator

    def length_m(self, span_m: Span) -> float:
        """Return a multiple of 0.5 m; the next one above the range if it has none."""
        first, last = modules_within(span_m)
        return int(self.rng.integers(first, max(first, last), endpoint=True)) * MODULE_SIDE_M

    def amount(self, span: Span, digits: int) -> float:
        """Return a number, rounded to `digits` decimal places within the range."""
        low, high = span
        drawn = round(low + (high - low) * float(self.rng.random()), digits)
        return min(max(drawn, low), high)

    def count(self, span: WholeSpan) -> int:
        """Return a whole number."""
        return int(self.rng.integers(*span, endpoint=True))

    def happens(self, probability: float) -> bool:
        """Return true with this probability."""
        return bool(self.rng.random() < probability)


def on_grid(value_m: float) -> float:
    """Return the largest multiple of 0.5 m that is not above a length."""
    return floor(value_m / MODULE_SIDE_M + 1e-9) * MODULE_SIDE_M


_TOLERANCE_M = 1e-9


class Apart(NamedTuple):
    """An obstacle with a least distance.

    Attributes:
        rectangle: Its rectangle, m.
        distance_m: Least distance to it; at 0 rectangles may touch, but not overlap.
    """

    rectangle: Rectangle
    distance_m: float


def draw_place(
    draws: Draws, area: Rectangle, size_m: tuple[float, float], others: Sequence[Apart]
) -> Rectangle | None:
    """Draw the place of a rectangle, uniformly over the allowed places on the 0.5 m grid.

    Args:
        draws: Draws.
        area: Area within which it must lie, m; its corner is on the grid.
        size_m: Width and height.
        others: Obstacles.

    Returns:
        The rectangle, m; `None` if there is no allowed place.
    """
    width_m, height_m = size_m
    left = np.arange(area.left, area.right - width_m + _TOLERANCE_M, MODULE_SIDE_M)
    bottom = np.arange(area.bottom, area.top - height_m + _TOLERANCE_M, MODULE_SIDE_M)
    bottom = bottom[:, np.newaxis]
    boxes = (left, bottom, left + width_m, bottom + height_m)
    has_room = np.ones((len(bottom), len(left)), dtype=bool)
    for rectangle, distance_m in others:
        if distance_m > 0.0:
            has_room &= box_distances_m(rectangle, boxes) >= distance_m - _TOLERANCE_M
        else:
            # Shrunk slightly, so that a touching rectangle is at a distance above 0.
            has_room &= box_distances_m(rectangle.grown(-_TOLERANCE_M), boxes) > 0.0
    places = np.argwhere(has_room)
    if not len(places):
        return None
    row, column = places[draws.count((0, len(places) - 1))].tolist()
    corner_m = (float(left[column]), float(bottom[row, 0]))
    return Rectangle.from_corner(corner_m, size_m)
