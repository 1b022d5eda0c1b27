"""Plan of a screening: the ground by the level of protection that a charge there allows."""

from collections.abc import Sequence
from math import isfinite
from typing import Final

import shapely

from blast_env.evaluation.questions.screening import Screening, ThreatScreening
from blast_env.geometry import Layout
from blast_env.plots.facade import LEVEL_COLOURS
from blast_env.plots.plan import Kinds, charge_feature, site_features, without
from blast_env.plots.site_plan import draw_features, draw_plan, write_heading, write_names
from blast_env.plots.style import render_extra
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.sections import PointM
from blast_env.site import AnyStructure, Scenario

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.colors import to_rgb
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, PathPatch, Polygon
    from matplotlib.path import Path

_PANEL_IN: Final = 4.6
_PALE: Final = 0.65
_BEYOND: Final = 1.5  # of the site's longer side, shown around it at most
_LEVELS: Final = tuple(sorted(LevelOfProtection, reverse=True)[:-1])


def screening_picture(scenario: Scenario, layout: Layout, found: Screening) -> Figure:
    """Return one plan per threat, with the stand-off of each level as a ring round the facades.

    Rings are for normal incidence and the components on the site. The star is the worst place.
    """
    count = len(found.threats)
    columns = min(count, 3)
    rows = -(-count // columns)
    size_in = (_PANEL_IN * columns + 0.4, (_PANEL_IN + 0.9) * rows + 0.9)
    figure = Figure(figsize=size_in, layout="constrained")
    panels = [figure.add_subplot(rows, columns, k + 1) for k in range(count)]
    features = site_features(scenario, layout)
    names = {bay.filled.bay.structure for bay in found.threats[0].bays}
    facades = shapely.union_all(
        [
            shapely.Polygon(ring)
            for structure in scenario.structures
            for ring in _rings(structure)
            if structure.name in names
        ]
    )
    for axes, threat in zip(panels, found.threats, strict=True):
        draw_plan(axes, [feature for feature in features if feature.kind is Kinds.SITE])
        _draw_rings(axes, scenario, facades, found, threat)
        for structure in scenario.structures_with(layout):
            for ring in _rings(structure):
                axes.add_patch(Polygon(ring, facecolor="white", zorder=1.9))
        draw_features(axes, without(features, Kinds.SITE))
        draw_features(axes, [charge_feature(threat.charge, "worst place")])
        axes.set_title(f"{threat.name}, {threat.charge.tnt_kg:g} kg TNT", fontsize=11)
    write_heading(
        figure,
        f"{scenario.name}: level of protection by the place of a charge",
        "Kingery and Bulmash in the open, at right angles; rings know no shielding, no echoes",
    )
    for axes in panels:
        write_names(axes, without(features, Kinds.CHARGE_PLACE, Kinds.GAUGE))
    return figure


def _rings(structure: AnyStructure) -> tuple[Sequence[PointM], ...]:
    """Return the outline of a structure in plan, as the only one."""
    if structure.footprint is not None:
        return structure.footprint.rings[:1]
    left, bottom, right, top = structure.rectangle_m
    return (((left, bottom), (right, bottom), (right, top), (left, top)),)


def _draw_rings(
    axes: Axes,
    scenario: Scenario,
    facades: shapely.Geometry,
    found: Screening,
    threat: ThreatScreening,
) -> None:
    """Draw the ground of each level, the widest ring first, and its legend."""
    needed_m = {
        level: found.needed_m(threat.name, Requirement.of_level(level)) for level in _LEVELS
    }
    site = scenario.site
    most_m = _BEYOND * max(site.width_m, site.height_m)
    # 1. The plan shows the farthest stand-off, within bounds.
    reach_m = min(
        max((distance for distance in needed_m.values() if isfinite(distance)), default=0.0), most_m
    )
    reach_m = max(reach_m, 0.05 * most_m)
    axes.set_xlim(-reach_m, site.width_m + reach_m)
    axes.set_ylim(-reach_m, site.height_m + reach_m)
    axes.set_facecolor(_pale(LevelOfProtection.HIGH))
    handles = [_patch(LevelOfProtection.HIGH, needed_m, found, threat)]
    # 2. The wide rings first: each covers the middle of the one before, in the colour of what is
    # left there.
    for level in _LEVELS:
        below = LevelOfProtection(level - 1)
        distance_m = min(needed_m[level], 4.0 * max(site.width_m, site.height_m))
        ring = shapely.buffer(facades, distance_m, quad_segs=32)
        for part in shapely.get_parts(ring):
            path = Path(shapely.get_coordinates(part.exterior), closed=True)
            patch = PathPatch(path, facecolor=_pale(below), edgecolor="0.25", linewidth=0.8)
            patch.set_zorder(1.1 + 0.01 * (LevelOfProtection.HIGH - level))
            axes.add_patch(patch)
        handles.append(_patch(below, needed_m, found, threat))
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        fontsize=8,
        ncols=2,
        frameon=False,
    )


def _pale(level: LevelOfProtection) -> tuple[float, float, float]:
    """Return the colour of a level, pale enough for what is drawn over it."""
    red, green, blue = (1.0 - _PALE * (1.0 - part) for part in to_rgb(LEVEL_COLOURS[level]))
    return red, green, blue


def _patch(
    level: LevelOfProtection,
    needed_m: dict[LevelOfProtection, float],
    found: Screening,
    threat: ThreatScreening,
) -> Patch:
    words = "nearer"
    if level in needed_m:
        words = f"from {found.stand_offs[threat.name][0].in_words(needed_m[level])} m"
    return Patch(facecolor=_pale(level), edgecolor="0.4", label=f"{level.label}: {words}")
