"""The plan of a site as SVG, and where a pixel of it is on the site."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from html import escape
from math import ceil, floor
from typing import Final

import numpy as np

from blast_env.app import edits, placing
from blast_env.app.editor import Ghost
from blast_env.app.edits import Kind, Thing
from blast_env.arrays import BoolArray
from blast_env.geometry import Cell, Layout, Rectangle
from blast_env.physics.structure import Colour
from blast_env.rendering.style import (
    BARRIER,
    BORDER,
    EXPLOSIVE,
    FAINT,
    INK,
    PROTECTED,
    QUIET_INK,
    SITE,
    STRUCTURE,
)
from blast_env.scenario import AnySource, Placement, RectangleSource, Scenario, VehicleSource
from blast_env.scenario.build_scene import vehicle_reach, worst_places
from blast_env.scenario.sections import PointM
from blast_env.scenario.vehicles import nearest_point_m, squares_of
from blast_env.units import MODULE_SIDE_M

_FITS: Final = "#0072B2"  # Okabe and Ito: blue and orange, whatever one's colour vision
_REFUSED: Final = "#D55E00"
_SELECTED: Final = "#0072B2"
_GAUGE: Final = "#7B2D8B"
_COST: Final = "#E69F00"

_LEAST_CELL_PX: Final = 9.0  # below it cells are not drawn one by one
_LEAST_LINES_PX: Final = 24.0
_MARGIN: Final = 0.04
_MOST_ZOOM: Final = 60.0


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


@dataclass(frozen=True)
class View:
    """What part of a site is seen in how many pixels.

    Attributes:
        left_m: Left border of what is seen.
        bottom_m: Lower border.
        pixels_per_m: Scale.
        width_px: Width of the picture.
        height_px: Its height.
    """

    left_m: float
    bottom_m: float
    pixels_per_m: float
    width_px: int
    height_px: int

    @classmethod
    def of(cls, scenario: Scenario, width_px: int, height_px: int) -> "View":
        """Return the view of a whole site."""
        site = scenario.site
        scale = (1.0 - 2.0 * _MARGIN) * min(width_px / site.width_m, height_px / site.height_m)
        left_m = (site.width_m - width_px / scale) / 2.0
        bottom_m = (site.height_m - height_px / scale) / 2.0
        return cls(left_m, bottom_m, scale, width_px, height_px)

    def pixel(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the pixel of a place."""
        across = (x_m - self.left_m) * self.pixels_per_m
        up = (y_m - self.bottom_m) * self.pixels_per_m
        return round(across, 2), round(self.height_px - up, 2)

    def metres(self, x_px: float, y_px: float) -> PointM:
        """Return the place of a pixel."""
        up_px = self.height_px - y_px
        return self.left_m + x_px / self.pixels_per_m, self.bottom_m + up_px / self.pixels_per_m

    def zoomed(self, factor: float, at_m: PointM | None = None) -> "View":
        """Return the view nearer by a factor, with a place, the middle unless given, kept."""
        x_m, y_m = at_m or self.metres(self.width_px / 2.0, self.height_px / 2.0)
        scale = min(max(self.pixels_per_m * factor, 0.1), _MOST_ZOOM)
        share = self.pixels_per_m / scale
        return replace(
            self,
            left_m=x_m - (x_m - self.left_m) * share,
            bottom_m=y_m - (y_m - self.bottom_m) * share,
            pixels_per_m=scale,
        )

    def panned(self, across: float, up: float) -> "View":
        """Return the view moved by shares of what is seen."""
        return replace(
            self,
            left_m=self.left_m + across * self.width_px / self.pixels_per_m,
            bottom_m=self.bottom_m + up * self.height_px / self.pixels_per_m,
        )

    def box(self, rectangle_m: Rectangle) -> tuple[float, float, float, float]:
        """Return x, y, width and height of a rectangle in pixels."""
        left, top = self.pixel(rectangle_m.left, rectangle_m.top)
        right, bottom = self.pixel(rectangle_m.right, rectangle_m.bottom)
        return left, top, round(right - left, 2), round(bottom - top, 2)


