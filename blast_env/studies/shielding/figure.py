"""The plan of a shielding study: the block, and its gauges in the colours of their ratios."""

from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.calibration.references import kingery_bulmash
from blast_env.geometry import Rectangle
from blast_env.rendering.site_plan import add_outline, draw_charge, rectangle_patch, write_heading
from blast_env.rendering.style import (
    INK,
    QUIET_INK,
    STRUCTURE,
    number_on_axis,
    render_extra,
    unit_interval,
)
from blast_env.statistics import Estimate
from blast_env.studies.shielding.ratios import EXPERIMENT, Region, scaled_ratio
from blast_env.studies.shielding.report import ShieldingReport
from blast_env.studies.shielding.scenes import BlockGeometry
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

_GAUGE_DEPTH_M: Final = 1.0  # drawn before the faces, so that no two overlap at a corner

_PATH_OFFSET_M: Final = 1.4

_MARGIN_M: Final = 2.6

_HIGHEST_RATIO: Final = 1.0


def draw_shielding_plan(axes: Axes, report: ShieldingReport) -> None:
    """Draw the block, its gauges, the charge, and the path round the corner.

    The charge is the origin; both gauges of a symmetric pair have the colour of their mean.
    """
    geometry = report.study.geometry
    half_m, near_m = geometry.side_m / 2.0, geometry.stand_off_m
    far_m = near_m + geometry.side_m
    block = Rectangle(near_m, -half_m, far_m, half_m)
    body = rectangle_patch(block)
    body.set(facecolor="white", hatch="///", edgecolor=(*unit_interval(QUIET_INK), 0.35))
    axes.add_patch(body)
    gauges = PatchCollection(
        [rectangle_patch(rectangle) for rectangle in gauge_rectangles(geometry)],
        cmap="viridis",
        norm=Normalize(0.0, _HIGHEST_RATIO),
        edgecolor="white",
        linewidth=0.4,
        zorder=3,
    )
    ratio = report.gauges.ratio.to_numpy()
    gauges.set_array(np.tile(ratio, 2))
    axes.add_collection(gauges)
    add_outline(axes, block, edgecolor=unit_interval(STRUCTURE), linewidth=1.6, zorder=4)
    _draw_path(axes, geometry)
    draw_charge(axes, (0.0, 0.0))
    axes.text(near_m + 0.25, 0.0, "front", rotation=90.0, va="center", color=unit_interval(INK))
    axes.set_xlim(-_MARGIN_M, far_m + _MARGIN_M)
    axes.set_ylim(-half_m - _MARGIN_M, half_m + _MARGIN_M)
    axes.set_aspect("equal")
    axes.set_xlabel("x from the charge (m)")
    axes.set_ylabel("y from the charge (m)")
    axes.set_title("Plan: gauges on the sides and the back", fontsize=11)
    figure = axes.get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(gauges, ax=axes, location="right", shrink=0.9, pad=0.02, extend="max")
    bar.set_label("normal impulse / free field")


def gauge_rectangles(geometry: BlockGeometry) -> list[Rectangle]:
    """Return where the gauges are drawn, m from the charge: all once, then all mirrored in y."""
    half_m, near_m, side = geometry.side_m / 2.0, geometry.stand_off_m, geometry.side_modules
    far_m, depth = near_m + geometry.side_m, _GAUGE_DEPTH_M
    edges = [MODULE_SIDE_M * index for index in range(side)]
    upper = [
        Rectangle(near_m + edge, half_m, near_m + edge + MODULE_SIDE_M, half_m + depth)
        for edge in edges
    ]
    upper += [
        Rectangle(far_m, half_m - edge - MODULE_SIDE_M, far_m + depth, half_m - edge)
        for edge in edges[: len(geometry.back_path_m)]
    ]
    lower = [Rectangle(left, -top, right, -bottom) for left, bottom, right, top in upper]
    return upper + lower


def _draw_path(axes: Axes, geometry: BlockGeometry) -> None:
    """Draw the path whose length counts, a little off the faces, to the middle of the back."""
    half_m, near_m = geometry.side_m / 2.0, geometry.stand_off_m
    far_m, off_m = near_m + geometry.side_m, _PATH_OFFSET_M
    x_m = (0.0, near_m, near_m, far_m + off_m, far_m + off_m)
    y_m = (0.0, half_m, half_m + off_m, half_m + off_m, 0.0)
    axes.plot(x_m, y_m, color=unit_interval(INK), linestyle="--", linewidth=1.1)
    axes.annotate(
        "path to the last gauge: "
        f"{geometry.corner_path_m:.1f} + {geometry.side_m:.1f} + {half_m:.1f} m",
        ((near_m + far_m) / 2.0, half_m + off_m),
        xytext=(0.0, 4.0),
        textcoords="offset points",
        ha="center",
        fontsize=9,
    )


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
