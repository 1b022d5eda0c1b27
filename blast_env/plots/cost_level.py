"""Cost against level of protection: the price of each level, by kind of measures."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from blast_env.plots.facade import LEVEL_COLOURS
from blast_env.plots.plan import QUIET_INK
from blast_env.plots.style import render_extra, unit_interval
from blast_env.response.levels import LevelOfProtection

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinct for any colour vision; markers differ as well.
_KINDS: Final = (
    *(("#000000", "o"), ("#56B4E9", "s"), ("#0072B2", "^")),
    *(("#009E73", "D"), ("#CC79A7", "v"), ("#E69F00", "P")),
)
_MOST_DAMAGE: Final = 5.0
_MARGIN: Final = 0.05


class DamagePrice(NamedTuple):
    """A layout as a point: its cost, and the worst damage of all components behind it.

    Attributes:
        cost: Cost in the unit of the zone's budget.
        damage: Damage from 0 to 5; see `blast_env.response.damage`.
    """

    cost: float
    damage: float


def cheapest(points: Iterable[DamagePrice]) -> list[DamagePrice]:
    """Return the Pareto front of cost and damage, the cheapest point first."""
    front: list[DamagePrice] = []
    for point in sorted(points):
        if not front or point.damage < front[-1].damage:
            front.append(point)
    return front


def cost_level_figure(
    tried: Mapping[str, Sequence[DamagePrice]],
    judged: Sequence[tuple[DamagePrice, DamagePrice]],
    target: LevelOfProtection,
    title: str,
    words: tuple[str, str],
    axis: str,
) -> Figure:
    """Return a picture of cost against level of protection.

    Args:
        tried: The layouts tried, by kind of measures.
        judged: The best layout of each kind, by the search and by the judge.
        target: The required level.
        words: Engines of the search and of the judge, as `gas, cells of 0.5 m`.
        axis: Label of the axis of costs.
    """
    figure = Figure(figsize=(8.6, 5.6), layout="constrained")
    axes = figure.subplots()
    every = [point for points in tried.values() for point in points]
    most = max((point.cost for point in every), default=0.0) or 1.0
    _draw_levels(axes, target, most)
    # The front of those that no other beats in both, as steps: between two points the cheaper one
    # is what can be had.
    front = cheapest(every)
    ends = [*front, DamagePrice(most, front[-1].damage)]
    grey = unit_interval(QUIET_INK)
    handles = axes.step(
        *zip(*ends, strict=True), where="post", color=grey, label="least damage for the cost"
    )
    for (kind, points), (colour, marker) in zip(tried.items(), _KINDS, strict=False):
        places = zip(*points, strict=True)
        handles += axes.plot(*places, marker, color=colour, markersize=5.0, label=kind, zorder=3)
    for pair in judged:
        axes.plot(*zip(*pair, strict=True), color="black", linestyle=":", linewidth=1.0, zorder=2)
    handles += axes.plot(
        *zip(*(ring for _, ring in judged), strict=True),
        "o",
        color="black",
        markerfacecolor="none",
        markersize=12.0,
        label=f"the same layouts, judged: {words[1]}",
        zorder=4,
    )
    axes.set_title(f"{title}\npoints: {words[0]}; peaks that cells do not clip", fontsize=11)
    axes.set_xlabel(axis)
    axes.set_ylabel("worst damage of all components and charges (0 to 5)")
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def _draw_levels(axes: Axes, target: LevelOfProtection, most: float) -> None:
    """Draw one band per level with its name, the best at the top; the target's limit is dashed."""
    left, right = -_MARGIN * most, (1.0 + 5.0 * _MARGIN) * most
    for level in LevelOfProtection:
        begin = _MOST_DAMAGE - 1.0 - level
        axes.axhspan(begin, begin + 1.0, color=LEVEL_COLOURS[level], alpha=0.45, lw=0.0, zorder=0)
        axes.text(right, begin + 0.5, f"{level.label} ", ha="right", va="center", fontsize=9)
    limit = _MOST_DAMAGE - target
    axes.axhline(limit, color="black", linestyle="--", linewidth=1.2, zorder=2)
    axes.text(left, limit - 0.03, f" {target.label} is wanted", va="bottom", fontsize=9)
    axes.set_xlim(left, right)
    axes.set_ylim(_MOST_DAMAGE, 0.0)
    axes.spines[["top", "right"]].set_visible(False)
