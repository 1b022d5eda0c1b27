"""What can be placed on a site, and what stands in a layout, for whoever edits or draws one.

The single place that knows what the elements of a layout are; whether one may stand somewhere is
for `Placement` to say.
"""

from collections.abc import Iterator
from typing import NamedTuple

from blast_env.errors import LayoutError
from blast_env.geometry import Cell, Layout, Rectangle
from blast_env.scenario import Placement, Scenario
from blast_env.units import MODULE_SIDE_M

Element = Cell


class Placeable(NamedTuple):
    """Something of which a layout can be made.

    Attributes:
        name: Its name; empty for the single module.
        label: What people call it.
        rows: Rows of cells that it covers.
        columns: Columns of cells that it covers.
        can_turn: Whether it can be turned by a right angle.
        left: How many of them are left.
    """

    name: str
    label: str
    rows: int
    columns: int
    can_turn: bool
    left: int


class Solid(NamedTuple):
    """What an element of a layout looks like.

    Attributes:
        rectangle_m: What it covers.
        height_m: Its height; `None` is as high as the air.
    """

    rectangle_m: Rectangle
    height_m: float | None


def palette(scenario: Scenario, layout: Layout) -> tuple[Placeable, ...]:
    """Return what can be placed; nothing without a build zone."""
    if scenario.build_zone is None:
        return ()
    left = Placement.of(scenario, layout).stock_left
    return (Placeable("", "module, 0.5 x 0.5 m", 1, 1, False, left),)


def element(scenario: Scenario, item: str, cell: Cell, turned: bool = False) -> Element:  # noqa: ARG001
    """Return the element that an item on a cell is."""
    return cell


def element_at(scenario: Scenario, layout: Layout, cell: Cell) -> Element | None:  # noqa: ARG001
    """Return the element of a layout that covers a cell."""
    return cell if cell in layout else None


def cell_at(scenario: Scenario, x_m: float, y_m: float) -> Cell | None:
    """Return the cell of the build zone at a place, perhaps one that does not exist."""
    zone = scenario.build_zone
    if zone is None:
        return None
    left, bottom = zone.corner_m
    return int((y_m - bottom) // MODULE_SIDE_M), int((x_m - left) // MODULE_SIDE_M)


def solids(scenario: Scenario, layout: Layout) -> Iterator[Solid]:
    """Yield what the modules of a layout look like, in the order of its elements."""
    for module in scenario.zone.modules(layout) if layout else ():
        yield Solid(scenario.zone.cell_rectangle_m(module.cell), module.height_m)


def reason_against(scenario: Scenario, layout: Layout, new: Element) -> str | None:
    """Return why something cannot stand beside a layout, or `None` if it can."""
    return Placement.of(scenario, layout).explain(new)


def what_still_stands(scenario: Scenario, layout: Layout) -> tuple[Layout, tuple[str, ...]]:
    """Return what of a layout may stand on a changed site, and why the rest may not.

    Returns:
        The layout, and a sentence for each element that fell away.
    """
    try:
        return Placement.of(scenario, layout).layout, ()
    except LayoutError:
        placement, reasons = Placement.empty(scenario), []
    for each in layout:
        reason = placement.explain(each)
        if reason is None:
            placement = placement.place(each)
        else:
            reasons.append(reason)
    return placement.layout, tuple(reasons)


def counted(scenario: Scenario, layout: Layout) -> str:
    """Return how many elements a layout has, of how many, and what they cost."""
    if scenario.build_zone is None:
        return "no build zone"
    placement, zone = Placement.of(scenario, layout), scenario.build_zone
    words = f"{len(layout)} of {zone.stock} modules, cost {placement.cost:g}"
    return words if zone.budget is None else f"{words} of {zone.budget:g}"


def cost_of(scenario: Scenario, layout: Layout) -> float:
    """Return what a layout costs."""
    return Placement.of(scenario, layout).cost


def rectangle_of(scenario: Scenario, new: Element) -> Rectangle:
    """Return what an element covers, also where there is no such cell."""
    return scenario.zone.cell_rectangle_m(new)


def moved_to(old: Element, cell: Cell) -> Element:  # noqa: ARG001
    """Return an element with its lower left cell somewhere else."""
    return cell
