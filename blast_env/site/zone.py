"""The build zone: its cells, and their availability for modules and pieces."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StrictFloat, StrictInt, model_validator

from blast_env.arrays import BoolArray, FloatArray, any_in_windows, counts_before
from blast_env.geometry import (
    TOLERANCE_M,
    Boxes,
    Cell,
    Element,
    Piece,
    Rectangle,
    Removal,
    box_distances_m,
    overlapping,
    overlapping_any,
)
from blast_env.sections import (
    FOR_PEOPLE,
    Area,
    Count,
    HashMark,
    Height,
    PointM,
    Section,
    Site,
    SparseSection,
)
from blast_env.site.catalogue import (
    MOST_ITEMS,
    AnyMeasure,
    Catalogue,
    Cost,
    Demolition,
    Hardening,
    Item,
    ModulePlace,
    Variant,
)
from blast_env.site.sources import AnySource, PointSource, RectangleSource, VehicleSource
from blast_env.site.structures import AnyStructure, ground_m, lie_wholly_on
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.vehicle import AccessWay

BUDGET_TOLERANCE: Final = 1e-9
"""Share of the budget by which rounding may exceed it."""

MOST_STOCK: Final = 10_000
"""Largest stock of modules, or of pieces of all items."""


class KeepOut(Area):
    """A part of the build zone that must stay empty, with the reason."""


class CostArea(Area, SparseSection):
    """A part of the build zone with another cost, with the reason.

    Attributes:
        module_cost: Cost of a module on a cell that overlaps the area, in a zone without a
            catalogue.
        cost_factor: Factor of the cost of an item on a cell that overlaps the area, in a zone with
            a catalogue.
    """

    sparse: ClassVar = frozenset({"module_cost", "cost_factor"})

    module_cost: Cost | None = None
    cost_factor: Cost | None = None


class BuildZone(Section):
    """The zone for barriers: a grid of cells of one module each.

    Barriers are the items of a catalogue or, without one, single modules.

    Attributes:
        corner_m: Lower left corner of the cell (0, 0).
        rows: Number of rows, counted upwards.
        columns: Number of columns, counted to the right.
        items: The catalogue; without one, single modules are placed.
        hardening: Measures that harden facades, beside the items; of two that change the same
            component of a bay, the later one counts.
        removable: Measures that remove structures, beside the items.
        stock: Number of modules; with a catalogue, the most pieces and measures in all, which is
            their total stock unless given.
        keep_outs: Areas in which no cell may be used.
        module_capacity: Capacity of the barrier's modules, as for structures.
        clearance_m: Least clear distance between a module and a structure.
        module_cost: Cost of a module outside all cost areas, without a catalogue.
        cost_areas: Areas with another cost; the highest one counts.
        budget: Largest total cost of a layout; unlimited unless given.
        currency: Unit of all costs, as `EUR`; see `cost_unit`.
        access_way: A way across the zone that must stay open, if there is one.
        height_m: Height of the modules, without a catalogue; the height of the air unless given.
    """

    corner_m: PointM
    rows: Count
    columns: Count
    items: Annotated[tuple[Item, ...], Field(max_length=MOST_ITEMS), HashMark.IF_SET] = ()
    hardening: Annotated[tuple[Hardening, ...], Field(max_length=MOST_ITEMS), HashMark.IF_SET] = ()
    removable: Annotated[tuple[Demolition, ...], Field(max_length=MOST_ITEMS), HashMark.IF_SET] = ()
    stock: Annotated[StrictInt, Field(ge=1, le=MOST_STOCK)]
    keep_outs: Annotated[tuple[KeepOut, ...], Field(max_length=100)] = ()
    module_capacity: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None
    clearance_m: Annotated[StrictFloat, Field(ge=0.0, le=2000.0), HashMark.IF_SET] = 0.0
    module_cost: Annotated[Cost, HashMark.IF_SET] = 1.0
    cost_areas: Annotated[tuple[CostArea, ...], Field(max_length=100), HashMark.IF_SET] = ()
    budget: Annotated[
        Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None,
        HashMark.IF_SET,
        HashMark.NOT_OF_PLACES,
    ] = None
    currency: Annotated[str, Field(max_length=20), FOR_PEOPLE, HashMark.NEVER] = ""
    access_way: Annotated[AccessWay | None, HashMark.IF_SET] = None
    height_m: Annotated[Height | None, HashMark.IF_SET] = None

    @model_validator(mode="before")
    @classmethod
    def _stock_of_items(cls, given: Any) -> Any:
        """Fill in the stock of a zone with a catalogue: pieces of all items, and measures."""
        if not isinstance(given, Mapping) or "stock" in given:
            return given
        items = given.get("items")
        if not isinstance(items, list | tuple) or not items:
            return given
        pieces = sum(map(_pieces_of, items))
        for measures in (given.get("hardening"), given.get("removable")):
            pieces += len(measures) if isinstance(measures, list | tuple) else 0
        # `check_sections` reports an empty catalogue.
        return {**given, "stock": min(max(pieces, 1), MOST_STOCK)}

    def priced(self, cost: float) -> str:
        """Return a cost with its unit: `12,000 EUR`."""
        return f"{cost:,.10g} {self.cost_unit}"

    @property
    def cost_unit(self) -> str:
        """The unit of costs: the currency, or `cost units` without one."""
        return self.currency or "cost units"

    @cached_property
    def catalogue(self) -> Catalogue:
        """The catalogue of items, or of the single module."""
        if self.items:
            return Catalogue.of_items(self.items, self.measures, self.shape)
        return Catalogue.of_modules(self.stock, self.height_m, self.module_cost, self.shape)

    @property
    def measures(self) -> tuple[AnyMeasure, ...]:
        """The measures: those that harden facades, then those that remove structures."""
        return (*self.hardening, *self.removable)

    def taken_away(self, layout: Iterable[Element]) -> frozenset[str]:
        """Return the names of the structures that a layout removes."""
        taken = {element.item for element in layout if isinstance(element, Removal)}
        own = (removal.structures for removal in self.removable if removal.name in taken)
        return frozenset().union(*own)

    def modules(self, layout: Iterable[Element]) -> tuple[ModulePlace, ...]:
        """Return the modules of a layout, piece by piece.

        Raises:
            LayoutError: If there is no such item, or it cannot be turned.
        """
        catalogue = self.catalogue
        modules = []
        for element in layout:
            variant = catalogue.variant(element)
            name = self.piece_name(element) if isinstance(element, Piece) else ""
            modules += [
                ModulePlace(cell, variant.height_m, name, variant.stops_vehicles)
                for cell in variant.cells_at(element[0], element[1])
            ]
        return tuple(modules)

    def piece_name(self, piece: Piece) -> str:
        """Return the name of a piece in tables: its item and its centre in metres."""
        x_m, y_m = self.element_rectangle_m(piece).centre
        return f"{piece.item}_x{x_m:.3f}_y{y_m:.3f}"

    def element_rectangle_m(self, element: Element) -> Rectangle:
        """Return the rectangle that a module or a piece covers.

        Raises:
            LayoutError: If there is no such item, or it cannot be turned.
        """
        variant = self.catalogue.variant(element)
        return self.cells_rectangle_m(element[0], element[1], variant.rows, variant.columns)

    @property
    def rectangle_m(self) -> Rectangle:
        """The whole zone."""
        size = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns."""
        return self.rows, self.columns

    @property
    def boxes(self) -> Boxes:
        """The squares of all cells, as arrays that broadcast to (rows, columns)."""
        return _boxes(self, np.arange(self.rows), np.arange(self.columns))

    @property
    def centres_m(self) -> tuple[FloatArray, FloatArray]:
        """X and y of the cells' centres, (rows, columns) each."""
        x = self.corner_m[0] + (np.arange(self.columns) + 0.5) * MODULE_SIDE_M
        y = self.corner_m[1] + (np.arange(self.rows) + 0.5) * MODULE_SIDE_M
        grid_x, grid_y = np.meshgrid(x, y)
        return grid_x, grid_y

    @property
    def cost_limit(self) -> float:
        """The budget with an allowance for rounding; infinite without a budget."""
        return inf if self.budget is None else self.budget * (1.0 + BUDGET_TOLERANCE)

    def cells(self) -> Iterator[Cell]:
        """Yield every cell, row by row."""
        return ((row, column) for row in range(self.rows) for column in range(self.columns))

    def cell_rectangle_m(self, cell: Cell) -> Rectangle:
        """Return the square that a cell covers."""
        return self.cells_rectangle_m(*cell, 1, 1)

    def cells_rectangle_m(self, row: int, column: int, rows: int, columns: int) -> Rectangle:
        """Return the rectangle of cells, m, by its lower left cell and its numbers of cells."""
        left_m, bottom_m = self.corner_m
        left_m, bottom_m = left_m + column * MODULE_SIDE_M, bottom_m + row * MODULE_SIDE_M
        right_m, top_m = left_m + columns * MODULE_SIDE_M, bottom_m + rows * MODULE_SIDE_M
        return Rectangle(left_m, bottom_m, right_m, top_m)

    def has(self, cell: Cell) -> bool:
        """Return whether a cell lies in the grid."""
        return 0 <= cell[0] < self.rows and 0 <= cell[1] < self.columns


