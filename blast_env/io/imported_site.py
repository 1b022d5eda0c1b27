"""The plan of an imported site: the outlines on the map, and the modules fitted to them."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from blast_env.io.importing import FittedBuilding, ImportedSite
from blast_env.plots.plan import (
    INK,
    PROTECTED,
    STRUCTURE,
    Feature,
    Kinds,
    site_features,
    without,
)
from blast_env.plots.site_picture import draw_north
from blast_env.plots.site_plan import (
    draw_plan,
    legend_of,
    outline_path,
    trim_height,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import render_extra, unit_interval

with render_extra():
    import shapely
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, PathPatch

_WIDTH_IN, _HEIGHT_IN = 10.0, 11.0  # at most as high
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
    figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    labelled = site_features(scenario)
    features = without(labelled, Kinds.STRUCTURE, Kinds.PROTECTED_STRUCTURE, Kinds.TERRACE)
    draw_plan(axes, features)
    for building in imported.buildings:
        _draw_building(axes, building)
    draw_north(axes, scenario)
    write_legend(figure, [*_legend(), *legend_of(features)])
    worst = max(imported.buildings, key=lambda each: each.deviation.outline_m)
    write_heading(
        figure,
        scenario.name,
        f"{imported.site.path.name}, turned by {imported.site.rotation_deg:.1f}°; modules at most "
        f"{worst.deviation.outline_m:.2f} m from an outline ({worst.name})",
    )
    trim_height(figure, [axes])
    write_names(axes, list(_with_deviations(labelled, imported.buildings)))
    return figure


def _with_deviations(
    features: Iterable[Feature], buildings: Iterable[FittedBuilding]
) -> Iterator[Feature]:
    """Yield features, with the deviation of each building in its label."""
    deviations = {
        part: f"{each.deviation.area_share:.1%}, {each.deviation.outline_m:.2f} m"
        for each in buildings
        for part in each.part_names
    }
    for feature in features:
        title = feature.label.rpartition("\n")[0] or feature.label
        own = deviations.get(feature.name)
        yield replace(feature, label=f"{title}\n{own}") if feature.label and own else feature


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
