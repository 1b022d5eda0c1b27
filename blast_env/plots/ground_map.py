"""Maps of the ground: peak overpressure and impulse of a blast of the gas engine."""

from collections.abc import Mapping, Sequence
from math import cbrt, ceil, inf, isfinite, sqrt
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.curves import Burst, burst_of, kingery_bulmash
from blast_env.curves import Quantity as CurveQuantity
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasResult
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import GroundMap
from blast_env.gas.spherical_stage import SphericalStage, spherical_stage
from blast_env.plots.gas import both_results, gas_heading, kind_of, loads_and_solids
from blast_env.plots.plan import (
    BORDER,
    INK,
    Feature,
    Kinds,
    blast_features,
    without,
    without_counts,
)
from blast_env.plots.site_plan import (
    add_bar,
    draw_features,
    draw_plan,
    legend_of,
    rectangle_patch,
    trim_height,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import barrier_text, render_extra, short_number, unit_interval
from blast_env.response.buildings import GroundThreshold, ground_thresholds
from blast_env.site.blast_site import Charge
from blast_env.units import PA_PER_KPA

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.contour import QuadContourSet
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Patch
    from matplotlib.ticker import FixedLocator, NullLocator

_LEVELS: Final = {"few": (1.0, 2.0, 5.0), "many": (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)}
_FEW_LEVELS: Final = 7
_NUMBER_CLEAR: Final = 0.025  # of the site's width
_MOST_OF_THE_GROUND: Final = 0.93
_MAP_WIDTHS_IN: Final = (6.0, 7.4)
_RISKS: Final = ("#fdeec2", "#f9c46b", "#d9682b", "#7a1f2b")  # from low to high risk
_FINER: Final = "spherical stage, finer than the grid"
_FINER_STYLE: Final[Mapping[str, Any]] = MappingProxyType(
    {"color": unit_interval(INK), "linewidth": 1.4, "linestyle": (0, (1.0, 2.0))}
)
_OPEN_STYLE: Final[Mapping[str, Any]] = MappingProxyType(
    {"color": "0.15", "linewidth": 1.2, "linestyle": (0, (4.0, 2.0))}
)
_HEIGHT_IN: Final = 8.7  # at most


def ground_recorders(grid: GasGrid) -> tuple[GroundMap, ...]:
    """Return the recorders that `ground_map` needs, for `GasBlast.run(recorders=...)`."""
    return (GroundMap(grid),)


def ground_values(result: GasResult, quantity: str) -> FloatArray:
    """Return a quantity in the lowest cells of the whole grid (nx, ny), NaN in solids.

    Near a charge on the ground it includes the spherical stage before the grid took over.

    Args:
        result: A blast that was run with `ground_recorders`.
        quantity: `"impulse"`, in Pa s, or `"peak"`, in Pa.

    Raises:
        BlastEnvError: If it was run without the recorders.
        UnknownNameError: If there is no such quantity.
    """
    kind_of(quantity)
    maps = [recorder for recorder in result.run.solver.recorders if isinstance(recorder, GroundMap)]
    if not maps:
        raise BlastEnvError("the blast has no map: run it with recorders=ground_recorders")
    opening = spherical_stage(result.run.charge, result.run.remap_radius_m)
    distance_m = _distances_m(result.run.grid, opening)
    if quantity == "peak":
        return np.maximum(maps[0].peak_pa, opening.peak_pa(distance_m))
    net_pa_s, largest_pa_s = opening.impulses_pa_s(distance_m)
    return np.maximum(largest_pa_s, net_pa_s + maps[0].impulse_pa_s)


def _distances_m(grid: GasGrid, opening: SphericalStage) -> FloatArray:
    """Return the distances of the lowest cells from the centre of a blast (nx, ny)."""
    x_m, y_m, z_m = opening.centre_m
    across = grid.centres_m(0)[:, np.newaxis] - x_m
    along = grid.centres_m(1)[np.newaxis, :] - y_m
    return np.asarray(np.sqrt(across**2 + along**2 + (grid.centres_m(2)[0] - z_m) ** 2))


def map_levels(result: GasResult, quantity: str) -> tuple[float, ...]:
    """Return the contour levels of `ground_map`, in Pa s or kPa, for use in further maps."""
    values = kind_of(quantity).factor * ground_values(result, quantity)
    return tuple(_contour_levels([_on_site(result, values)[2]]))


def ground_map(
    result: GasResult,
    quantity: str = "peak",
    beside: GasResult | None = None,
    levels: Sequence[float] | None = None,
) -> Figure:
    """Return a map of the load over the ground, with contours and the features of the site.

    Args:
        result: A blast that was run with `ground_recorders`.
        quantity: `"peak"`, overpressure in kPa, or `"impulse"`, peak specific impulse in Pa s.
        beside: Another result with the same site and charge, drawn to the left on the same scale:
            without the barrier, or with another layout.
        levels: Contour levels, which also set the scale, for comparisons of maps; see
            `map_levels`. By default they follow from the values drawn.
    """
    kind, results = kind_of(quantity), both_results(result, beside)
    values = [kind.factor * ground_values(result, quantity) for result in results]
    if levels is None:
        levels = _contour_levels(
            [_on_site(result, value)[2] for result, value in zip(results, values, strict=True)]
        )
    scale = LogNorm(levels[0], levels[-1])
    figure, plans = _plans(results)
    for axes, item, value in zip(plans, results, values, strict=True):
        _draw_ground(axes, item, value, levels, scale)
    colours = ScalarMappable(scale, loads_and_solids())
    bar = add_bar(figure, plans, colours, kind.label, extend="both", shrink=0.85, pad=0.02)
    bar.ax.yaxis.set_major_locator(FixedLocator(levels))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    features = [feature for result in results for feature in _features(result)]
    handles = legend_of(without_counts(features) if len(results) > 1 else features)
    if result.run.charge.on_ground:
        handles.append(Line2D([], [], **_FINER_STYLE, label=_FINER))
    height_m = result.run.grid.centres_m(2)[0]
    note = f"{height_m:g} m above the ground"
    _write(figure, results, handles, f"{kind.name} over the ground", note)
    return figure


def threshold_map(result: GasResult, beside: GasResult | None = None) -> Figure:
    """Return a map of the areas with a risk to windows and eardrums.

    Regions follow the peak overpressure on the ground as the cells resolve it. Dashed circles show
    the reach of each threshold over open ground by the curves of Kingery and Bulmash, which do not
    depend on cells.

    Args:
        result: A blast that was run with `ground_recorders`.
        beside: Another result with the same site and charge, drawn to the left.

    Raises:
        BlastEnvError: If a blast was run without the recorders, or site or charge differ.
    """
    results, thresholds = both_results(result, beside), ground_thresholds()
    figure, plans = _plans(results)
    levels = [threshold.peak_pa for threshold in thresholds]
    for axes, item in zip(plans, results, strict=True):
        x_m, y_m, inside = _on_site(item, ground_values(item, "peak"))
        shown = axes.contourf(
            x_m, y_m, inside.T, levels=[*levels, np.inf], colors=_RISKS, extend="neither", zorder=1
        )
        shown.set_clip_path(axes.patches[0])
        charge = item.run.site.charge
        for threshold in thresholds:
            # Beside what the cells give, which clip peaks, the distance on open ground by the
            # curves.
            distance_m = open_distance_m(threshold.peak_pa, charge)
            if isfinite(distance_m):
                _add_circle(axes, charge, distance_m, **_OPEN_STYLE)
        _draw_standing(axes, item)
    handles: list[Artist] = [
        Patch(
            facecolor=colour, edgecolor="0.4", label=_risk_words(threshold, result.run.site.charge)
        )
        for threshold, colour in zip(thresholds, _RISKS, strict=True)
    ]
    handles.append(Line2D([], [], **_OPEN_STYLE, label="the same in the open, curve"))
    handles += legend_of(without_counts(_features(result)))
    title, note = (
        "where windows and eardrums are at risk",
        "cells clip peaks: dashed is the safe side",
    )
    _write(figure, results, handles, title, note)
    return figure


def _plans(results: Sequence[GasResult]) -> tuple[Figure, Sequence[Axes]]:
    """Return a figure with the empty ground of each site."""
    count = len(results)
    width_in = count * _MAP_WIDTHS_IN[0 if count > 1 else 1] + 1.6
    figure = Figure(figsize=(width_in, _HEIGHT_IN), layout="constrained")
    plans = figure.subplots(1, len(results), squeeze=False, sharex=True, sharey=True)[0]
    for axes, result in zip(plans, results, strict=True):
        draw_plan(axes, [feature for feature in _features(result) if feature.kind is Kinds.SITE])
        if len(results) > 1:
            axes.set_title(barrier_text(result.blast.layout), fontsize=11)
    for axes in plans[1:]:
        axes.set_ylabel("")
        axes.tick_params(left=False, labelleft=False)
    return figure, list(plans)


def _draw_standing(axes: Axes, result: GasResult) -> None:
    """Draw the features of a site over its ground, and its border."""
    draw_features(axes, without(_features(result), Kinds.SITE))
    border = rectangle_patch(result.run.site.site_m)
    border.set(fill=False, edgecolor=unit_interval(BORDER), linewidth=1.8)
    axes.add_patch(border)


def _add_circle(axes: Axes, charge: Charge, radius_m: float, **style: Any) -> None:
    circle = Circle(charge.position_m, radius_m, fill=False, zorder=2, **style)
    axes.add_patch(circle)
    circle.set_clip_path(axes.patches[0])


def _write(
    figure: Figure, results: Sequence[GasResult], handles: Sequence[Artist], what: str, note: str
) -> None:
    write_legend(figure, handles)
    title, subtitle = gas_heading(results, what)
    write_heading(figure, title, f"{subtitle}; {note}")
    plans = figure.axes[: len(results)]
    trim_height(figure, plans)
    for axes, result in zip(plans, results, strict=True):
        write_names(axes, _features(result))


def open_distance_m(peak_pa: float, charge: Charge) -> float:
    """Return the reach of a peak over open ground by the curves of Kingery and Bulmash, m.

    It is that of the side-on peak of a surface burst. For a charge too high for that (`burst_of`),
    the reflection on the ground also counts: the wave of a burst in free air at normal incidence,
    an upper bound. The larger reach is returned.

    It is infinite beyond the end of the curves, at some 40 m/kg^(1/3).
    """
    distance_m = _reach_m(peak_pa, "incident_overpressure", charge.tnt_kg, "hemispherical")
    if burst_of(charge.height_m, charge.tnt_kg) == "hemispherical":
        return distance_m
    slant_m = _reach_m(peak_pa, "reflected_overpressure", charge.tnt_kg, "spherical")
    return max(distance_m, sqrt(max(slant_m**2 - charge.height_m**2, 0.0)))


def _reach_m(peak_pa: float, quantity: CurveQuantity, tnt_kg: float, burst: Burst) -> float:
    scaled = np.geomspace(0.21, 39.5, 400)
    peaks = kingery_bulmash(quantity, scaled, 1.0, burst)
    if peak_pa < peaks[-1]:
        return inf
    found = np.interp(-np.log(peak_pa), -np.log(np.asarray(peaks)), np.log(scaled))
    return float(np.exp(found) * cbrt(tnt_kg))


def _risk_words(threshold: GroundThreshold, charge: Charge) -> str:
    distance_m = open_distance_m(threshold.peak_pa, charge)
    reach = (
        f"{ceil(distance_m)} m in the open" if isfinite(distance_m) else "farther than the curves"
    )
    return f"{threshold.words}: from {threshold.peak_pa / PA_PER_KPA:.3g} kPa, {reach}"


def _features(result: GasResult) -> tuple[Feature, ...]:
    blast = result.blast
    return blast_features(blast.scenario, blast.layout, blast.site.charge)


def _on_site(result: GasResult, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x and y of the cells on the site, and the values there (nx,), (ny,), (nx, ny)."""
    grid, site = result.run.grid, result.run.site.site_m
    x_m, y_m = grid.centres_m(0), grid.centres_m(1)
    across = (x_m > site.left) & (x_m < site.right)
    along = (y_m > site.bottom) & (y_m < site.top)
    return x_m[across], y_m[along], values[np.ix_(across, along)]


def _contour_levels(parts: Sequence[FloatArray]) -> list[float]:
    """Return levels of few digits for most of the ground; loads near the charge exceed them."""
    values = np.concatenate([part[np.isfinite(part)] for part in parts])
    high = float(np.quantile(values, _MOST_OF_THE_GROUND))
    low = max(float(values.min()), 1e-3 * high)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    for steps in ("few", "many"):
        levels = [step * 10.0**power for power in powers for step in _LEVELS[steps]]
        first = max((k for k, level in enumerate(levels) if level <= low), default=0)
        last = min((k for k, level in enumerate(levels) if level >= high), default=len(levels))
        shown = [float(f"{level:.3g}") for level in levels[first : last + 1]]
        if len(shown) >= _FEW_LEVELS:
            break
    return shown


def _draw_ground(
    axes: Axes, result: GasResult, values: FloatArray, levels: Sequence[float], scale: Normalize
) -> None:
    x_m, y_m, inside = _on_site(result, values)
    half = result.run.grid.cell_m / 2.0
    image = axes.imshow(
        inside.T,
        norm=scale,
        cmap=loads_and_solids(),
        origin="lower",
        interpolation="nearest",
        extent=(x_m[0] - half, x_m[-1] + half, y_m[0] - half, y_m[-1] + half),
        zorder=1,
    )
    image.set_clip_path(axes.patches[0])
    lines = axes.contour(
        x_m, y_m, inside.T, levels=levels, colors=[unit_interval(INK)], linewidths=0.7
    )
    _write_levels(axes, lines, result)
    _draw_standing(axes, result)
    if result.run.charge.on_ground:
        # The radius of the front when the grid took over: inside, peaks are sharper.
        _add_circle(axes, result.run.site.charge, result.run.remap_radius_m, **_FINER_STYLE)


def _write_levels(axes: Axes, lines: QuadContourSet, result: GasResult) -> None:
    """Write the numbers of contours, except near the border, solids and the charge."""
    grid, site = result.run.grid, result.run.site.site_m
    clear_m = _NUMBER_CLEAR * (site.right - site.left)
    solid = np.argwhere(grid.solid[:, :, 0])
    solid_m = np.array(grid.origin_m)[:2] + grid.cell_m * (solid + 0.5)
    charge_m = np.array([result.run.site.charge.position_m])
    standing_m = np.concatenate((solid_m, charge_m))
    numbers = axes.clabel(lines, fmt=lambda value: short_number(value, 3), fontsize=8, inline=False)
    for text in list(numbers):
        x_m, y_m = text.get_position()
        to_border_m = min(x_m - site.left, site.right - x_m, y_m - site.bottom, site.top - y_m)
        to_solid_m = float(np.hypot(*(standing_m - (x_m, y_m)).T).min())
        if min(to_border_m, to_solid_m) < clear_m:
            text.remove()
            continue
        text.set_path_effects([patheffects.withStroke(linewidth=3.0, foreground="white")])