def _pieces_of(item: Any) -> int:
    """Return the stock of an item of a catalogue, validated or not; 0 if it is no whole number."""
    stock = item.get("stock") if isinstance(item, Mapping) else getattr(item, "stock", 0)
    return stock if isinstance(stock, int) else 0


NO_ZONE: Final = BuildZone.model_construct(corner_m=(0.0, 0.0), rows=0, columns=0, stock=0)
"""The zone without cells, in place of a missing one."""


def source_bounds_m(source: AnySource) -> Rectangle:
    """Return the bounding box of all places of the charge's centre, m.

    For a vehicle, whose places depend on the layout, it is that of its entries.
    """
    if isinstance(source, RectangleSource):
        return source.rectangle_m
    x_m, y_m = zip(*(place for ends in source.lines_m for place in ends), strict=True)
    return Rectangle(min(x_m), min(y_m), max(x_m), max(y_m))


def distances_m(source: AnySource, boxes: Boxes) -> FloatArray:
    """Return the least distance of the charge's centre from each rectangle, m.

    For a vehicle it is the distance of its entries on the border.
    """
    if isinstance(source, PointSource | RectangleSource):
        return box_distances_m(source_bounds_m(source), boxes)
    import shapely  # a tenth of a second

    lines = shapely.MultiLineString(source.lines_m)
    return np.asarray(shapely.distance(lines, shapely.box(*boxes)))


