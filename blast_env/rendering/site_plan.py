"""The plan of a site in matplotlib, with captions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.geometry import Rectangle
from blast_env.physics.scene import StructureOutline
from blast_env.physics.structure import LoadColours, ModularObstacle
from blast_env.rendering.style import (
    BARRIER,
    BORDER,
    EXPLOSIVE,
    INK,
    PAGE,
    PROTECTED,
    QUIET_INK,
    SITE,
    STRUCTURE,
    render_extra,
    unit_interval,
)
from blast_env.scenario.models import BuildZone
from blast_env.units import UNITS_PER_M

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.patches import Rectangle as RectanglePatch
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox


Obstacle = ModularObstacle | StructureOutline


def load_colours() -> Colormap:
    """Return the colours of `load_colour` as a colour map, white where there is no load.

    Their lightness falls all the way, so that the order shows without any colour vision.
    """
    colours = [unit_interval(colour) for colour in LoadColours()]
    colour_map = LinearSegmentedColormap.from_list("load", colours)
    return colour_map.with_extremes(bad=unit_interval(PAGE))


def in_metres(rectangle: Rectangle) -> Rectangle:
    """Return a rectangle in units as one in metres."""
    return rectangle.scaled(1.0 / UNITS_PER_M)


def rectangle_patch(rectangle: Rectangle) -> RectanglePatch:
    """Return a rectangle as a patch without a style."""
    left, bottom, right, top = rectangle
    return RectanglePatch((left, bottom), right - left, top - bottom)


def add_outline(axes: Axes, rectangle: Rectangle, **style: object) -> None:
    """Add the outline of a rectangle in metres; `style` is matplotlib's."""
    patch = rectangle_patch(rectangle)
    patch.set(**({"fill": False} | style))
    axes.add_patch(patch)


def draw_site(axes: Axes, site_m: Rectangle, margin: float = 0.03) -> None:
    """Set up axes in metres with equal scales and draw ground and border."""
    reach = margin * max(site_m.right, site_m.top)
    axes.set_xlim(site_m.left - reach, site_m.right + reach)
    axes.set_ylim(site_m.bottom - reach, site_m.top + reach)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.spines[:].set_visible(False)
    ground = rectangle_patch(site_m)
    ground.set(facecolor=unit_interval(SITE), edgecolor=unit_interval(BORDER), linewidth=1.8)
    axes.add_patch(ground)


def draw_zone(axes: Axes, zone: BuildZone) -> None:
    """Draw where barrier modules may stand, and the keep-outs as hatched areas."""
    quiet = unit_interval(QUIET_INK)
    for keep_out in zone.keep_outs:
        add_outline(
            axes, keep_out.rectangle_m, hatch="////", edgecolor=(*quiet, 0.4), linewidth=0.0
        )
    add_outline(axes, zone.rectangle_m, edgecolor=quiet, linestyle="--", linewidth=0.9)


def draw_outline(axes: Axes, obstacle: Obstacle, linewidth: float = 1.6) -> None:
    """Draw the outline of a structure in the colour of its role; a barrier has none."""
    if obstacle.cells is None:
        colour = PROTECTED if obstacle.protected else STRUCTURE
        add_outline(
            axes,
            in_metres(obstacle.rectangle),
            edgecolor=unit_interval(colour),
            linewidth=1.5 * linewidth if obstacle.protected else linewidth,
            zorder=3,
        )


def draw_what_stands(axes: Axes, structures: Sequence[StructureOutline]) -> None:
    """Draw the outlines of the structures, and what the barrier consists of as filled.

    Pieces of a catalogue have light edges, and are the lighter the lower they are.
    """
    for outline in structures:
        draw_outline(axes, outline)
        if outline.cells is None:
            continue
        blocks = outline.blocks
        parts = [rectangle_patch(in_metres(block.rectangle)) for block in blocks]
        if outline.pieces is None:
            axes.add_collection(PatchCollection(parts, color=unit_interval(BARRIER), zorder=4))
            continue
        shades = [_shade(block.height_m, outline.height_m) for block in blocks]
        edge = unit_interval(PAGE)
        axes.add_collection(
            PatchCollection(parts, facecolor=shades, edgecolor=edge, linewidth=0.5, zorder=4)
        )


def _shade(height_m: float | None, highest_m: float | None) -> tuple[float, float, float]:
    """Return the colour of a piece: that of barriers for the highest item, lighter below."""
    share = 1.0 if height_m is None or highest_m is None else height_m / highest_m
    dark, light = np.array(unit_interval(BARRIER)), np.array(unit_interval(SITE))
    red, green, blue = dark + 0.6 * (1.0 - share) * (light - dark)
    return float(red), float(green), float(blue)


