"""A layout on its site for other programs: its modules or pieces, and the bill of quantities."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import fsum, nan
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from blast_env.geometry import Element, Layout, Piece, Rectangle
from blast_env.layout import LayoutState, check_layout
from blast_env.plots.plan import Feature, rounded_m, site_features
from blast_env.site import Scenario, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Variant
from blast_env.site.structures import module_name
from blast_env.tables import Column, as_types, table_of
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


@dataclass(frozen=True, eq=False)
class LayoutPlan:
    """A layout on its site.

    Attributes:
        scenario: The scenario; its bundled name or path will do.
        layout: (row, column) of each module, or the pieces; their order is kept.
        charge: The charge that the layout was made for; `None` if it is for all possible places of
            the charge, or unknown.
        provenance: The origin of the layout: anything that JSON can hold.

    Raises:
        LayoutError: If the layout is not legal in the scenario.
    """

    scenario: Scenario
    layout: Layout
    charge: Charge | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Find the scenario, and check the layout."""
        object.__setattr__(self, "scenario", find_scenario(self.scenario))
        object.__setattr__(self, "layout", check_layout(self.scenario, self.layout))

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """All features of the site, in metres, the topmost last."""
        return site_features(self.scenario, self.layout, self.charge)


PIECE_COLUMNS: Final = (
    Column("piece", "", "name of the piece, made from its item and its centre in metres"),
    Column("item", "", "item of the catalogue, or `module`"),
    Column("row", "", "row of its lower left cell, upwards from 0"),
    Column("column", "", "column of its lower left cell, to the right from 0"),
    Column("turned", "", "whether its length runs upwards rather than to the right"),
    Column("corner_x_m", "m", "lower left corner, from the left border"),
    Column("corner_y_m", "m", "lower left corner, from the lower border"),
    Column("centre_x_m", "m", "centre, from the left border"),
    Column("centre_y_m", "m", "centre, from the lower border"),
    Column("length_m", "m", "length"),
    Column("thickness_m", "m", "thickness"),
    Column("height_m", "m", "height; nothing where it is as high as the air"),
    Column("cost", "", "cost at that place, in the unit of the budget"),
    Column("stops_vehicles", "", "whether no vehicle gets past it"),
)
"""Columns of the pieces of a layout; single modules are pieces, too."""

BILL_COLUMNS: Final = (
    Column("item", "", "item or measure of the zone, or `module`; `total` is all of them"),
    Column("description", "", "description"),
    Column("count", "", "pieces that the layout takes"),
    Column("in_stock", "", "pieces that there are"),
    Column("length_m", "m", "length"),
    Column("thickness_m", "m", "thickness"),
    Column("height_m", "m", "height; nothing where it is as high as the air"),
    Column("unit_cost", "", "cost of a piece outside all cost areas"),
    Column("cost", "", "cost of these pieces at their places, in the unit of the budget"),
)
"""Columns of the bill of quantities."""

MODULE: Final = "module"
"""Name in the bill of the single module of a zone without a catalogue."""

TOTAL: Final = "total"
"""The last line of the bill."""


def element_table(plan: LayoutPlan) -> "pd.DataFrame":
    """Return one row per module or piece in the order of the layout; see `PIECE_COLUMNS`."""
    return table_of(list(_element_rows(plan)), PIECE_COLUMNS)


class PlacedElement(NamedTuple):
    """A module or piece at its place.

    Attributes:
        element: The element of the layout.
        rectangle_m: Its plan.
        cost: Its cost there.
    """

    name: str
    element: Element
    variant: Variant
    rectangle_m: Rectangle
    cost: float


def placed_elements(plan: LayoutPlan) -> Iterator[PlacedElement]:
    """Yield the modules and pieces of a layout in its order, without measures of hardening."""
    zone = plan.scenario.zone
    for element, cost in _with_costs(plan):
        variant = zone.catalogue.variant(element)
        if not variant.is_measure:
            rectangle_m = zone.element_rectangle_m(element)
            name = module_name(*rectangle_m.centre)
            if isinstance(element, Piece):
                name = zone.piece_name(element)
            yield PlacedElement(name, element, variant, rectangle_m, cost)


def _element_rows(plan: LayoutPlan) -> Iterator[dict[str, object]]:
    for name, element, variant, rectangle, cost in placed_elements(plan):
        corner_x_m, corner_y_m = rounded_m(rectangle.left, rectangle.bottom)
        centre_x_m, centre_y_m = rounded_m(*rectangle.centre)
        sides = (
            (variant.rows, variant.columns) if variant.turned else (variant.columns, variant.rows)
        )
        yield {
            "piece": name,
            "item": variant.name or MODULE,
            "row": element[0],
            "column": element[1],
            "turned": variant.turned,
            "corner_x_m": corner_x_m,
            "corner_y_m": corner_y_m,
            "centre_x_m": centre_x_m,
            "centre_y_m": centre_y_m,
            "length_m": sides[0] * MODULE_SIDE_M,
            "thickness_m": sides[1] * MODULE_SIDE_M,
            "height_m": variant.height_m,
            "cost": cost,
            "stops_vehicles": variant.stops_vehicles,
        }


def _with_costs(plan: LayoutPlan) -> list[tuple[Element, float]]:
    """Return the elements of a layout, each with its cost at its place."""
    placement = LayoutState.of(plan.scenario, plan.layout)
    number, costs = placement.catalogue.variant_number, placement.costs
    return [
        (element, float(costs[number(element), element[0], element[1]]))
        for element in placement.layout
    ]


def bill_of_quantities(plan: LayoutPlan) -> "pd.DataFrame":
    """Return the bill of quantities, one row per item used, and the total; `BILL_COLUMNS`."""
    of_items: dict[str, list[float]] = {}
    for element, cost in _with_costs(plan):
        name = element.item if isinstance(element, Piece) else MODULE
        of_items.setdefault(name, []).append(cost)
    rows = [
        {**line._asdict(), "count": len(costs), "cost": fsum(costs)}
        for line in stock_of(plan.scenario)
        if (costs := of_items.get(line.item))
    ]
    everything = [cost for costs in of_items.values() for cost in costs]
    nothing = dict.fromkeys(("length_m", "thickness_m", "height_m", "unit_cost", "in_stock"))
    total = {"item": TOTAL, "description": "", "count": len(everything), "cost": fsum(everything)}
    return as_types(table_of([*rows, {**nothing, **total}], BILL_COLUMNS), {"in_stock": "Int64"})


class StockLine(NamedTuple):
    """One line of the bill without its counts and its cost; measures have no size."""

    item: str
    description: str
    in_stock: int
    length_m: float
    thickness_m: float
    height_m: float | None
    unit_cost: float


def stock_of(scenario: Scenario) -> tuple[StockLine, ...]:
    """Return a line for each item and measure of the build zone, or for its single module."""
    zone, side_m = scenario.build_zone, MODULE_SIDE_M
    if zone is None:
        return ()
    if not zone.items:
        sizes_m = side_m, side_m, zone.height_m
        return (StockLine(MODULE, "single module", zone.stock, *sizes_m, zone.module_cost),)
    items = (
        StockLine(
            item.name,
            item.description,
            item.stock,
            item.length_modules * side_m,
            item.thickness_modules * side_m,
            item.height_m,
            item.cost,
        )
        for item in zone.items
    )
    measures = (
        StockLine(measure.name, measure.description, 1, nan, nan, nan, measure.cost)
        for measure in zone.measures
    )
    return (*items, *measures)