def distance_m(source: AnySource, rectangle: Rectangle) -> float:
    """Return the least distance of the charge's centre from a rectangle, m; see `distances_m`."""
    left, bottom, right, top = map(np.asarray, rectangle)
    return float(distances_m(source, (left, bottom, right, top)))


@dataclass(frozen=True)
class Surroundings:
    """A build zone with all that decides the usable cells before any module is placed.

    Attributes:
        structures: The structures on the site.
        sources: The sources of the charge.
        charge_radius_m: Radius of the charge's disc.
        site: The site, for the entries of vehicles; `None` if it is invalid.
    """

    zone: BuildZone
    structures: tuple[AnyStructure, ...]
    sources: tuple[AnySource, ...]
    charge_radius_m: float
    site: Site | None


@dataclass(frozen=True)
class EmptyZone:
    """The cells of a build zone without modules; all arrays are read-only.

    Attributes:
        usable: Whether each cell may be used, shape (rows, columns).
        passable: Whether each cell is free of structures without a passage, shape (rows, columns).
        ground_m: Height of the ground of each cell, shape (rows, columns).
        levels: Mask of each height of the ground (heights, rows, columns); heights is 0 if it is
            flat.
        module_costs: Cost of a module on each cell, shape (rows, columns); with a catalogue, the
            factor of an item's cost there.
        fits: Whether the cells under each variant may be used, by its lower left cell, shape
            (variants, rows, columns).
        costs: Cost of each variant by its lower left cell (variants, rows, columns); infinite if it
            reaches outside.
    """

    catalogue: Catalogue
    usable: BoolArray
    passable: BoolArray
    ground_m: FloatArray
    levels: BoolArray
    module_costs: NDArray[np.float64]
    fits: BoolArray
    costs: NDArray[np.float64]

    def places(self, free: BoolArray) -> BoolArray:
        """Return whether each variant covers only free cells, all of them on one level.

        Args:
            free: Masks of free cells (..., rows, columns).

        Returns:
            Shape (..., variants, rows, columns).
        """
        # A piece stands on one level: places on each of them, as if the others were taken.
        if len(self.levels):
            flat = replace(self, levels=self.levels[:0])
            anywhere: BoolArray = np.any([flat.places(free & own) for own in self.levels], axis=0)
            return anywhere
        variants = self.catalogue.variants
        if len(variants) == 1 and variants[0].rows == variants[0].columns == 1:
            return free[..., np.newaxis, :, :]  # the usual case
        *many, rows, columns = free.shape
        # A window is free if the counts at its corners cancel (summed-area table, Crow 1984); items
        # of one size have the same windows.
        places = np.zeros((*many, len(variants), rows, columns), dtype=bool)
        taken = counts_before(~free)
        windows: dict[tuple[int, int], BoolArray] = {}
        for number, variant in enumerate(variants):
            place, size = places[..., number, :, :], (variant.rows, variant.columns)
            if variant.is_measure:
                place[..., 0, 0] = True
                continue
            if size not in windows:
                windows[size] = ~any_in_windows(taken, *size)
            place[..., : windows[size].shape[-2], : windows[size].shape[-1]] = windows[size]
        return places


