"""The plan of an imported site: the outlines on the map, and the modules fitted to them."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import shapely

from blast_env.io.importing import SiteImport
from blast_env.plots.plan import INK, Feature, FeatureKind, Look, site_features
from blast_env.plots.site_picture import plan_figure
from blast_env.plots.site_plan import draw_features, legend_of
from blast_env.plots.style import render_extra

with render_extra():
    from matplotlib.figure import Figure

_ON_MAP: Final = FeatureKind("on_map", "outline on the map", 3.5, Look(INK, 1.3))


def imported_plan(imported: SiteImport) -> Figure:
    """Return the plan of an imported site: filled modules, with the outlines on the map as lines.

    North is marked, and each building has its name and the deviation of its modules.
    """
    site, name = imported.site, imported.scenario.name
    worst = max(imported.buildings, key=lambda building: building.deviation.outline_m)
    words = (
        f"{site.path.name}, turned by {site.rotation_deg:.1f}°; modules at most "
        f"{worst.deviation.outline_m:.2f} m from an outline ({worst.name})"
    )
    outlines = [
        Feature(_ON_MAP, tuple(ring.coords[:-1]), building.name)
        for building in imported.buildings
        for ring in shapely.get_rings(shapely.get_parts(building.outline))
    ]
    features = list(_features(imported))
    figure = plan_figure(imported.scenario, features, legend_of(outlines), (name, words))
    draw_features(figure.axes[0], outlines)
    return figure


def _features(imported: SiteImport) -> Iterator[Feature]:
    """Yield the features of the site, buildings as modules with the deviation in the label."""
    deviations = {
        part: f"{building.deviation.area_share:.1%}, {building.deviation.outline_m:.2f} m"
        for building in imported.buildings
        for part in building.part_names
    }
    for feature in site_features(imported.scenario):
        if feature.name not in deviations:
            yield feature
            continue
        modules = shapely.union_all([shapely.box(*box) for box in feature.boxes_m])
        title = feature.label.rpartition("\n")[0] or feature.label
        label = f"{title}\n{deviations[feature.name]}"
        for part in shapely.get_parts(shapely.normalize(modules.simplify(0.0))):
            outer, *holes = (tuple(ring.coords[:-1]) for ring in shapely.get_rings(part))
            words = f"modules of {feature.title}"
            yield replace(feature, places_m=outer, holes_m=tuple(holes), words=words, label=label)
            label = ""
