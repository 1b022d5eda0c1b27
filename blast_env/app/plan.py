"""The plan of a site as SVG, and the conversion between its pixels and the site."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby
from math import ceil, floor
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.app import edits
from blast_env.app.editor import Ghost
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.geometry import Cell, Layout, Rectangle
from blast_env.layout import LayoutState
from blast_env.particles.objects import Colour
from blast_env.plots.labels import labels_of, settled_labels
from blast_env.plots.plan import (
    FAINT,
    FREE_CELL,
    INK,
    NO_CELL,
    QUIET_INK,
    STANDING,
    Feature,
    FeatureKind,
    Kinds,
    Look,
    cell_features,
    in_order,
    site_features,
    vehicle_features,
    without,
)
from blast_env.sections import PointM
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # needs the extra `maps`
    from blast_env.io.importing.convert import MapSketch

_FITS: Final = "#0072B2"  # Okabe and Ito: blue and orange, safe for colour-blind readers
_REFUSED: Final = "#D55E00"
_SELECTED: Final = "#0072B2"
_LEAST_CELL_PX: Final = 9.0  # below it cells are not drawn one by one
_LEAST_LINES_PX: Final = 24.0
_MARGIN: Final = 0.04
_MOST_ZOOM: Final = 60.0
_LETTER_PX: Final = 7.2  # of the typeface, on average
_LINE_PX: Final = 15.0
_SIGN_PX: Final = 9.0


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


@dataclass(frozen=True)
class PixelView:
    """The visible part of a site, and its size in pixels.

    Attributes:
        left_m: Left border of the visible part.
        bottom_m: Lower border.
        pixels_per_m: Scale.
        width_px: Width of the picture.
    """

    left_m: float
    bottom_m: float
    pixels_per_m: float
    width_px: int
    height_px: int

    @classmethod
    def of(cls, scenario: Scenario, width_px: int, height_px: int) -> "PixelView":
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

    def zoomed(self, factor: float) -> "PixelView":
        """Return the view magnified by a factor about its middle."""
        x_m, y_m = self.metres(self.width_px / 2.0, self.height_px / 2.0)
        scale = min(max(self.pixels_per_m * factor, 0.1), _MOST_ZOOM)
        share = self.pixels_per_m / scale
        return replace(
            self,
            left_m=x_m - (x_m - self.left_m) * share,
            bottom_m=y_m - (y_m - self.bottom_m) * share,
            pixels_per_m=scale,
        )

    def panned(self, across: float, up: float) -> "PixelView":
        """Return the view moved by shares of its width and height."""
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


def plan_svg(
    view: PixelView, scenario: Scenario, layout: Layout, selected: SiteThing | None
) -> str:
    """Return the plan of a site with a layout; `overlay_svg` goes on top of it."""
    features = _features(scenario, layout)
    cells = [feature for feature in features if feature.kind in (NO_CELL, FREE_CELL)]
    return "".join(
        (
            *draw_features(view, [feature for feature in features if feature.kind is Kinds.SITE]),
            *_lines(view, scenario),
            *draw_features(view, cells),
            *_cell_lines(view, scenario),
            *draw_features(view, without(features, Kinds.SITE, NO_CELL, FREE_CELL)),
            *_names(view, [_named(feature) for feature in features]),
            *_selection(view, scenario, selected),
            *_scale_bar(view),
        )
    )


def plan_legend(scenario: Scenario, layout: Layout) -> str:
    """Return the legend of the plan as HTML, the topmost features first."""
    shown = {own.title: own for own in without(_features(scenario, layout), Kinds.SITE)}
    return "".join(
        f'<span><svg width="24" height="14" aria-hidden="true">{"".join(_swatch(part))}</svg>'
        f"{escape(title)}</span>"
        for title, part in sorted(shown.items(), key=lambda pair: -pair[1].kind.level)
    )


def _features(scenario: Scenario, layout: Layout) -> tuple[Feature, ...]:
    """Return everything that the plan shows, the lowest first."""
    found = [*site_features(scenario, layout), *vehicle_features(scenario, layout)]
    if scenario.build_zone is not None:
        usable = LayoutState.of(scenario.without_budget, layout).usable
        found += cell_features(scenario.build_zone, usable)
    return in_order(found)


def _swatch(feature: Feature) -> Iterator[str]:
    """Yield the sign of a feature in the legend, in 24 x 14 pixels."""
    look = feature.look
    if len(feature.places_m) > 2:
        area = [(1.0, 1.0), (23.0, 1.0), (23.0, 13.0), (1.0, 13.0)]
        return _areas(feature.kind, look, feature.colour, [area])
    if len(feature.places_m) == 2:
        return iter([_line(look, (1.0, 7.0), (23.0, 7.0))])
    return iter([f'<g transform="translate(12 7) scale(0.75)">{_sign(look, 0.0, 0.0)}</g>'])


def _named(feature: Feature) -> Feature:
    """Return a feature with its label; the build zone's is its name."""
    is_zone = feature.kind is Kinds.BUILD_ZONE
    return replace(feature, label=feature.name) if is_zone else feature


