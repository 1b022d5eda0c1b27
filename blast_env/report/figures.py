"""The pictures of a report, as PNG."""

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from typing import Final

import numpy as np

from blast_env.evaluation import LoadCase, ThreatOutcome
from blast_env.evaluation.consequences import Consequences
from blast_env.geometry import Layout
from blast_env.plots.facade import facade_picture
from blast_env.plots.figures import png_of
from blast_env.plots.gas import KINDS, Kind, facades
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
from blast_env.plots.pressure_film import scale_end_kpa
from blast_env.plots.pressure_frames import PressurePainter, PressureShot
from blast_env.plots.pressure_impulse import pressure_impulse_diagram
from blast_env.plots.site_picture import draw_north, draw_scale
from blast_env.plots.site_plan import (
    draw_plan,
    legend_of,
    rectangle_patch,
    write_legend,
    write_names,
)
from blast_env.plots.style import count_of, render_extra, unit_interval
from blast_env.report.loads import MeasuredBlast, ReportedBuilding, UnitSystem
from blast_env.report.outcomes import FrontPoint, ItemWorth
from blast_env.site import Scenario
from blast_env.site.scene import Charge
from blast_env.site.worst_places import nearest_point_m
from blast_env.units import MODULE_SIDE_M, MS_PER_S

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import TwoSlopeNorm
    from matplotlib.figure import Figure
    from matplotlib.ticker import PercentFormatter
    from PIL import Image

_DOTS_PER_IN: Final = 150
_WIDTH_IN: Final = 6.5  # letters of 10 points stay legible where A4 leaves a figure its height
_HEIGHTS_IN: Final = (2.8, 6.2)
_STILL_PX: Final = 760
_BARE, _WALLED = "#D55E00", "#0072B2"  # Okabe and Ito's
_ZONE: Final = (Kinds.BUILD_ZONE, Kinds.KEEP_OUT, Kinds.COST_AREA, Kinds.GATE, Kinds.ACCESS_WAY)

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


def kinds(units: UnitSystem) -> dict[str, Kind]:
    """Return the kinds of loads for drawing, impulse and peak, in the given units."""
    factors = {
        "impulse": (units.impulse, 1.0 / units.pa_s_per_impulse),
        "peak": (units.pressure, 1.0 / units.pa_per_pressure),
    }
    return {
        name: replace(KINDS[name], unit=unit, factor=factor)
        for name, (unit, factor) in factors.items()
    }


def blast_pictures(
    unprotected: MeasuredBlast, protected: MeasuredBlast, units: UnitSystem
) -> tuple[Picture, ...]:
    """Return the unfolded facades of the protected buildings, and the histories on them."""
    pictures: list[Picture] = []
    for target in protected.targets:
        if not target.protected or target.name not in protected.loads:
            continue
        pictures.append(_history(unprotected, protected, target, units))
        for kind in kinds(units).values():
            figure = facades(protected.result, target.name, kind, unprotected.result)
            pictures.append((f"{target.name}: {kind.name}, walls unfolded", png(figure)))
    return tuple(pictures)


def _history(
    unprotected: MeasuredBlast,
    protected: MeasuredBlast,
    target: ReportedBuilding,
    units: UnitSystem,
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
                pressure / units.pa_per_pressure,
                color=colour,
                linestyle="-" if measured is protected else "--",
                linewidth=1.8,
                label=words,
            )
    axes.axhline(0.0, color=unit_interval(QUIET_INK), linewidth=0.8)
    axes.set(
        xlabel="time since the detonation (ms)", ylabel=f"mean overpressure ({units.pressure})"
    )
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


def film_stills(shots: Sequence[PressureShot], moments_s: Sequence[float]) -> tuple[Picture, ...]:
    """Return stills of two blasts side by side, in plan and in a section."""
    painter = PressurePainter(shots, scale_end_kpa([each.result for each in shots]), _STILL_PX)
    pictures = []
    for moment_s in moments_s:
        buffer = BytesIO()
        Image.fromarray(painter.paint(moment_s)).save(buffer, "PNG", optimize=True)
        pictures.append((f"{MS_PER_S * moment_s:.1f} ms after the detonation", buffer.getvalue()))
    return tuple(pictures)


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


def mass_figure(masses: dict[str, tuple[ThreatOutcome, ...]], units: UnitSystem) -> bytes:
    """Return impulses without and with the layout for other masses, one panel per threat."""
    figure = Figure(figsize=(_WIDTH_IN, 2.6), layout="constrained")
    panels = figure.subplots(1, len(masses), squeeze=False, sharey=True)[0]
    for axes, (name, outcomes) in zip(panels, masses.items(), strict=True):
        _bars(axes, outcomes, units)
        axes.set_title(name, fontsize=10)
    panels[0].set_ylabel(f"impulse, by weight ({units.impulse})")
    panels[-1].legend(fontsize=9, frameon=False)
    return png(figure)


def _bars(axes: Axes, outcomes: Sequence[ThreatOutcome], units: UnitSystem) -> None:
    place = np.arange(len(outcomes))
    for shift, colour, label, values in (
        (-0.2, _BARE, "no barrier", [each.unprotected_load for each in outcomes]),
        (0.2, _WALLED, "layout", [each.load for each in outcomes]),
    ):
        heights = np.array(values) / units.pa_s_per_impulse
        axes.bar(place + shift, heights, 0.38, color=colour, label=label)
    axes.set_xticks(place, [each.threat.name for each in outcomes], fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.25)


def place_figure(
    scenario: Scenario, charges: Sequence[Charge], outcomes: Sequence[ThreatOutcome]
) -> bytes:
    """Return the plan with the reduction for charges at other places, with the layout."""
    figure, axes = _page(_height_in(scenario) + 0.3)
    features = without(_unlabelled(site_features(scenario)), *_ZONE)
    draw_plan(axes, features)
    places = np.array([each.position_m for each in charges])
    shares = 100.0 * np.array([each.reduction for each in outcomes])
    reach = max(float(np.nanmax(np.abs(shares))), 1e-6)
    x_m, y_m = places.T
    dots = axes.scatter(
        x_m,
        y_m,
        c=shares,
        s=70,
        cmap="PuOr",
        norm=TwoSlopeNorm(0.0, -reach, reach),
        edgecolor=unit_interval(INK),
        zorder=6,
    )
    figure.colorbar(dots, ax=axes, shrink=0.8).set_label("reduction (%)")
    write_names(axes, [*features, *(charge_feature(each, "charge") for each in charges)])
    return png(figure)


def front_figure(
    points: Sequence[FrontPoint], own: tuple[float, float], threat_count: int
) -> bytes:
    """Return the diagram of reduction against cost, with the layout of the report."""
    figure, axes = _page(2.8)
    axes.plot(
        [each.cost for each in points],
        [each.reduction for each in points],
        "o-",
        color=_WALLED,
        label="layouts of the search",
    )
    axes.plot(*own, "*", markersize=15, color=_BARE, label="the layout of this report")
    axes.set(xlabel="cost", ylabel=f"reduction, mean of {count_of('threat', threat_count)}")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, frameon=False)
    return png(figure)