def draw_loads(
    axes: Axes,
    obstacle: ModularObstacle,
    scale: Normalize,
    linewidth: float = 0.4,
    factor: float = 1.0,
) -> PatchCollection:
    """Draw the modules in the colours of their loads; one that was not hit stays white.

    Args:
        axes: The axes.
        obstacle: The structure or barrier.
        scale: The colour scale.
        linewidth: Of the modules' edges.
        factor: From the impulses to the unit of the scale.

    Returns:
        The modules; its array has their loads in their order, masked where nothing hit.
    """
    impulse = np.ma.masked_array(
        [factor * part.impulse for part in obstacle.parts],
        [part.hits == 0 for part in obstacle.parts],
    )
    is_barrier = obstacle.cells is not None
    modules = PatchCollection(
        [rectangle_patch(in_metres(part.rectangle)) for part in obstacle.parts],
        cmap=load_colours(),
        norm=scale,
        edgecolor=unit_interval(BARRIER if is_barrier else STRUCTURE),
        linewidth=2.0 * linewidth if is_barrier else linewidth,
    )
    modules.set_array(impulse)
    axes.add_collection(modules)
    destroyed = [in_metres(part.rectangle) for part in obstacle.parts if part.destroyed]
    crosses = [
        line
        for left, bottom, right, top in destroyed
        for line in (((left, bottom), (right, top)), ((left, top), (right, bottom)))
    ]
    if crosses:
        axes.add_collection(
            LineCollection(crosses, colors=[unit_interval(INK)], linewidths=2.0 * linewidth)
        )
    return modules


def draw_charge(axes: Axes, position_m: tuple[float, float]) -> None:
    """Draw a star at the charge."""
    axes.add_line(_star(*position_m))


BARRIER_MODULE: Final = "barrier module"


def legend_handles(obstacles: Sequence[Obstacle], zone: BuildZone | None) -> list[Artist]:
    """Return the legend entries for what a site has."""
    handles: list[Artist] = [_star()]
    in_pieces = any(obstacle.pieces is not None for obstacle in obstacles)
    barrier = "barrier piece, darker is higher" if in_pieces else BARRIER_MODULE
    roles = (
        ("protected structure", PROTECTED, 2.4, lambda o: o.protected),
        ("other structure", STRUCTURE, 1.6, lambda o: not o.protected and o.cells is None),
        (barrier, BARRIER, 1.2, lambda o: o.cells is not None),
    )
    for label, colour, linewidth, matches in roles:
        if any(matches(obstacle) for obstacle in obstacles):
            handles.append(_box(label, unit_interval(colour), linewidth))
    if any(obstacle.capacity is not None for obstacle in obstacles):
        ink = unit_interval(INK)
        handles.append(Line2D([], [], marker="x", linestyle="none", color=ink, label="destroyed"))
    if zone is not None:
        handles.append(_box("build zone", unit_interval(QUIET_INK), 0.9, linestyle="--"))
        if zone.keep_outs:
            handles.append(_box("keep-out", unit_interval(QUIET_INK), 0.0, hatch="////"))
    handles.append(_box("site border", unit_interval(BORDER), 1.8))
    return handles


def layout_legend(structures: Sequence[Obstacle], zone: BuildZone | None) -> list[Artist]:
    """Return the legend entries for a charge and for what `draw_what_stands` shows."""
    handles = legend_handles(structures, zone)
    for handle in handles:
        if str(handle.get_label()).startswith("barrier "):
            handle.set(fill=True, facecolor=unit_interval(BARRIER))
    return handles


def _box(
    label: str, colour: tuple[float, float, float], linewidth: float, **style: object
) -> Patch:
    patch = Patch(fill=False, edgecolor=colour, linewidth=linewidth, label=label)
    patch.set(**style)
    return patch


def _star(*position_m: float) -> Line2D:
    """Return the star that marks a charge; without a position, one for the legend."""
    return Line2D(
        position_m[:1],
        position_m[1:],
        marker="*",
        markersize=15.0,
        color=unit_interval(EXPLOSIVE),
        markeredgecolor=unit_interval(INK),
        markeredgewidth=0.6,
        linestyle="none",
        label="charge",
        zorder=5,
    )


_GAP_PT = 4.0
_TALL: Final = 3.0  # a structure so many times as high as wide has its name beside it