def overlay_svg(
    view: PixelView, scenario: Scenario, ghost: Ghost | None, cursor: Cell | None
) -> str:
    """Return the moving layer: the ghost of an element, and the cell of the keyboard."""
    parts = []
    if cursor is not None and scenario.build_zone is not None:
        cell = scenario.build_zone.cell_rectangle_m(cursor)
        parts.append(_rectangle(view, cell.grown(0.1), "none", _hex(INK), 2.0, dash="2 2"))
    if ghost is not None:
        parts += _ghost(view, ghost)
    return "".join(parts)


# Features.


def draw_features(view: PixelView, features: Iterable[Feature]) -> Iterator[str]:
    """Yield the SVG of features by geometry and look; areas of a kind are one figure."""
    for (kind, look, colour, corners), group in groupby(
        features, key=lambda part: (part.kind, part.look, part.colour, min(len(part.places_m), 3))
    ):
        alike = list(group)
        shapes = (ring for own in alike for ring in own.rings_m)
        places = [[view.pixel(*place) for place in shape] for shape in shapes]
        if corners == 3:
            yield from _areas(kind, look, colour, places)
        elif corners == 2:
            yield from (_line(look, start, end) for start, end in places)
        else:
            yield from (_sign(look, *place) for (place,) in places)


def _areas(
    kind: FeatureKind, look: Look, colour: Colour | None, outlines: list[list[PointM]]
) -> Iterator[str]:
    path = "".join(f"M{'L'.join(f'{x:g} {y:g}' for x, y in outline)}Z" for outline in outlines)
    fill = "none" if colour is None else _hex(colour)
    if look.hatched:
        ground, fill = fill, f"url(#{kind.name})"
        yield (
            f'<pattern id="{kind.name}" width="9" height="9" patternUnits="userSpaceOnUse"'
            f' patternTransform="rotate(-45)"><rect width="9" height="9" fill="{ground}"></rect>'
            f'<line x1="0" y1="0" x2="0" y2="9" stroke="{_hex(look.line or QUIET_INK)}"'
            ' stroke-width="2" stroke-opacity="0.5"></line></pattern>'
        )
    stroke = "none" if look.line is None else _hex(look.line)
    dashed = ' stroke-dasharray="7 4"' if look.dashed else ""
    yield (
        f'<path d="{path}" fill="{fill}" fill-opacity="{look.opacity:g}" stroke="{stroke}"'
        f' stroke-width="{look.width:g}"{dashed}></path>'
    )


def _line(look: Look, start: PointM, end: PointM) -> str:
    (x0, y0), (x1, y1), colour = start, end, _hex(look.line or INK)
    dashed = ' stroke-dasharray="5 3"' if look.dashed else ""
    line = (
        f'<line x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}" stroke="{colour}"'
        f' stroke-width="{1.3 * look.width:g}"{dashed}></line>'
    )
    length = float(np.hypot(x1 - x0, y1 - y0))
    if not look.arrows or length == 0.0:
        return line
    x, y = (x1 - x0) / length, (y1 - y0) / length
    heads = "".join(
        f"M{tip_x} {tip_y}l{turn * 9.0 * x - 4.0 * y:.1f} {turn * 9.0 * y + 4.0 * x:.1f}"
        f"l{8.0 * y:.1f} {-8.0 * x:.1f}Z"
        for tip_x, tip_y, turn in ((x0, y0, 1.0), (x1, y1, -1.0))
    )
    return f'{line}<path d="{heads}" fill="{colour}"></path>'


