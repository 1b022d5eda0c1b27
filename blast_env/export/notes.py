"""What a drawing has to say beside its lines: conditions of the site, and how far they reach."""

from math import pi, tan
from typing import Final

from blast_env.export.plan import LayoutPlan
from blast_env.geometry import Rectangle
from blast_env.scenario import BuildZone, Placement
from blast_env.units import MODULE_SIDE_M

_DIGITS: Final = 9  # of a metre: what is beyond is rounding

BULGE_OF_A_QUARTER: Final = tan(pi / 8.0)
"""Bulge of an arc over a right angle: the tangent of a quarter of it, counterclockwise."""

CornerM = tuple[float, float, float]
"""x, y, and the bulge of the way to the next corner: 0 is straight."""


def note_lines(plan: LayoutPlan) -> tuple[str, ...]:
    """Return the notes of a drawing, a line a subject; none has a sign that drawings read."""
    lines = [
        f"Scenario: {plan.scenario.name}",
        "Units: metres, from the lower left corner of the site",
        f"Charge: {_charge(plan)}",
    ]
    zone = plan.scenario.build_zone
    if zone is None:
        return tuple(lines)
    side = f"{MODULE_SIDE_M:g}"
    lines.append(
        f"Modules: {len(plan.layout)} of a stock of {zone.stock}, {side} m x {side} m each"
    )
    lines += _conditions(zone)
    if zone.budget is not None:
        cost = Placement.of(plan.scenario, plan.layout).cost
        lines.append(f"Budget: {_number(zone.budget)}, of which the modules take {_number(cost)}")
    return tuple(lines)


def _conditions(zone: BuildZone) -> tuple[str, str]:
    """Return how near modules may come to structures, and what must stay open."""
    clearance, way = "none required", "none required"
    if zone.clearance_m > 0.0:
        clearance = f"{_number(zone.clearance_m)} m at least between modules and structures"
    if zone.access_way is not None:
        sides = zone.access_way.between.replace("_", " to ")
        width = _number(zone.access_way.width_m)
        way = f"{width} m wide, from {sides} of the build zone, to be kept open"
    return f"Clearance: {clearance}", f"Access way: {way}"


def _charge(plan: LayoutPlan) -> str:
    """Return the mass of the charge, and where it is or may be."""
    if plan.charge is not None:
        (x_m, y_m), tnt_kg = plan.charge
        return f"{_number(tnt_kg)} kg TNT at ({x_m:.2f}, {y_m:.2f})"
    masses_kg = sorted({source.tnt_kg for source in plan.scenario.charge})
    return f"{' or '.join(map(_number, masses_kg))} kg TNT, anywhere on the layer CHARGE_PLACE"


def _number(value: float) -> str:
    return f"{value:.10g}"


def clearance_outlines(plan: LayoutPlan) -> tuple[tuple[CornerM, ...], ...]:
    """Return how near modules may come to each structure; nothing if they may touch it.

    The clearance is the least distance of any two points of module and structure. So the outline
    is a rectangle whose corners are rounded by the clearance: four sides and four arcs,
    counterclockwise from the left end of the lower side.
    """
    zone = plan.scenario.build_zone
    if zone is None or zone.clearance_m == 0.0:
        return ()
    return tuple(
        _rounded_outline(structure.rectangle_m, zone.clearance_m)
        for structure in plan.scenario.structures
    )


def _rounded_outline(rectangle: Rectangle, radius: float) -> tuple[CornerM, ...]:
    """Return the line at a distance around a rectangle."""
    left, bottom, right, top = rectangle
    far_left, far_bottom, far_right, far_top = rectangle.grown(radius)
    ends = (
        ((left, far_bottom), (right, far_bottom)),
        ((far_right, bottom), (far_right, top)),
        ((right, far_top), (left, far_top)),
        ((far_left, top), (far_left, bottom)),
    )
    return tuple(
        (round(x, _DIGITS), round(y, _DIGITS), bulge)
        for side in ends
        for (x, y), bulge in zip(side, (0.0, BULGE_OF_A_QUARTER), strict=True)
    )
