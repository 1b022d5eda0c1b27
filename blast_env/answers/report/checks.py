"""Checks of a report that a reviewer can repeat by hand, each with all of its numbers."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from blast_env.answers.document import AnyPart, Line, Section, lines
from blast_env.curves import CURVES_SCALED_M, Load, air_share, normally_reflected
from blast_env.evaluation.study import Study
from blast_env.io.export.bill import LayoutPlan, bill_of_quantities
from blast_env.layout import LayoutState
from blast_env.response.components import Glazing
from blast_env.response.facade import FacadeResponse
from blast_env.response.glass import pane_of
from blast_env.response.sdof import impulses
from blast_env.site.structures import buildings_of
from blast_env.units import MS_PER_S, PA_PER_KPA

_INTERVALS: Final = 6


def checks_of(study: Study) -> Section:
    """Return the checks: a stand-off, an impulse, a pane and the cost.

    Impulse and pane need a building with a facade.
    """
    found = [_stand_off(study)]
    if study.unprotected.responses:
        found += _of_facade(study.unprotected.responses[0].on_cells)
    return Section.of(
        "Checks by hand", *found, _check("Cost: number times unit cost", _cost(study))
    )


def _check(title: str, texts: Iterable[str]) -> Iterator[AnyPart]:
    """Yield a check: what against which source, and the numbers in the order of calculation."""
    yield Line.of(title, kind="head")
    yield from lines(texts, "item")


def _stand_off(study: Study) -> Iterator[AnyPart]:
    threat, scenario = study.threats[0], study.scenario
    charge = threat.charge_against(scenario)
    # 1. The nearest protected building with a load, by its outline in plan.
    known = study.buildings(protected=True)
    distances_m = {
        name: min(box.distance_to(charge.position_m) for part in parts for box in part.boxes_m)
        for name, parts in buildings_of(scenario.structures).items()
        if name in known
    }
    if not distances_m:
        return
    building = min(distances_m, key=distances_m.__getitem__)
    away_m = distances_m[building]
    # 2. The scaled distance; 3. the curves there, if they reach so far; 4. beside the load by gas
    # dynamics.
    scale = float(np.cbrt(charge.tnt_kg))
    texts = [
        f"{threat.name}: {charge.tnt_kg:g} kg TNT at ({charge.position_m[0]:g},"
        f" {charge.position_m[1]:g}) m, {away_m:.2f} m from the outline of {building}",
        f"Z = {away_m:.2f} m / ({charge.tnt_kg:g} kg)^(1/3) = {away_m / scale:.2f} m/kg^(1/3)",
    ]
    if CURVES_SCALED_M[0] <= away_m / scale <= CURVES_SCALED_M[1]:
        quantities: tuple[Load, Load] = ("overpressure", "impulse")
        peak_pa, impulse_pa_s = (
            float(normally_reflected(load, np.array(away_m), charge.tnt_kg, charge.height_m))
            for load in quantities
        )
        in_air = float(air_share(charge.height_m, charge.tnt_kg))
        burst = "hemispherical" if in_air < 1.0 else "free air and its mirror image in the ground"
        if 0.0 < in_air < 1.0:
            burst = f"between hemispherical and free air with its mirror image, {in_air:.2f}"
        load = study.blasts.records[study.blasts.unprotected][0].complete.buildings[building]
        texts += [
            f"Kingery and Bulmash, {burst}, normal reflection: {peak_pa / PA_PER_KPA:,.1f} kPa,"
            f" {impulse_pa_s:,.0f} Pa s",
            f"gas, most loaded wall without the layout, mean over the wall:"
            f" {load.wall_impulse_pa_s:,.0f} Pa s; largest peak {load.peak_pa / PA_PER_KPA:,.1f}"
            " kPa",
        ]
    yield from _check("Stand-off and load in the open: UFC 3-340-02, chapter 2", texts)


def _of_facade(facade: FacadeResponse) -> Iterator[Iterator[AnyPart]]:
    yield _check("Impulse of a bay: sum of mean pressure times time", _sum(facade))
    glazing = next((bay.glazing for bay in facade.bays if bay.glazing is not None), None)
    if glazing is not None:
        yield _check("Load resistance of a pane: charts of ASTM E1300", _pane(glazing))


def _sum(facade: FacadeResponse) -> tuple[str, ...]:
    """Return the impulse of the most loaded bay as a sum over intervals until its largest value."""
    net_pa_s = impulses(facade.time_s, facade.pressure_pa)
    index = int(net_pa_s.max(axis=1).argmax())
    own, time_s = net_pa_s[index], facade.time_s
    last = int(own.argmax())
    first = int(np.argmax(own >= 1e-5 * own[last]))  # suction may follow: it is not sorted
    ends_s = np.linspace(time_s[max(first - 1, 0)], time_s[last], _INTERVALS + 1)
    parts_pa_s = np.diff(np.interp(ends_s, time_s, own))
    step_s = float(ends_s[1] - ends_s[0])
    means = " + ".join(f"{part / step_s / PA_PER_KPA:.3f}" for part in parts_pa_s)
    return (
        f"{facade.bays[index].bay.name}, from {MS_PER_S * ends_s[0]:.2f} ms to the largest running"
        f" integral at {MS_PER_S * ends_s[-1]:.2f} ms, {_INTERVALS} intervals of"
        f" {MS_PER_S * step_s:.3f} ms",
        f"({means}) kPa x {MS_PER_S * step_s:.3f} ms = {parts_pa_s.sum():.1f} Pa s",
        f"in the table of bays: {own[last]:.1f} Pa s",
    )


def _pane(glazing: Glazing) -> tuple[str, ...]:
    pane = pane_of(glazing)
    load_kpa = pane.load_resistance_pa() / PA_PER_KPA
    return (
        f"{glazing.title}: {pane.width_m:g} x {pane.height_m:g} m, least thickness"
        f" {glazing.thickness_mm:g} mm, four sides held, 3 s, 8 of 1,000 break",
        f"non-factored load from the chart times the glass type factor {pane.kind.type_factor:g}"
        + (" and the share of the other pane" if pane.outer_thickness_m else "")
        + f"; here {load_kpa:.2f} kPa",
    )


def _cost(study: Study) -> Iterator[str]:
    bill = bill_of_quantities(LayoutPlan(study.scenario, study.layout))
    *items, total = bill.to_dict("records")
    for line in items:
        unit = line["unit_cost"]
        known = "" if unit != unit else f" x {unit:,.10g}"  # NaN without a unit cost
        yield f"{line['item']}: {line['count']}{known} = {line['cost']:,.10g}"
    cost = LayoutState.of(study.scenario, study.layout).cost
    yield f"sum {total['cost']:,.10g}; cost of the layout {cost:,.10g}"
