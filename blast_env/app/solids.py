"""A site in three dimensions, as boxes."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from blast_env.geometry import Layout, Rectangle
from blast_env.particles.objects import Colour
from blast_env.plots.plan import (
    EXPLOSIVE,
    STANDING,
    Feature,
    Kinds,
    in_boxes,
    on_levels,
    site_features,
)
from blast_env.site import Scenario

_GROUND: Final[Colour] = (223, 228, 234)
_ZONE: Final[Colour] = (185, 217, 195)
_GROUND_M: Final = 0.1
_ZONE_M: Final = 0.04
_LINE_M: Final = 0.3
_SIGN_M: Final = 0.6
SEE_THROUGH: Final = 0.45
"""Opacity of a structure without a height."""


class SolidBox(NamedTuple):
    """A box.

    Attributes:
        size_m: Its sides.
        colour: Its colour, `#rrggbb`.
        opacity: 1, or less for a see-through box: as high as the air, or a place of a charge.
        name: Its label.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    colour: str
    opacity: float
    name: str


def boxes(scenario: Scenario, layout: Layout) -> Iterator[SolidBox]:
    """Yield the boxes of a site with a layout; one without height is see-through up to the air."""
    for feature in in_boxes(on_levels(site_features(scenario, layout), scenario.structures)):
        bounds_m = feature.bounds_m
        if feature.kind is Kinds.SITE:
            yield _box(bounds_m, -_GROUND_M, 0.0, _GROUND, 1.0, "site")
        elif feature.kind is Kinds.BUILD_ZONE:
            base_m = feature.base_m
            yield _box(bounds_m, base_m, base_m + _ZONE_M, _ZONE, 1.0, feature.name)
        elif feature.kind in STANDING:
            yield _standing(feature, scenario.air_height_m)
        elif feature.kind in (Kinds.CHARGE_PLACE, Kinds.GAUGE):
            yield from _place(feature)


def _standing(feature: Feature, air_m: float) -> SolidBox:
    height_m = feature.properties.get("height_m")
    known = isinstance(height_m, float)
    colour = feature.colour if feature.kind is Kinds.BARRIER else feature.kind.look.line
    name = str(feature.properties.get("item", feature.name))
    top_m = height_m if isinstance(height_m, float) else air_m
    opacity = 1.0 if known else SEE_THROUGH
    return _box(feature.bounds_m, feature.base_m, top_m, colour or EXPLOSIVE, opacity, name)


def _place(feature: Feature) -> Iterator[SolidBox]:
    """Yield the possible places of a charge, or a gauge: a point, a line along an axis, an area."""
    low_m, colour = feature.above_ground_m, feature.kind.look.line or EXPLOSIVE
    name, bounds_m = feature.label or feature.name, feature.bounds_m
    if len(feature.places_m) > 2:
        yield _box(bounds_m, low_m, low_m + 0.2, colour, 0.5, name)
        return
    if len(feature.places_m) == 2 and (
        bounds_m.left == bounds_m.right or bounds_m.bottom == bounds_m.top
    ):
        line_m = bounds_m.grown(_LINE_M / 2.0)
        yield _box(line_m, low_m, low_m + 0.2, colour, 0.6, name)
    x_m, y_m = bounds_m.centre
    middle_m = Rectangle(x_m, y_m, x_m, y_m).grown(_SIGN_M / 2.0)
    yield _box(middle_m, low_m, low_m + _SIGN_M, colour, 1.0, name)


def _box(
    rectangle_m: Rectangle, low_m: float, high_m: float, colour: Colour, opacity: float, name: str
) -> SolidBox:
    x_m, y_m = rectangle_m.centre
    size_m = (
        rectangle_m.right - rectangle_m.left,
        rectangle_m.top - rectangle_m.bottom,
        high_m - low_m,
    )
    middle_m = (x_m, y_m, (low_m + high_m) / 2.0)
    return SolidBox(middle_m, size_m, "#{:02x}{:02x}{:02x}".format(*colour), opacity, name)
