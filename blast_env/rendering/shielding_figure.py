"""A shielding study as a figure: gauges round the block, their ratios, and the free field."""

from typing import Final

import numpy as np

from blast_env.calibration.references import kingery_bulmash
from blast_env.calibration.shielding_ratios import EXPERIMENT, Region, scaled_ratio
from blast_env.calibration.shielding_report import ShieldingReport
from blast_env.calibration.shielding_scenes import FloatArray
from blast_env.evaluation.statistics import Estimate
from blast_env.rendering.captions import write_heading
from blast_env.rendering.extra import render_extra
from blast_env.rendering.shielding_plan import draw_shielding_plan
from blast_env.rendering.style import number_on_axis

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

# Okabe and Ito's colours, which people with any colour vision can tell apart.
_BAND: Final = "#E69F00"
_OPEN: Final = "#000000"
_FACES: Final[tuple[tuple[Region, str, str, str, str], ...]] = (
    ("one_corner", "side", "sides, one corner away", "#0072B2", "o"),
    ("two_corners", "back", "back, two corners away", "#CC79A7", "s"),
)
_LEAST_TOP: Final = 1.1  # of the axis of ratios: the free field itself is to be seen
_HIGHEST_TOP: Final = 1.5
_DECADES: Final = 2.5  # of loads that are shown


def shielding_figure(report: ShieldingReport, exponent: float | None = None) -> Figure:
    """Return the plan with the gauges, their ratios with the experiments', and the loads.

    Args:
        report: What the study found.
        exponent: Exponent B of a calibration's power law: shows the scaled ratios as well.
    """
    study = report.study
    figure = Figure(figsize=(14.0, 8.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.5, 1.0))
    draw_shielding_plan(figure.add_subplot(grid[0, 0]), report)
    _draw_loads(figure.add_subplot(grid[1, 0]), report)
    _draw_ratios(figure.add_subplot(grid[:, 1]), report, exponent)
    one, two = report.one_corner.value, report.two_corners.value
    name = f"preset {study.simulation}" if isinstance(study.simulation, str) else "own parameters"
    seeds = "1 seed" if len(study.seeds) == 1 else f"{len(study.seeds)} seeds"
    write_heading(
        figure,
        f"Shielding by a block: {one:.2f} of the free field one corner away, {two:.2f} two corners",
        f"normal impulse over that on a wall parallel to the flow at the same path length; {name}, "
        f"engine {study.engine}, {seeds}, {study.geometry.tnt_kg:g} kg TNT",
    )
    return figure


def _draw_ratios(axes: Axes, report: ShieldingReport, exponent: float | None) -> None:
    gauges = report.gauges
    for region, face, label, colour, marker in _FACES:
        of_face = gauges[gauges.face == face]
        ends_m = (of_face.path_m.min() - 0.25, of_face.path_m.max() + 0.25)
        errors = np.array([of_face.ratio - of_face.ratio_low, of_face.ratio_high - of_face.ratio])
        axes.errorbar(
            of_face.path_m,
            of_face.ratio,
            yerr=None if np.isnan(errors).any() else errors,
            color=colour,
            marker=marker,
            markersize=4.5,
            linestyle="none",
            elinewidth=0.8,
            zorder=3,
        )
        ratio = report.ratio(region)
        lines = [(ratio, "-", f"{label}: {_text(ratio)}")]
        if exponent is not None:
            scaled = scaled_ratio(ratio, exponent)
            lines.append((scaled, "--", f"scaled, ratio$^{{{exponent:.3g}}}$: {_text(scaled)}"))
        for (value, _, _), style, words in lines:
            axes.hlines(value, *ends_m, color=colour, lw=2.0, ls=style, label=words, zorder=4)
        _draw_band(axes, region, ends_m)
    axes.axhline(1.0, color=_OPEN, lw=0.8, ls=":")
    _set_ratio_axes(axes, gauges.ratio.to_numpy())


def _draw_band(axes: Axes, region: Region, ends_m: tuple[float, float]) -> None:
    band = EXPERIMENT[region]
    label = f"experiments: {band.value:.2f} ± {band.tolerance:.2f}"
    axes.fill_between(
        ends_m, *band.bounds, color=_BAND, alpha=0.3, linewidth=0.0, label=label, zorder=1
    )
    axes.hlines(band.value, *ends_m, color=_BAND, lw=1.2, zorder=2)


def _set_ratio_axes(axes: Axes, ratio: FloatArray) -> None:
    top = min(max(_LEAST_TOP, 1.1 * float(ratio.max())), _HIGHEST_TOP)
    axes.set_ylim(0.0, top)
    above = int((ratio > top).sum())
    if above:
        axes.text(
            0.99,
            0.98,
            f"gauges above the axis: {above}",
            transform=axes.transAxes,
            ha="right",
            va="top",
            fontsize=9,
        )
    axes.set_title("Gauges with 95 % intervals; lines: all gauges of a face", fontsize=11)
    axes.set_xlabel("path length from the charge, round the corners (m)")
    axes.set_ylabel("normal impulse / free field at the same path length")
    axes.grid(alpha=0.3)
    # Column by column: one for the sides, one for the back.
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=9, frameon=False)


def _text(ratio: Estimate) -> str:
    interval = "" if np.isnan(ratio.low) else f" ({ratio.low:.2f} to {ratio.high:.2f})"
    return f"{ratio.value:.2f}{interval}"


def _draw_loads(axes: Axes, report: ShieldingReport) -> None:
    free, gauges = report.free_field, report.gauges
    fitted = free[free.fitted]
    for table, marker in ((fitted, "."), (free[~free.fitted], "x")):
        axes.plot(table.path_m, table.transferred_impulse, marker, color=_OPEN, ms=5, alpha=0.6)
    axes.plot(
        fitted.path_m,
        fitted.transferred_impulse_curve,
        color=_OPEN,
        lw=1.8,
        label=f"free field: on average as path$^{{{report.free_field_slope.value:.2f}}}$",
    )
    _draw_reference(axes, report)
    for _, face, label, colour, marker in _FACES:
        of_face = gauges[gauges.face == face]
        hit = of_face[of_face.transferred_impulse > 0.0]
        axes.plot(hit.path_m, hit.transferred_impulse, marker, color=colour, ms=4.5, label=label)
    axes.set_yscale("log")
    highest = float(free.transferred_impulse.max())
    axes.set_ylim(highest / 10.0**_DECADES, 2.0 * highest)
    axes.yaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(MultipleLocator(2.0))
    axes.set_title("Loads; crosses: ends of the wall, which the curve leaves out", fontsize=11)
    axes.set_xlabel("path length from the charge, round the corners (m)")
    axes.set_ylabel("normal impulse per module\n(simulation units)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8.5, ncols=2, loc="lower right")


def _draw_reference(axes: Axes, report: ShieldingReport) -> None:
    """Draw how Kingery and Bulmash's incident impulse falls, through the middle of the curve."""
    geometry = report.study.geometry
    path_m = np.linspace(geometry.gauge_path_m[0], geometry.gauge_path_m[-1], 60)
    impulse = kingery_bulmash("incident_impulse", path_m, geometry.tnt_kg)
    free = report.free_field
    curve = np.interp(path_m, free.path_m, free.transferred_impulse_curve)
    factor = np.exp(np.log(curve / impulse).mean())
    axes.plot(
        path_m,
        factor * impulse,
        color=_BAND,
        ls="--",
        lw=1.8,
        label=f"shape of Kingery-Bulmash, incident: path$^{{{report.reference_slope:.2f}}}$",
    )
