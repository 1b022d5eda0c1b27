"""The oblique view of a site: isometric, so that lengths, widths and heights have one scale."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, radians, sin, tan
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import UnknownNameError
from blast_env.geometry import Element, Piece, Rectangle
from blast_env.rendering.style import (
    BORDER,
    EXPLOSIVE,
    INK,
    PROTECTED,
    QUIET_INK,
    SITE,
    STRUCTURE,
    nice_floor,
    render_extra,
    unit_interval,
)
from blast_env.rendering.vehicle_plan import REACHED_ALPHA
from blast_env.scenario import (
    AnySource,
    BuildZone,
    PointSource,
    RectangleSource,
    Scenario,
    SegmentSource,
    VehicleSource,
)
from blast_env.scenario.build_scene import vehicle_reach, worst_places
from blast_env.scenario.sections import PointM
from blast_env.scenario.vehicles import nearest_point_m, squares_of
from blast_env.scenario.zone import TOLERANCE_M, source_bounds_m
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib import patheffects
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch, PathPatch, Polygon
    from matplotlib.path import Path

CORNERS: Final = ("southwest", "southeast", "northeast", "northwest")
"""Over which corner of a site one looks at it; south is towards smaller y, west smaller x."""


_ACROSS, _UP = cos(radians(30.0)), sin(radians(30.0))


_TOP, _RIGHT_SIDE, _LEFT_SIDE = 1.0, 0.82, 0.66
"""How bright the three faces are that one sees of a box."""


_ITEM_COLOURS: Final = (
    *((0.00, 0.45, 0.70), (0.90, 0.62, 0.00), (0.80, 0.47, 0.65), (0.34, 0.71, 0.91)),
    *((0.94, 0.89, 0.26), (0.55, 0.34, 0.16), (0.42, 0.31, 0.66), (0.98, 0.66, 0.55)),
)
"""Okabe and Ito's without the red of charges and the green of what is protected, and others."""


_DARKER: Final = 0.6


_OVER_STAR_PT: Final = 13.0
"""How far above the middle of a short stand-off its length is written."""


Colour = tuple[float, float, float]


