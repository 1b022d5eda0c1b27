"""The impulse on the facades of the structures over time."""

import numpy as np
import pandas as pd

from blast_env.physics.structure import ModularObstacle
from blast_env.recording.tables import faces_hit
from blast_env.rendering.captions import write_heading
from blast_env.rendering.extra import render_extra
from blast_env.rendering.span import shown_until_s
from blast_env.rendering.style import (
    QUIET_INK,
    blast_title,
    count_of,
    number_on_axis,
    short_number,
    unit_interval,
)
from blast_env.simulation import BlastResult
from blast_env.units import MS_PER_S

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

# Okabe and Ito's colours, which people with any colour vision can tell apart.
_FACADES = (
    ("left", "#0072B2", "-"),
    ("right", "#D55E00", "--"),
    ("top", "#009E73", "-."),
    ("bottom", "#CC79A7", (0, (1.2, 1.2))),
)
_MOST_PANELS = 6


def impulse_over_time(result: BlastResult) -> Figure:
    """Return the cumulative impulse on each facade of each structure over time.

    The facade is told by the normal of the collision. At most six structures are shown: the
    protected ones first, then those with the largest impulses.
    """
    structures = [obstacle for obstacle in result.obstacles if obstacle.cells is None]
    structures.sort(key=lambda obstacle: (not obstacle.protected, -obstacle.impulse))
    shown = structures[:_MOST_PANELS]
    columns = min(len(shown), 3 if len(shown) > 4 else 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(max(4.6 * columns, 8.0), 1.2 + 3.6 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    table = result.collisions.assign(facade=faces_hit(result.collisions))
    end_ms = shown_until_s(result) * MS_PER_S
    for axes, obstacle in zip(panels, shown, strict=False):
        hits = table[table["structure"] == obstacle.name]
        _draw_structure(axes, obstacle, hits, end_ms)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    title, subtitle = blast_title(result.blast)
    write_heading(figure, f"{title}: impulse over time", subtitle)
    later = table.loc[table["time_s"] * MS_PER_S > end_ms, "impulse_sim"].sum()
    share = later / max(table["impulse_sim"].sum(), 1e-300)
    figure.supxlabel(
        f"Legend: sums up to the end of the run at {result.time_s * MS_PER_S:.0f} ms"
        + (f"; {share:.1%} of all impulse comes after {end_ms:.0f} ms" if later > 0.0 else ""),
        fontsize=9,
        color=unit_interval(QUIET_INK),
    )
    return figure


def _draw_structure(
    axes: Axes, obstacle: ModularObstacle, hits: pd.DataFrame, end_ms: float
) -> None:
    for facade, colour, style in _FACADES:
        own = hits[hits["facade"] == facade]
        if not len(own):
            continue
        arrived = own["impulse_sim"].cumsum().to_numpy()
        time_ms = own["time_s"].to_numpy() * MS_PER_S
        axes.step(
            np.concatenate(([0.0], time_ms, [max(end_ms, time_ms[-1])])),
            np.concatenate(([0.0], arrived, arrived[-1:])),
            where="post",
            color=colour,
            linestyle=style,
            linewidth=2.0,
            label=f"{facade}: {short_number(float(arrived[-1]))} ({count_of('hit', len(own))})",
        )
    if len(hits):
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2, fontsize=9, frameon=False
        )
    else:
        axes.text(0.5, 0.5, "no hits", transform=axes.transAxes, ha="center", va="center")
    axes.set_xlim(0.0, end_ms or 1.0)
    axes.set_ylim(bottom=0.0)
    role = " (protected)" if obstacle.protected else ""
    axes.set_title(f"{obstacle.name}{role}", fontsize=11)
    axes.set_xlabel("time (ms)")
    axes.xaxis.set_tick_params(labelbottom=True)
    axes.set_ylabel("cumulative impulse (simulation units)")
    axes.yaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