def _sign(look: Look, x: float, y: float) -> str:
    colour = _hex(look.line or INK)
    if look.sign == "star":
        return _star(x, y, colour)
    return (
        f'<circle cx="{x}" cy="{y}" r="5" fill="white" stroke="{colour}" stroke-width="2">'
        f'</circle><path d="M{x - 9} {y}h18M{x} {y - 9}v18" stroke="{colour}"></path>'
    )


def _names(view: PixelView, features: Sequence[Feature]) -> Iterator[str]:
    """Yield the labels of features, so that none covers another."""

    def box(feature: Feature) -> Rectangle:  # pixels, y upwards
        left, top, width, height = view.box(feature.bounds_m)
        grown = _SIGN_PX if len(feature.places_m) == 1 else 0.0
        return Rectangle(left, -top - height, left + width, -top).grown(grown)

    labels = labels_of(features)[::-1]
    lines = [label.text.split("\n") for label in labels]
    settled = settled_labels(
        features,
        labels,
        [(_LETTER_PX * max(map(len, line)) + 4.0, _LINE_PX * len(line)) for line in lines],
        box,
        lambda part: box(part) if part.kind in STANDING else None,
        Rectangle(0.0, -float(view.height_px), float(view.width_px), 0.0),
        gap=4.0,
        far=10.0,
    )
    for own, texts in zip(settled, lines, strict=True):
        kind = own.label.feature.kind
        colour = _hex(INK if kind is Kinds.STRUCTURE else kind.look.line or INK)
        if own.leader is not None:
            (x0, y0), (x1, y1) = own.leader
            yield (
                f'<line x1="{x0:g}" y1="{-y0:g}" x2="{x1:g}" y2="{-y1:g}" stroke="{colour}"'
                ' stroke-width="0.8"></line>'
            )
        x, _ = own.place.centre
        for number, text in enumerate(texts):
            y = -own.place.top + _LINE_PX * (number + 0.8)
            yield _text(x, y, text, colour, 13 if number == 0 else 12)


# The ground.


