"""Pictures of a site without a blast: plan and oblique view, side by side or each alone."""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Final

import numpy as np

from blast_env.errors import UnknownNameError
from blast_env.geometry import Element, layout_words
from blast_env.layout import LayoutState
from blast_env.plots.oblique import boxes_of, draw_oblique, scale_length_m
from blast_env.plots.plan import (
    INK,
    Feature,
    item_colours,
    item_words,
    site_features,
    stand_off_text,
    vehicle_features,
)
from blast_env.plots.site_plan import (
    PLAN,
    View,
    draw_plan,
    legend_of,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import render_extra, unit_interval
from blast_env.site import AnyScenario, BuildZone, Scenario, find_scenario

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

SITE_VIEWS: Final = ("both", "plan", "oblique")
"""The choices of views for a picture of a site."""

_PANEL_IN: Final = 5.4
_WIDTHS_IN: Final = (4.6, 8.8)
_HEADING_IN: Final = 0.9
_LEGEND_ROW_IN: Final = 0.24
_ARROW_PT: Final = 32.0


def site_picture(
    scenario: AnyScenario,
    layout: Sequence[Element] = (),
    view: str = "both",
    corner: str | None = None,
) -> Figure:
    """Return a picture of a site with a layout; no blast is run.

    It shows structures, barriers in one colour per item, possible places of charges, the reach of
    vehicles, and the conditions of the build zone; heights are to scale in the oblique view.

    Args:
        scenario: The scenario, or its bundled name or path.
        layout: The layout of the build zone.
        view: `"plan"`, `"oblique"`, or `"both"`.
        corner: The corner nearest to the viewer in the oblique view (`"southwest"`, ...); by
            default the one on the side of the charges.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        UnknownNameError: If there is no such view or corner.
    """
    if view not in SITE_VIEWS:
        raise UnknownNameError("view", view, SITE_VIEWS)
    found = find_scenario(scenario)
    placement = LayoutState.of(found, layout)
    views = SITE_VIEWS[1:] if view == "both" else (view,)
    widths_in = [_width_in(placement, each) for each in views]
    layout = placement.layout
    features = (*site_features(found, layout), *vehicle_features(found, layout))
    handles = [*legend_of(features), *_items_left(found.build_zone, placement)]
    height_in = _PANEL_IN + _HEADING_IN
    figure = Figure(figsize=(sum(widths_in), height_in), layout="constrained")
    figure.set_figheight(height_in + write_legend(figure, handles) * _LEGEND_ROW_IN)
    panels = figure.subplots(1, len(views), width_ratios=widths_in, squeeze=False)[0]
    shown: list[tuple[Axes, Sequence[Feature], View]] = []
    for axes, each in zip(panels, views, strict=True):
        if each == "oblique":
            oblique, raised = draw_oblique(axes, found, layout, corner)
            _draw_directions(axes, found, oblique)
            shown.append((axes, raised, oblique))
        else:
            draw_plan(axes, features)
            draw_scale(axes, found)
            draw_north(axes, found, PLAN)
            shown.append((axes, features, PLAN))
    write_heading(figure, found.name, _subtitle(found, placement))
    for axes, of_view, seen in shown:
        write_names(axes, of_view, seen)
    return figure


def _items_left(zone: BuildZone | None, placement: LayoutState) -> list[Artist]:
    """Return the legend entries for items without a placed piece."""
    if zone is None:
        return []
    words, standing = item_words(zone, placement.layout), item_words(zone, ())
    return [
        Patch(facecolor=unit_interval(colour), edgecolor=unit_interval(INK), label=words[name])
        for name, colour in item_colours(zone).items()
        if words[name] == standing[name]
    ]


def _width_in(placement: LayoutState, view: str) -> float:
    """Return the width of a panel whose view fills the common height of panels, inches."""
    site = placement.scenario.site
    width_m, height_m = site.width_m, site.height_m
    if view == "oblique":
        boxes = boxes_of(placement.scenario, placement.layout)
        sides_m = width_m + height_m
        highest_m = max(box.height_m for box in boxes)
        width_m = sides_m * cos(radians(30.0))
        height_m = sides_m * sin(radians(30.0)) + 0.5 * highest_m
    least_in, most_in = _WIDTHS_IN
    return min(max(_PANEL_IN * width_m / height_m, least_in), most_in)


def _subtitle(scenario: Scenario, placement: LayoutState) -> str:
    masses = sorted({source.tnt_kg for source in scenario.charge})
    parts = [" or ".join(f"{mass:g}" for mass in masses) + " kg TNT"]
    zone = scenario.build_zone
    if zone is not None:
        parts.append(layout_words(placement.layout) if placement.layout else "no barrier")
        if zone.budget is not None:
            parts.append(f"cost {placement.cost:.4g} of {zone.budget:g}")
    parts.append(stand_off_text(scenario, placement.layout))
    if any(each.height_m is None for each in scenario.structures):
        air_m = scenario.air_height_m
        parts.append(f"structures without a height are drawn as high as the air, {air_m:g} m")
    return ", ".join(filter(None, parts))


def draw_scale(axes: Axes, scenario: Scenario) -> None:
    """Draw a scale bar over the lower left corner of the site."""
    length_m = scale_length_m(scenario.site.rectangle_m)
    x_m = y_m = 0.03 * max(scenario.site.width_m, scenario.site.height_m)
    ink = unit_interval(INK)
    style = {"color": ink, "linewidth": 3.0, "solid_capstyle": "butt", "zorder": 6.0}
    bar = Line2D([x_m, x_m + length_m], [y_m, y_m])
    bar.set(**style)
    axes.add_line(bar)
    axes.annotate(
        f"{length_m:g} m",
        (x_m + length_m / 2.0, y_m),
        xytext=(0.0, 3.0),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=8,
        zorder=6.0,
    )


def _draw_directions(axes: Axes, scenario: Scenario, view: View) -> None:
    """Draw the directions of x and y in the oblique view, and north if it is known."""
    for label, x, y in (("x", 1.0, 0.0), ("y", 0.0, 1.0)):
        _draw_arrow(axes, view, label, (x, y), place=(0.09, 0.88))
    draw_north(axes, scenario, view)


def draw_north(axes: Axes, scenario: Scenario, view: View) -> None:
    """Draw an arrow to the north, or along the y axis of the drawing from which a site comes."""
    georeference = scenario.georeference
    if georeference is not None:
        turned = radians(georeference.rotation_deg)
        label = "N" if georeference.kind == "map" else "drawing's y"
        _draw_arrow(axes, view, label, (sin(turned), cos(turned)), place=(0.93, 0.88))


def _draw_arrow(
    axes: Axes,
    view: View,
    label: str,
    direction: tuple[float, float],
    place: tuple[float, float],
) -> None:
    """Draw an arrow in a direction on the ground, with its label at the tip."""
    ends = view.places(np.array([(0.0, 0.0, 0.0), (*direction, 0.0)]))
    across, up = _ARROW_PT * (ends[1] - ends[0])
    axes.annotate(
        label,
        xy=place,
        xycoords="axes fraction",
        xytext=(across, up),
        textcoords="offset points",
        # Annotations draw their arrow from the text to the point, hence the tip there.
        arrowprops={"arrowstyle": "<|-", "color": unit_interval(INK), "shrinkB": 0.0},
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold",
    )
