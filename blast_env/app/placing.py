"""The elements that can be placed on a site, and those of a layout, for editing and drawing.

Only this module of the page handles the elements of a layout; `LayoutState` decides whether one may
stand at a place. A layout may cost more than the budget, which its words say.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from blast_env.errors import LayoutError
from blast_env.geometry import WALLS, Cell, Element, Layout, Measure, Piece, Rectangle
from blast_env.layout import LayoutState
from blast_env.response.components import catalogue
from blast_env.site import Scenario
from blast_env.site.catalogue import AnyMeasure, Demolition
from blast_env.site.facade import Components
from blast_env.units import MODULE_SIDE_M

PlainLayout = tuple[tuple[Any, ...], ...]
"""A layout as data: lists of numbers and names."""


class Placeable(NamedTuple):
    """An item from which a layout can be made.

    Attributes:
        name: Its name; empty for the single module.
        can_turn: Whether it can be turned by a right angle.
        left: Number of them left.
    """

    name: str
    label: str
    can_turn: bool
    left: int


class Measurable(NamedTuple):
    """An optional measure of a layout: it hardens facades or removes structures.

    Attributes:
        label: Its label, with its cost.
        words: Its effect and its place.
        is_taken: Whether the layout takes it.
    """

    name: str
    label: str
    words: str
    is_taken: bool


def plain(layout: Iterable[Element]) -> PlainLayout:
    """Return a layout as data."""
    return tuple(tuple(own) for own in layout)


def layout_from(scenario: Scenario, data: Sequence[Sequence[Any]]) -> Layout:
    """Return the layout of data, whether or not it is legal."""
    if scenario.build_zone is None:
        if data:
            raise LayoutError(f"{scenario.name} has no build zone: no barrier can be placed")
        return ()
    return scenario.build_zone.catalogue.layout_from([tuple(own) for own in data])


def palette(scenario: Scenario, layout: Layout) -> tuple[Placeable, ...]:
    """Return the items that can be placed; none without a build zone."""
    zone = scenario.build_zone
    if zone is None:
        return ()
    placement = LayoutState.of(scenario.without_budget, layout)
    if not zone.items:
        height = "" if zone.height_m is None else f", {zone.height_m:g} m high"
        return (Placeable("", f"module of 0.5 m{height}", False, placement.stock_left),)
    return tuple(
        Placeable(
            item.name,
            f"{item.name}, {item.length_modules * MODULE_SIDE_M:g} x"
            f" {item.thickness_modules * MODULE_SIDE_M:g} m, {item.height_m:g} m high,"
            f" {zone.priced(item.cost)}",
            len(item.orientations) > 1,
            left,
        )
        for item, left in zip(zone.items, placement.stocks_left, strict=False)
    )


def measures(scenario: Scenario, layout: Layout) -> tuple[Measurable, ...]:
    """Return the measures that a layout may take; none without a build zone."""
    zone = scenario.build_zone
    if zone is None:
        return ()
    known = {**catalogue(), **scenario.components}
    return tuple(
        Measurable(
            measure.name,
            f"{measure.name}, {zone.priced(measure.cost)}",
            _words_of(measure, known),
            Measure.named(measure.name) in layout,
        )
        for measure in zone.measures
    )


def _words_of(measure: AnyMeasure, known: Components) -> str:
    """Return a measure in words: `window, 12 mm laminated on office, west, storeys 1`."""
    if isinstance(measure, Demolition):
        return f"removes {', '.join(measure.structures)}: needs a new blast"
    names = [own for own in (measure.glazing, measure.wall) if own]
    what = " and ".join(known[name].title or name for name in names)
    where = [*(measure.structures or ("all structures",))]
    where += [] if len(measure.walls) == len(WALLS) else measure.walls
    if measure.storeys is not None:
        where.append(f"storeys {', '.join(map(str, measure.storeys))}")
    words = f"{what} on {', '.join(where)}"
    return f"{measure.description}: {words}" if measure.description else words


def element(scenario: Scenario, item: str, cell: Cell, turned: bool = False) -> Element:
    """Return the element of an item with its lower left cell at `cell`.

    An unknown item stands for the first of the catalogue; one that cannot be turned is not turned.
    """
    items = {own.name: own for own in scenario.zone.items}
    if not items:
        return cell
    chosen = items.get(item, scenario.zone.items[0])
    return Piece(*cell, chosen.name, turned and turned in chosen.orientations)


def element_at(scenario: Scenario, layout: Layout, cell: Cell) -> Element | None:
    """Return the element of a layout that covers a cell."""
    if scenario.build_zone is None:
        return None
    catalogue = scenario.build_zone.catalogue
    return next((own for own in layout if cell in catalogue.cells(own)), None)


def cell_at(scenario: Scenario, x_m: float, y_m: float) -> Cell | None:
    """Return the cell of the build zone's grid at a place; it may lie outside the zone."""
    zone = scenario.build_zone
    if zone is None:
        return None
    left, bottom = zone.corner_m
    return int((y_m - bottom) // MODULE_SIDE_M), int((x_m - left) // MODULE_SIDE_M)


def rectangle_of(scenario: Scenario, new: Element) -> Rectangle:
    """Return the rectangle that an element covers, m, also outside the zone."""
    return scenario.zone.element_rectangle_m(new)


def moved_to(old: Element, cell: Cell) -> Element:
    """Return an element with its lower left cell at `cell`."""
    return old._replace(row=cell[0], column=cell[1]) if isinstance(old, Piece) else cell


def reason_against(scenario: Scenario, layout: Layout, new: Element) -> str | None:
    """Return the reason why an element cannot stand beside a layout, or `None` if it can."""
    return LayoutState.of(scenario.without_budget, layout).explain(new)


def legal_elements(scenario: Scenario, layout: Layout) -> tuple[Layout, tuple[str, ...]]:
    """Return the part of a layout that is legal on a changed site.

    Returns:
        The layout, and one reason for each element removed.
    """
    try:
        return LayoutState.of(scenario.without_budget, layout).layout, ()
    except LayoutError:
        placement, reasons = LayoutState.empty(scenario.without_budget), []
    for own in layout:
        try:
            placement = placement.place(own)
        except LayoutError as error:
            reasons.append(str(error))
    return placement.layout, tuple(reasons)


def counted(scenario: Scenario, layout: Layout) -> str:
    """Return the number of elements of a layout out of the stock, and their cost, in words."""
    zone = scenario.build_zone
    if zone is None:
        return "no build zone"
    placement = LayoutState.of(scenario.without_budget, layout)
    what = "pieces" if zone.items else "modules"
    words = f"{len(layout)} of {zone.stock} {what}, "
    if zone.budget is None:
        return words + zone.priced(placement.cost)
    words += f"{placement.cost:,.10g} of {zone.priced(zone.budget)}"
    over = placement.cost - zone.budget
    return words + (f": {over:,.10g} over the budget" if over > 0.0 else "")


def cost_of(scenario: Scenario, layout: Layout) -> float:
    """Return the cost of a layout."""
    return LayoutState.of(scenario.without_budget, layout).cost
