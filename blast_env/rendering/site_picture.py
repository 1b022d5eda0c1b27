"""A site before any blast: its plan and its oblique view, side by side or each alone."""

from collections import Counter
from collections.abc import Sequence
from math import ceil, cos, radians, sin
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import UnknownNameError
from blast_env.geometry import Element, Piece, layout_counts
from blast_env.rendering.oblique import (
    DEARER,
    WAY,
    View,
    add_area,
    boxes_of,
    draw_conditions,
    draw_oblique,
    draw_sources,
    draw_star,
    item_colours,
    scale_length_m,
)
from blast_env.rendering.site_plan import (
    draw_outline,
    draw_site,
    draw_zone,
    legend_handles,
    what_stands,
    write_heading,
    write_names,
)
from blast_env.rendering.style import EXPLOSIVE, INK, PAGE, render_extra, unit_interval
from blast_env.rendering.vehicle_plan import draw_vehicles, stand_off_text, vehicle_legend
from blast_env.scenario import (
    AnyScenario,
    Placement,
    RectangleSource,
    Scenario,
    SegmentSource,
    find_scenario,
)
from blast_env.scenario.build_scene import build_site, worst_places

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

SITE_VIEWS: Final = ("both", "plan", "oblique")
"""What a picture of a site shows."""


_PANEL_IN: Final = 5.4


_WIDTHS_IN: Final = (4.6, 8.8)


_HEADING_IN: Final = 0.9


_LEGEND_ROW_IN: Final = 0.24


_LEGEND_COLUMN_IN: Final = 3.0


_ARROW_PT: Final = 26.0


class PlanView:
    """The view from above: heights do not show."""

    def places(self, points_m: FloatArray) -> FloatArray:
        """Return x and y (n, 2) of x, y and height (n, 3), m."""
        return np.asarray(points_m, dtype=np.float64)[:, :2]


PLAN: Final = PlanView()


def site_picture(
    scenario: AnyScenario,
    layout: Sequence[Element] = (),
    view: str = "both",
    corner: str | None = None,
) -> Figure:
    """Return a picture of a site and of what stands on it; no blast is run.

    It shows structures, barriers in a colour an item, where charges may go off, what vehicles
    reach, and the conditions of the build zone; heights are to scale in the oblique view.

    Args:
        scenario: The scenario, or its bundled name or path.
        layout: What stands on the build zone.
        view: `"plan"`, `"oblique"`, or `"both"`.
        corner: Over which corner one looks in the oblique view (`"southwest"`, ...); the one on
            the side of the charges unless given.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        UnknownNameError: If there is no such view or corner.
    """
    if view not in SITE_VIEWS:
        raise UnknownNameError("view", view, SITE_VIEWS)
    found = find_scenario(scenario)
    placement = Placement.of(found, layout)
    views = SITE_VIEWS[1:] if view == "both" else (view,)
    widths_in = [_width_in(placement, each) for each in views]
    handles = site_legend(found, placement)
    columns = max(int(sum(widths_in) / _LEGEND_COLUMN_IN), 2)
    legend_in = ceil(len(handles) / columns) * _LEGEND_ROW_IN
    figure = Figure(
        figsize=(sum(widths_in), _PANEL_IN + _HEADING_IN + legend_in), layout="constrained"
    )
    panels = figure.subplots(1, len(views), width_ratios=widths_in, squeeze=False)[0]
    for axes, each in zip(panels, views, strict=True):
        if each == "oblique":
            _draw_directions(axes, found, draw_oblique(axes, found, placement.layout, corner))
        else:
            draw_full_plan(axes, found, placement.layout)
            _draw_plan_scale(axes, found)
            _draw_north(axes, found, PLAN)
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, fontsize=9, frameon=False
    )
    write_heading(figure, found.name, _subtitle(found, placement))
    if "plan" in views:
        write_names(panels[0], what_stands(build_site(found, placement.layout).structures))
    return figure


def draw_full_plan(axes: Axes, scenario: Scenario, layout: Sequence[Element] = ()) -> None:
    """Draw the plan of a site with everything that can be drawn before a blast.

    Args:
        axes: Empty axes.
        scenario: The scenario.
        layout: What stands on the build zone; it must fit there.
    """
    draw_site(axes, scenario.site.rectangle_m)
    zone = scenario.build_zone
    if zone is not None:
        draw_zone(axes, zone)
        draw_conditions(axes, PLAN, zone, [each.rectangle_m for each in scenario.structures])
    draw_vehicles(axes, scenario, layout)
    draw_sources(axes, PLAN, scenario.charge)
    for source in scenario.vehicles:
        draw_star(axes, PLAN, worst_places(scenario, source, layout).places_m[0], 0.0)
    for outline in build_site(scenario).structures:
        draw_outline(axes, outline)
    colours = item_colours(zone)
    for element in layout:
        add_area(
            axes,
            PLAN,
            scenario.zone.element_rectangle_m(element),
            facecolor=colours[element.item if isinstance(element, Piece) else ""],
            edgecolor=unit_interval(PAGE),
            linewidth=0.4,
            zorder=4.0,
        )


