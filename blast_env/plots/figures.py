"""Figures of one blast by particles, and files of figures."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.files import write_atomically
from blast_env.particles.objects import ModularObstacle
from blast_env.particles.tables import faces_hit
from blast_env.plots.heat_map import heat_map
from blast_env.plots.plan import QUIET_INK
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import (
    blast_title,
    number_on_axis,
    render_extra,
    short_number,
    shown_until_s,
    unit_interval,
)
from blast_env.units import MS_PER_S
from blast_env.values import count_of, path_of

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter


# Okabe and Ito's colours, distinct for any colour vision.
_FACADES = (
    ("west", "#0072B2", "-"),
    ("east", "#D55E00", "--"),
    ("north", "#009E73", "-."),
    ("south", "#CC79A7", (0, (1.2, 1.2))),
)

_MOST_PANELS = 6


def impulse_over_time(result: BlastResult) -> Figure:
    """Return the cumulative impulse on each facade of each structure over time.

    The normal of a collision determines its facade. At most six structures are shown: the
    protected ones first, then those with the largest impulses.
    """
    structures = [obstacle for obstacle in result.obstacles if not obstacle.is_barrier]
    structures.sort(key=lambda obstacle: (not obstacle.protected, -obstacle.impulse))
    shown = structures[:_MOST_PANELS]
    columns = min(len(shown), 3 if len(shown) > 4 else 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(max(4.6 * columns, 8.0), 1.2 + 3.6 * rows), layout="constrained")
    panels = [figure.add_subplot(rows, columns, k + 1) for k in range(len(shown))]
    table = result.collisions.assign(facade=faces_hit(result.collisions))
    end_ms = shown_until_s(result) * MS_PER_S
    unit = result.load_unit
    for axes, obstacle in zip(panels, shown, strict=True):
        hits = table[table["structure"] == obstacle.name]
        _draw_structure(axes, obstacle, hits, end_ms, unit.factor_of(obstacle.name))
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
    axes: Axes,
    obstacle: ModularObstacle,
    hits: pd.DataFrame,
    end_ms: float,
    factor: float | None,
) -> None:
    """Draw the impulse on each facade; `factor` converts it to Pa s, None without a calibration."""
    for facade, colour, style in _FACADES:
        own = hits[hits["facade"] == facade]
        if not len(own):
            continue
        arrived = (factor or 1.0) * own["impulse_sim"].cumsum().to_numpy()
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
    axes.set_ylabel(f"cumulative impulse ({'simulation units' if factor is None else 'Pa s'})")
    axes.yaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


__all__ = [
    "FIGURE_SUFFIXES",
    "Figure",
    "heat_map",
    "impulse_over_time",
    "png_of",
    "save_figure",
]

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""Suffixes of the file formats of figures."""

_DOTS_PER_IN = 150


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Save a figure, in the format of the suffix.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is none of `FIGURE_SUFFIXES` or the file cannot be written;
            no file remains then.
    """
    path = path_of(path)
    suffix = path.suffix.lower()
    if suffix not in FIGURE_SUFFIXES:
        raise BlastEnvError(
            f"{path}: cannot save a figure with the suffix {path.suffix!r}, "
            f"must be one of {', '.join(FIGURE_SUFFIXES)}"
        )
    if suffix == ".png":
        content = png_of(figure, _DOTS_PER_IN)
    else:
        buffer = BytesIO()  # `savefig` would leave a file open after an error
        figure.savefig(buffer, format=suffix[1:], dpi=_DOTS_PER_IN)
        content = buffer.getvalue()
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)
    return path


def png_of(figure: Figure, dots_per_in: float) -> bytes:
    """Return a figure as PNG, faster than `savefig`, which draws all twice to find the layout."""
    before = figure.dpi
    figure.set_dpi(dots_per_in)
    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)  # type: ignore[no-untyped-call]
    figure.set_dpi(before)
    return buffer.getvalue()
