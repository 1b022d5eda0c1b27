"""The plan of a site in matplotlib: features, loads, names, legends and headings."""

from collections.abc import Iterable, Sequence
from textwrap import wrap
from typing import Any, Final

import numpy as np
import shapely

from blast_env.geometry import Rectangle
from blast_env.particles.objects import LoadColours, ModularObstacle
from blast_env.plots.labels import labels_of, settled_labels
from blast_env.plots.plan import (
    BARRIER,
    INK,
    PAGE,
    PROTECTED,
    QUIET_INK,
    STRUCTURE,
    Feature,
    FeatureKind,
    Kinds,
    Look,
    without,
)
from blast_env.plots.style import number_on_axis, render_extra, unit_interval
from blast_env.sections import PointM
from blast_env.site.structures import StructureOutline

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colorbar import Colorbar
    from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch, Patch, PathPatch
    from matplotlib.patches import Rectangle as RectanglePatch
    from matplotlib.path import Path
    from matplotlib.text import Text
    from matplotlib.ticker import FuncFormatter
    from matplotlib.transforms import Bbox


Obstacle = ModularObstacle | StructureOutline


def load_colours() -> Colormap:
    """Return the colours of `LoadColours` as a colour map, white for missing loads.

    Their lightness decreases throughout, so that the order shows without colour vision.
    """
    colours = [unit_interval(colour) for colour in LoadColours()]
    colour_map = LinearSegmentedColormap.from_list("load", colours)
    return colour_map.with_extremes(bad=unit_interval(PAGE))


def add_bar(
    figure: Figure, panels: Sequence[Axes], colours: ScalarMappable, label: str, **style: Any
) -> Colorbar:
    """Add a colour bar beside panels; `style` is passed to matplotlib."""
    form = FuncFormatter(number_on_axis)
    bar = figure.colorbar(colours, ax=list(panels), format=form, **style)
    bar.set_label(label)
    return bar


_MARGIN: Final = 0.03  # around a site, of its longer side


def rectangle_patch(rectangle: Rectangle) -> RectanglePatch:
    """Return a rectangle as a patch without a style."""
    left, bottom, right, top = rectangle
    return RectanglePatch((left, bottom), right - left, top - bottom)


def draw_plan(axes: Axes, features: Sequence[Feature]) -> None:
    """Set up axes in metres with equal scales for a site, and draw its features."""
    (site_m,) = (feature.bounds_m for feature in features if feature.kind is Kinds.SITE)
    reach = _MARGIN * max(site_m.right, site_m.top)
    axes.set_xlim(site_m.left - reach, site_m.right + reach)
    axes.set_ylim(site_m.bottom - reach, site_m.top + reach)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.spines[:].set_visible(False)
    draw_features(axes, features)


def draw_features(axes: Axes, features: Iterable[Feature]) -> list[Artist]:
    """Draw features by their geometry and their look.

    Args:
        axes: The axes, in metres.

    Returns:
        The artists drawn, the lowest first.
    """
    drawn: list[Artist] = []
    areas: dict[tuple[FeatureKind, Look, object], list[Feature]] = {}
    for feature in features:
        if len(feature.places_m) > 2:
            areas.setdefault((feature.kind, feature.look, feature.colour), []).append(feature)
        elif len(feature.places_m) == 2:
            drawn.append(_line(feature))
        else:
            drawn.append(_sign(feature))
    for (kind, look, fill), alike in areas.items():
        # One patch, so that there is no seam between neighbours.
        patch = PathPatch(_path_of(ring for thing in alike for ring in thing.rings_m))
        patch.set(**area_style(look, fill), zorder=kind.level)
        drawn.append(patch)
    drawn.sort(key=lambda artist: artist.get_zorder())
    for artist in drawn:
        axes.add_artist(artist)
    return drawn


def area_style(look: Look, fill: object) -> dict[str, Any]:
    """Return the matplotlib style of areas with a look and a fill, which may be None."""
    line = QUIET_INK if look.line is None else look.line
    style: dict[str, Any] = {
        "facecolor": (*unit_interval(fill), look.opacity) if isinstance(fill, tuple) else "none",
        "edgecolor": (*unit_interval(line), 0.4 if look.hatched else 1.0),
        "linewidth": 0.0 if look.line is None else look.width,
        "linestyle": "--" if look.dashed else "-",
    }
    return style | {"hatch": "////"} if look.hatched else style


