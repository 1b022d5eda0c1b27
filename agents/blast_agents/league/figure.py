"""Figure of a track: the reduction over the blasts per case."""

from typing import Final

import numpy as np

from blast_agents.league.entries import NO_TRAINING
from blast_agents.league.standings import Result, Standings
from blast_env.plots.plan import INK, QUIET_INK
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import count_of, render_extra, unit_interval

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator, PercentFormatter

# Okabe and Ito's colours, which are distinguishable with any colour vision; the yellow is darker,
# so that it is visible on white.
_SEARCHES: Final = ("#0072B2", "#E69F00", "#009E73", "#56B4E9", "#C9A800")
_AGENTS: Final = ("#D55E00", "#CC79A7", "#000000")
_SEARCH_MARKERS: Final = "osD^v<>"  # 7 beside 5 colours: 35 searches differ in one or both
_AGENT_LINES: Final = ("-", "--", "-.", ":")
_NOTHING_MARKERS: Final = "xP*Xdpv^<>+1"
_APART: Final = 1.05
"""Square root of the factor between points with equal blasts, so that all are visible."""

_AROUND_ZERO: Final = 1.4
"""Largest factor between points without blasts and the tick of 0."""


def league_figure(standings: Standings) -> Figure:
    """Return the figure of the reductions with their 95 % intervals over the blasts per case.

    Agents are horizontal lines, because they spend no blasts.
    """
    figure = Figure(figsize=(13.6, 6.4), layout="constrained")
    axes = figure.add_subplot()
    searches, agents, others = _kinds(standings)
    spent = sorted({each.entry.budget for own in searches.values() for each in own}) or [1]
    zero = spent[0] / 4.0
    places = np.geomspace(zero / _AROUND_ZERO, zero * _AROUND_ZERO, len(others) + len(agents))
    for index, result in enumerate(agents):
        _draw_agent(axes, standings, result, index, places[len(others) + index])
    for index, result in enumerate(others):
        _draw_other(axes, standings, result, index, places[index])
    for index, (method, results) in enumerate(searches.items()):
        aside = _APART ** (2.0 * index - (len(searches) - 1))
        _draw_search(axes, standings, method, results, index, aside)
    axes.set_xscale("log")
    axes.set_xlim(zero / 1.5, 1.5 * spent[-1])
    axes.set_xticks([zero, *spent], ["0", *(f"{each:,}" for each in spent)])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.axvline(zero * 2.0, color=unit_interval(QUIET_INK), linewidth=0.8, linestyle=":")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.set_xlabel("blasts spent on a case (logarithmic from the dotted line on)")
    axes.set_ylabel(f"reduction of the {standings.noun} on held-out threats")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    figure.legend(loc="outside right center", fontsize=8, frameon=False)
    write_heading(figure, standings.track.title, _subtitle(standings))
    return figure


def _kinds(standings: Standings) -> tuple[dict[str, list[Result]], list[Result], list[Result]]:
    """Return the searches by method, the agents, and the other entries that build something."""
    searches: dict[str, list[Result]] = {}
    agents, others = [], []
    for result in standings.results:
        if result.entry.budget:
            searches.setdefault(result.entry.method, []).append(result)
        elif result.entry.training != NO_TRAINING:
            agents.append(result)
        elif any(proposal.layout for proposal in result.proposals):
            others.append(result)
    return searches, agents, others


def _draw_agent(
    axes: Axes, standings: Standings, result: Result, index: int, blasts: float
) -> None:
    """Draw the line of an agent, with its interval at `blasts`, near the tick of 0."""
    value = standings.reduction(result).value
    colour = _AGENTS[index % len(_AGENTS)]
    style = _AGENT_LINES[index // len(_AGENTS) % len(_AGENT_LINES)]
    label = f"{result.name}: no blast a case, {result.entry.training.blasts:,} in training"
    axes.axhline(value, color=colour, linewidth=1.8, linestyle=style, label=label, zorder=2)
    bars = _error_bars(standings, [result])
    axes.errorbar([blasts], [value], yerr=bars, color=colour, capsize=3, linewidth=1.2, zorder=3)


def _draw_other(
    axes: Axes, standings: Standings, result: Result, index: int, blasts: float
) -> None:
    axes.errorbar(
        [blasts],
        [standings.reduction(result).value],
        yerr=_error_bars(standings, [result]),
        color=unit_interval(INK),
        marker=_NOTHING_MARKERS[index % len(_NOTHING_MARKERS)],
        markersize=8,
        capsize=3,
        linestyle="",
        linewidth=1.2,
        label=result.name,
        zorder=3,
    )


def _draw_search(
    axes: Axes,
    standings: Standings,
    method: str,
    results: list[Result],
    index: int,
    aside: float,
) -> None:
    results = sorted(results, key=lambda result: result.entry.budget)
    axes.errorbar(
        [result.entry.budget * aside for result in results],
        [standings.reduction(result).value for result in results],
        yerr=_error_bars(standings, results),
        color=_SEARCHES[index % len(_SEARCHES)],
        marker=_SEARCH_MARKERS[index % len(_SEARCH_MARKERS)],
        markersize=6,
        capsize=3,
        linewidth=1.6,
        label=method if "search" in method else f"{method} search",
        zorder=4,
    )


def _error_bars(standings: Standings, results: list[Result]) -> "np.ndarray[tuple[int, int]]":
    """Return the lengths of the intervals down and up (2, results); 0 without an interval."""
    estimates = np.array([standings.reduction(result) for result in results])
    value, low, high = estimates.T
    return np.nan_to_num(np.maximum([value - low, high - value], 0.0))


def _subtitle(standings: Standings) -> str:
    count, threats = standings.unprotected.shape
    over = f"{count} cases, {count_of('held-out seed', threats)} each"
    sample = f"95 % intervals over {over}"
    if standings.has_one_case:
        sample = f"one case, 95 % intervals over its {threats} held-out threats"
    return f"{sample}; engine {standings.engine}"
