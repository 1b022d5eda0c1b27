"""The picture of a scenario: site, threats and conditions, loads without and with a barrier.

For a zone with a catalogue: the plan of the best layout, beside a chart of all reductions.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from blast_env.evaluation import LayoutEvaluation
from blast_env.layout import Placement
from blast_env.layout.build_scene import build_scene
from blast_env.plots.plan import (
    BARRIER,
    EXPLOSIVE,
    INK,
    PROTECTED,
    QUIET_INK,
    STANDING,
    STRUCTURE,
    Feature,
    Kinds,
    charge_feature,
    site_features,
    stand_off_text,
    vehicle_features,
    without,
)
from blast_env.plots.site_plan import (
    draw_features,
    draw_loads,
    draw_outlines,
    draw_plan,
    draw_site,
    legend_of,
    load_colours,
    rectangle_patch,
    write_heading,
    write_names,
)
from blast_env.plots.style import (
    count_of,
    nice_ceiling,
    number_on_axis,
    render_extra,
    unit_interval,
)
from blast_env.site import AnySource, BuildZone, RectangleSource, Scenario
from blast_env.site.scene import Scene
from studies.difficulty.items import ItemResult, Purchase, cost_of, pieces_text

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import FuncFormatter

_FREE, _DEAR = "#d6eedb", "#f6dfa4"
_PLAN_WIDTH_IN: Final = 6.6
_EXTRA_HEIGHT_IN: Final = 2.1
_PERCENT: Final = 100.0


def difficulty_figure(evaluation: LayoutEvaluation, name: str) -> Figure:
    """Return two plans of the site: no barrier, and a layout.

    Both show the places of the charges, the cells for modules by cost, and the mean load on every
    module of the protected structures.

    Args:
        evaluation: Evaluation of the layout against no barrier.
        name: Description of the layout for the title.
    """
    scenario, count = evaluation.scenario, len(evaluation.layout)
    height_in = _PLAN_WIDTH_IN * scenario.site.height_m / scenario.site.width_m + _EXTRA_HEIGHT_IN
    figure = Figure(figsize=(2.0 * _PLAN_WIDTH_IN + 1.0, height_in), layout="constrained")
    plans = figure.subplots(1, 2, sharey=True)
    _draw_plans(plans, evaluation)
    plans[0].set_title(f"no barrier: {evaluation.unprotected_impulse_pa_s.value:,.0f} Pa·s")
    with_pa_s = evaluation.impulse_pa_s.value
    plans[1].set_title(f"{name}, {count_of('module', count)}: {with_pa_s:,.0f} Pa·s")
    plans[1].set_ylabel("")
    figure.legend(
        handles=_legend(scenario), loc="outside lower center", ncols=4, fontsize=9, frameon=False
    )
    value, low, high = (_PERCENT * each for each in evaluation.reduction)
    write_heading(
        figure,
        f"{scenario.name}: a reduction of {value:.0f} % (95 %: {low:.0f} to {high:.0f} %)",
        f"best layout for all threats, means over {len(evaluation.threats)} threats; preset "
        f"{scenario.simulation.preset}, calibration {evaluation.calibration}, engine "
        f"{evaluation.engine.name}",
    )
    for axes, layout in zip(plans, ((), evaluation.layout), strict=True):
        # The other names carry little information and would cover much.
        features = without(site_features(scenario, layout), Kinds.STRUCTURE, Kinds.CHARGE_PLACE)
        write_names(axes, features, inside=False)
    return figure


def _draw_plans(plans: Sequence[Axes], evaluation: LayoutEvaluation) -> None:
    """Draw the site without and with the layout, with a shared scale of loads."""
    scenario, modules, threat = evaluation.scenario, evaluation.module_table, evaluation.threats[0]
    columns = ["unprotected_impulse_sim", "impulse_sim"]
    protected = [structure.name for structure in scenario.structures if structure.protected]
    highest = float(modules.loc[modules.structure.isin(protected), columns].to_numpy().max())
    scale = Normalize(0.0, nice_ceiling(highest) if highest > 0.0 else 1.0)
    for axes, column, layout in zip(plans, columns, ((), evaluation.layout), strict=True):
        scene = build_scene(scenario, layout, threat.seed, threat.charge)
        impulse = dict(zip(modules.module_id, modules[column], strict=True))
        _draw_plan(axes, scenario, scene, impulse, scale)
    figure = plans[0].get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(
        ScalarMappable(scale, load_colours()),
        ax=list(plans),
        shrink=0.8,
        pad=0.01,
        format=FuncFormatter(number_on_axis),
    )
    bar.set_label("mean impulse per module (simulation units); white: not hit")


def _draw_plan(
    axes: Axes, scenario: Scenario, scene: Scene, impulse: dict[str, float], scale: Normalize
) -> None:
    draw_site(axes, scene.site_m)
    if scenario.build_zone is not None:
        _draw_cells(axes, scenario, scenario.build_zone)
        draw_features(axes, _conditions(scenario))
    for obstacle in scene.obstacles():
        if obstacle.protected:
            for part in obstacle.parts:
                part.impulse = impulse[part.module_id]
                part.hits = int(part.impulse > 0.0)
            draw_loads(axes, obstacle, scale, linewidth=0.2)
            continue
        colour = unit_interval(BARRIER if obstacle.is_barrier else STRUCTURE)
        parts = [rectangle_patch(part.rectangle_m) for part in obstacle.parts]
        axes.add_collection(PatchCollection(parts, color=colour, linewidth=0.3, zorder=4))
    protected = [each for each in scene.structures if each.protected]
    draw_outlines(axes, protected)
    share = 1.0 / sum(source.weight for source in scenario.charge)
    for source in scenario.charge:
        _draw_source(axes, source, share * source.weight)


def _draw_cells(axes: Axes, scenario: Scenario, zone: BuildZone) -> None:
    """Colour the free cells; those at a higher cost have a different colour."""
    placement = Placement.empty(scenario)
    dear = placement.module_costs > zone.module_cost
    kinds = np.ma.masked_array(dear.astype(float), mask=~placement.free)
    left, bottom, right, top = zone.rectangle_m
    axes.imshow(
        kinds,
        cmap=ListedColormap([_FREE, _DEAR]),
        vmin=0.0,
        vmax=1.0,
        origin="lower",
        extent=(left, right, bottom, top),
        interpolation="none",
        zorder=1.5,
        aspect="equal",
    )


def _conditions(scenario: Scenario) -> tuple[Feature, ...]:
    """Return the zone and its conditions, without cost areas, which are drawn by cell."""
    features = without(site_features(scenario), Kinds.SITE, Kinds.COST_AREA, *STANDING)
    return without(features, Kinds.CHARGE_PLACE)


def _draw_source(axes: Axes, source: AnySource, share: float) -> None:
    """Draw the possible places of a charge, with its mass and probability."""
    colour = unit_interval(EXPLOSIVE)
    if isinstance(source, RectangleSource):
        patch = rectangle_patch(source.rectangle_m)
        patch.set(facecolor=(*colour, 0.3), edgecolor=colour, linewidth=1.0, zorder=5)
        axes.add_patch(patch)
        x_m, y_m = source.rectangle_m.centre
    else:
        (x0_m, y0_m), (x1_m, y1_m) = source.lines_m[0]
        axes.plot(
            (x0_m, x1_m),
            (y0_m, y1_m),
            color=(*colour, 0.6),
            linewidth=6.0,
            solid_capstyle="round",
            marker="o",
            markersize=4.0,
            zorder=5,
        )
        x_m, y_m = (x0_m + x1_m) / 2.0, (y0_m + y1_m) / 2.0
    _write_source(axes, source, (x_m, y_m), share)


def _write_source(
    axes: Axes, source: AnySource, middle_m: tuple[float, float], share: float
) -> None:
    """Write the mass and probability of a charge into an area, or beside a line or point."""
    if isinstance(source, RectangleSource):
        offset_pt, turn, across, along = (0.0, 0.0), 0.0, "center", "center"
    elif source.lines_m[0][0][0] == source.lines_m[0][1][0] != source.lines_m[0][0][1]:
        offset_pt, turn, across, along = (-7.0, 0.0), 90.0, "right", "center"
    else:
        offset_pt, turn, across, along = (0.0, 7.0), 0.0, "center", "bottom"
    text = axes.annotate(
        f"{source.tnt_kg:g} kg, {_PERCENT * share:.0f} %",
        middle_m,
        xytext=offset_pt,
        textcoords="offset points",
        rotation=turn,
        ha=across,
        va=along,
        fontsize=8.5,
        color=unit_interval(EXPLOSIVE),
        zorder=6,
    )
    text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white")])


def _legend(scenario: Scenario) -> list[Artist]:
    """Return the legend entries for the features of the scenario."""
    zone = scenario.build_zone
    charge = (*unit_interval(EXPLOSIVE), 0.6)
    handles: list[Artist] = [
        Line2D([], [], color=charge, linewidth=6.0, label="charge: mass, how likely"),
        Patch(
            fill=False,
            edgecolor=unit_interval(PROTECTED),
            linewidth=2.4,
            label="protected structure",
        ),
    ]
    if not all(structure.protected for structure in scenario.structures):
        handles.append(Patch(color=unit_interval(STRUCTURE), label="other structure"))
    handles.append(Patch(color=unit_interval(BARRIER), label="barrier module"))
    if zone is None:
        return handles
    handles.append(Patch(color=_FREE, label=_free_label(zone)))
    if zone.cost_areas:
        costs = sorted({f"{area.module_cost:g}" for area in zone.cost_areas})
        budget = "" if zone.budget is None else f" (budget {zone.budget:g})"
        handles.append(Patch(color=_DEAR, label=f"cost {' or '.join(costs)}{budget}"))
    return [*handles, *legend_of(_conditions(scenario))]


def _free_label(zone: BuildZone) -> str:
    """Return the legend's label of the free cells."""
    words = f"free cell, stock of {zone.stock}"
    if zone.cost_areas:
        words += f", cost {zone.module_cost:g}"
    if zone.clearance_m > 0.0:
        words += f", {zone.clearance_m:g} m from structures"
    return words