def _line(feature: Feature) -> Artist:
    look, (start, end) = feature.look, feature.places_m
    colour = unit_interval(look.line or INK)
    if look.arrows:
        arrow = FancyArrowPatch(start, end, arrowstyle="<->", shrinkA=0, shrinkB=0)
        arrow.set(color=colour, linewidth=look.width, mutation_scale=14.0)
        arrow.set_zorder(feature.kind.level)
        return arrow
    x, y = zip(start, end, strict=True)
    line = Line2D(x, y, color=colour, linewidth=look.width, linestyle=_dashes(look))
    line.set(solid_capstyle="butt", zorder=feature.kind.level)
    return line


def _dashes(look: Look) -> tuple[float, Sequence[float]] | None:
    return (0.0, (3.0, 1.5)) if look.dashed else None


def _sign(feature: Feature) -> Artist:
    """Return the sign of a single point."""
    ((x, y),) = feature.places_m
    sign = Line2D([x], [y], **_sign_style(feature.kind))
    sign.set_zorder(Kinds.CHARGE.level)
    return sign


def _sign_style(kind: FeatureKind) -> dict[str, Any]:
    colour = unit_interval(kind.look.line or INK)
    if kind.look.sign == "ring":
        style: dict[str, Any] = {"marker": "o", "markersize": 0.55 * _SIGN_PT}
        return style | {"color": "white", "markeredgecolor": colour, "linestyle": "none"}
    style = {"marker": "*", "markersize": _SIGN_PT, "color": colour, "linestyle": "none"}
    return style | {"markeredgecolor": unit_interval(INK), "markeredgewidth": 0.6}


def legend_of(features: Iterable[Feature]) -> list[Artist]:
    """Return one legend entry per distinct feature, the topmost first."""
    shown = {(feature.title, min(len(feature.places_m), 3)): feature for feature in features}
    ordered = sorted(shown.values(), key=lambda feature: -feature.kind.level)
    return [_legend_entry(feature) for feature in ordered]


def legend_of_loads(features: Iterable[Feature], *, destructible: bool) -> list[Artist]:
    """Return the legend entries for a picture of the loads on modules.

    Args:
        features: The features of the site.
        destructible: Whether modules can be destroyed.
    """
    features = tuple(features)
    handles = legend_of(without(features, Kinds.BARRIER))
    if any(feature.kind is Kinds.BARRIER for feature in features):
        edge = unit_interval(BARRIER)
        handles.insert(0, Patch(fill=False, edgecolor=edge, label="barrier module"))
    if destructible:
        ink = unit_interval(INK)
        sign = Line2D([], [], marker="x", linestyle="none", color=ink, label="destroyed module")
        handles.append(sign)
    return handles


def _legend_entry(feature: Feature) -> Artist:
    kind, look = feature.kind, feature.look
    entry: Artist
    if len(feature.places_m) > 2:
        entry = Patch(**area_style(look, feature.colour))
    elif len(feature.places_m) == 1:
        entry = Line2D([], [], **_sign_style(kind))
    else:
        colour = unit_interval(look.line or INK)
        entry = Line2D([], [], color=colour, linewidth=look.width, linestyle=_dashes(look))
        if look.arrows:
            entry.set(marker="D", markersize=4.0)
    entry.set_label(feature.title)
    return entry


_LETTER_IN: Final = 0.075  # width of a letter in a legend; sign and gaps take that of seven


