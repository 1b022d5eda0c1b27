"""The pictures of a report, as PNG."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.evaluation import LoadCase
from blast_env.evaluation.consequences import Consequences
from blast_env.geometry import Layout
from blast_env.plots.facade import facade_picture
from blast_env.plots.figures import png_of
from blast_env.plots.gas import KINDS, facades
from blast_env.plots.ground_map import threshold_map
from blast_env.plots.plan import (
    INK,
    QUIET_INK,
    Feature,
    Kinds,
    charge_feature,
    site_features,
    vehicle_features,
    without,
)
from blast_env.plots.pressure_impulse import pressure_impulse_diagram
from blast_env.plots.site_picture import draw_north, draw_scale
from blast_env.plots.site_plan import (
    draw_plan,
    legend_of,
    rectangle_patch,
    write_legend,
    write_names,
)
from blast_env.plots.style import render_extra, unit_interval
from blast_env.report.loads import MeasuredBlast, ReportedBuilding
from blast_env.report.outcomes import ItemWorth
from blast_env.site import Scenario
from blast_env.site.worst_places import nearest_point_m
from blast_env.units import MODULE_SIDE_M, MS_PER_S, PA_PER_KPA

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import TwoSlopeNorm
    from matplotlib.figure import Figure

_DOTS_PER_IN: Final = 150
_WIDTH_IN: Final = 6.5  # letters of 10 points stay legible where A4 leaves a figure its height
_HEIGHTS_IN: Final = (2.8, 6.2)
_BARE, _WALLED = "#D55E00", "#0072B2"  # Okabe and Ito's

Picture = tuple[str, bytes]
"""A caption, and a PNG."""


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    return png_of(figure, _DOTS_PER_IN)


def _page(height_in: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")
    return figure, figure.subplots()


# The site.


def site_plan(scenario: Scenario, threats: Sequence[LoadCase], layout: Layout) -> bytes:
    """Return the plan of a site with buildings, heights, threats and the layout.

    Vehicles and their charges stand at the places that the layout leaves them.
    """
    figure, axes = _page(_height_in(scenario) + 0.9)
    charges = [
        charge_feature(
            threat.charge_against(scenario, layout),
            threat.name,
            f"{threat.name}: {threat.charge.tnt_kg:g} kg",
        )
        for threat in threats
    ]
    vehicles = without(vehicle_features(scenario, layout), Kinds.CHARGE)
    features = (*_unlabelled(site_features(scenario, layout)), *vehicles, *charges)
    draw_plan(axes, features)
    for threat in threats:
        _draw_stand_off(axes, scenario, threat.charge_against(scenario, layout).position_m)
    draw_scale(axes, scenario)
    draw_north(axes, scenario)
    write_legend(figure, legend_of(features))
    write_names(axes, features)
    return png(figure)


def _draw_stand_off(axes: Axes, scenario: Scenario, place_m: tuple[float, float]) -> None:
    """Draw the line from a charge to the nearest protected wall, with its length."""
    wall_m = nearest_point_m(scenario.structures, place_m)
    length_m = float(np.hypot(wall_m[0] - place_m[0], wall_m[1] - place_m[1]))
    ink = unit_interval(INK)
    axes.annotate("", wall_m, place_m, arrowprops={"arrowstyle": "<|-|>", "color": ink}, zorder=7.0)
    middle_m = (0.5 * (wall_m[0] + place_m[0]), 0.5 * (wall_m[1] + place_m[1]))
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    axes.annotate(f"{length_m:.1f} m", middle_m, ha="center", va="center", bbox=box, zorder=8.0)


def _unlabelled(features: Sequence[Feature]) -> list[Feature]:
    """Return the features of a site without point charges and labels of charges.

    The threats are drawn with labels in their place.
    """
    return [
        replace(each, label="") if each.kind is Kinds.CHARGE_PLACE else each
        for each in features
        if each.kind is not Kinds.CHARGE_PLACE or len(each.places_m) > 1
    ]


def _height_in(scenario: Scenario) -> float:
    low, high = _HEIGHTS_IN
    return min(max(_WIDTH_IN * scenario.site.height_m / scenario.site.width_m, low), high)


# A threat.


def blast_pictures(unprotected: MeasuredBlast, protected: MeasuredBlast) -> tuple[Picture, ...]:
    """Return the unfolded facades of the protected buildings, and the histories on them."""
    pictures: list[Picture] = []
    for target in protected.targets:
        if not target.protected or target.name not in protected.loads:
            continue
        pictures.append(_history(unprotected, protected, target))
        for kind in KINDS.values():
            figure = facades(protected.result, target.name, kind, unprotected.result)
            pictures.append((f"{target.name}: {kind.name}, walls unfolded", png(figure)))
    return tuple(pictures)


def _history(
    unprotected: MeasuredBlast,
    protected: MeasuredBlast,
    target: ReportedBuilding,
) -> Picture:
    """Return the mean overpressure on the most loaded wall over time, without and with."""
    wall = unprotected.loads[target.name].wall
    figure, axes = _page(2.6)
    for measured, colour, words in (
        (unprotected, _BARE, "no barrier"),
        (protected, _WALLED, "layout"),
    ):
        pressure = measured.histories.of(target.name, wall)
        if pressure is not None:
            axes.plot(
                MS_PER_S * measured.histories.time_s,
                pressure / PA_PER_KPA,
                color=colour,
                linestyle="-" if measured is protected else "--",
                linewidth=1.8,
                label=words,
            )
    axes.axhline(0.0, color=unit_interval(QUIET_INK), linewidth=0.8)
    axes.set(xlabel="time since the detonation (ms)", ylabel="mean overpressure (kPa)")
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, frameon=False)
    return f"{target.name}: overpressure over time, mean over its {wall} wall", png(figure)


def damage_pictures(unprotected: Consequences, protected: Consequences) -> tuple[Picture, ...]:
    """Return pictures of the damage to facades under one threat, without the layout and with it.

    They are the unfolded facades and the pressure-impulse diagram of each building.
    """
    pictures: list[Picture] = []
    for first, second in zip(unprotected.responses, protected.responses, strict=True):
        name = second.building
        rows = list(zip(("no barrier", "layout"), (first, second), strict=True))
        pictures.append((f"{name}: facades unfolded", png(facade_picture(rows, name))))
        points = [(each, response.facade) for each, response in rows]
        diagram = pressure_impulse_diagram(points, name)
        pictures.append((f"{name}: pressure-impulse diagram", png(diagram)))
    return tuple(pictures)


def risk_picture(unprotected: MeasuredBlast, protected: MeasuredBlast) -> Picture:
    """Return the map of risk to windows and eardrums.

    The map without the layout stands beside it if the charge is at the same place in both.
    """
    charges = (unprotected.result.run.site.charge, protected.result.run.site.charge)
    beside = unprotected.result if charges[0] == charges[1] else None
    figure = threshold_map(protected.result, beside)
    return "risk to windows and eardrums, for the choice of assembly points", png(figure)


# The worth of items.


def worth_map(scenario: Scenario, items: Sequence[ItemWorth]) -> bytes:
    """Return the layout with every module or piece in the colour of its worth."""
    figure, axes = _page(_height_in(scenario) + 0.3)
    features = without(site_features(scenario), Kinds.CHARGE_PLACE)
    draw_plan(axes, features)
    worths = 100.0 * np.array([each.worth for each in items])
    reach = max(float(np.abs(worths).max()), 1e-6)
    scale = TwoSlopeNorm(0.0, -reach, reach)
    squares = [rectangle_patch(each.rectangle_m) for each in items]
    modules = PatchCollection(squares, cmap="PuOr", norm=scale, edgecolor=unit_interval(INK))
    modules.set_array(worths)
    modules.set(linewidth=0.5, zorder=5)
    axes.add_collection(modules)
    sides = np.array([each.rectangle_m for each in items])
    low, high = sides[:, :2].min(axis=0), sides[:, 2:].max(axis=0)
    reach_m = max(8.0 * MODULE_SIDE_M, 0.6 * float((high - low).max()))
    (left, bottom), (right, top) = low - reach_m, high + reach_m
    axes.set_xlim(max(left, 0.0), min(right, scenario.site.width_m))
    axes.set_ylim(max(bottom, 0.0), min(top, scenario.site.height_m))
    bar = figure.colorbar(ScalarMappable(scale, modules.get_cmap()), ax=axes, shrink=0.8)
    bar.set_label("contribution: percentage points of reduction lost without the item")
    write_names(axes, features)
    return png(figure)
