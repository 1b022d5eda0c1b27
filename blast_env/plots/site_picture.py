"""Plans of sites, without a blast."""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Final

from blast_env.geometry import Element, layout_words
from blast_env.layout import LayoutState
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
    draw_plan,
    legend_of,
    trim_height,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import nice_floor, render_extra, unit_interval
from blast_env.site import AnyScenario, BuildZone, Scenario, find_scenario

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

_WIDTHS_IN: Final = (4.6, 8.8)
_SITE_IN, _HEIGHT_IN = 5.4, 8.0  # heights at most
_ARROW_PT: Final = 32.0


def site_picture(scenario: AnyScenario, layout: Sequence[Element] = ()) -> Figure:
    """Return the plan of a site with a layout; no blast is run.

    It shows structures, barriers in one colour per item, possible places of charges, the reach of
    vehicles, and the conditions of the build zone. Names and the legend give heights.

    Args:
        scenario: The scenario, or its bundled name or path.
    """
    found = find_scenario(scenario)
    placement = LayoutState.of(found, layout)
    layout = placement.layout
    features = (*site_features(found, layout), *vehicle_features(found, layout))
    left = _items_left(found.build_zone, placement)
    return plan_figure(found, features, left, (found.name, _subtitle(found, placement)))


def plan_figure(
    scenario: Scenario,
    features: Sequence[Feature],
    handles: Sequence[Artist] = (),
    heading: tuple[str, str] | None = None,
) -> Figure:
    """Return a plan of a site with its scale, north, legend and names.

    Args:
        features: The features to draw and to name.
        handles: Further entries of the legend.
        heading: Title and subtitle.
    """
    least_in, most_in = _WIDTHS_IN
    ratio = scenario.site.width_m / scenario.site.height_m
    width_in = min(max(_SITE_IN * ratio, least_in), most_in)
    figure = Figure(figsize=(width_in, _HEIGHT_IN), layout="constrained")
    write_legend(figure, [*legend_of(features), *handles])
    axes = figure.subplots()
    draw_plan(axes, features)
    _draw_scale(axes, scenario)
    draw_north(axes, scenario)
    if heading:
        write_heading(figure, *heading)
    trim_height(figure, [axes])
    write_names(axes, features)
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


def _subtitle(scenario: Scenario, placement: LayoutState) -> str:
    masses = sorted({source.tnt_kg for source in scenario.charge})
    parts = [" or ".join(f"{mass:g}" for mass in masses) + " kg TNT"]
    zone = scenario.build_zone
    if zone is not None:
        parts.append(layout_words(placement.layout) if placement.layout else "no barrier")
        if zone.budget is not None:
            parts.append(f"cost {placement.cost:,.10g} of {zone.priced(zone.budget)}")
    parts.append(stand_off_text(scenario, placement.layout))
    return ", ".join(filter(None, parts))


def _draw_scale(axes: Axes, scenario: Scenario) -> None:
    """Draw a scale bar over the lower left corner of the site."""
    length_m = nice_floor(scenario.site.width_m / 3.0)  # a round one
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


def draw_north(axes: Axes, scenario: Scenario) -> None:
    """Draw an arrow to the north, or along the y axis of the drawing from which a site comes."""
    georeference = scenario.georeference
    if georeference is None:
        return
    turned = radians(georeference.rotation_deg)
    axes.annotate(
        "N" if georeference.kind == "map" else "drawing's y",
        xy=(0.93, 0.88),
        xycoords="axes fraction",
        xytext=(_ARROW_PT * sin(turned), _ARROW_PT * cos(turned)),
        textcoords="offset points",
        # Annotations draw their arrow from the text to the point, hence the tip there.
        arrowprops={"arrowstyle": "<|-", "color": unit_interval(INK), "shrinkB": 0.0},
        ha="center",
        va="center",
        fontsize=9,
        fontweight="bold",
    )
