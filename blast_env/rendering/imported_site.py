"""The plan of an imported site: the outlines on the map, and the modules fitted to them."""

import numpy as np

from blast_env.importing import FittedBuilding, ImportedSite
from blast_env.plan import INK, PROTECTED, STRUCTURE, Kinds, site_features, without
from blast_env.rendering.site_picture import draw_north
from blast_env.rendering.site_plan import (
    PLAN,
    draw_plan,
    legend_of,
    outline_path,
    write_heading,
    write_legend,
)
from blast_env.rendering.style import render_extra, unit_interval

with render_extra():
    import shapely
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, PathPatch

_WIDTH_IN = 10.0
_LEAST_IN, _MOST_IN = 5.0, 11.0
_HEADING_IN = 1.7
_FAINT = 0.35


def _box(label: str, colour: tuple[float, float, float]) -> Patch:
    return Patch(facecolor=(*colour, _FAINT), edgecolor=colour, label=label)


def _legend() -> list[Artist]:
    """Return the legend entries for the fitted buildings, in addition to those of features."""
    return [
        Line2D([], [], color=unit_interval(INK), linewidth=1.3, label="outline on the map"),
        _box("modules, protected", unit_interval(PROTECTED)),
        _box("modules, not protected", unit_interval(STRUCTURE)),
    ]


def imported_plan(imported: ImportedSite) -> Figure:
    """Return the plan of an imported site: filled modules, with the outlines on the map as lines.

    North is marked, and each building has its name and the deviation of its modules.
    """
    scenario = imported.scenario
    width_m, height_m = scenario.site.width_m, scenario.site.height_m
    height_in = np.clip(_WIDTH_IN * height_m / width_m + _HEADING_IN, _LEAST_IN, _MOST_IN)
    figure = Figure(figsize=(_WIDTH_IN, float(height_in)), layout="constrained")
    axes = figure.subplots()
    features = without(site_features(scenario), Kinds.STRUCTURE, Kinds.PROTECTED_STRUCTURE)
    draw_plan(axes, features)
    for building in imported.buildings:
        _draw_building(axes, building)
    draw_north(axes, scenario, PLAN)
    write_legend(figure, [*_legend(), *legend_of(features)])
    worst = max(imported.buildings, key=lambda each: each.deviation.outline_m)
    write_heading(
        figure,
        scenario.name,
        f"{imported.site.path.name}, turned by {imported.site.rotation_deg:.1f}°; modules at most "
        f"{worst.deviation.outline_m:.2f} m from an outline ({worst.name})",
    )
    return figure


def _draw_building(axes: Axes, building: FittedBuilding) -> None:
    colour = unit_interval(PROTECTED if building.protected else STRUCTURE)
    modules = PathPatch(outline_path(building.boxes_m))
    modules.set(facecolor=(*colour, _FAINT), edgecolor=colour, linewidth=0.8, zorder=2)
    axes.add_patch(modules)
    rings = [
        shapely.get_coordinates(ring)
        for ring in shapely.get_rings(shapely.get_parts(building.outline))
    ]
    lines = LineCollection(rings, colors=[unit_interval(INK)], linewidths=1.3, zorder=3)
    axes.add_collection(lines)
    middle = building.outline.representative_point()
    text = axes.text(
        middle.x,
        middle.y,
        f"{building.name}\n{building.deviation.area_share:.1%}, "
        f"{building.deviation.outline_m:.2f} m",
        ha="center",
        va="center",
        fontsize=7.5,
        fontweight="bold" if building.protected else "normal",
        zorder=6,
    )
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white")])
