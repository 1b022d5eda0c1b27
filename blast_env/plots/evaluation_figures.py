"""Figures of evaluations."""

from collections.abc import Sequence
from math import isnan

import numpy as np

from blast_env.evaluation.questions.reduction import Evaluation
from blast_env.geometry import Layout
from blast_env.plots.plan import (
    EXPLOSIVE,
    INK,
    QUIET_INK,
    Feature,
    Kinds,
    charge_feature,
    site_features,
    stand_off_text,
    vehicle_features,
    without,
)
from blast_env.plots.site_plan import (
    draw_plan,
    legend_of,
    trim_height,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import charge_text, render_extra, unit_interval
from blast_env.site import Scenario
from blast_env.values import count_of

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


_PERCENT = 100.0


def _shown(scenario: Scenario, layout: Layout) -> list[Feature]:
    """Return the features of the site with a layout, without charges but with vehicle entries."""
    features = (*site_features(scenario, layout), *vehicle_features(scenario, layout))
    entries = [
        feature for feature in features if feature.kind is Kinds.CHARGE_PLACE and scenario.vehicles
    ]
    return [*without(features, Kinds.CHARGE_PLACE, Kinds.CHARGE), *entries]


def _draw_charges(axes: Axes, evaluation: Evaluation) -> None:
    # The smallest reduction last, on top.
    outcomes = sorted(evaluation.outcomes, key=lambda outcome: -np.nan_to_num(outcome.reduction))
    reduction = _PERCENT * np.array([outcome.reduction for outcome in outcomes])
    scale = Normalize(0.0, _PERCENT)
    for marker, in_range in (("o", True), ("s", False)):
        chosen = np.array([outcome.in_range is in_range for outcome in outcomes])
        places = np.array([outcome.charge.position_m for outcome in outcomes])[chosen]
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


def _charge_legend(evaluation: Evaluation) -> list[Artist]:
    handles: list[Artist] = [_charge_handle("o", "charge")]
    if not evaluation.in_range:
        handles.append(_charge_handle("s", "charge outside the validated range"))
    return [*handles, _worst_ring()]


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


# Okabe and Ito's colours, distinct for any colour vision.
_WITHOUT, _WITH = "#D55E00", "#0072B2"
_HEIGHT_IN, _RIGHT_IN = 8.4, 7.2
_PLAN_HEIGHT_IN, _PLAN_WIDTHS_IN = 5.6, (4.8, 8.4)
_MOST_NAMED_THREATS = 40
_MOST_UPRIGHT_NAMES = 16
_MOST_UPRIGHT_LETTERS = 64


def evaluation_figure(evaluation: Evaluation, title: str) -> Figure:
    """Return a figure of an evaluation.

    On the left the site with the layout and all charges, coloured by the reduction of their
    impulse. On the right the load of each threat without and with the barrier.
    """
    site = evaluation.scenario.site
    least_in, most_in = _PLAN_WIDTHS_IN
    plan_in = min(max(_PLAN_HEIGHT_IN * site.width_m / site.height_m, least_in), most_in)
    figure = Figure(figsize=(plan_in + _RIGHT_IN, _HEIGHT_IN), layout="constrained")
    plan, threats = figure.subplots(1, 2, width_ratios=(plan_in, _RIGHT_IN))
    features = _shown(evaluation.scenario, evaluation.layout)
    draw_plan(plan, features)
    plan.set_title("Site, layout and charges", fontsize=11)
    _draw_charges(plan, evaluation)
    plan.add_line(_worst_ring(*evaluation.worst.charge.position_m))
    _draw_threats(threats, evaluation)
    write_legend(figure, [*_charge_legend(evaluation), *legend_of(features)])
    write_heading(figure, title, _subtitle(evaluation))
    trim_height(figure, [plan])
    charges = [charge_feature(outcome.charge, "charge") for outcome in evaluation.outcomes]
    write_names(plan, [*features, *charges])
    return figure


def _subtitle(evaluation: Evaluation) -> str:
    stand_off = stand_off_text(evaluation.scenario, evaluation.layout)
    law = f"calibration {evaluation.calibration}, " if evaluation.engine.needs_calibration else ""
    range_note = "" if evaluation.in_range else "; partly outside the validated range"
    return (
        f"{count_of('threat', len(evaluation.threats))}; worst: "
        f"{charge_text(evaluation.worst.charge)}, {_load_text(evaluation, evaluation.worst.load)}; "
        f"{stand_off and f'{stand_off}; '}"
        f"{law}engine {evaluation.engine.words}{range_note}"
    )


def _percent(share: float) -> str:
    return "-" if isnan(share) else f"{_PERCENT * share:z.0f} %"


def _draw_threats(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the load of each threat without and with the barrier, the worst first."""
    outcomes = sorted(evaluation.outcomes, key=lambda outcome: -outcome.load)
    place = np.arange(1, len(outcomes) + 1)
    without = np.array([outcome.unprotected_load for outcome in outcomes])
    load = np.array([outcome.load for outcome in outcomes])
    objective = evaluation.scenario.objective
    axes.vlines(place, load, without, color=unit_interval(QUIET_INK), linewidth=1.2, zorder=2)
    for values, estimate, colour, words in (
        (without, evaluation.unprotected_mean, _WITHOUT, "without"),
        (load, evaluation.mean, _WITH, "with"),
    ):
        label = f"{words} barrier, mean {_load_text(evaluation, estimate.value)}"
        axes.plot(place, values, "o", color=colour, markersize=5.5, label=label, zorder=3)
        axes.axhline(estimate.value, color=colour, linewidth=1.2, zorder=1)
        if not np.isnan(estimate.low):
            axes.axhspan(estimate.low, estimate.high, color=colour, alpha=0.15, linewidth=0.0)
    worst = _percent(1.0 - evaluation.cvar_level)
    label = f"mean of the worst {worst} with barrier, {_load_text(evaluation, evaluation.cvar)}"
    axes.axhline(evaluation.cvar, color=_WITH, linewidth=1.4, linestyle="--", label=label)
    axes.set_xlim(0.3, len(outcomes) + 0.7)
    axes.set_ylim(0.0, 1.32 * max(without.max(), load.max()))  # room for the legend
    unit = f" ({objective.unit.replace(' ', '·')})" if objective.unit else ""
    axes.set_ylabel(f"{_load_name(evaluation)}\nprotected structures{unit}")
    axes.set_title("Every threat, the worst with the barrier first", fontsize=11)
    axes.legend(loc="upper center", ncols=2, fontsize=8.5, frameon=False)
    axes.grid(axis="y", alpha=0.3)
    if evaluation.engine.has_noise:
        _name_threats(
            axes, "seed of the threat", [str(outcome.threat.seed) for outcome in outcomes]
        )
    else:  # the seed determines only the charge
        places = (outcome.charge.position_m for outcome in outcomes)
        names = [f"({x_m:.1f}, {y_m:.1f})" for x_m, y_m in places]
        _name_threats(axes, "charge of the threat (m)", names)


def _load_text(evaluation: Evaluation, load: float) -> str:
    """Return a load with its unit, in the notation of figures."""
    return evaluation.scenario.objective.text(load).replace("Pa s", "Pa·s")


def _load_name(evaluation: Evaluation) -> str:
    """Return the name of the loads: that of one structure, or a weighted sum."""
    noun = evaluation.scenario.objective.noun
    first = evaluation.blasts.records[evaluation.blasts.judged][0]
    protected = first.loads.protected
    weighted = len(protected) > 1 or protected[0].weight != 1.0
    return f"weighted sum of the {noun} on the" if weighted else f"{noun} on the"


def _name_threats(axes: Axes, what: str, names: Sequence[str]) -> None:
    bands = "; bands: 95 % intervals of the means" if len(names) > 1 else ""
    if len(names) > _MOST_NAMED_THREATS:
        axes.set_xlabel(f"rank of the threat{bands}")
        return
    upright = len(names) <= _MOST_UPRIGHT_NAMES and sum(map(len, names)) <= _MOST_UPRIGHT_LETTERS
    axes.set_xticks(
        range(1, len(names) + 1),
        names,
        fontsize=8,
        rotation=0.0 if upright else 90.0,
    )
    axes.set_xlabel(f"{what}{bands}")
