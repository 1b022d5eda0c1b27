"""A layout on its site for other programs: its modules or pieces, and the bill of quantities."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import fsum, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from blast_env.geometry import Element, Layout, Measure, Piece
from blast_env.layout import LayoutState, check_layout
from blast_env.layout.build_site import barrier_outline
from blast_env.particles.structure import ModularPart, obstacle_of
from blast_env.plots.plan import Feature, rounded_m, site_features
from blast_env.provenance import package_version
from blast_env.site import Scenario, find_scenario
from blast_env.site.blast_site import Charge
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

    @property
    def modules(self) -> tuple[ModularPart, ...]:
        """The modules, in the order of the layout, with their names in the tables of a blast."""
        if self.scenario.build_zone is None:
            return ()
        return tuple(obstacle_of(barrier_outline(self.scenario, self.layout)).parts)

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """All features of the site, in metres, the topmost last."""
        return site_features(self.scenario, self.layout, self.charge)


MODULE_COLUMNS: Final = (
    Column("module_id", "", "name of the module, made from its centre in metres"),
    Column("row", "", "row of the build zone, upwards from 0"),
    Column("column", "", "column of the build zone, to the right from 0"),
    Column("corner_x_m", "m", "lower left corner, from the left border"),
    Column("corner_y_m", "m", "lower left corner, from the lower border"),
    Column("centre_x_m", "m", "centre, from the left border"),
    Column("centre_y_m", "m", "centre, from the lower border"),
    Column("side_m", "m", "side of the module"),
)
"""Columns of the modules of a zone without a catalogue."""

PIECE_COLUMNS: Final = (
    Column("piece", "", "name of the piece, made from its item and its centre in metres"),
    Column("item", "", "item of the catalogue"),
    Column("row", "", "row of its lower left cell, upwards from 0"),
    Column("column", "", "column of its lower left cell, to the right from 0"),
    Column("turned", "", "whether its length runs upwards rather than to the right"),
    Column("corner_x_m", "m", "lower left corner, from the left border"),
    Column("corner_y_m", "m", "lower left corner, from the lower border"),
    Column("centre_x_m", "m", "centre, from the left border"),
    Column("centre_y_m", "m", "centre, from the lower border"),
    Column("length_m", "m", "length"),
    Column("thickness_m", "m", "thickness"),
    Column("height_m", "m", "height"),
    Column("cost", "", "cost at that place, in the unit of the budget"),
    Column("stops_vehicles", "", "whether no vehicle gets past it"),
)
"""Columns of the pieces of a zone with a catalogue."""

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


def element_columns(plan: LayoutPlan) -> tuple[Column, ...]:
    """Return the columns of `element_table`: those of pieces, or of modules."""
    zone = plan.scenario.build_zone
    return PIECE_COLUMNS if zone is not None and zone.items else MODULE_COLUMNS


def element_table(plan: LayoutPlan) -> "pd.DataFrame":
    """Return one row per module or piece in the order of the layout; see `element_columns`."""
    columns = element_columns(plan)
    rows = _piece_rows(plan) if columns is PIECE_COLUMNS else _module_rows(plan)
    return table_of(list(rows), columns)


def _module_rows(plan: LayoutPlan) -> Iterator[dict[str, object]]:
    for part in plan.modules:
        corner_x_m, corner_y_m = rounded_m(part.rectangle_m.left, part.rectangle_m.bottom)
        centre_x_m, centre_y_m = rounded_m(*part.centre_m)
        yield {
            "module_id": part.module_id,
            "row": part.row,
            "column": part.column,
            "corner_x_m": corner_x_m,
            "corner_y_m": corner_y_m,
            "centre_x_m": centre_x_m,
            "centre_y_m": centre_y_m,
            "side_m": MODULE_SIDE_M,
        }


def _piece_rows(plan: LayoutPlan) -> Iterator[dict[str, object]]:
    zone = plan.scenario.zone
    items = {item.name: item for item in zone.items}
    for piece, cost in _with_costs(plan):
        if isinstance(piece, Measure):
            continue  # it is in the bill
        if not isinstance(piece, Piece):
            raise AssertionError("a zone with a catalogue has pieces")
        item, rectangle = items[piece.item], zone.element_rectangle_m(piece)
        corner_x_m, corner_y_m = rounded_m(rectangle.left, rectangle.bottom)
        centre_x_m, centre_y_m = rounded_m(*rectangle.centre)
        yield {
            "piece": zone.piece_name(piece),
            **piece._asdict(),
            "corner_x_m": corner_x_m,
            "corner_y_m": corner_y_m,
            "centre_x_m": centre_x_m,
            "centre_y_m": centre_y_m,
            "length_m": item.length_modules * MODULE_SIDE_M,
            "thickness_m": item.thickness_modules * MODULE_SIDE_M,
            "height_m": item.height_m,
            "cost": cost,
            "stops_vehicles": item.stops_vehicles,
        }


def _with_costs(plan: LayoutPlan) -> list[tuple[Element, float]]:
    """Return the elements of a layout, each with its cost at its place."""
    placement = LayoutState.of(plan.scenario, plan.layout)
    number, costs = placement.catalogue.variant_number, placement.costs
    return [(each, float(costs[number(each), each[0], each[1]])) for each in placement.layout]


class _Line(NamedTuple):
    """One line of the bill without its counts and its cost."""

    item: str
    description: str
    in_stock: int
    length_m: float
    thickness_m: float
    height_m: float | None
    unit_cost: float


def bill_of_quantities(plan: LayoutPlan) -> "pd.DataFrame":
    """Return the bill of quantities, one row per item used, and the total; `BILL_COLUMNS`."""
    lines = _lines(plan)
    of_items: dict[str, list[float]] = {line.item: [] for line in lines}
    for element, cost in _with_costs(plan):
        of_items[element.item if isinstance(element, Piece) else MODULE].append(cost)
    rows: list[dict[str, object]] = [
        {
            **line._asdict(),
            "count": len(of_items[line.item]),
            "cost": fsum(of_items[line.item]),
        }
        for line in lines
        if of_items[line.item]
    ]
    everything = [cost for costs in of_items.values() for cost in costs]
    nothing = dict.fromkeys(("length_m", "thickness_m", "height_m", "unit_cost", "in_stock"))
    total = {"item": TOTAL, "description": "", "count": len(everything), "cost": fsum(everything)}
    return as_types(table_of([*rows, {**nothing, **total}], BILL_COLUMNS), {"in_stock": "Int64"})


def _lines(plan: LayoutPlan) -> Sequence[_Line]:
    zone, side_m = plan.scenario.build_zone, MODULE_SIDE_M
    if zone is None:
        return ()
    if not zone.items:
        words = "single module"
        return [_Line(MODULE, words, zone.stock, side_m, side_m, zone.height_m, zone.module_cost)]
    return [
        _Line(
            item.name,
            item.description,
            item.stock,
            item.length_modules * side_m,
            item.thickness_modules * side_m,
            item.height_m,
            item.cost,
        )
        for item in zone.items
    ] + [_Line(each.name, each.description, 1, nan, nan, nan, each.cost) for each in zone.measures]


def write_excel(plan: LayoutPlan, path: Path) -> None:
    """Write a workbook: the bill of quantities, the modules or pieces, and a record of their site.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    zone, columns = plan.scenario.build_zone, element_columns(plan)
    name = "Pieces" if columns is PIECE_COLUMNS else "Modules"
    record: dict[str, str | int | float] = {
        "scenario": plan.scenario.name,
        "scenario hash": plan.scenario.content_hash,
        "blast-env version": package_version(),
        "coordinates": "local site metres, from the lower left corner of the site",
    }
    if zone is not None and zone.budget is not None:
        record["budget"] = zone.budget
    if plan.charge is not None:
        record |= {
            "charge x (m)": plan.charge.position_m[0],
            "charge y (m)": plan.charge.position_m[1],
            "charge height (m)": plan.charge.height_m,
            "charge TNT equivalent (kg)": plan.charge.tnt_kg,
        }
    record |= {f"made by: {key}": str(value) for key, value in plan.provenance.items()}
    # Here, because pandas takes a third of a second to import.
    from blast_env.particles.workbook import SheetTable, write_tables

    tables = (
        SheetTable("Bill", bill_of_quantities(plan), BILL_COLUMNS),
        SheetTable(name, element_table(plan), columns),
    )
    write_tables(record, tables, path, f"Layout for {plan.scenario.name}")
