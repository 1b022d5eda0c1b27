"""Figures of a search: the best reduction over the blasts spent, and the Pareto front."""

from collections.abc import Sequence

import numpy as np

from blast_env.design.search.problem import Candidate, SearchResult
from blast_env.evaluation import DesignProblem
from blast_env.geometry import layout_counts
from blast_env.plots.plan import QUIET_INK
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import number_on_axis, render_extra, unit_interval
from blast_env.values import count_of

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import (
        FuncFormatter,
        LogLocator,
        MaxNLocator,
        NullFormatter,
        PercentFormatter,
    )

# Okabe and Ito's colours, which are distinguishable with any colour vision.
_COLOURS = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#0072B2")
_BEST = "#0072B2"


def search_figure(result: SearchResult, problem: DesignProblem) -> Figure:
    """Return a figure of a search.

    Args:
        result: The result of the search, which has spent blasts.
    """
    panels = 2 if result.front else 1
    figure = Figure(figsize=(2.0 + 5.6 * panels, 5.4), layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0]
    _draw_history(axes[0], result, problem)
    if result.front:
        _draw_front(axes[1], result.front, problem)
    best = result.history[-1]
    scenario = problem.scenario
    write_heading(
        figure,
        f"{scenario.name}, {result.method} search: reduction "
        f"{100.0 * best.reduction(problem):.0f} % with "
        f"{layout_counts(best.layout)}",
        f"{result.blasts:,} of {count_of('blast', result.budget)} spent"
        f"{', interrupted' if result.interrupted else ''}; engine "
        f"{problem.evaluator.engine.name}, seed {result.seed}; reductions are "
        f"on the threats that the search chose by",
    )
    return figure


def _draw_history(axes: Axes, result: SearchResult, problem: DesignProblem) -> None:
    """Draw the best reduction over the blasts spent, in a colour for each number of threats."""
    history = result.history
    ends = [*(step.blasts for step in history[1:]), max(result.blasts, history[-1].blasts)]
    counts = sorted({step.threats for step in history})
    # The strongest colour last, for the largest number of threats.
    colours = _COLOURS[-len(counts) :] if len(counts) <= len(_COLOURS) else (_BEST,) * len(counts)
    for count, colour in zip(counts, colours, strict=True):
        chosen = [(step, end) for step, end in zip(history, ends, strict=True)]
        chosen = [(item, end) for item, end in chosen if item.threats == count]
        blasts = np.array([(item.blasts, end) for item, end in chosen]).ravel()
        reduction = np.repeat([item.reduction(problem) for item, _ in chosen], 2)
        axes.plot(blasts, reduction, color=colour, linewidth=2.2, zorder=3)
        starts = [item.blasts for item, _ in chosen]
        axes.plot(
            starts,
            reduction[::2],
            "o",
            color=colour,
            markersize=4.0,
            label=f"under {count_of('threat', count)}",
            zorder=4,
        )
    axes.set_xscale("log")
    axes.set_xlim(max(0.8, 0.8 * history[0].blasts), 1.15 * max(result.blasts, 2))
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("blasts spent")
    axes.set_title("Best layout so far", fontsize=11)
    _set_reduction_axis(axes, problem)
    axes.legend(loc="lower right", fontsize=9, frameon=False)


def _draw_front(axes: Axes, front: Sequence[Candidate], problem: DesignProblem) -> None:
    """Draw the reduction over the number of modules or, with a catalogue, over the cost."""
    prices = [problem.price(candidate.layout) for candidate in front]
    reduction = [candidate.reduction(problem) for candidate in front]
    axes.step(prices, reduction, where="post", color=unit_interval(QUIET_INK), linewidth=1.0)
    axes.plot(prices, reduction, "o", color=_BEST, markersize=6.0, zorder=3)
    has_items = bool(problem.scenario.zone.items)
    axes.set_xlabel("cost" if has_items else "modules")
    axes.xaxis.set_major_locator(MaxNLocator(integer=not has_items))
    threats = count_of("threat", front[0].threats)
    price = "cost" if has_items else "number of modules"
    axes.set_title(f"Front: reduction against {price}, under {threats}", fontsize=11)
    _set_reduction_axis(axes, problem)


def _set_reduction_axis(axes: Axes, problem: DesignProblem) -> None:
    low = min(0.0, axes.get_ylim()[0])
    axes.set_ylim(low, 1.0)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    axes.set_ylabel(f"reduction of the {problem.scenario.objective.noun}")
    axes.grid(alpha=0.3, which="both")
    axes.spines[["top", "right"]].set_visible(False)