def site_legend(scenario: Scenario, placement: Placement) -> list[Artist]:
    """Return the legend entries for a plan and an oblique view of a site.

    The items of a catalogue are there with their heights, and how many of them stand.
    """
    zone, red = scenario.build_zone, unit_interval(EXPLOSIVE)
    star, *handles = legend_handles(build_site(scenario).structures, zone)
    if scenario.vehicles:
        star.set_label("worst place of a vehicle")
    stars = any(not isinstance(each, SegmentSource | RectangleSource) for each in scenario.charge)
    handles = [star, *handles] if stars else handles
    if any(isinstance(each, SegmentSource) for each in scenario.charge):
        line = Line2D([], [], color=red, linewidth=2.2, label="road on which the charge may be")
        handles.append(line)
    if any(isinstance(each, RectangleSource) for each in scenario.charge):
        label = "area in which the charge may be"
        handles.append(Patch(facecolor=(*red, 0.35), edgecolor=red, label=label))
    handles += vehicle_legend(scenario)
    if zone is None:
        return handles
    if zone.cost_areas:
        handles.append(Patch(facecolor=DEARER, label="building costs more"))
    if zone.access_way is not None:
        label = "access way that stays open"
        line = Line2D([], [], color=WAY, linewidth=1.8, marker="D", markersize=4.0, label=label)
        handles.append(line)
        if zone.access_way.gate is not None:
            handles.append(Patch(facecolor=(*WAY, 0.3), edgecolor=WAY, label="its gate"))
    return [*handles, *_items_legend(scenario, placement)]


def _items_legend(scenario: Scenario, placement: Placement) -> list[Artist]:
    zone, catalogue = scenario.zone, placement.catalogue
    placed = Counter(each.item if isinstance(each, Piece) else "" for each in placement.layout)
    handles: list[Artist] = []
    for number, (name, colour) in enumerate(item_colours(zone).items()):
        variant = next(each for each in catalogue.variants if each.item == number)
        height = "as high as the air" if variant.height_m is None else f"{variant.height_m:g} m"
        label = (
            f"{name or 'barrier module'}, {height}: {placed[name]} of {catalogue.stocks[number]}"
        )
        handles.append(Patch(facecolor=colour, edgecolor=unit_interval(INK), label=label))
    return handles


def _width_in(placement: Placement, view: str) -> float:
    """Return how wide a panel is, so that the view fills the height of all panels."""
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


def _subtitle(scenario: Scenario, placement: Placement) -> str:
    masses = sorted({source.tnt_kg for source in scenario.charge})
    parts = [" or ".join(f"{mass:g}" for mass in masses) + " kg TNT"]
    zone = scenario.build_zone
    if zone is not None:
        parts.append(
            layout_counts(placement.layout, "barrier") if placement.layout else "no barrier"
        )
        if zone.budget is not None:
            parts.append(f"cost {placement.cost:.4g} of {zone.budget:g}")
    parts.append(stand_off_text(scenario, placement.layout))
    if any(each.height_m is None for each in scenario.structures):
        air_m = scenario.air_height_m
        parts.append(f"what has no height is drawn as high as the air, {air_m:g} m")
    return ", ".join(filter(None, parts))


def _draw_plan_scale(axes: Axes, scenario: Scenario) -> None:
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
    """Draw how the axes of the plan run in the oblique view, and north where it is known."""
    for label, x, y in (("x", 1.0, 0.0), ("y", 0.0, 1.0)):
        _draw_arrow(axes, view, label, (x, y), place=(0.09, 0.88))
    _draw_north(axes, scenario, view)


def _draw_north(axes: Axes, scenario: Scenario, view: View) -> None:
    """Draw an arrow to the north, or along the y axis of the drawing that a site comes from."""
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
    """Draw an arrow that stands for a direction on the ground, with its label at the tip."""
    ends = view.places(np.array([(0.0, 0.0, 0.0), (*direction, 0.0)]))
    across, up = _ARROW_PT * (ends[1] - ends[0])
    # Annotations draw their arrow from the text to the point, hence the tip twice.
    arrow = {"arrowstyle": "<|-", "color": unit_interval(INK), "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate(
        "",
        xy=place,
        xycoords="axes fraction",
        xytext=(across, up),
        textcoords="offset points",
        arrowprops=arrow,
    )
    axes.annotate(
        label,
        xy=place,
        xycoords="axes fraction",
        xytext=(1.3 * across, 1.3 * up),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold",
    )