with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Okabe and Ito's colours, distinguishable with any colour vision.
_COLOURS: Final[Mapping[Purchase | None, str]] = {
    Purchase.HEIGHT: "#D55E00",
    Purchase.LENGTH: "#0072B2",
    Purchase.DISTANCE: "#CC79A7",
    None: "#666666",
}
_LABELS: Final[Mapping[Purchase | None, str]] = {
    Purchase.HEIGHT: "rule that buys height",
    Purchase.LENGTH: "rule that buys length",
    Purchase.DISTANCE: "rule that buys distance",
    None: "other rule",
}
_WIDTH_IN: Final = 13.5
_PLAN_SHARE: Final = 0.55
_ROW_IN: Final = 0.36


def items_figure(result: ItemResult) -> Figure:
    """Return the plan of the best layout, beside a chart of the reductions of all layouts."""
    scenario, best = result.scenario, result.best
    site, rows = scenario.site, len(result.task.rules) + 3
    plan_in = _PLAN_SHARE * _WIDTH_IN * site.height_m / site.width_m
    figure = Figure(
        figsize=(_WIDTH_IN, max(plan_in, _ROW_IN * rows + 0.8) + 2.3), layout="constrained"
    )
    plan, chart = figure.subplots(1, 2, width_ratios=(_PLAN_SHARE, 1.0 - _PLAN_SHARE))
    features = _draw_item_plan(plan, result)
    _draw_reductions(chart, result)
    layout = best.layouts[0]
    budget = scenario.zone.budget
    spent = f"cost {cost_of(scenario, layout):g}" + ("" if budget is None else f" of {budget:g}")
    write_heading(
        figure,
        f"{scenario.name}: the best found takes off {_PERCENT * best.reduction.value:.0f} %",
        "; ".join(filter(None, (pieces_text(layout), spent, stand_off_text(scenario, layout)))),
    )
    write_names(plan, features)
    return figure


