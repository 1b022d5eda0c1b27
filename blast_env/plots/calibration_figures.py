"""A calibration as a figure."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.particles.calibration.free_field import CalibrationReport
from blast_env.particles.calibration.model import SimulatedQuantity
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import number_on_axis, render_extra
from blast_env.units import PA_PER_PSI

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, ScalarFormatter

# Okabe and Ito's colours, distinguishable with any colour vision.
_LAWS = {
    "proportional": ("#E69F00", "--", "s"),
    "linear": ("#56B4E9", "-.", "^"),
    "power": ("#009E73", "-", "o"),
}

_SIMULATED_LABELS: Final[Mapping[SimulatedQuantity, str]] = MappingProxyType(
    {
        "impulse": "impulse on the facade, sum of m|v|",
        "transferred_impulse": "impulse really transferred to the facade",
    }
)

_LEAST_TICK_RATIO: Final = 1.18
_SIMULATED, _REFERENCE = "#0072B2", "#000000"


def calibration_figure(report: CalibrationReport, name: str) -> Figure:
    """Return a figure of the simulated impulse, of the laws and the reference, and of residuals.

    Args:
        name: Name of the calibration, for the heading.
    """
    figure = Figure(figsize=(12.0, 8.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 2))
    _draw_simulated(figure.add_subplot(grid[:, 0]), report)
    scaled = figure.add_subplot(grid[0, 1])
    _draw_scaled(scaled, report)
    _draw_residuals(figure.add_subplot(grid[1, 1], sharex=scaled), report)
    section, study = report.reference.section, report.study
    charge = "" if section.charge_kg is None else f", {section.charge_kg:g} kg TNT"
    burst = "" if section.burst is None else f", {section.burst}"
    write_heading(
        figure,
        f"Calibration {name}",
        f"preset {study.scenario.simulation.preset}, engine {study.engine}, "
        f"{len(study.seeds)} seeds a distance; reference: {section.source}, "
        f"{section.quantity.replace('_', ' ')}{burst}{charge}",
    )
    return figure


def _draw_simulated(axes: Axes, report: CalibrationReport) -> None:
    summary = report.summary
    axes.errorbar(
        summary.distance_m,
        summary.i_sim,
        yerr=summary.ci95,
        color=_SIMULATED,
        marker="o",
        capsize=4,
        label="mean over seeds, 95 % interval",
    )
    slope, _ = np.polyfit(np.log(summary.distance_m), np.log(summary.i_sim), 1)
    axes.set_title(f"Simulated impulse: falls as R$^{{{slope:.2f}}}$ on average")
    axes.set_ylabel(f"{_SIMULATED_LABELS[report.simulated]} (simulation units)")
    _set_axes(axes, report)
    axes.legend()


def _draw_scaled(axes: Axes, report: CalibrationReport) -> None:
    distance_m, reference = report.summary.distance_m, report.reference.impulse_psi_s
    axes.plot(distance_m, reference, color=_REFERENCE, marker="D", lw=2.5, label="reference")
    for name, law in report.laws.items():
        colour, line, marker = _LAWS[name]
        scaled = law(report.summary.i_sim.to_numpy())
        shown = np.where(scaled > 0.0, scaled, np.nan)  # the linear law can be negative
        label = f"{name}: MAPE {report.metrics[name].mape_percent:.1f} %"
        axes.plot(distance_m, shown, color=colour, ls=line, marker=marker, label=label)
    axes.set_title("Scaled impulse and reference")
    axes.set_ylabel("impulse (psi·s)")
    _set_axes(axes, report)
    in_pa_s = axes.twinx()
    in_pa_s.set_yscale("log")
    in_pa_s.set_ylim(*(PA_PER_PSI * bound for bound in axes.get_ylim()))
    in_pa_s.set_ylabel("impulse (Pa·s)")
    _set_impulse_axis(in_pa_s)
    axes.legend()


def _draw_residuals(axes: Axes, report: CalibrationReport) -> None:
    table = report.table()
    for name in report.laws:
        colour, line, marker = _LAWS[name]
        axes.plot(
            table.distance_m,
            table[f"{name}_error_percent"],
            color=colour,
            ls=line,
            marker=marker,
        )
    axes.axhline(0.0, color=_REFERENCE, lw=1.0)
    axes.set_title("Residuals of the three laws")
    axes.set_ylabel("deviation from the reference (%)")
    axes.set_xlabel("distance R (m)")
    axes.grid(alpha=0.3)


def _set_axes(axes: Axes, report: CalibrationReport) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(_spread_out(report.summary.distance_m.to_list()))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    _set_impulse_axis(axes)
    axes.set_xlabel("distance R (m)")
    axes.grid(alpha=0.3, which="both")


def _set_impulse_axis(axes: Axes) -> None:
    axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
    for set_formatter in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        set_formatter(FuncFormatter(number_on_axis))


def _spread_out(distances_m: list[float]) -> list[float]:
    """Return the largest distance and those below it whose labels do not touch on a log axis."""
    kept = distances_m[-1:]
    for distance_m in reversed(distances_m[:-1]):
        if distance_m * _LEAST_TICK_RATIO <= kept[-1]:
            kept.append(distance_m)
    return kept[::-1]