def plan_svg(view: View, scenario: Scenario, layout: Layout, selected: Thing | None) -> str:
    """Return what stands on a site; `overlay_svg` goes on top of it."""
    return "".join(
        (
            _PATTERNS,
            *_ground(view, scenario),
            *_zone(view, scenario, layout),
            *_reach(view, scenario, layout),
            *_structures(view, scenario),
            *_charges(view, scenario),
            *_layout(view, scenario, layout),
            *_gauges(view, scenario),
            *_selection(view, scenario, selected),
            *_scale_bar(view),
        )
    )


def overlay_svg(view: View, scenario: Scenario, ghost: Ghost | None, cursor: Cell | None) -> str:
    """Return what is on the move: what would stand where, and where the keyboard is."""
    parts = []
    if cursor is not None and scenario.build_zone is not None:
        cell = scenario.build_zone.cell_rectangle_m(cursor)
        parts.append(_rectangle(view, cell.grown(0.1), "none", _hex(INK), 2.0, dash="2 2"))
    if ghost is not None:
        parts += _ghost(view, ghost)
    return "".join(parts)


_PATTERNS: Final = (
    '<pattern id="blocked" width="7" height="7" patternUnits="userSpaceOnUse"'
    ' patternTransform="rotate(45)"><rect width="7" height="7" fill="#e2e4e8"></rect>'
    '<line x1="0" y1="0" x2="0" y2="7" stroke="#9ea4ae" stroke-width="1.6"></line></pattern>'
    '<pattern id="keepout" width="9" height="9" patternUnits="userSpaceOnUse"'
    ' patternTransform="rotate(-45)"><line x1="0" y1="0" x2="0" y2="9" stroke="#5c636e"'
    ' stroke-width="2"></line></pattern>'
)


def _rectangle(
    view: View,
    rectangle_m: Rectangle,
    fill: str,
    stroke: str = "none",
    width: float = 1.0,
    *,
    opacity: float = 1.0,
    dash: str = "",
) -> str:
    x, y, across, down = view.box(rectangle_m)
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<rect x="{x}" y="{y}" width="{across}" height="{down}" fill="{fill}"'
        f' fill-opacity="{opacity:g}" stroke="{stroke}" stroke-width="{width:g}"{dashed}></rect>'
    )


def _text(
    x_px: float, y_px: float, text: str, colour: str, size_px: int = 13, anchor: str = "middle"
) -> str:
    return (
        f'<text x="{x_px:g}" y="{y_px:g}" font-size="{size_px}" font-family="sans-serif"'
        f' text-anchor="{anchor}" fill="{colour}" stroke="white" stroke-width="3"'
        f' paint-order="stroke" stroke-linejoin="round">{escape(text)}</text>'
    )


def _ground(view: View, scenario: Scenario) -> Iterator[str]:
    site = scenario.site.rectangle_m
    yield _rectangle(view, site, _hex(SITE), _hex(BORDER), 2.0)
    steps = (1.0, 5.0, 10.0, 50.0, 100.0)
    step = next((each for each in steps if each * view.pixels_per_m >= _LEAST_LINES_PX), 500.0)
    lines = []
    for number in range(1, ceil(site.right / step)):
        (x, y0), (_, y1) = view.pixel(number * step, 0.0), view.pixel(0.0, site.top)
        lines.append(f"M{x} {y0}V{y1}")
    for number in range(1, ceil(site.top / step)):
        (x0, y), (x1, _) = view.pixel(0.0, number * step), view.pixel(site.right, 0.0)
        lines.append(f"M{x0} {y}H{x1}")
    path = "".join(lines)
    yield f'<path d="{path}" stroke="#e3e7ec" stroke-width="1" fill="none"></path>'