@lru_cache(maxsize=16)
def empty_zone(surroundings: Surroundings) -> EmptyZone:
    """Return the cells of a build zone without modules, cached."""
    zone = surroundings.zone
    # 1. What a cell is good for: building, driving, and on which height it lies.
    boxes, usable = zone.boxes, usable_cells(surroundings)
    passable = np.ones_like(usable)
    for structure in surroundings.structures:
        if not structure.lets_through:
            passable &= ~overlapping_any(structure.boxes_m, boxes)
    ground = ground_m(surroundings.structures, boxes)
    heights_m = np.unique(ground)
    levels = ground == heights_m[len(heights_m) == 1 :, np.newaxis, np.newaxis]
    # 2. What a piece costs by its lower left cell.
    module_costs = module_costs_of(zone)
    catalogue = zone.catalogue
    costs = np.stack([_costs(variant, module_costs, zone) for variant in catalogue.variants])
    # Where pieces fit follows from the zone itself: first without, then with the answer.
    cells = EmptyZone(
        catalogue, usable, passable, ground, levels, module_costs, usable[np.newaxis], costs
    )
    cells = replace(cells, fits=cells.places(usable))
    for array in (usable, passable, ground, levels, module_costs, cells.fits, costs):
        array.flags.writeable = False
    return cells


def usable_cells(surroundings: Surroundings) -> BoolArray:
    """Return whether each cell may be used, shape (rows, columns)."""
    usable = np.ones(surroundings.zone.shape, dtype=bool)
    for _, blocked in _blocked(surroundings, surroundings.zone.boxes):
        usable &= ~blocked
    return usable


def reasons_against(surroundings: Surroundings, cells: BoolArray) -> dict[str, int]:
    """Return the first reason against the use of each cell of a mask, with the number of cells."""
    # Each cell counts for the first reason only: the numbers add up to the cells.
    left, found = cells.copy(), {}
    for reason, blocked in _blocked(surroundings, surroundings.zone.boxes):
        if count := int((left & blocked).sum()):
            found[reason] = count
        left &= ~blocked
    return found


def reason_against(surroundings: Surroundings, cell: Cell) -> str | None:
    """Return the reason why a cell of the grid may not be used, or `None` if it may."""
    boxes = _boxes(surroundings.zone, np.array([cell[0]]), np.array([cell[1]]))
    for reason, blocked in _blocked(surroundings, boxes):
        if blocked.any():
            return reason
    return None