def _rectangle(
    view: PixelView,
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


def _text(x_px: float, y_px: float, text: str, colour: str, size_px: int = 13) -> str:
    return (
        f'<text x="{x_px:g}" y="{y_px:g}" font-size="{size_px}" font-family="sans-serif"'
        f' text-anchor="middle" fill="{colour}" stroke="white" stroke-width="3"'
        f' paint-order="stroke" stroke-linejoin="round">{escape(text)}</text>'
    )


def _lines(view: PixelView, scenario: Scenario) -> Iterator[str]:
    site = scenario.site.rectangle_m
    steps = (1.0, 5.0, 10.0, 50.0, 100.0)
    step = next((own for own in steps if own * view.pixels_per_m >= _LEAST_LINES_PX), 500.0)
    lines = []
    for number in range(1, ceil(site.right / step)):
        (x, y0), (_, y1) = view.pixel(number * step, 0.0), view.pixel(0.0, site.top)
        lines.append(f"M{x} {y0}V{y1}")
    for number in range(1, ceil(site.top / step)):
        (x0, y), (x1, _) = view.pixel(0.0, number * step), view.pixel(site.right, 0.0)
        lines.append(f"M{x0} {y}H{x1}")
    path = "".join(lines)
    yield f'<path d="{path}" stroke="#e3e7ec" stroke-width="1" fill="none"></path>'


def _cell_lines(view: PixelView, scenario: Scenario) -> Iterator[str]:
    zone, pitch = scenario.build_zone, MODULE_SIDE_M * view.pixels_per_m
    if zone is None or pitch < _LEAST_CELL_PX:
        return
    left, top, across, down = view.box(zone.rectangle_m)
    lines = [f"M{left + k * pitch:.2f} {top}v{down}" for k in range(1, round(across / pitch))]
    lines += [f"M{left} {top + k * pitch:.2f}h{across}" for k in range(1, round(down / pitch))]
    path = "".join(lines)
    yield f'<path d="{path}" stroke="{_hex(FAINT)}" stroke-width="0.7" fill="none"></path>'


def _star(x: float, y: float, colour: str) -> str:
    points = []
    for k in range(16):
        angle, reach = k * np.pi / 8.0, 9.0 if k % 2 == 0 else 4.0
        points.append(f"{x + reach * np.sin(angle):.1f},{y - reach * np.cos(angle):.1f}")
    return f'<polygon points="{" ".join(points)}" fill="{colour}" stroke="white"></polygon>'


def _selection(view: PixelView, scenario: Scenario, selected: SiteThing | None) -> Iterator[str]:
    if selected is None or not edits.has(scenario, selected) or selected.kind in edits.NOWHERE:
        return
    box = edits.rectangle_of(scenario, selected)
    grown = 0.6 if selected.kind in (ThingKind.CHARGE, ThingKind.GAUGE) else 0.0
    yield _rectangle(view, box.grown(grown), "none", _SELECTED, 3.0, dash="5 3")
    if grown == 0.0:
        x, y = view.pixel(box.right, box.top)
        yield (
            f'<rect x="{x - 5}" y="{y - 5}" width="10" height="10" fill="white"'
            f' stroke="{_SELECTED}" stroke-width="2.5"></rect>'
        )


def _scale_bar(view: PixelView) -> Iterator[str]:
    lengths = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
    fitting = [length for length in lengths if length * view.pixels_per_m <= 0.2 * view.width_px]
    length_m = fitting[-1] if fitting else lengths[0]
    x, y, width = 12.0, view.height_px - 10.0, length_m * view.pixels_per_m
    ink = _hex(INK)
    yield f'<path d="M{x} {y - 5}v5h{width:.1f}v-5" stroke="{ink}" fill="none" stroke-width="2">'
    yield f"</path>{_text(x + width / 2.0, y - 8.0, f'{length_m:g} m', ink, 12)}"


def _ghost(view: PixelView, ghost: Ghost) -> list[str]:
    colour = _REFUSED if ghost.reason else _FITS
    dash = "4 3" if ghost.reason else ""
    parts = []
    # A line that is being drawn, or the rectangle of a piece, crossed out where it cannot stand.
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
    elif ghost.line_m is None:
        width_m, height_m = (
            ghost.rectangle_m.right - ghost.rectangle_m.left,
            ghost.rectangle_m.top - ghost.rectangle_m.bottom,
        )
        if max(width_m, height_m) > MODULE_SIDE_M:
            text = f"{width_m:g} x {height_m:g} m"
            parts.append(_text(x + across / 2.0, y - 6.0, text, colour, 12))
    return parts


_SKETCH_PX: Final = 500


class SketchView:
    """The picture of a map's buildings.

    Args:
        sketch: The buildings.
    """

    def __init__(self, sketch: "MapSketch") -> None:
        left, bottom, right, top = sketch.bounds
        width, height = sketch.stretch * (right - left), top - bottom
        scale = _SKETCH_PX / max(width, height)
        self._sketch, self._corner = sketch, (left, top)
        self._scales = scale * sketch.stretch, scale
        self.size_px = max(int(scale * width), 1), max(int(scale * height), 1)

    def place(self, x_px: float, y_px: float) -> PointM:
        """Return the place in the coordinates of the file."""
        (left, top), (across, up) = self._corner, self._scales
        return left + x_px / across, top - y_px / up

    def svg(self, chosen: PointM | None) -> str:
        """Return the outlines, and a star at the chosen place."""
        rings = "".join(
            f"M{'L'.join('{:.1f} {:.1f}'.format(*self._pixel(point)) for point in outline)}Z"
            for outline in self._sketch.outlines
        )
        ink = _hex(INK)
        star = "" if chosen is None else _star(*self._pixel(chosen), _SELECTED)
        return f'<path d="{rings}" fill="#d5dbe3" stroke="{ink}" stroke-width="0.7"></path>{star}'

    def _pixel(self, place: PointM) -> PointM:
        (left, top), (across, up) = self._corner, self._scales
        return across * (place[0] - left), up * (top - place[1])


def words_of_place(view: PixelView, x_m: float, y_m: float) -> str:
    """Return a place in words, as precise as a pixel."""
    digits = 1 if view.pixels_per_m >= 5.0 else 0
    return f"x {floor(x_m * 10.0) / 10.0:.{digits}f} m, y {floor(y_m * 10.0) / 10.0:.{digits}f} m"
