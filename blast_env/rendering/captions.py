"""Headings of figures, and names on site plans that cover nothing."""

from collections.abc import Sequence

from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import Obstacle, in_metres
from blast_env.rendering.style import INK, PROTECTED, QUIET_INK, unit_interval

with render_extra():
    from matplotlib import patheffects
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

_GAP_PT = 4.0


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
    figure.draw_without_rendering()
    taken = [_pixels(axes, obstacle) for obstacle in obstacles]
    site = axes.patches[0].get_window_extent()
    for text, obstacle in zip(texts, named, strict=True):
        taken.append(_settle(text, _pixels(axes, obstacle), taken, site, below))


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
    for across, along in (
        (0.0, first),
        (0.0, -first),
        *((sign * side, shift) for shift in (0.0, low, -low) for sign in (1.0, -1.0)),
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
