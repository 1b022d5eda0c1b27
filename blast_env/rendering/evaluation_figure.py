"""An evaluation of a layout as a figure: where, against what, and how much it takes off."""

from collections.abc import Sequence

import numpy as np

from blast_env.evaluation.layout_evaluation import LayoutEvaluation
from blast_env.evaluation.statistics import Estimate
from blast_env.physics.structure import ModularObstacle
from blast_env.rendering.captions import write_heading, write_names
from blast_env.rendering.evaluation_plan import draw_plan, plan_legend, what_stands
from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import (
    draw_loads,
    draw_outline,
    in_metres,
    load_colours,
)
from blast_env.rendering.style import (
    PROTECTED,
    QUIET_INK,
    count_of,
    nice_ceiling,
    number_on_axis,
    unit_interval,
)
from blast_env.scene import Scene, build_scene

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

# Okabe and Ito's colours, which people with any colour vision can tell apart.
_WITHOUT, _WITH = "#D55E00", "#0072B2"
_HEIGHT_IN, _RIGHT_IN = 8.4, 7.2
_PLAN_HEIGHT_IN, _PLAN_WIDTHS_IN = 5.6, (4.8, 8.4)
_MOST_NAMED_THREATS = 40
_MOST_UPRIGHT_NAMES = 16
_PERCENT = 100.0


def evaluation_figure(evaluation: LayoutEvaluation) -> Figure:
    """Return a figure of an evaluation.

    On the left the site with the layout and all charges, in the colour of how much of their
    impulse the layout takes off. On the right the impulse of each threat without and with the
    barrier, and below it the mean load on every module of the protected structure that is loaded
    most without a barrier.

    Args:
        evaluation: The evaluation.
    """
    site = evaluation.scenario.site
    least_in, most_in = _PLAN_WIDTHS_IN
    plan_in = min(max(_PLAN_HEIGHT_IN * site.width_m / site.height_m, least_in), most_in)
    figure = Figure(figsize=(plan_in + _RIGHT_IN, _HEIGHT_IN), layout="constrained")
    halves = figure.add_gridspec(1, 2, width_ratios=(plan_in, _RIGHT_IN))
    plan = figure.add_subplot(halves[0])
    right = halves[1].subgridspec(2, 1, height_ratios=(1.0, 1.05))
    threats = figure.add_subplot(right[0])
    lower = right[1].subgridspec(1, 2)
    modules = [figure.add_subplot(lower[column]) for column in range(2)]
    threat = evaluation.threats[0]
    scene = build_scene(evaluation.scenario, evaluation.layout, threat.seed, threat.charge)
    draw_plan(plan, evaluation, scene)
    _draw_threats(threats, evaluation)
    _draw_modules(modules, evaluation, scene)
    handles = plan_legend(evaluation, scene)
    figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    write_heading(figure, _title(evaluation), _subtitle(evaluation))
    write_names(plan, what_stands(scene))
    return figure


def _title(evaluation: LayoutEvaluation) -> str:
    modules = len(evaluation.layout)
    barrier = count_of("barrier module", modules) if modules else "no barrier"
    reduction = f"reduction of the impulse {_percent(evaluation.mean_reduction)}"
    return f"{evaluation.scenario.name}, {barrier}: {reduction}{_interval(evaluation.reduction)}"


def _subtitle(evaluation: LayoutEvaluation) -> str:
    charge = evaluation.worst.threat.charge
    x_m, y_m = charge.position_m
    range_note = "" if evaluation.in_range else "; partly outside the calibration's range"
    return (
        f"{count_of('threat', len(evaluation.threats))}; worst: {charge.tnt_kg:g} kg TNT at "
        f"({x_m:.1f} m, {y_m:.1f} m), {evaluation.worst.impulse_pa_s:,.0f} Pa·s; "
        f"calibration {evaluation.calibration.name}, engine {evaluation.engine_name}{range_note}"
    )


def _percent(share: float) -> str:
    return f"{_PERCENT * share:.0f} %"


def _interval(reduction: Estimate) -> str:
    """Return the interval in words; nothing for a single threat."""
    if np.isnan(reduction.low):
        return ""
    return f" (95 %: {_percent(reduction.low)} to {_percent(reduction.high)})"


