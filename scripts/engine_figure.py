"""The figure of the comparison: how pymunk nears the event engine as its step gets shorter."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.rendering.site_plan import write_heading
from blast_env.rendering.style import render_extra
from scripts.engine_comparison import CLOSE, QUANTITIES, Comparison

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

# Okabe and Ito's colours, which people with any colour vision can tell apart.
_LOOKS: Final = (
    ("#0072B2", "o"),
    ("#56B4E9", "s"),
    ("#009E73", "^"),
    ("#E69F00", "D"),
    ("#000000", "v"),
    ("#D55E00", "X"),
)
_SPREAD: Final = 0.012
"""Lines are shifted sideways by this share of the axis, so that their intervals lie apart."""
_LOADS: Final = ("impulse", "transferred", "hits")
_MOST_SHOWN_PERCENT: Final = 45.0


def convergence_figure(comparisons: Sequence[Comparison], event_seeds: int) -> Figure:
    """Return one panel a quantity, one line a scene.

    Args:
        comparisons: Of one structure of each scene, at several steps.
        event_seeds: Blasts of each scene on the event engine.
    """
    figure = Figure(figsize=(13.0, 8.2), layout="constrained")
    panels = figure.subplots(2, 3)
    steps = sorted({comparison.step_radii for comparison in comparisons}, reverse=True)
    for axes, (name, words) in zip(panels.flat, QUANTITIES.items(), strict=False):
        _draw_quantity(axes, comparisons, name)
        axes.set_title(words[0].upper() + words[1:])
        _set_axes(axes, steps)
        if name in _LOADS:
            axes.axhspan(-100.0 * CLOSE, 100.0 * CLOSE, color="#000000", alpha=0.07, lw=0)
    _write_legend(panels.flat[-1], panels.flat[0])
    write_heading(
        figure,
        "pymunk against the event engine, by the length of pymunk's step",
        f"difference of the means over the seeds with 95 % intervals; event engine: {event_seeds} "
        "seeds a scene; grey: within 5 %",
    )
    return figure


def _draw_quantity(axes: Axes, comparisons: Sequence[Comparison], name: str) -> None:
    scenes = dict.fromkeys(each.scene for each in comparisons)
    lowest, highest = -8.0, 8.0
    for number, (scene, (colour, marker)) in enumerate(zip(scenes, _LOOKS, strict=False)):
        own = [each for each in comparisons if each.scene == scene]
        differences = [each.differences[name] for each in own]
        value = 100.0 * np.array([difference.value for difference in differences])
        half_width = 100.0 * np.array([difference.half_width for difference in differences])
        shift = np.exp(_SPREAD * (number - len(scenes) / 2.0) * np.log(50.0))
        axes.errorbar(
            shift * np.array([each.step_radii for each in own]),
            value,
            yerr=half_width,
            color=colour,
            marker=marker,
            ms=5.0,
            lw=1.3,
            capsize=2.5,
            label=f"{scene}: {own[0].structure}",
        )
        lowest = min(lowest, float((value - half_width).min()))
        highest = max(highest, float((value + half_width).max()))
    axes.set_ylim(
        max(1.08 * lowest, -_MOST_SHOWN_PERCENT), min(1.08 * highest, _MOST_SHOWN_PERCENT)
    )


def _set_axes(axes: Axes, steps: Sequence[float]) -> None:
    axes.axhline(0.0, color="#000000", lw=0.8)
    axes.set_xscale("log")
    axes.invert_xaxis()
    axes.xaxis.set_major_locator(FixedLocator(list(steps)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlabel("step of pymunk (radii)")
    axes.set_ylabel("pymunk / event - 1 (%)")
    axes.grid(alpha=0.3)


def _write_legend(axes: Axes, source: Axes) -> None:
    axes.axis("off")
    axes.legend(*source.get_legend_handles_labels(), loc="center", fontsize=11, frameon=False)