def _zone(view: View, scenario: Scenario, layout: Layout) -> Iterator[str]:
    zone = scenario.build_zone
    if zone is None:
        return
    yield _rectangle(view, zone.rectangle_m, "#e9f3ec", _hex(QUIET_INK), 1.6, dash="7 4")
    usable = Placement.of(scenario, layout).usable
    for box in merged_cells(~usable):
        yield _rectangle(view, _cells_m(scenario, box), "url(#blocked)")
    if MODULE_SIDE_M * view.pixels_per_m >= _LEAST_CELL_PX:
        yield from _cell_lines(view, zone.rectangle_m)
    for cost_area in zone.cost_areas:
        yield _rectangle(view, cost_area.rectangle_m, _COST, _COST, 1.5, opacity=0.25)
    for keep_out in zone.keep_outs:
        ink = _hex(QUIET_INK)
        yield _rectangle(view, keep_out.rectangle_m, "url(#keepout)", ink, 1.5, opacity=0.75)
    yield _rectangle(view, zone.rectangle_m, "none", _hex(QUIET_INK), 1.6, dash="7 4")
    x, y = view.pixel(zone.rectangle_m.left, zone.rectangle_m.top)
    yield _text(x, y - 5.0, "build zone", _hex(QUIET_INK), 12, "start")


def _cell_lines(view: View, zone_m: Rectangle) -> Iterator[str]:
    left, top, across, down = view.box(zone_m)
    pitch = MODULE_SIDE_M * view.pixels_per_m
    lines = [f"M{left + k * pitch:.2f} {top}v{down}" for k in range(1, round(across / pitch))]
    lines += [f"M{left} {top + k * pitch:.2f}h{across}" for k in range(1, round(down / pitch))]
    path = "".join(lines)
    yield f'<path d="{path}" stroke="{_hex(FAINT)}" stroke-width="0.7" fill="none"></path>'


def _cells_m(scenario: Scenario, box: tuple[int, int, int, int]) -> Rectangle:
    """Return the rectangle of cells from the lower left one to beyond the upper right one."""
    bottom, left, top, right = box
    first = scenario.zone.cell_rectangle_m((bottom, left))
    last = scenario.zone.cell_rectangle_m((top - 1, right - 1))
    return Rectangle(first.left, first.bottom, last.right, last.top)


def merged_cells(cells: BoolArray) -> list[tuple[int, int, int, int]]:
    """Return few rectangles that cover cells: first row and column, last ones excluded."""
    boxes: list[tuple[int, int, int, int]] = []
    growing: dict[tuple[int, int], int] = {}
    for row in range(len(cells) + 1):
        runs = _runs(cells[row]) if row < len(cells) else []
        for run, first in [*growing.items()]:
            if run not in runs:
                boxes.append((first, run[0], row, run[1]))
                del growing[run]
        for run in runs:
            growing.setdefault(run, row)
    return boxes


def _runs(row: BoolArray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], row, [False])).astype(np.int8)))
    return [(int(edges[k]), int(edges[k + 1])) for k in range(0, len(edges), 2)]


def _structures(view: View, scenario: Scenario) -> Iterator[str]:
    for each in scenario.structures:
        colour = _hex(PROTECTED if each.protected else STRUCTURE)
        fill = "#cfe8e3" if each.protected else "#d9d6d0"
        yield _rectangle(view, each.rectangle_m, fill, colour, 3.0 if each.protected else 2.0)
        x, y = view.pixel(*each.rectangle_m.centre)
        height = "" if each.height_m is None else f"{each.height_m:g} m high"
        yield _text(x, y, each.name, _hex(INK))
        if height:
            yield _text(x, y + 15.0, height, _hex(QUIET_INK), 11)


