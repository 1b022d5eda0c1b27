"""A site in three dimensions, as boxes."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from blast_env.app import placing
from blast_env.geometry import Layout, Rectangle
from blast_env.scenario import AnySource, RectangleSource, Scenario, VehicleSource
from blast_env.scenario.sections import PointM

PROTECTED: Final = "#008070"
STRUCTURE: Final = "#8a8276"
BARRIER: Final = "#1f2023"
CHARGE: Final = "#e21c24"
GAUGE: Final = "#7b2d8b"
GROUND: Final = "#dfe4ea"
ZONE: Final = "#b9d9c3"

_GROUND_M: Final = 0.1
_DOT_M: Final = 0.6


class Box(NamedTuple):
    """A box.

    Attributes:
        centre_m: Its centre.
        size_m: Its sides.
        colour: Its colour.
        opacity: 1, or less where one can look through it: as high as the air.
        name: What it is.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    colour: str
    opacity: float
    name: str


def boxes(scenario: Scenario, layout: Layout) -> Iterator[Box]:
    """Yield a site with what stands on it; what has no height goes up to the air, see-through."""
    air_m = scenario.air_height_m
    yield _box(scenario.site.rectangle_m, -_GROUND_M, 0.0, GROUND, 1.0, "site")
    if scenario.build_zone is not None:
        zone_m = scenario.build_zone.rectangle_m
        yield _box(zone_m, 0.0, 0.04, ZONE, 1.0, "build zone")
    for each in scenario.structures:
        colour = PROTECTED if each.protected else STRUCTURE
        yield _standing(each.rectangle_m, each.height_m, air_m, colour, each.name)
    for solid in placing.solids(scenario, layout):
        yield _standing(solid.rectangle_m, solid.height_m, air_m, BARRIER, solid.name or "barrier")
    for number, source in enumerate(scenario.charge, start=1):
        yield from _charge(source, f"charge {number}")
    for gauge in scenario.gauges:
        x_m, y_m, z_m = gauge.position_m
        dot = Rectangle(x_m, y_m, x_m, y_m).grown(_DOT_M / 4.0)
        yield _box(dot, z_m - _DOT_M / 4.0, z_m + _DOT_M / 4.0, GAUGE, 1.0, gauge.name)


def _standing(
    rectangle_m: Rectangle, height_m: float | None, air_m: float, colour: str, name: str
) -> Box:
    opacity = 1.0 if height_m is not None else 0.45
    return _box(rectangle_m, 0.0, height_m or air_m, colour, opacity, name)


def _charge(source: AnySource, name: str) -> Iterator[Box]:
    if isinstance(source, RectangleSource):
        low = source.height_m
        yield _box(source.rectangle_m, low, low + 0.2, CHARGE, 0.5, name)
        return
    lines_m = source.lines_m if isinstance(source, VehicleSource) else (source.segment_m,)
    for line_m in lines_m:
        yield from _charge_on_line(line_m, source.height_m, name)


def _charge_on_line(line_m: tuple[PointM, PointM], height_m: float, name: str) -> Iterator[Box]:
    (x0, y0), (x1, y1) = line_m
    line = Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    if x0 == x1 or y0 == y1:
        yield _box(line.grown(0.15), height_m, height_m + 0.2, CHARGE, 0.6, name)
    middle = Rectangle(*line.centre, *line.centre).grown(_DOT_M / 2.0)
    yield _box(middle, height_m, height_m + _DOT_M, CHARGE, 1.0, name)


def _box(
    rectangle_m: Rectangle, low_m: float, high_m: float, colour: str, opacity: float, name: str
) -> Box:
    x_m, y_m = rectangle_m.centre
    across, along = rectangle_m.right - rectangle_m.left, rectangle_m.top - rectangle_m.bottom
    return Box(
        (x_m, y_m, (low_m + high_m) / 2.0), (across, along, high_m - low_m), colour, opacity, name
    )
