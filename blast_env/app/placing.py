"""What can be placed on a site, and what stands in a layout, for whoever edits or draws one.

The single place of the page that knows what the elements of a layout are; whether one may stand
somewhere is for `Placement` to say.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from blast_env.errors import LayoutError
from blast_env.geometry import Cell, Element, Layout, Measure, Piece, Rectangle
from blast_env.physics.scene import WALLS
from blast_env.response.components import catalogue
from blast_env.scenario import Placement, Scenario
from blast_env.scenario.catalogue import AnyMeasure, Removable
from blast_env.scenario.facade import Components
from blast_env.units import MODULE_SIDE_M

PlainLayout = tuple[tuple[Any, ...], ...]
"""A layout as data: lists of numbers and names."""


class Placeable(NamedTuple):
    """Something of which a layout can be made.

    Attributes:
        name: Its name; empty for the single module.
        label: What people call it.
        can_turn: Whether it can be turned by a right angle.
        left: How many of them are left.
    """

    name: str
    label: str
    can_turn: bool
    left: int


class Measurable(NamedTuple):
    """A measure that hardens facades, which a layout takes or not.

    Attributes:
        name: Its name.
        label: What people call it, with its cost.
        words: What it puts where.
        is_taken: Whether the layout takes it.
    """

    name: str
    label: str
    words: str
    is_taken: bool


def plain(layout: Iterable[Element]) -> PlainLayout:
    """Return a layout as data."""
    return tuple(tuple(each) for each in layout)


def layout_from(scenario: Scenario, data: Sequence[Sequence[Any]]) -> Layout:
    """Return the layout of data, whether or not it may stand.

    Raises:
        LayoutError: If it is none for this site.
    """
    if scenario.build_zone is None:
        if data:
            raise LayoutError(f"{scenario.name} has no build zone, so that nothing can stand on it")
        return ()
    return scenario.build_zone.catalogue.layout_from([tuple(each) for each in data])


def palette(scenario: Scenario, layout: Layout) -> tuple[Placeable, ...]:
    """Return what can be placed; nothing without a build zone."""
    zone = scenario.build_zone
    if zone is None:
        return ()
    placement = Placement.of(scenario, layout)
    if not zone.items:
        height = "" if zone.height_m is None else f", {zone.height_m:g} m high"
        return (Placeable("", f"module of 0.5 m{height}", False, placement.stock_left),)
    return tuple(
        Placeable(
            item.name,
            f"{item.name}, {item.length_modules * MODULE_SIDE_M:g} x"
            f" {item.thickness_modules * MODULE_SIDE_M:g} m, {item.height_m:g} m high,"
            f" cost {item.cost:g}",
            len(item.orientations) > 1,
            left,
        )
        for item, left in zip(zone.items, placement.stocks_left, strict=False)
    )


def measures(scenario: Scenario, layout: Layout) -> tuple[Measurable, ...]:
    """Return what may be taken or not; nothing without a build zone that has some."""
    zone = scenario.build_zone
    known = {**catalogue(), **scenario.components}
    return tuple(
        Measurable(
            each.name,
            f"{each.name}, cost {each.cost:g}",
            _words_of(each, known),
            Measure.named(each.name) in layout,
        )
        for each in (() if zone is None else zone.measures)
    )


def _words_of(measure: AnyMeasure, known: Components) -> str:
    """Return what a measure puts where: `window, 12 mm laminated on office, west, storey 1`."""
    if isinstance(measure, Removable):
        return f"takes away {', '.join(measure.structures)}: needs a blast of its own"
    names = [each for each in (measure.glazing, measure.wall) if each]
    what = " and ".join(known[name].title or name for name in names)
    where = [*(measure.structures or ("all structures",))]
    where += [] if len(measure.walls) == len(WALLS) else measure.walls
    if measure.storeys is not None:
        where.append(f"storeys {', '.join(map(str, measure.storeys))}")
    words = f"{what} on {', '.join(where)}"
    return f"{measure.description}: {words}" if measure.description else words


def element(scenario: Scenario, item: str, cell: Cell, turned: bool = False) -> Element:
    """Return the element that an item is with its lower left cell there.

    An item that there is none of is taken for the first one, one that cannot be turned for not
    turned.
    """
    items = {each.name: each for each in scenario.zone.items}
    if not items:
        return cell
    chosen = items.get(item, scenario.zone.items[0])
    return Piece(*cell, chosen.name, turned and turned in chosen.orientations)


def element_at(scenario: Scenario, layout: Layout, cell: Cell) -> Element | None:
    """Return the element of a layout that covers a cell."""
    if scenario.build_zone is None:
        return None
    catalogue = scenario.build_zone.catalogue
    return next((each for each in layout if cell in catalogue.cells(each)), None)


def cell_at(scenario: Scenario, x_m: float, y_m: float) -> Cell | None:
    """Return the cell of the build zone at a place, perhaps one that does not exist."""
    zone = scenario.build_zone
    if zone is None:
        return None
    left, bottom = zone.corner_m
    return int((y_m - bottom) // MODULE_SIDE_M), int((x_m - left) // MODULE_SIDE_M)


def rectangle_of(scenario: Scenario, new: Element) -> Rectangle:
    """Return what an element covers, also where there is no such cell."""
    return scenario.zone.element_rectangle_m(new)


def moved_to(old: Element, cell: Cell) -> Element:
    """Return an element with its lower left cell somewhere else."""
    return old._replace(row=cell[0], column=cell[1]) if isinstance(old, Piece) else cell


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
        try:
            placement = placement.place(each)
        except LayoutError as error:
            reasons.append(str(error))
    return placement.layout, tuple(reasons)


def counted(scenario: Scenario, layout: Layout) -> str:
    """Return how many elements a layout has, of how many, and what they cost."""
    zone = scenario.build_zone
    if zone is None:
        return "no build zone"
    placement = Placement.of(scenario, layout)
    what = "pieces" if zone.items else "modules"
    words = f"{len(layout)} of {zone.stock} {what}, cost {placement.cost:g}"
    return words if zone.budget is None else f"{words} of {zone.budget:g}"


def cost_of(scenario: Scenario, layout: Layout) -> float:
    """Return what a layout costs."""
    return Placement.of(scenario, layout).cost