def write_legend(figure: Figure, handles: Sequence[Artist]) -> int:
    """Write a legend below a figure, in as many columns as fit; return its number of lines."""
    longest = max(len(str(handle.get_label())) for handle in handles)
    columns = max(int(figure.get_figwidth() / (_LETTER_IN * (longest + 7))), 1)
    lines = -(-len(handles) // columns)
    columns = -(-len(handles) // lines)  # as few as these lines need
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, fontsize=9, frameon=False
    )
    return lines


_GRID_M: Final = 1e-9  # finer differences of coordinates are rounding errors


def outline_path(rectangles: Sequence[Rectangle]) -> Path:
    """Return the common outline of rectangles."""
    joined = shapely.union_all(
        [shapely.box(*rectangle) for rectangle in rectangles], grid_size=_GRID_M
    )
    rings = shapely.get_rings(shapely.get_parts(joined.simplify(0.0)))
    return _path_of(shapely.get_coordinates(ring)[:-1].tolist() for ring in rings)


def _path_of(rings: Iterable[Sequence[PointM]]) -> Path:
    closed = (Path(np.array([*ring, ring[0]]), closed=True) for ring in rings)
    return Path.make_compound_path(*closed)


def draw_outlines(axes: Axes, obstacles: Iterable[Obstacle]) -> list[Artist]:
    """Draw the outlines of structures in the colours of their roles; barriers get none."""
    drawn: list[Artist] = []
    for obstacle in obstacles:
        if not obstacle.is_barrier:
            patch = PathPatch(outline_path(obstacle.boxes_m), fill=False, zorder=3.0)
            patch.set_edgecolor(unit_interval(PROTECTED if obstacle.protected else STRUCTURE))
            patch.set_linewidth(2.4 if obstacle.protected else 1.6)
            drawn.append(axes.add_patch(patch))
    return drawn


def draw_loads(
    axes: Axes,
    obstacle: ModularObstacle,
    scale: Normalize,
    linewidth: float = 0.4,
    factor: float = 1.0,
) -> tuple[PolyCollection, LineCollection]:
    """Draw modules in the colours of their loads; those that were not hit are white.

    Args:
        obstacle: The structure or barrier.
        linewidth: Width of the modules' edges, points.
        factor: Conversion from impulses to the unit of the scale.

    Returns:
        The modules, and the crosses on destroyed ones.
    """
    is_barrier = obstacle.is_barrier
    left, bottom, right, top = np.array([part.rectangle_m for part in obstacle.parts]).T
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    modules = PolyCollection(
        np.moveaxis(corners, 2, 0).tolist(),
        cmap=load_colours(),
        norm=scale,
        edgecolor=unit_interval(BARRIER if is_barrier else STRUCTURE),
        linewidth=2.0 * linewidth if is_barrier else linewidth,
    )
    crosses = LineCollection([], colors=[unit_interval(INK)], linewidths=2.0 * linewidth)
    show_loads((modules, crosses), obstacle, factor)
    for mask in (modules, crosses):
        axes.add_collection(mask, autolim=False)
    return modules, crosses


def show_loads(
    drawn: tuple[PolyCollection, LineCollection], obstacle: ModularObstacle, factor: float = 1.0
) -> None:
    """Update the artists of `draw_loads` to the present loads."""
    modules, crosses = drawn
    impulse = [factor * part.impulse for part in obstacle.parts]
    modules.set_array(np.ma.masked_array(impulse, [part.hits == 0 for part in obstacle.parts]))
    destroyed = [part.rectangle_m for part in obstacle.parts if part.destroyed]
    crosses.set_segments(
        [
            line
            for left, bottom, right, top in destroyed
            for line in (((left, bottom), (right, top)), ((left, top), (right, bottom)))
        ]
    )


_GAP_PT: Final = 4.0
_SIGN_PT: Final = 13.0
_STAR_PT: Final = 15.0
_FAR_PT: Final = 7.0  # distance beyond which a line joins a name to its feature


def write_names(axes: Axes, features: Sequence[Feature], *, inside: bool = True) -> list[Artist]:
    """Write the labels of features inside or beside them, without overlap if possible.

    Call it last: positions depend on the final layout of the figure.

    Args:
        axes: The picture of the site.
        features: Its features, which are labelled and not to be covered.
        inside: Whether labels may cover their features; not if these show loads by colour.

    Returns:
        The labels, and the lines that join them to their features.
    """
    figure = axes.get_figure(root=True)
    labels = labels_of(features)[::-1]  # the topmost has the first choice
    if figure is None or not labels:
        return []
    texts = [_text(axes, label.text, label.feature.kind) for label in labels]
    lay_out(figure)
    pixels_per_pt = figure.dpi / 72.0
    extents = [text.get_window_extent() for text in texts]
    settled = settled_labels(
        features,
        labels,
        [(extent.width, extent.height) for extent in extents],
        lambda label: _box(axes, label, pixels_per_pt),
        lambda label: _box(axes, label, pixels_per_pt) if inside else None,
        Rectangle(*axes.get_window_extent().extents),
        gap=_GAP_PT * pixels_per_pt,
        far=_FAR_PT * pixels_per_pt,
        others=_other_texts(axes, texts),
    )
    to_data, written = axes.transData.inverted(), list[Artist](texts)
    for text, thing in zip(texts, settled, strict=True):
        x, y = to_data.transform(thing.place.centre).tolist()
        text.set_position((x, y))
        if thing.leader is not None:
            ends = to_data.transform(thing.leader)
            leader = Line2D(*ends.T, color=text.get_color(), linewidth=0.6, zorder=5.9)
            written.append(axes.add_line(leader))
    return written


def _text(axes: Axes, words: str, kind: FeatureKind) -> Text:
    protected = kind is Kinds.PROTECTED_STRUCTURE
    colour = unit_interval(INK if kind.look.line is None else kind.look.line)
    if kind is Kinds.STRUCTURE:
        colour = unit_interval(INK)
    text = axes.text(0.0, 0.0, words, ha="center", va="center", fontsize=9, color=colour, zorder=6)
    text.set(fontweight="bold" if protected else "normal", clip_on=True)
    text.set_path_effects([patheffects.withStroke(linewidth=3, foreground="white")])
    text.set_in_layout(False)
    return text


def trim_height(figure: Figure, panels: Iterable[Axes]) -> None:
    """Take the height from a figure that its panels leave free, which have one scale in x and y.

    Heights of rows must be in proportion to what their panels show.
    """
    lay_out(figure)
    rows: dict[int, float] = {}
    used = 1.0
    for axes in panels:
        place, share = axes.get_subplotspec(), axes.get_position(original=True).height
        assert place is not None
        rows[place.rowspan.start] = share
        used = min(used, axes.get_position().height / share)
    figure.set_figheight(figure.get_figheight() * (1.0 - (1.0 - used) * sum(rows.values())))


def lay_out(figure: Figure) -> None:
    """Position the axes as in drawing, without the cost of drawing."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    for axes in figure.axes:
        axes.apply_aspect()


def _other_texts(axes: Axes, names: Sequence[Text]) -> list[Rectangle]:
    others = [text for text in axes.texts if text not in names and text.get_text()]
    boxes: list[Bbox] = [text.get_window_extent() for text in others]
    return [Rectangle(*box.extents) for box in boxes]


def _box(axes: Axes, feature: Feature, pixels_per_pt: float) -> Rectangle:
    """Return the bounding box of a feature or its sign, pixels."""
    pixels = axes.transData.transform(feature.places_m)
    around = Rectangle(*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())
    if len(feature.places_m) == 1:
        around = around.grown(_STAR_PT / 2.0 * pixels_per_pt)
    return around


_HEADING_SHARE: Final = 0.97  # of the width of a figure
_LEFT_SHARE: Final = 0.0125
_SUBTITLE_PT: Final = 10.0


def write_heading(
    figure: Figure, title: str, subtitle: str, share: float = _HEADING_SHARE, *, left: bool = False
) -> None:
    """Write the title of a figure and a subtitle of one or more lines.

    Args:
        figure: The figure, with axes.
        share: Largest share of the width that they take.
        left: Whether they begin at the left border rather than stand in the middle.
    """
    x, side = (_LEFT_SHARE, "left") if left else (0.5, "center")
    subtitle = _wrapped(figure, subtitle, share)
    # The empty lines reserve room for the subtitle, which the layout ignores.
    room = "\n" * len(subtitle.split("\n"))
    heading = figure.suptitle(
        f"{title}{room}", x=x, ha=side, fontsize=14, fontweight="bold", linespacing=1.5
    )
    line = figure.axes[0].annotate(
        subtitle,
        xy=(0.0 if left else 0.5, 0.12),
        xycoords=heading,
        ha=side,
        va="bottom",
        fontsize=_SUBTITLE_PT,
        color=unit_interval(QUIET_INK),
        annotation_clip=False,
    )
    line.set_in_layout(False)
    for text, size_pt in ((heading, 14.0), (line, _SUBTITLE_PT)):
        text.set_fontsize(size_pt / max(_share_of_width(figure, text) / share, 1.0))


def _wrapped(figure: Figure, subtitle: str, share: float) -> str:
    """Return a subtitle in lines that fit a share of the width, broken between words."""
    drawn = figure.text(0.0, 0.0, subtitle, fontsize=_SUBTITLE_PT)
    wide = max(_share_of_width(figure, drawn) / share, 1.0)
    drawn.remove()
    lines = subtitle.split("\n")
    most = int(max(map(len, lines)) / wide)
    parts = (wrap(line, most, break_long_words=False, break_on_hyphens=False) for line in lines)
    return "\n".join(part for of_line in parts for part in of_line or [""])


def _share_of_width(figure: Figure, text: Text) -> float:
    return float(text.get_window_extent().width / figure.bbox.width)