def _draw_item_plan(axes: Axes, result: ItemResult) -> Sequence[Feature]:
    """Draw the best layout and every place of the charge; return the features drawn."""
    scenario, layout = result.scenario, result.best.layouts[0]
    places = [place.charge_against(scenario, layout) for place in result.places]
    features = (
        *site_features(scenario, layout),
        *vehicle_features(scenario, layout),
        *(charge_feature(place, "charge") for place in places),
    )
    draw_plan(axes, features)
    axes.legend(
        handles=legend_of(features),
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=3,
        fontsize=8.5,
        frameon=False,
    )
    return features


def _draw_reductions(axes: Axes, result: ItemResult) -> None:
    """Draw rows for no barrier, random layouts, the rules by reduction, and the search on top."""
    task = result.task
    pairs = sorted(
        zip(task.rules, result.buys, strict=True), key=lambda pair: pair[0].reduction.value
    )
    names = ["no barrier", "random layouts", *(rule.name for rule, _ in pairs), task.searched.name]
    axes.axvline(0.0, color=unit_interval(QUIET_INK), linewidth=0.9, zorder=1)
    low, high = (_PERCENT * each for each in result.random_percentiles)
    axes.barh(1, high - low, left=low, height=0.5, color="#d8dde6", zorder=1)
    random = _PERCENT * task.random.layout_reductions
    scatter = np.random.default_rng(0).uniform(-0.16, 0.16, len(random))
    axes.scatter(random, 1.0 + scatter, s=9, color=unit_interval(QUIET_INK), zorder=2)
    axes.plot(0.0, 0, "o", color=unit_interval(INK), markersize=7)
    for row, (rule, buys) in enumerate(pairs, start=2):
        axes.plot(_PERCENT * rule.reduction.value, row, "o", color=_COLOURS[buys], markersize=8)
    value = _PERCENT * task.searched.reduction.value
    axes.plot(value, len(names) - 1, "D", color=unit_interval(PROTECTED), markersize=9)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.set_xlabel("impulse on the protected structures: reduction (%)")
    axes.grid(axis="x", color="#e6e9ee", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    kinds = [each for each in _LABELS if each in result.buys]
    handles = [
        Line2D([], [], marker="o", linestyle="none", color=_COLOURS[each], label=_LABELS[each])
        for each in kinds
    ]
    handles.append(Line2D([], [], color="#d8dde6", linewidth=8.0, label="10th to 90th percentile"))
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.4, -0.12),
        ncols=2,
        fontsize=8.5,
        frameon=False,
    )
