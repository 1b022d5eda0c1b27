"""The picture of a scenario with a catalogue: the best layout, and what all others take off."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from blast_env.plan import (
    INK,
    PROTECTED,
    QUIET_INK,
    Feature,
    charge_feature,
    site_features,
    stand_off_text,
    vehicle_features,
)
from blast_env.rendering.site_plan import draw_plan, legend_of, write_heading, write_names
from blast_env.rendering.style import render_extra, unit_interval
from studies.difficulty.items import ItemResult, Purchase, cost_of, pieces_text

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Okabe and Ito's colours: they can be told apart with any colour vision.
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
_PERCENT: Final = 100.0


def items_figure(result: ItemResult) -> Figure:
    """Return the plan of the best layout, and beside it the reductions of all that was compared."""
    scenario, best = result.scenario, result.best
    site, rows = scenario.site, len(result.task.rules) + 3
    plan_in = _PLAN_SHARE * _WIDTH_IN * site.height_m / site.width_m
    figure = Figure(
        figsize=(_WIDTH_IN, max(plan_in, _ROW_IN * rows + 0.8) + 2.3), layout="constrained"
    )
    plan, chart = figure.subplots(1, 2, width_ratios=(_PLAN_SHARE, 1.0 - _PLAN_SHARE))
    features = _draw_plan(plan, result)
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


def _draw_plan(axes: Axes, result: ItemResult) -> Sequence[Feature]:
    """Draw the best layout and every place of the charge; return what was drawn."""
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
    """Draw a row for each rule, for random layouts and for the search, the best rule on top."""
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