def _boxes(zone: BuildZone, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Boxes:
    """Return the squares of cells, as arrays that broadcast to (rows, columns)."""
    left = np.asarray(zone.corner_m[0] + columns[np.newaxis, :] * MODULE_SIDE_M, dtype=np.float64)
    bottom = np.asarray(zone.corner_m[1] + rows[:, np.newaxis] * MODULE_SIDE_M, dtype=np.float64)
    return left, bottom, left + MODULE_SIDE_M, bottom + MODULE_SIDE_M


def _blocked(surroundings: Surroundings, boxes: Boxes) -> Iterator[tuple[str, BoolArray]]:
    """Yield each reason against the use of cells, with a mask of the cells."""
    zone, radius_m = surroundings.zone, surroundings.charge_radius_m
    for keep_out in zone.keep_outs:
        yield f"must stay empty: {keep_out.reason}", overlapping(keep_out.rectangle_m, boxes)
    for structure in surroundings.structures:
        own = overlapping_any(structure.boxes_m, boxes)
        if structure.carries:
            whole = lie_wholly_on(surroundings.structures, structure.height_m, boxes)
            yield f"lies only partly on the terrace {structure.name!r}", own & ~whole
        else:
            yield f"overlaps the structure {structure.name!r}", own
    if zone.clearance_m > 0.0:
        yield from _too_close(surroundings, boxes)
    if zone.access_way is not None and zone.access_way.gate is not None:
        gate = zone.access_way.gate.rectangle_m
        yield "is where the gate of the access way stands", overlapping(gate, boxes)
    for index, source in enumerate(surroundings.sources):
        if isinstance(source, VehicleSource):
            yield (
                f"is where a vehicle enters (charge[{index}])",
                _on_entries(source, surroundings.site, boxes),
            )
            continue
        yield (
            f"is closer than the charge's radius of {radius_m:g} m to where the charge"
            f" may be (charge[{index}])",
            distances_m(source, boxes) < radius_m - TOLERANCE_M,
        )


def _on_entries(source: VehicleSource, site: Site | None, boxes: Boxes) -> BoolArray:
    """Return whether a vehicle at one of its entries overlaps each square."""
    inside = np.zeros(np.broadcast_shapes(boxes[0].shape, boxes[1].shape), dtype=bool)
    if site is not None:
        for entry in source.entries:
            side = entry.side(site)
            if side is not None:
                inside |= overlapping(entry.strip_m(site, side, source.width_m), boxes)
    return inside


def _too_close(surroundings: Surroundings, boxes: Boxes) -> Iterator[tuple[str, BoolArray]]:
    """Yield for each structure a reason with a mask of the cells within the clearance."""
    clearance_m = surroundings.zone.clearance_m
    ground = ground_m(surroundings.structures, boxes)
    for structure in surroundings.structures:
        distances = np.min([box_distances_m(box_m, boxes) for box_m in structure.boxes_m], axis=0)
        if structure.carries:  # cells on a terrace need no clearance from it
            distances = np.where(ground < (structure.height_m or inf), distances, inf)
        yield (
            f"is closer than {clearance_m:g} m to the structure {structure.name!r}"
            f" ({distances.min():g} m)",
            distances < clearance_m - TOLERANCE_M,
        )


def module_costs_of(zone: BuildZone) -> NDArray[np.float64]:
    """Return the cost of a module on each cell: the highest of the areas that overlap it.

    With a catalogue it is the factor of an item's cost, 1 outside all areas.
    """
    # Where areas overlap, the dearest one counts.
    highest, boxes = np.zeros(zone.shape), zone.boxes
    for area in zone.cost_areas:
        inside = overlapping(area.rectangle_m, boxes)
        cost = area.cost_factor if zone.items else area.module_cost
        highest[inside] = np.maximum(highest[inside], 0.0 if cost is None else cost)
    return np.where(highest > 0.0, highest, 1.0 if zone.items else zone.module_cost)


def _costs(
    variant: Variant, module_costs: NDArray[np.float64], zone: BuildZone
) -> NDArray[np.float64]:
    """Return the cost of a variant by its lower left cell (rows, columns).

    Every module of a piece bears its share of the cost, times the factor of its own cell.
    """
    if not zone.items:
        return module_costs
    # A place from which a piece would leave the zone has no cost; a measure is bought at the first
    # cell.
    costs = np.full(zone.shape, inf)
    if variant.is_measure:
        costs[0, 0] = variant.cost
        return costs
    rows, columns = zone.rows - variant.rows + 1, zone.columns - variant.columns + 1
    if rows > 0 and columns > 0:
        factors = sum(
            module_costs[up : up + rows, right : right + columns]
            for up, right in variant.cells_at(0, 0)
        )
        costs[:rows, :columns] = variant.cost * (factors / (variant.rows * variant.columns))
    return costs