def _draw_threats(axes: Axes, evaluation: LayoutEvaluation) -> None:
    """Draw the impulse of each threat without and with the barrier, the worst first."""
    outcomes = sorted(evaluation.outcomes, key=lambda outcome: -outcome.impulse_psi_s)
    place = np.arange(1, len(outcomes) + 1)
    bare = np.array([outcome.unprotected_impulse_pa_s for outcome in outcomes])
    impulse = np.array([outcome.impulse_pa_s for outcome in outcomes])
    axes.vlines(place, impulse, bare, color=unit_interval(QUIET_INK), linewidth=1.2, zorder=2)
    for values, estimate, colour, words in (
        (bare, evaluation.unprotected_impulse_pa_s, _WITHOUT, "without"),
        (impulse, evaluation.impulse_pa_s, _WITH, "with"),
    ):
        label = f"{words} barrier, mean {estimate.value:,.0f} Pa·s"
        axes.plot(place, values, "o", color=colour, markersize=5.5, label=label, zorder=3)
        axes.axhline(estimate.value, color=colour, linewidth=1.2, zorder=1)
        if not np.isnan(estimate.low):
            axes.axhspan(estimate.low, estimate.high, color=colour, alpha=0.15, linewidth=0.0)
    worst = _percent(1.0 - evaluation.cvar_level)
    label = f"mean of the worst {worst} with barrier, {evaluation.cvar:,.0f} Pa·s"
    axes.axhline(evaluation.cvar, color=_WITH, linewidth=1.4, linestyle="--", label=label)
    axes.set_xlim(0.3, len(outcomes) + 0.7)
    axes.set_ylim(0.0, 1.32 * max(bare.max(), impulse.max()))  # room for the legend
    axes.set_ylabel(f"{_impulse_name(evaluation)}\nprotected structures (Pa·s)")
    axes.set_title("Every threat, the worst with the barrier first", fontsize=11)
    axes.legend(loc="upper center", ncols=2, fontsize=8.5, frameon=False)
    axes.grid(axis="y", alpha=0.3)
    _name_threats(axes, [outcome.threat.seed for outcome in outcomes])


def _impulse_name(evaluation: LayoutEvaluation) -> str:
    """Return what the impulses are: of one structure as it is, or a weighted sum."""
    protected = evaluation.loads[0].protected
    weighted = len(protected) > 1 or protected[0].weight != 1.0
    return "weighted sum of the impulses on the" if weighted else "impulse on the"


def _name_threats(axes: Axes, seeds: Sequence[int]) -> None:
    bands = "; bands: 95 % intervals of the means" if len(seeds) > 1 else ""
    if len(seeds) > _MOST_NAMED_THREATS:
        axes.set_xlabel(f"rank of the threat{bands}")
        return
    upright = len(seeds) <= _MOST_UPRIGHT_NAMES and max(seeds) < 10_000
    axes.set_xticks(
        range(1, len(seeds) + 1),
        [str(seed) for seed in seeds],
        fontsize=8,
        rotation=0.0 if upright else 90.0,
    )
    axes.set_xlabel(f"seed of the threat{bands}")


def _draw_modules(panels: Sequence[Axes], evaluation: LayoutEvaluation, scene: Scene) -> None:
    """Draw the mean load on the modules of one structure, without and with the barrier."""
    table = evaluation.table.set_index("structure")
    protected = table[table.protected]
    name = str((protected.weight * protected.unprotected_impulse_pa_s).idxmax())
    modules = evaluation.module_table
    of_structure = modules[modules.structure == name]
    columns = ("unprotected_impulse_sim", "impulse_sim")
    highest = float(of_structure[list(columns)].to_numpy().max())
    scale = Normalize(0.0, nice_ceiling(highest) if highest > 0.0 else 1.0)
    for axes, column, words in zip(panels, columns, ("without", "with"), strict=True):
        (outline,) = (each for each in scene.structures if each.name == name)
        obstacle = outline.build()
        for part, impulse in zip(obstacle.parts, of_structure[column], strict=True):
            part.impulse, part.hits = float(impulse), int(impulse > 0.0)
        _draw_structure(axes, obstacle, scale)
        pa_s = float(table[column.replace("_sim", "_pa_s")][name])
        axes.set_title(
            f"{name} {words} barrier\n{pa_s:,.0f} Pa·s",
            fontsize=11,
            color=unit_interval(PROTECTED),
        )
    figure = panels[0].get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(
        ScalarMappable(scale, load_colours()),
        ax=list(panels),
        shrink=0.9,
        pad=0.03,
        format=FuncFormatter(number_on_axis),
    )
    bar.set_label("mean impulse per module\n(simulation units); white: not hit")


def _draw_structure(axes: Axes, obstacle: ModularObstacle, scale: Normalize) -> None:
    draw_loads(axes, obstacle, scale, linewidth=0.4)
    draw_outline(axes, obstacle)
    left, bottom, right, top = in_metres(obstacle.rectangle)
    axes.set(xlim=(left - 0.25, right + 0.25), ylim=(bottom - 0.25, top + 0.25), aspect="equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.spines[:].set_visible(False)