def write_heading(figure: Figure, title: str, subtitle: str) -> None:
    """Write the title of a figure and a quiet line under it."""
    # The empty lines make the layout keep room for the second text, which it does not see.
    heading = figure.suptitle(f"{title}\n", fontsize=14, fontweight="bold", linespacing=1.5)
    line = figure.axes[0].annotate(
        subtitle,
        xy=(0.5, 0.12),
        xycoords=heading,
        ha="center",
        va="bottom",
        fontsize=10,
        color=unit_interval(QUIET_INK),
        annotation_clip=False,
    )
    line.set_in_layout(False)


def write_names(axes: Axes, obstacles: Sequence[Obstacle], below: bool = False) -> None:
    """Write the names of the structures beside them, so that none covers anything.

    To be called last: places are found in the figure as it is laid out then.

    Args:
        axes: The site plan; its first patch is the site.
        obstacles: All that stands on the site.
        below: Whether names are rather to be below their structures than above.
    """
    figure = axes.get_figure(root=True)
    named = [obstacle for obstacle in obstacles if obstacle.cells is None]
    texts = [_name(axes, obstacle) for obstacle in named]
    if figure is None or not texts:
        return
    _lay_out(figure)
    taken = [_pixels(axes, obstacle) for obstacle in obstacles] + _stars_and_texts(axes, texts)
    site = axes.patches[0].get_window_extent()
    for text, obstacle in zip(texts, named, strict=True):
        taken.append(_settle(text, _pixels(axes, obstacle), taken, site, below))


def _lay_out(figure: Figure) -> None:
    """Put the axes where they are going to be drawn, which drawing would do too, and much more."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    for axes in figure.axes:
        axes.apply_aspect()


def _stars_and_texts(axes: Axes, names: Sequence[Annotation]) -> list[Bbox]:
    """Return where charges and texts other than the names are."""
    texts = [text for text in axes.texts if text not in names and text.get_text()]
    stars = [line for line in axes.lines if line.get_marker() == "*"]
    return [each.get_window_extent() for each in (*texts, *stars)]


def what_stands(structures: Sequence[StructureOutline]) -> list[StructureOutline]:
    """Return what names should not cover: structures, and the barrier's modules one by one."""
    obstacles = [outline for outline in structures if outline.cells is None]
    for outline in structures:
        if outline.cells is not None:
            corners = [part.rectangle[:2] for part in outline.build().parts]
            single = replace(
                outline, rows=1, columns=1, cells=((0, 0),), heights_m=None, pieces=None
            )
            obstacles += [replace(single, corner=corner) for corner in corners]
    return obstacles


def _name(axes: Axes, obstacle: Obstacle) -> Annotation:
    text = axes.annotate(
        obstacle.name,
        in_metres(obstacle.rectangle).centre,
        xytext=(0.0, 0.0),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold" if obstacle.protected else "normal",
        color=unit_interval(PROTECTED if obstacle.protected else INK),
        zorder=6,
    )
    text.set_path_effects([patheffects.withStroke(linewidth=3, foreground="white")])
    text.set_in_layout(False)
    return text


def _settle(text: Annotation, own: Bbox, taken: Sequence[Bbox], site: Bbox, below: bool) -> Bbox:
    """Move a text from the middle of its structure to the first free place; return its box."""
    box = text.get_window_extent()
    figure = text.get_figure(root=True)
    assert figure is not None
    points_per_pixel = 72.0 / figure.dpi
    gap = _GAP_PT / points_per_pixel
    first = ((own.height + box.height) / 2.0 + gap) * (-1.0 if below else 1.0)
    side = (own.width + box.width) / 2.0 + gap
    low = own.height / 2.0 - box.height
    over_or_under = [(0.0, first), (0.0, -first)]
    beside = [(sign * side, shift) for shift in (0.0, low, -low) for sign in (1.0, -1.0)]
    if own.height > _TALL * own.width:
        over_or_under, beside = beside, over_or_under
    for across, along in (
        *over_or_under,
        *beside,
        *((sign * side, shift) for shift in (first, -first) for sign in (1.0, -1.0)),
        *((shift, 2.0 * far) for far in (first, -first) for shift in (0.0, side, -side)),
    ):
        place = box.translated(across, along)
        inside = Bbox.intersection(place, site)
        if inside is None or inside.width < 0.99 * place.width or inside.height < place.height:
            continue
        if place.count_overlaps(taken) == 0:
            text.set_position((across * points_per_pixel, along * points_per_pixel))
            return place
    return box


def _pixels(axes: Axes, obstacle: Obstacle) -> Bbox:
    left, bottom, right, top = in_metres(obstacle.rectangle)
    corners = axes.transData.transform([(left, bottom), (right, top)])
    return Bbox(corners)
