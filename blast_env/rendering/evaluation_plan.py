"""The site plan of an evaluation: the layout, and how well it does against each charge."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from blast_env.evaluation.layout_evaluation import LayoutEvaluation
from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import (
    draw_outline,
    draw_site,
    draw_zone,
    in_metres,
    legend_handles,
    rectangle_patch,
)
from blast_env.rendering.style import BARRIER, EXPLOSIVE, INK, unit_interval
from blast_env.scenario import BuildZone
from blast_env.scene import Scene, StructureOutline

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import Normalize
    from matplotlib.lines import Line2D

_PERCENT = 100.0


def draw_plan(axes: Axes, evaluation: LayoutEvaluation, scene: Scene) -> None:
    """Draw the site, the layout, and the charges in the colours of their reductions."""
    draw_layout(axes, evaluation.scenario.build_zone, scene)
    _draw_charges(axes, evaluation)
    axes.add_line(_worst_ring(*evaluation.worst.threat.charge.position_m))
    axes.set_title("Site, layout and charges", fontsize=11)


def draw_layout(axes: Axes, zone: BuildZone | None, scene: Scene) -> None:
    """Draw the site and what stands on it, the modules of the barrier as filled squares."""
    draw_site(axes, in_metres(scene.site))
    if zone is not None:
        draw_zone(axes, zone)
    for outline in scene.structures:
        draw_outline(axes, outline)
        if outline.cells is not None:
            parts = [rectangle_patch(in_metres(part.rectangle)) for part in outline.build().parts]
            axes.add_collection(PatchCollection(parts, color=unit_interval(BARRIER), zorder=4))


def _draw_charges(axes: Axes, evaluation: LayoutEvaluation) -> None:
    # The least protected last, on top.
    outcomes = sorted(evaluation.outcomes, key=lambda outcome: -np.nan_to_num(outcome.reduction))
    reduction = _PERCENT * np.array([outcome.reduction for outcome in outcomes])
    scale = Normalize(0.0, _PERCENT)
    for marker, in_range in (("o", True), ("s", False)):
        chosen = np.array([outcome.in_range is in_range for outcome in outcomes])
        places = np.array([outcome.threat.charge.position_m for outcome in outcomes])[chosen]
        axes.scatter(
            places[:, 0],
            places[:, 1],
            c=reduction[chosen],
            norm=scale,
            s=62.0,
            marker=marker,
            edgecolor=unit_interval(INK),
            linewidth=0.6,
            zorder=5,
        )
    figure = axes.get_figure(root=True)
    assert figure is not None
    below = "min" if np.nanmin(reduction, initial=0.0) < 0.0 else "neither"
    mappable = ScalarMappable(scale)
    bar = figure.colorbar(mappable, ax=axes, location="bottom", shrink=0.8, pad=0.02, extend=below)
    bar.set_label("charges: reduction of the impulse on the protected structures (%)")


def plan_legend(evaluation: LayoutEvaluation, scene: Scene) -> list[Artist]:
    """Return the legend entries for what the plan shows."""
    handles: list[Artist] = [_charge_handle("o", "charge")]
    if not evaluation.in_range:
        label = "charge outside the calibration's range"
        handles.append(_charge_handle("s", label))
    handles.append(_worst_ring())
    site = layout_legend(scene.structures, evaluation.scenario.build_zone)
    return [*handles, *(handle for handle in site if handle.get_label() != "charge")]


def layout_legend(structures: Sequence[StructureOutline], zone: BuildZone | None) -> list[Artist]:
    """Return the legend entries for a charge and for what `draw_layout` shows."""
    handles = legend_handles(structures, zone)
    for handle in handles:
        if handle.get_label() == "barrier module":
            handle.set(fill=True, facecolor=unit_interval(BARRIER))
    return handles


def _charge_handle(marker: str, label: str) -> Line2D:
    return Line2D(
        [],
        [],
        marker=marker,
        linestyle="none",
        markersize=8.0,
        markerfacecolor="white",
        markeredgecolor=unit_interval(INK),
        label=label,
    )


def _worst_ring(*position_m: float) -> Line2D:
    """Return the ring around the worst charge; without a position, one for the legend."""
    return Line2D(
        position_m[:1],
        position_m[1:],
        marker="o",
        markersize=15.0,
        markerfacecolor="none",
        markeredgecolor=unit_interval(EXPLOSIVE),
        markeredgewidth=2.2,
        linestyle="none",
        label="charge with the largest impulse",
        zorder=6,
    )


def what_stands(scene: Scene) -> list[StructureOutline]:
    """Return what names should not cover: structures, and the barrier's modules one by one."""
    obstacles = [outline for outline in scene.structures if outline.cells is None]
    for outline in scene.structures:
        if outline.cells is not None:
            corners = [part.rectangle[:2] for part in outline.build().parts]
            single = replace(outline, rows=1, columns=1, cells=((0, 0),))
            obstacles += [replace(single, corner=corner) for corner in corners]
    return obstacles
