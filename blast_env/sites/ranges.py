"""Ranges of generated sites, draws within them, and the parts of a site that all families share."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat, StrictInt, ValidationError

from blast_env.geometry import Rectangle, box_distances_m
from blast_env.problems import problems_from
from blast_env.sections import Name, Section
from blast_env.site import Problem, ScenarioError
from blast_env.site.parameters import PresetName
from blast_env.sites.criterion import VisibilityCriterion
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.vehicle import WholeModules

Span = tuple[float, float]
"""Lowest and highest value, both possible."""

WholeSpan = tuple[int, int]
"""Lowest and highest whole number, both possible."""

_TOLERANCE: Final = 1e-9  # of a module


def modules_within(span_m: Span) -> tuple[int, int]:
    """Return the least and the largest whole number of modules in a range of lengths."""
    low_m, high_m = span_m
    return ceil(low_m / MODULE_SIDE_M - _TOLERANCE), floor(high_m / MODULE_SIDE_M + _TOLERANCE)


def _check_rising(span: Span) -> Span:
    if span[0] > span[1]:
        problem = Problem("", f"is {span}, must be a pair (lowest, highest)")
        raise ScenarioError("ranges", [problem])
    return span


def _check_grid(span_m: Span) -> Span:
    first, last = modules_within(_check_rising(span_m))
    if first > last:
        message = f"is {span_m}, must have a multiple of {MODULE_SIDE_M:g} m between"
        raise ScenarioError("ranges", [Problem("", message)])
    return span_m


_Length = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0)]
_Gap = Annotated[StrictFloat, Field(ge=0.0, le=2000.0)]
_Shift = Annotated[StrictFloat, Field(ge=-2000.0, le=2000.0)]
_Amount = Annotated[StrictFloat, Field(ge=0.1, le=1e9)]
_Number = Annotated[StrictInt, Field(ge=0, le=90)]
_Count = Annotated[StrictInt, Field(ge=1, le=10_000)]

Probability = Annotated[StrictFloat, Field(ge=0.0, le=1.0)]
Side = Annotated[StrictFloat, Field(ge=2.0, le=2000.0), WholeModules]
ZoneSide = Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=500.0), WholeModules]
Lengths = Annotated[tuple[_Length, _Length], AfterValidator(_check_grid)]
Gaps = Annotated[tuple[_Gap, _Gap], AfterValidator(_check_grid)]
Shifts = Annotated[tuple[_Shift, _Shift], AfterValidator(_check_grid)]
Amounts = Annotated[tuple[_Amount, _Amount], AfterValidator(_check_rising)]
Numbers = Annotated[tuple[_Number, _Number], AfterValidator(_check_rising)]
Counts = Annotated[tuple[_Count, _Count], AfterValidator(_check_rising)]

MARGIN_M: Final = 1.0
"""Width of the free strip along the border of a site."""


class SiteParts(NamedTuple):
    """The drawn parts of a site.

    Attributes:
        description: Its description, with `{side}` for the side of the threat after the turn.
        sections: The sections of its scenario that differ between sites, as plain data.
    """

    description: str
    sections: dict[str, Any]


class Ranges(Section):
    """Base of the ranges of a family of sites.

    A pair is the lowest and the highest value, both included, of a uniform distribution; lengths
    are drawn on the 0.5 m grid of the modules. Descriptions assume the threat on the left;
    `generate_site` turns the site by right angles.

    Attributes:
        preset: Preset of the particle model.
        calibration: Name of the calibration for the particle engines.

    Raises:
        ScenarioError: If a value is out of bounds, there is no such preset, or the site is too
            small for these ranges.
    """

    preset: PresetName = "collisional"
    calibration: Name = "collisional_kb"

    criterion: ClassVar[VisibilityCriterion]
    """The default acceptance criterion."""

    def __init__(self, **values: Any) -> None:
        """Check the values; see the class for the errors."""
        try:
            super().__init__(**values)
        except ValidationError as error:
            problems = problems_from(error, type(self))
            raise ScenarioError(type(self).__name__, problems) from error

    def changed(self, **values: Any) -> Self:
        """Return the ranges with other values; see the class for the errors."""
        return type(self)(**{**self.model_dump(), **values})

    def drawn(self, draws: "Draws") -> SiteParts:
        """Draw a site."""
        raise NotImplementedError


class SquareRanges(Ranges):
    """Base of the ranges of square sites, all of one size, with square build zones of one size.

    Attributes:
        side_m: Width and height of the site, m.
        zone_side_m: Width and height of the build zone, m.
    """

    side_m: Side
    zone_side_m: ZoneSide

    @property
    def zone_cells(self) -> int:
        """Number of rows and of columns of the build zone."""
        return round(self.zone_side_m / MODULE_SIDE_M)

    def _without_room(self, needs_m: Mapping[str, float]) -> Iterator[Problem]:
        """Yield a problem for each need of the ranges for which the site is too small."""
        for what, need_m in needs_m.items():
            if need_m > self.side_m:
                message = (
                    f"is {self.side_m:g}, must be at least {need_m:g}, to have room for {what}"
                )
                yield Problem("side_m", message)


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of random values; each method takes one number from the stream."""

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


class ObstacleSpace(NamedTuple):
    """An obstacle with a least distance.

    Attributes:
        rectangle: Its rectangle, m.
        distance_m: Least distance to it; at 0 rectangles may touch, but not overlap.
    """

    rectangle: Rectangle
    distance_m: float


def draw_place(
    draws: Draws, area: Rectangle, size_m: tuple[float, float], others: Sequence[ObstacleSpace]
) -> Rectangle | None:
    """Draw the place of a rectangle, uniformly over the allowed places on the 0.5 m grid.

    Args:
        area: Area within which it must lie, m; its corner is on the grid.
        size_m: Width and height.

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


def source(threat: Rectangle, tnt_kg: float) -> dict[str, Any]:
    """Return the charge in a parking area or, if its width is 0, on a stretch of road."""
    left, bottom, right, top = threat
    if left == right:
        ends = {"start_m": (left, bottom), "end_m": (right, top)}
        return {"kind": "segment", **ends, "tnt_kg": tnt_kg}
    return {"kind": "rectangle", **ground(threat), "tnt_kg": tnt_kg}


def structure(name: str, rectangle: Rectangle, **others: Any) -> dict[str, Any]:
    """Return a block of modules."""
    left, bottom, right, top = rectangle
    return {
        "kind": "ModularObstacle",
        "name": name,
        "corner_m": (left, bottom),
        "rows": round((top - bottom) / MODULE_SIDE_M),
        "columns": round((right - left) / MODULE_SIDE_M),
        **others,
    }


def ground(rectangle: Rectangle, **others: Any) -> dict[str, Any]:
    """Return a rectangle of the site."""
    left, bottom, right, top = rectangle
    return {"corner_m": (left, bottom), "size_m": (right - left, top - bottom), **others}


def draw_path(
    draws: Draws, zone: Rectangle, building: Rectangle, width_m: float
) -> Rectangle | None:
    """Draw a path through the zone to the door of a building; `None` if no door leads there."""
    lowest = max(zone.bottom, building.bottom)
    highest = min(zone.top, building.top) - width_m
    if highest < lowest:
        return None
    corner_m = (zone.left, draws.length_m((lowest, highest)))
    return Rectangle.from_corner(corner_m, (yard(zone, building).right - zone.left, width_m))


def yard(zone: Rectangle, building: Rectangle) -> Rectangle:
    """Return the part of the zone before a building."""
    return zone._replace(right=min(zone.right, building.left))