def _reach(view: View, scenario: Scenario, layout: Layout) -> Iterator[str]:
    """Yield the ground that vehicles reach, and what stand-off is left."""
    red = _hex(EXPLOSIVE)
    for source in scenario.vehicles:
        rows, columns = squares_of(scenario.site)
        ground = vehicle_reach(scenario, source, layout).ground(rows, columns)
        for bottom, left, top, right in merged_cells(ground):
            sides_m = (MODULE_SIDE_M * each for each in (left, bottom, right, top))
            yield _rectangle(view, Rectangle(*sides_m), red, opacity=0.14)
        place_m = worst_places(scenario, source, layout).places_m[0]
        wall_m = nearest_point_m(scenario.structures, place_m)
        (x0, y0), (x1, y1) = view.pixel(*place_m), view.pixel(*wall_m)
        yield (
            f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{_hex(INK)}"'
            ' stroke-width="1.5" stroke-dasharray="5 3"></line>'
        )
        yield _star(x0, y0, red)
        stand_off_m = float(np.hypot(*np.subtract(place_m, wall_m)))
        words = f"stand-off {stand_off_m:.1f} m"
        yield _text((x0 + x1) / 2.0, (y0 + y1) / 2.0 - 6.0, words, _hex(INK), 12)


def _charges(view: View, scenario: Scenario) -> Iterator[str]:
    red = _hex(EXPLOSIVE)
    for number, source in enumerate(scenario.charge, start=1):
        yield _charge_place(view, source, scenario.charge_radius_m, red)
        centre = edits.rectangle_of(scenario, Thing(Kind.CHARGE, number - 1)).centre
        x, y = view.pixel(*centre)
        if not isinstance(source, RectangleSource | VehicleSource):
            yield _star(x, y, red)
        raised = f", {source.height_m:g} m up" if source.height_m > 0.0 else ""
        kind = "vehicle" if isinstance(source, VehicleSource) else "charge"
        words = f"{kind} {number}: {source.tnt_kg:g} kg{raised}"
        near_left = x < 0.2 * view.width_px
        anchor, shift = ("start", 12.0) if near_left else ("middle", 0.0)
        yield _text(x + shift, y - 12.0, words, red, 12, anchor)


def _charge_place(view: View, source: AnySource, radius_m: float, colour: str) -> str:
    radius_px = max(radius_m * view.pixels_per_m, 4.0)
    if isinstance(source, RectangleSource):
        area = source.rectangle_m.grown(radius_m)
        return _rectangle(view, area, colour, colour, 1.5, opacity=0.25)
    lines_m = source.lines_m if isinstance(source, VehicleSource) else (source.segment_m,)
    return "".join(_charge_line(view, line_m, radius_px, colour) for line_m in lines_m)


def _charge_line(view: View, line_m: tuple[PointM, PointM], radius_px: float, colour: str) -> str:
    (x0, y0), (x1, y1) = (view.pixel(*place) for place in line_m)
    return (
        f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{colour}" stroke-opacity="0.35"'
        f' stroke-width="{2.0 * radius_px:.1f}" stroke-linecap="round"></line>'
    )


def _star(x: float, y: float, colour: str) -> str:
    points = []
    for k in range(16):
        angle, reach = k * np.pi / 8.0, 9.0 if k % 2 == 0 else 4.0
        points.append(f"{x + reach * np.sin(angle):.1f},{y - reach * np.cos(angle):.1f}")
    return f'<polygon points="{" ".join(points)}" fill="{colour}" stroke="white"></polygon>'


def _layout(view: View, scenario: Scenario, layout: Layout) -> Iterator[str]:
    for solid in placing.solids(scenario, layout):
        yield _rectangle(view, solid.rectangle_m, _hex(BARRIER), "white", 0.8)


def _gauges(view: View, scenario: Scenario) -> Iterator[str]:
    for gauge in scenario.gauges:
        x, y = view.pixel(gauge.position_m[0], gauge.position_m[1])
        yield (
            f'<circle cx="{x}" cy="{y}" r="5" fill="white" stroke="{_GAUGE}" stroke-width="2">'
            f'</circle><path d="M{x - 9} {y}h18M{x} {y - 9}v18" stroke="{_GAUGE}"></path>'
        )
        yield _text(x + 10.0, y + 14.0, gauge.name, _GAUGE, 12, "start")


