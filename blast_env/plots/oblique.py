"""The oblique view of a site: isometric, with one scale for lengths, widths and heights."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, radians, sin, tan
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import UnknownNameError
from blast_env.geometry import Element, Place, Rectangle, Side, open_sides, outlines
from blast_env.plots.plan import (
    INK,
    STANDING,
    Feature,
    Kinds,
    in_boxes,
    on_levels,
    site_features,
    vehicle_features,
    without,
)
from blast_env.plots.site_plan import area_style, draw_features
from blast_env.plots.style import nice_floor, render_extra, unit_interval
from blast_env.site import Scenario
from blast_env.site.boxes import TOLERANCE_M
from blast_env.site.zone import source_bounds_m

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

CORNERS: Final = ("southwest", "southeast", "northeast", "northwest")
"""Corners of a site nearest to the viewer; south is towards smaller y, west towards smaller x."""

_ACROSS, _UP = cos(radians(30.0)), sin(radians(30.0))

_LEAST_M = 1e-6  # between features that lie on each other
_BOXES_LEVEL, _LEVEL_STEP = 3.0, 1e-4  # drawing levels of the boxes

_TOP, _RIGHT_SIDE, _LEFT_SIDE = 1.0, 0.82, 0.66
"""Brightness of the three visible faces of a box."""

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class ObliqueView:
    """The projection of places on a site, and heights above it, to the picture.

    Attributes:
        site_m: The site.
        corner: The corner nearest to the viewer.
    """

    site_m: Rectangle
    corner: str = "southwest"

    def __post_init__(self) -> None:
        """Check the corner.

        Raises:
            UnknownNameError: If there is no such corner.
        """
        if self.corner not in CORNERS:
            raise UnknownNameError("corner", self.corner, CORNERS)

    def towards(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the distances from the near corner, m: up to the right, and up to the left."""
        left, bottom, right, top = self.site_m
        if self.corner == "southwest":
            return x - left, y - bottom
        if self.corner == "southeast":
            return y - bottom, right - x
        if self.corner == "northeast":
            return right - x, top - y
        return top - y, x - left

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return positions in the picture (n, 2), with metres to scale along all three axes.

        Args:
            points_m: x, y and height above the ground, (n, 3), m.
        """
        x, y, z = np.asarray(points_m, dtype=np.float64).T
        right, left = self.towards(x, y)
        return np.column_stack([(right - left) * _ACROSS, (right + left) * _UP + z])

    def on_ground(self, rectangle_m: Rectangle, height_m: float = 0.0) -> FloatArray:
        """Return the corners of a rectangle, counterclockwise from the near one (4, 2)."""
        return self.places(self._corners_m(rectangle_m, height_m))

    def faces(
        self, rectangle_m: Rectangle, height_m: float, base_m: float = 0.0
    ) -> tuple[FloatArray, ...]:
        """Return the visible faces of a box: the right side, the left side, the top."""
        low, high = (self.on_ground(rectangle_m, each) for each in (base_m, height_m))
        right = np.array([low[0], low[1], high[1], high[0]])
        left = np.array([low[0], low[3], high[3], high[0]])
        return right, left, high

    def _corners_m(self, rectangle_m: Rectangle, height_m: float) -> FloatArray:
        """Return the corners of a rectangle, counterclockwise from the near one (4, 3)."""
        x0, y0, x1, y1 = rectangle_m
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        corners = np.roll(corners, -CORNERS.index(self.corner), axis=0)
        return np.column_stack([corners, np.full(4, height_m)])


def corner_towards(scenario: Scenario) -> str:
    """Return the corner from which the walls that face the charges are visible.

    It is on the side of the charges as seen from the protected structures; if they are straight
    to one side, it is the corner of that side to the south or west.
    """
    protected = [each.rectangle_m for each in scenario.structures if each.protected]
    rectangles = protected or [each.rectangle_m for each in scenario.structures]
    to_x, to_y = Rectangle.around([source_bounds_m(each) for each in scenario.charge]).centre
    from_x, from_y = Rectangle.around(rectangles).centre
    along_x, along_y = to_x - from_x, to_y - from_y
    straight = tan(radians(22.5))  # nearer to a side than to a corner
    east, north = along_x > straight * abs(along_y), along_y > straight * abs(along_x)
    if north:
        return "northeast" if east else "northwest"
    return "southeast" if east else "southwest"


class Tile(NamedTuple):
    """A part of a wall in a separate colour.

    Attributes:
        wall: Its wall: west, east, south or north.
        corners_m: Its corners in order (4, 3).
        colour: Its colour.
    """

    wall: str
    corners_m: FloatArray
    colour: Colour


class Box(NamedTuple):
    """A structure or a barrier in a view.

    Attributes:
        rectangle_m: Its plan.
        height_m: Its height.
        colour: Colour of its top.
        edge: Colour of its edges.
        tiles: Parts of its walls.
        base_m: Height of its base.
        sides: The parts of its outline with a line, counterclockwise; without those at which it
            continues in another box.
        corners: Corners between walls, with an upright line.
    """

    rectangle_m: Rectangle
    height_m: float
    colour: Colour
    edge: Colour
    tiles: Sequence[Tile] = ()
    base_m: float = 0.0
    sides: Sequence[Side] = ()
    corners: Collection[Place] = ()


class Lid(NamedTuple):
    """A part of the build zone, or of an area in it, that lies on a terrace.

    Attributes:
        rectangle_m: Its plan.
        height_m: The height of the terrace.
        feature: The feature of which it is a part.
        sides: The parts of its outline with a line.
    """

    rectangle_m: Rectangle
    height_m: float
    feature: Feature
    sides: Sequence[Side]

    @property
    def base_m(self) -> float:
        """Its height in the order of painting: below all boxes on the terrace."""
        return self.height_m - _LEAST_M * (Kinds.CHARGE.level - self.feature.kind.level)


def painted_order(
    view: ObliqueView, rectangles_m: Sequence[Rectangle], bases_m: Sequence[float] | None = None
) -> list[int]:
    """Return the order of painting of boxes, from the rear to the front.

    A box is behind another if a plane along the x or the y axis separates them with the other on
    the viewer's side, and none separates them with itself on that side. Disjoint boxes have such an
    order for any heights: it is the same for all directions of one quadrant.

    Args:
        view: The view.
        rectangles_m: The plans of the boxes.
        bases_m: Heights of their bases; by default on the ground. Boxes with overlapping plans are
            above each other, and the lowest comes first.
    """
    left, bottom, right, top = np.array(rectangles_m, dtype=np.float64).reshape(-1, 4).T
    first, second = view.towards(left, bottom), view.towards(right, top)
    near, far = np.minimum(first, second), np.maximum(first, second)
    beyond: BoolArray = np.logical_or.reduce(
        near[:, :, np.newaxis] >= far[:, np.newaxis, :] - TOLERANCE_M
    )
    lower = np.subtract.outer(bases_m or np.zeros(len(left)), bases_m or np.zeros(len(left))) < 0.0
    behind = (beyond & ~beyond.T) | (lower & ~beyond & ~beyond.T)
    waits_for = behind.sum(axis=0)
    order: list[int] = []
    for _ in rectangles_m:
        chosen = int(np.argmin(waits_for))
        order.append(chosen)
        waits_for -= behind[chosen]
        waits_for[chosen] = len(rectangles_m) + 1
    return order


def draw_oblique(
    axes: Axes,
    scenario: Scenario,
    layout: Sequence[Element] = (),
    corner: str | None = None,
    tiles: Mapping[str, Sequence[Tile]] = MappingProxyType({}),
) -> tuple[ObliqueView, tuple[Feature, ...]]:
    """Draw a site with structures and barriers, heights to scale, and the places of charges.

    Structures without a height are drawn as high as the air; charges and stand-offs are drawn over
    everything else, to be visible.

    Args:
        axes: Empty axes.
        scenario: The scenario.
        layout: The layout of the build zone; it must fit there.
        corner: The corner nearest to the viewer; by default that of `corner_towards`.
        tiles: Parts of the walls of structures, by the names of these.

    Returns:
        The view, for further drawing, and the features drawn.

    Raises:
        UnknownNameError: If there is no such corner.
    """
    site_m = scenario.site.rectangle_m
    view = ObliqueView(site_m, corner or corner_towards(scenario))
    features = (*_raised(scenario, layout), *vehicle_features(scenario, layout))
    standing = [each for each in features if each.kind in STANDING]
    boxes = [
        box._replace(tiles=own)
        for box, own in zip(_boxes_of(standing), _tiles_of(standing, tiles), strict=True)
    ]
    flat = without(features, *STANDING)
    lids = [each for each in flat if each.base_m > 0.0]
    _set_up(axes, view, boxes)
    draw_features(axes, [each for each in flat if each.base_m == 0.0], view)
    _draw_boxes(axes, view, boxes, _lids_of(lids))
    _draw_scale(axes, view)
    return view, features


def _tiles_of(standing: Sequence[Feature], tiles: Mapping[str, Sequence[Tile]]) -> list[list[Tile]]:
    """Return the tiles on each box; each tile of a structure is on the nearest of its boxes."""
    found: list[list[Tile]] = [[] for _ in standing]
    for name, own in tiles.items():
        numbers = [number for number, each in enumerate(standing) if each.name == name]
        for tile in own:
            x_m, y_m, _ = tile.corners_m.mean(axis=0).tolist()
            away_m = {each: standing[each].bounds_m.distance_to((x_m, y_m)) for each in numbers}
            if away_m:
                found[min(away_m, key=lambda each: away_m[each])].append(tile)
    return found


def boxes_of(scenario: Scenario, layout: Sequence[Element] = ()) -> list[Box]:
    """Return the boxes of a site: structures, and the modules or pieces of the layout."""
    return _boxes_of([each for each in _raised(scenario, layout) if each.kind in STANDING])


def _raised(scenario: Scenario, layout: Sequence[Element]) -> tuple[Feature, ...]:
    """Return the features of a site; structures without a height get that of the air."""
    air = {"height_m": scenario.air_height_m}
    return tuple(
        replace(each, properties={**air, **each.properties}) if each.kind in STANDING else each
        for each in in_boxes(on_levels(site_features(scenario, layout), scenario.structures))
    )


def _outlined(features: Sequence[Feature]) -> list[tuple[list[Side], frozenset[Place]]]:
    """Return the sides of each feature with a line, and the corners of the whole it belongs to."""
    wholes: dict[object, list[int]] = {}
    for number, each in enumerate(features):
        whole = (each.kind, each.look, each.part_of) if each.part_of else number
        wholes.setdefault(whole, []).append(number)
    found: dict[int, tuple[list[Side], frozenset[Place]]] = {}
    for numbers in wholes.values():
        plans = [features[number].bounds_m for number in numbers]
        corners = frozenset(place for outline in outlines(plans) for place in outline)
        found |= {
            number: (sides, corners)
            for number, sides in zip(numbers, open_sides(plans), strict=True)
        }
    return [found[number] for number in range(len(features))]


def _boxes_of(features: Sequence[Feature]) -> list[Box]:
    """Return features as boxes, without lines between the parts of one building."""
    return [
        _box_of(each)._replace(sides=sides, corners=corners)
        for each, (sides, corners) in zip(features, _outlined(features), strict=True)
    ]


def _lids_of(features: Sequence[Feature]) -> list[Lid]:
    """Return features on terraces as lids."""
    return [
        Lid(each.bounds_m, each.base_m, each, sides)
        for each, (sides, _) in zip(features, _outlined(features), strict=True)
    ]


def _box_of(feature: Feature) -> Box:
    height_m = feature.properties["height_m"]
    assert isinstance(height_m, float)
    if feature.kind is Kinds.BARRIER:
        colour = unit_interval(feature.colour or INK)
    else:
        colour = _lighter(unit_interval(feature.kind.look.line or INK))
    return Box(feature.bounds_m, height_m, colour, unit_interval(INK), base_m=feature.base_m)


def scale_length_m(site_m: Rectangle) -> float:
    """Return a round length for the scale bar of a site, at most a third of its width, m."""
    return nice_floor((site_m.right - site_m.left) / 3.0)


def _lighter(colour: Colour) -> Colour:
    red, green, blue = (each + 0.45 * (1.0 - each) for each in colour)
    return red, green, blue


def _set_up(axes: Axes, view: ObliqueView, boxes: Sequence[Box]) -> None:
    ground = view.on_ground(view.site_m)
    left, bottom = ground.min(axis=0)
    right, top = ground.max(axis=0)
    roofs = [view.on_ground(box.rectangle_m, box.height_m)[:, 1].max() for box in boxes]
    margin_m = 0.06 * (right - left)
    axes.set(xlim=(left - margin_m, right + margin_m), aspect="equal")
    axes.set_ylim(bottom - 1.6 * margin_m, max(top, *roofs) + margin_m)
    axes.axis("off")


class _Shapes:
    """Polygons in the order of painting."""

    def __init__(self) -> None:
        self._shapes: list[FloatArray] = []
        self._colours: list[Colour] = []
        self._edges: list[Colour] = []

    def paint(self, shape: FloatArray, colour: Colour, edge: Colour) -> None:
        """Add a polygon."""
        self._shapes.append(shape)
        self._colours.append(colour)
        self._edges.append(edge)

    def draw(self, axes: Axes, level: float) -> None:
        """Draw all polygons at a drawing level."""
        shapes = PolyCollection(self._shapes, facecolor=self._colours, edgecolor=self._edges)
        shapes.set(linewidth=0.5, zorder=level, joinstyle="round")
        axes.add_collection(shapes, autolim=False)


def _draw_boxes(
    axes: Axes, view: ObliqueView, boxes: Sequence[Box], lids: Sequence[Lid] = ()
) -> None:
    things: list[Box | Lid] = [*boxes, *lids]
    shapes, level = _Shapes(), _BOXES_LEVEL
    bases_m = [each.base_m for each in things]
    for number in painted_order(view, [each.rectangle_m for each in things], bases_m):
        thing = things[number]
        if isinstance(thing, Box):
            _paint_box(shapes, view, thing)
            continue
        shapes.draw(axes, level)
        _draw_lid(axes, view, thing, level + 0.5 * _LEVEL_STEP)
        shapes, level = _Shapes(), level + _LEVEL_STEP
    shapes.draw(axes, level)


def _paint_box(shapes: _Shapes, view: ObliqueView, box: Box) -> None:
    faces = view.faces(box.rectangle_m, box.height_m, box.base_m)
    for face, bright in zip(faces, (_RIGHT_SIDE, _LEFT_SIDE, _TOP), strict=True):
        red, green, blue = (bright * part for part in box.colour)
        shapes.paint(face, (red, green, blue), (red, green, blue))
    for line in _lines_of(view, box):
        shapes.paint(line, box.edge, box.edge)
    for tile in box.tiles:
        if tile.wall in view.corner:  # "southwest": south and west walls are visible
            shapes.paint(view.places(tile.corners_m), tile.colour, box.edge)


def _draw_lid(axes: Axes, view: ObliqueView, lid: Lid, level: float) -> None:
    look = lid.feature.look
    if look.hatched or lid.feature.colour is not None:
        area = Polygon(view.on_ground(lid.rectangle_m, lid.height_m))
        area.set(**area_style(look, lid.feature.colour) | {"linewidth": 0.0}, zorder=level)
        axes.add_patch(area)
    if look.line is not None:
        ends = [np.array([(*place, lid.height_m) for place in side]) for side in lid.sides]
        style = "--" if look.dashed else "-"
        lines = LineCollection([view.places(each) for each in ends], linestyles=style)
        lines.set(color=unit_interval(look.line), linewidth=look.width, zorder=level)
        axes.add_collection(lines, autolim=False)


def _lines_of(view: ObliqueView, box: Box) -> Iterator[FloatArray]:
    """Yield the visible lines of a box: around its top, below and between its walls."""
    low_m, high_m = box.base_m, box.height_m
    for start, end in box.sides:
        yield view.places(np.array([(*start, high_m), (*end, high_m)]))
        if _wall_of(start, end) in view.corner:
            yield view.places(np.array([(*start, low_m), (*end, low_m)]))
            for place in {start, end} & {*box.corners}:
                yield view.places(np.array([(*place, low_m), (*place, high_m)]))


def _wall_of(start: Place, end: Place) -> str:
    """Return the name of the wall at a side of a counterclockwise outline."""
    if start[1] == end[1]:
        return "south" if end[0] > start[0] else "north"
    return "east" if end[1] > start[1] else "west"


def _draw_scale(axes: Axes, view: ObliqueView) -> None:
    """Draw a scale bar along the near side of the site."""
    length_m, ink = scale_length_m(view.site_m), unit_interval(INK)
    near = view.on_ground(view.site_m)[:2]
    along = (near[1] - near[0]) / np.hypot(*(near[1] - near[0]))
    start = near[0] + np.array([0.5, -1.0]) * 0.05 * np.ptp(axes.get_xlim())
    ends = np.array([start, start + length_m * along])
    axes.add_line(Line2D(*ends.T, color=ink, linewidth=3.0, solid_capstyle="butt", zorder=2.0))
    axes.annotate(
        f"{length_m:g} m, also upwards",
        ends.mean(axis=0),
        xytext=(6.0, -6.0),
        textcoords="offset points",
        ha="left",
        va="top",
        fontsize=8,
        color=ink,
    )
