"""The pictures of a report, as PNG."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from blast_env.evaluation import LoadCase
from blast_env.evaluation.engines.gas import BlastMeasurement, GasBlast
from blast_env.evaluation.questions.verdict import BuildingResponse, response_to
from blast_env.gas.engine import Recorders
from blast_env.geometry import Element, Layout
from blast_env.plots.facade import facade_picture
from blast_env.plots.figures import png_of
from blast_env.plots.gas import KINDS, facades
from blast_env.plots.ground_map import ground_recorders, threshold_map
from blast_env.plots.plan import (
    INK,
    QUIET_INK,
    Kinds,
    charge_feature,
    in_order,
    site_features,
    stand_off_feature,
    vehicle_features,
    without,
)
from blast_env.plots.pressure_impulse import pressure_impulse_diagram
from blast_env.plots.site_picture import plan_figure
from blast_env.plots.site_plan import draw_plan, rectangle_patch, trim_height, write_names
from blast_env.plots.style import render_extra, unit_interval
from blast_env.site import Scenario
from blast_env.site.structures import buildings_of
from blast_env.units import MODULE_SIDE_M, MS_PER_S, PA_PER_KPA

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import TwoSlopeNorm
    from matplotlib.figure import Figure

_DOTS_PER_IN: Final = 150
_WIDTH_IN: Final = 6.5  # letters of 10 points stay legible where A4 leaves a figure its height
_BARE, _WALLED = "#D55E00", "#0072B2"  # Okabe and Ito's


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    return png_of(figure, _DOTS_PER_IN)


def _page(height_in: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")
    return figure, figure.subplots()


# The site.


def site_plan(scenario: Scenario, threats: Sequence[LoadCase], layout: Layout) -> bytes:
    """Return the plan of a site with buildings, heights, the layout, and the stand-off of threats.

    Vehicles and their charges stand at the places that the layout leaves them.
    """
    features = [*without(vehicle_features(scenario, layout), Kinds.CHARGE, Kinds.STAND_OFF)]
    for feature in site_features(scenario, layout):
        if feature.kind is not Kinds.CHARGE_PLACE:
            features.append(feature)
        elif len(feature.places_m) > 1:  # the threats have labels of their own
            features.append(replace(feature, label=""))
    for threat in threats:
        charge = threat.charge_against(scenario, layout)
        label = f"{threat.name}: {threat.charge.tnt_kg:g} kg"
        features.append(charge_feature(charge, threat.name, label))
        features.append(stand_off_feature(scenario.loaded_walls, charge.position_m))
    return png(plan_figure(scenario, in_order(features)))


# A threat.


class Drawing(NamedTuple):
    """A picture of a threat.

    Attributes:
        is_facade: Whether it shows the damage of unfolded facades.
    """

    caption: str
    png: bytes
    is_facade: bool = False


class ThreatPictures:
    """Draws a threat: first without the layout, then with it, while both results are in memory.

    Attributes:
        pictures: Once both are there: the damage, the risk, and the loads of both blasts.
    """

    def __init__(self) -> None:
        self._unprotected: BlastMeasurement | None = None
        self.pictures: tuple[Drawing, ...] = ()

    def recorders(self, _: GasBlast) -> Recorders:
        """Return what makes the recorders of the ground."""
        return ground_recorders

    def draw(self, found: BlastMeasurement) -> None:
        """Keep the first blast until the second one, and draw both."""
        if self._unprotected is None:
            self._unprotected = found
            return
        both, self._unprotected = (self._unprotected, found), None
        self.pictures = (*damage_pictures(*both), risk_picture(*both), *blast_pictures(*both))


def blast_pictures(unprotected: BlastMeasurement, protected: BlastMeasurement) -> Iterator[Drawing]:
    """Yield the unfolded facades of the protected buildings, and the histories on them."""
    structures = protected.result.blast.scenario.structures
    for name, parts in buildings_of(structures).items():
        sides = (unprotected, protected)
        known = all(name in side.record.complete.buildings for side in sides)
        if not (known and any(part.protected for part in parts)):
            continue
        yield _history(unprotected, protected, name)
        for quantity, kind in KINDS.items():
            figure = facades(protected.result, name, quantity, unprotected.result)
            yield Drawing(f"{name}: {kind.name}, walls unfolded", png(figure))


def _history(unprotected: BlastMeasurement, protected: BlastMeasurement, building: str) -> Drawing:
    """Return the mean overpressure on the most loaded wall over time, without and with."""
    wall = unprotected.record.complete.buildings[building].wall
    figure, axes = _page(2.6)
    for measured, colour, words in (
        (unprotected, _BARE, "no barrier"),
        (protected, _WALLED, "layout"),
    ):
        pressure = measured.histories.of(building, wall)
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
    return Drawing(f"{building}: overpressure over time, mean over its {wall} wall", png(figure))


def damage_pictures(
    unprotected: BlastMeasurement, protected: BlastMeasurement
) -> Iterator[Drawing]:
    """Yield pictures of the damage to facades, without the layout and with it.

    They are the unfolded facades and the pressure-impulse diagram of each building.
    """
    sides = {"no barrier": _responses(unprotected), "layout": _responses(protected)}
    names = dict.fromkeys(response.building for own in sides.values() for response in own)
    for name in names:
        rows = [(side, x) for side, own in sides.items() for x in own if x.building == name]
        yield Drawing(f"{name}: facades unfolded", png(facade_picture(rows, name)), is_facade=True)
        points = [(side, response.facade) for side, response in rows]
        diagram = pressure_impulse_diagram(points, name)
        yield Drawing(f"{name}: pressure-impulse diagram", png(diagram))


def _responses(found: BlastMeasurement) -> tuple[BuildingResponse, ...]:
    blast = found.result.blast
    charge = found.result.run.site.charge
    return response_to(blast.scenario, tuple(blast.layout), charge, found.record).responses


def risk_picture(unprotected: BlastMeasurement, protected: BlastMeasurement) -> Drawing:
    """Return the map of risk to windows and eardrums.

    The map without the layout stands beside it if the charge is at the same place in both.
    """
    charges = (unprotected.result.run.site.charge, protected.result.run.site.charge)
    beside = unprotected.result if charges[0] == charges[1] else None
    figure = threshold_map(protected.result, beside)
    return Drawing("risk to windows and eardrums, for the choice of assembly points", png(figure))


# The worth of items.


def worth_map(scenario: Scenario, worths: Sequence[tuple[Element, float]]) -> bytes:
    """Return the layout with every module or piece in the colour of its worth."""
    figure, axes = _page(_WIDTH_IN)
    features = without(site_features(scenario), Kinds.CHARGE_PLACE)
    draw_plan(axes, features)
    points = 100.0 * np.array([worth for _, worth in worths])
    reach = max(float(np.abs(points).max()), 1e-6)
    # White is no worth; a piece that does harm has the other colour, on the same scale.
    scale = TwoSlopeNorm(0.0, -reach, reach)
    sides_m = [scenario.zone.element_rectangle_m(element) for element, _ in worths]
    squares = [rectangle_patch(rectangle_m) for rectangle_m in sides_m]
    modules = PatchCollection(squares, cmap="PuOr", norm=scale, edgecolor=unit_interval(INK))
    modules.set_array(points)
    modules.set(linewidth=0.5, zorder=5)
    axes.add_collection(modules)
    sides = np.array(sides_m)
    low, high = sides[:, :2].min(axis=0), sides[:, 2:].max(axis=0)
    # The picture is of the barrier and its surroundings, inside the site.
    reach_m = max(8.0 * MODULE_SIDE_M, 0.6 * float((high - low).max()))
    (left, bottom), (right, top) = low - reach_m, high + reach_m
    axes.set_xlim(max(left, 0.0), min(right, scenario.site.width_m))
    axes.set_ylim(max(bottom, 0.0), min(top, scenario.site.height_m))
    colours = ScalarMappable(scale, modules.get_cmap())
    bar = figure.colorbar(colours, ax=axes, location="bottom", shrink=0.8)
    bar.set_label("contribution: percentage points of reduction lost without the item")
    trim_height(figure, [axes])
    write_names(axes, features)
    return png(figure)