def _selection(view: View, scenario: Scenario, selected: Thing | None) -> Iterator[str]:
    if (
        selected is None
        or not edits.has(scenario, selected)
        or selected.kind in (Kind.SITE, Kind.ITEM)
    ):
        return
    box = edits.rectangle_of(scenario, selected)
    grown = 0.6 if selected.kind in (Kind.CHARGE, Kind.GAUGE) else 0.0
    yield _rectangle(view, box.grown(grown), "none", _SELECTED, 3.0, dash="5 3")
    if grown == 0.0:
        x, y = view.pixel(box.right, box.top)
        yield (
            f'<rect x="{x - 5}" y="{y - 5}" width="10" height="10" fill="white"'
            f' stroke="{_SELECTED}" stroke-width="2.5"></rect>'
        )


def _scale_bar(view: View) -> Iterator[str]:
    lengths = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
    fitting = [each for each in lengths if each * view.pixels_per_m <= 0.2 * view.width_px]
    length_m = fitting[-1] if fitting else lengths[0]
    x, y, width = 12.0, view.height_px - 10.0, length_m * view.pixels_per_m
    ink = _hex(INK)
    yield f'<path d="M{x} {y - 5}v5h{width:.1f}v-5" stroke="{ink}" fill="none" stroke-width="2">'
    yield f"</path>{_text(x + width / 2.0, y - 8.0, f'{length_m:g} m', ink, 12)}"


def _ghost(view: View, ghost: Ghost) -> list[str]:
    colour = _REFUSED if ghost.reason else _FITS
    dash = "4 3" if ghost.reason else ""
    parts = []
    if ghost.line_m is not None:
        (x0, y0), (x1, y1) = (view.pixel(*place) for place in ghost.line_m)
        parts.append(
            f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{colour}" stroke-width="4">'
            "</line>"
        )
        parts.append(_star(x1, y1, colour))
    else:
        parts.append(
            _rectangle(view, ghost.rectangle_m, colour, colour, 2.5, opacity=0.3, dash=dash)
        )
    x, y, across, _ = view.box(ghost.rectangle_m)
    if ghost.reason:
        middle = x + across / 2.0
        parts.append(
            f'<path d="M{middle - 6} {y - 16}l12 12m0 -12l-12 12" stroke="{_REFUSED}"'
            ' stroke-width="3"></path>'
        )
        parts += _wrapped(view, middle, y - 22.0, ghost.reason)
    elif ghost.line_m is None:
        width_m, height_m = (
            ghost.rectangle_m.right - ghost.rectangle_m.left,
            ghost.rectangle_m.top - ghost.rectangle_m.bottom,
        )
        if max(width_m, height_m) > MODULE_SIDE_M:
            text = f"{width_m:g} x {height_m:g} m"
            parts.append(_text(x + across / 2.0, y - 6.0, text, colour, 12))
    return parts


_LINE: Final = 48  # characters of a reason on a line
_LINE_PX: Final = 15.0


def _wrapped(view: View, x_px: float, y_px: float, text: str) -> list[str]:
    """Return a reason in lines that stay in the picture."""
    lines: list[str] = []
    for word in text.split():
        if lines and len(lines[-1]) + len(word) < _LINE:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    half = 3.6 * max(map(len, lines))
    x = min(max(x_px, half + 4.0), max(view.width_px - half - 4.0, half + 4.0))
    first = y_px - _LINE_PX * (len(lines) - 1)
    if first < _LINE_PX:
        first = y_px + 60.0
    return [
        _text(x, first + _LINE_PX * number, line, _REFUSED, 13) for number, line in enumerate(lines)
    ]


def words_of_place(view: View, x_m: float, y_m: float) -> str:
    """Return a place in words: as exact as a pixel is."""
    digits = 1 if view.pixels_per_m >= 5.0 else 0
    return f"x {floor(x_m * 10.0) / 10.0:.{digits}f} m, y {floor(y_m * 10.0) / 10.0:.{digits}f} m"