def item_colours(zone: BuildZone | None) -> Mapping[str, Colour]:
    """Return the colour of each item of a catalogue, and of single modules under no name."""
    names = [""] if zone is None or not zone.items else [item.name for item in zone.items]
    colours: dict[str, Colour] = {}
    for number, name in enumerate(names):
        darker = _DARKER ** (number // len(_ITEM_COLOURS))
        red, green, blue = _ITEM_COLOURS[number % len(_ITEM_COLOURS)]
        colours[name] = (darker * red, darker * green, darker * blue)
    return MappingProxyType(colours)


DEARER: Final[Colour] = (0.99, 0.84, 0.48)
"""Ground on which building costs more."""


WAY: Final[Colour] = (0.10, 0.35, 0.85)
"""The access way."""


_WAY_PLACES: Final = (0.5, 0.75, 0.25, 0.875, 0.125)


class View(Protocol):
    """How places on a site become places in a picture."""

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return places in the picture (n, 2) of x, y and height (n, 3), m."""


@dataclass(frozen=True)
class ObliqueView:
    """How places on a site and heights above it become places in the picture.

    Attributes:
        site_m: The site.
        corner: The corner that is nearest to whoever looks.
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
        """Return how far places are from the near corner, m: up to the right, up to the left."""
        left, bottom, right, top = self.site_m
        if self.corner == "southwest":
            return x - left, y - bottom
        if self.corner == "southeast":
            return y - bottom, right - x
        if self.corner == "northeast":
            return right - x, top - y
        return top - y, x - left

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return places in the picture, in metres along each of the three axes (n, 2).

        Args:
            points_m: x, y and height above the ground, (n, 3), m.
        """
        x, y, z = np.asarray(points_m, dtype=np.float64).T
        right, left = self.towards(x, y)
        return np.column_stack([(right - left) * _ACROSS, (right + left) * _UP + z])

    def on_ground(self, rectangle_m: Rectangle, height_m: float = 0.0) -> FloatArray:
        """Return the corners of a rectangle, counterclockwise from the near one (4, 2)."""
        return self.places(self._corners_m(rectangle_m, height_m))

    def faces(self, rectangle_m: Rectangle, height_m: float) -> tuple[FloatArray, ...]:
        """Return the faces that one sees of a box: the right side, the left side, the top."""
        low, high = (self.on_ground(rectangle_m, each) for each in (0.0, height_m))
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
    """Return the corner over which one sees the sides that the charges are on.

    It is on the side of the charges as seen from what is protected; where they are straight to a
    side, the one to the south or west of it.
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


class Box(NamedTuple):
    """Something on the ground that a view shows.

    Attributes:
        rectangle_m: Its plan.
        height_m: Its height.
        colour: Colour of its top.
        edge: Colour of its edges.
    """

    rectangle_m: Rectangle
    height_m: float
    colour: Colour
    edge: Colour


def painted_order(view: ObliqueView, rectangles_m: Sequence[Rectangle]) -> list[int]:
    """Return in which order boxes are painted, so that none covers one that is before it.

    A box is behind another if there is a wall between them, along the x or the y axis, with the
    other on the viewer's side, and none with itself on that side. Boxes that stand apart have such
    an order whatever their heights are: it is the same for all directions of one quadrant.

    Args:
        view: The view.
        rectangles_m: The plans of the boxes, which do not overlap.
    """
    left, bottom, right, top = np.array(rectangles_m, dtype=np.float64).reshape(-1, 4).T
    first, second = view.towards(left, bottom), view.towards(right, top)
    near, far = np.minimum(first, second), np.maximum(first, second)
    beyond: BoolArray = np.logical_or.reduce(
        near[:, :, np.newaxis] >= far[:, np.newaxis, :] - TOLERANCE_M
    )
    behind = beyond & ~beyond.T
    waits_for = behind.sum(axis=0)
    order: list[int] = []
    for _ in rectangles_m:
        chosen = int(np.argmin(waits_for))
        order.append(chosen)
        waits_for -= behind[chosen]
        waits_for[chosen] = len(rectangles_m) + 1
    return order


def draw_oblique(
    axes: Axes, scenario: Scenario, layout: Sequence[Element] = (), corner: str | None = None
) -> ObliqueView:
    """Draw a site with what stands on it, heights to scale, and where charges may go off.

    What has no height is drawn as high as the air; charges and stand-offs are drawn over
    everything, so that they can be seen.

    Args:
        axes: Empty axes.
        scenario: The scenario.
        layout: What stands on the build zone; it must fit there.
        corner: Over which corner one looks; that on the side of the charges unless given.

    Returns:
        The view, to draw more in it.

    Raises:
        UnknownNameError: If there is no such corner.
    """
    site_m = scenario.site.rectangle_m
    view = ObliqueView(site_m, corner or corner_towards(scenario))
    boxes = boxes_of(scenario, layout)
    _set_up(axes, view, boxes)
    _draw_ground(axes, view, scenario, layout)
    _draw_boxes(axes, view, boxes)
    _draw_stand_offs(axes, view, scenario, layout)
    _write_names(axes, view, scenario)
    _draw_scale(axes, view)
    return view


def boxes_of(scenario: Scenario, layout: Sequence[Element] = ()) -> list[Box]:
    """Return what stands on a site: the structures, then each module or piece of the layout."""
    air_m, edge = scenario.air_height_m, unit_interval(INK)
    boxes = [
        Box(
            each.rectangle_m,
            air_m if each.height_m is None else each.height_m,
            _lighter(unit_interval(PROTECTED if each.protected else STRUCTURE)),
            edge,
        )
        for each in scenario.structures
    ]
    colours = item_colours(scenario.build_zone)
    for element in layout:
        height_m = scenario.zone.catalogue.variant(element).height_m
        boxes.append(
            Box(
                scenario.zone.element_rectangle_m(element),
                air_m if height_m is None else height_m,
                colours[element.item if isinstance(element, Piece) else ""],
                edge,
            )
        )
    return boxes


def scale_length_m(site_m: Rectangle) -> float:
    """Return the length of a scale bar for a site: a round one, at most a third of its width."""
    return nice_floor((site_m.right - site_m.left) / 3.0)


def _lighter(colour: Colour, share: float = 0.45) -> Colour:
    red, green, blue = (each + share * (1.0 - each) for each in colour)
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


def _draw_ground(
    axes: Axes, view: ObliqueView, scenario: Scenario, layout: Sequence[Element]
) -> None:
    border = {"facecolor": unit_interval(SITE), "edgecolor": unit_interval(BORDER)}
    add_area(axes, view, view.site_m, linewidth=1.5, zorder=1.0, **border)
    zone = scenario.build_zone
    if zone is not None:
        quiet = unit_interval(QUIET_INK)
        hatched = {"hatch": "////", "edgecolor": (*quiet, 0.4), "linewidth": 0.0, "fill": False}
        for keep_out in zone.keep_outs:
            add_area(axes, view, keep_out.rectangle_m, zorder=1.5, **hatched)
        dashed = {"edgecolor": quiet, "linestyle": "--", "linewidth": 0.9, "fill": False}
        add_area(axes, view, zone.rectangle_m, zorder=1.6, **dashed)
        draw_conditions(axes, view, zone, [each.rectangle_m for each in scenario.structures])
    for source in scenario.vehicles:
        _draw_reached(axes, view, scenario, source, layout)
        for ends_m in source.lines_m:
            _add_line(axes, view, ends_m, color=unit_interval(EXPLOSIVE), linewidth=4.0, zorder=2.0)
    draw_sources(axes, view, scenario.charge)


def draw_conditions(
    axes: Axes, view: View, zone: BuildZone, structures_m: Sequence[Rectangle]
) -> None:
    """Draw what a zone has beside keep-outs: dearer ground, the way that stays open, its gate."""
    for area in zone.cost_areas:
        add_area(axes, view, area.rectangle_m, zorder=1.2, linewidth=0.0, facecolor=DEARER)
    way = zone.access_way
    if way is None:
        return
    if way.gate is not None:
        add_area(axes, view, way.gate.rectangle_m, zorder=1.7, facecolor=(*WAY, 0.3), edgecolor=WAY)
    start, end = view.places(
        np.array([(*end_m, 0.0) for end_m in access_way_ends_m(zone, structures_m)])
    )
    arrow = FancyArrowPatch(
        (start[0], start[1]), (end[0], end[1]), arrowstyle="<->", shrinkA=0, shrinkB=0
    )
    arrow.set(color=WAY, linewidth=1.8, zorder=2.2, mutation_scale=14.0)
    axes.add_patch(arrow)


def access_way_ends_m(zone: BuildZone, structures_m: Sequence[Rectangle]) -> tuple[PointM, PointM]:
    """Return from where to where an arrow for the access way of a zone goes.

    Where the way runs is left open; the arrow is where no structure stands, or through the gate.
    """
    way = zone.access_way
    assert way is not None
    left, bottom, right, top = zone.rectangle_m
    places = [
        (left + share * (right - left), bottom + share * (top - bottom)) for share in _WAY_PLACES
    ]
    if way.gate is not None:
        places = [way.gate.rectangle_m.centre]
    arrows = [
        ((left, y), (right, y)) if way.between == "left_right" else ((x, bottom), (x, top))
        for x, y in places
    ]
    free = (ends for ends in arrows if not any(each.meets_segment(*ends) for each in structures_m))
    return next(free, arrows[0])


def draw_sources(axes: Axes, view: View, sources: Sequence[AnySource]) -> None:
    """Draw where charges may be that come from no vehicle: stars on stems, lines, areas."""
    red = unit_interval(EXPLOSIVE)
    for source in sources:
        if isinstance(source, PointSource):
            draw_star(axes, view, source.position_m, source.height_m)
        elif isinstance(source, SegmentSource):
            _add_line(axes, view, source.segment_m, color=red, linewidth=2.2, zorder=2.0)
        elif isinstance(source, RectangleSource):
            style = {"facecolor": (*red, 0.35), "edgecolor": red, "linewidth": 1.0}
            add_area(axes, view, source.rectangle_m, zorder=1.8, **style)


def _draw_reached(
    axes: Axes,
    view: ObliqueView,
    scenario: Scenario,
    source: VehicleSource,
    layout: Sequence[Element],
) -> None:
    """Draw the ground that a vehicle reaches as one figure, whose parts leave no seams."""
    rows, columns = squares_of(scenario.site)
    ground = vehicle_reach(scenario, source, layout).ground(rows, columns)
    paths = [
        Path(view.on_ground(rectangle_m)[[0, 1, 2, 3, 0]], closed=True)
        for rectangle_m in _runs(ground)
    ]
    if paths:
        patch = PathPatch(Path.make_compound_path(*paths), linewidth=0.0, zorder=1.4)
        patch.set_facecolor((*unit_interval(EXPLOSIVE), REACHED_ALPHA))
        axes.add_patch(patch)


def _runs(ground: BoolArray) -> list[Rectangle]:
    """Return rectangles that cover the squares of a grid, one for each run in a row, m."""
    side = MODULE_SIDE_M
    steps = np.diff(np.pad(ground, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    begins, ends = np.argwhere(steps == 1), np.argwhere(steps == -1)
    return [
        Rectangle(begin * side, row * side, end * side, (row + 1) * side)
        for (row, begin), (_, end) in zip(begins.tolist(), ends.tolist(), strict=True)
    ]


def _draw_boxes(axes: Axes, view: ObliqueView, boxes: Sequence[Box]) -> None:
    polygons: list[FloatArray] = []
    colours: list[Colour] = []
    edges: list[Colour] = []
    for number in painted_order(view, [box.rectangle_m for box in boxes]):
        box = boxes[number]
        polygons += view.faces(box.rectangle_m, box.height_m)
        for bright in (_RIGHT_SIDE, _LEFT_SIDE, _TOP):
            red, green, blue = box.colour
            colours.append((bright * red, bright * green, bright * blue))
            edges.append(box.edge)
    faces = PolyCollection(polygons, facecolor=colours, edgecolor=edges, linewidth=0.5, zorder=3.0)
    faces.set_joinstyle("round")
    axes.add_collection(faces, autolim=False)


def _draw_stand_offs(
    axes: Axes, view: ObliqueView, scenario: Scenario, layout: Sequence[Element]
) -> None:
    """Draw a star at the worst place of each vehicle, and the line to the nearest wall."""
    dashed = {"color": unit_interval(INK), "linestyle": (0, (3.0, 1.5)), "linewidth": 1.4}
    for source in scenario.vehicles:
        place_m = worst_places(scenario, source, layout).places_m[0]
        wall_m = nearest_point_m(scenario.structures, place_m)
        _add_line(axes, view, (place_m, wall_m), zorder=5.0, **dashed)
        ends_m = np.array([place_m, wall_m])
        middle = view.places(np.array([(*ends_m.mean(axis=0), 0.0)]))[0]
        _write(
            axes, f"{np.hypot(*np.diff(ends_m, axis=0)[0]):.1f} m", middle, lift_pt=_OVER_STAR_PT
        )
        draw_star(axes, view, place_m, source.height_m)


def draw_star(axes: Axes, view: View, place_m: PointM, height_m: float) -> None:
    """Draw the star of a charge, over everything, on a stem to the ground."""
    ends = view.places(np.array([(*place_m, 0.0), (*place_m, height_m)]))
    ink = unit_interval(INK)
    axes.add_line(Line2D(*ends.T, color=ink, linewidth=0.8, zorder=5.0))
    star = Line2D(*ends[1:].T, marker="*", markersize=13.0, linestyle="none", zorder=5.5)
    star.set(color=unit_interval(EXPLOSIVE), markeredgecolor=ink, markeredgewidth=0.6)
    axes.add_line(star)


def _write_names(axes: Axes, view: ObliqueView, scenario: Scenario) -> None:
    """Write the names of the structures on their roofs, with the heights that are known."""
    for structure in scenario.structures:
        height_m, (x_m, y_m) = structure.height_m, structure.rectangle_m.centre
        words = structure.name if height_m is None else f"{structure.name}\n{height_m:g} m"
        top_m = scenario.air_height_m if height_m is None else height_m
        place = view.places(np.array([(x_m, y_m, top_m)]))[0]
        _write(axes, words, place, bold=structure.protected)


def _write(
    axes: Axes, words: str, place: FloatArray, *, bold: bool = False, lift_pt: float = 0.0
) -> None:
    """Write over everything, on a white rim, at a place or a little above it."""
    text = axes.annotate(
        words,
        (place[0], place[1]),
        xytext=(0.0, lift_pt),
        textcoords="offset points",
        ha="center",
        va="center",
        zorder=6.0,
    )
    text.set(fontsize=8, color=unit_interval(INK), fontweight="bold" if bold else "normal")
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white")])


def _draw_scale(axes: Axes, view: ObliqueView) -> None:
    """Draw a scale bar along the near side of the site, and how its x and y axes run."""
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


def add_area(axes: Axes, view: View, rectangle_m: Rectangle, **style: object) -> None:
    """Add a rectangle on the ground; `style` is matplotlib's."""
    left, bottom, right, top = rectangle_m
    corners_m = np.array([(left, bottom, 0.0), (right, bottom, 0.0), (right, top, 0.0)])
    corners_m = np.vstack([corners_m, (left, top, 0.0)])
    patch = Polygon(view.places(corners_m), closed=True)
    patch.set(**style)
    axes.add_patch(patch)


def _add_line(axes: Axes, view: View, ends_m: Sequence[PointM], **style: object) -> None:
    """Add a line on the ground; `style` is matplotlib's."""
    line = Line2D(*view.places(np.array([(*end, 0.0) for end in ends_m])).T)
    line.set(**style)
    axes.add_line(line)
