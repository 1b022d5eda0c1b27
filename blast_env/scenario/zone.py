"""The build zone: its cells, which of them may take a module, and the access way."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, StrictFloat, StrictInt
from scipy.ndimage import label

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Cell, Rectangle
from blast_env.scenario.sections import (
    AnySource,
    AnyStructure,
    Count,
    Height,
    PointM,
    PointSource,
    RectangleSource,
    Section,
    SizeM,
)
from blast_env.units import MODULE_SIDE_M

BUDGET_TOLERANCE: Final = 1e-9
"""Share of the budget by which rounding may exceed it."""


Cost = Annotated[StrictFloat, Field(gt=0.0, le=1e9)]


Reason = Annotated[str, Field(min_length=1, max_length=200)]


class Area(Section):
    """A rectangle of the build zone for which something else holds, and why."""

    corner_m: PointM
    size_m: SizeM
    reason: Reason

    @property
    def rectangle_m(self) -> Rectangle:
        """The area."""
        return Rectangle.from_corner(self.corner_m, self.size_m)


class KeepOut(Area):
    """A part of the build zone that must stay empty, and why."""


class CostArea(Area):
    """A part of the build zone in which a module has another cost, and why.

    Attributes:
        module_cost: Cost of a module on a cell that overlaps the area.
    """

    module_cost: Cost


def _check_whole_modules(width_m: float) -> float:
    """Refuse a width that is not a whole number of cells."""
    if abs(width_m - round(width_m / MODULE_SIDE_M) * MODULE_SIDE_M) > 1e-9:
        raise ValueError(f"must be a multiple of {MODULE_SIDE_M:g}, the side of a module")
    return width_m


class AccessWay(Section):
    """A way across the build zone that a vehicle must always be able to take.

    The vehicle is a square of whole cells. It moves along rows and columns, stays inside the
    zone, and covers neither a module nor a structure; keep-outs are open to it.

    Attributes:
        width_m: Side of the vehicle's square; whole modules.
        between: The two sides of the zone that the way connects.
    """

    width_m: Annotated[
        StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0), AfterValidator(_check_whole_modules)
    ]
    between: Literal["left_right", "bottom_top"]

    @property
    def width_cells(self) -> int:
        """Side of the vehicle's square in cells."""
        return round(self.width_m / MODULE_SIDE_M)

    @property
    def description(self) -> str:
        """The way in words: `access way of 3 m from left to right`."""
        return f"access way of {self.width_m:g} m from {self.between.replace('_', ' to ')}"


class BuildZone(Section):
    """Where barrier modules may stand: a grid of cells of one module each.

    Attributes:
        corner_m: Lower left corner of the cell (0, 0).
        rows: Number of rows, counted upwards.
        columns: Number of columns, counted to the right.
        stock: How many modules there are to place.
        keep_outs: Areas in which no cell may be used.
        module_capacity: As for structures, for the modules of the barrier.
        clearance_m: Least clear distance between a module and a structure.
        module_cost: Cost of a module outside all cost areas.
        cost_areas: Areas in which a module has another cost; the highest one counts.
        budget: What the modules may cost together; without it, anything.
        access_way: A way across the zone that must stay open; without it, none need.
        height_m: Height of the modules; without it, as high as the air.
    """

    corner_m: PointM
    rows: Count
    columns: Count
    stock: Annotated[StrictInt, Field(ge=1, le=10_000)]
    keep_outs: Annotated[tuple[KeepOut, ...], Field(max_length=100)] = ()
    module_capacity: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None
    clearance_m: Annotated[StrictFloat, Field(ge=0.0, le=2000.0)] = 0.0
    module_cost: Cost = 1.0
    cost_areas: Annotated[tuple[CostArea, ...], Field(max_length=100)] = ()
    budget: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None
    access_way: AccessWay | None = None
    height_m: Height | None = None

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
    def centres_m(self) -> tuple[FloatArray, FloatArray]:
        """X and y of the cells' centres, (rows, columns) each."""
        x = self.corner_m[0] + (np.arange(self.columns) + 0.5) * MODULE_SIDE_M
        y = self.corner_m[1] + (np.arange(self.rows) + 0.5) * MODULE_SIDE_M
        grid_x, grid_y = np.meshgrid(x, y)
        return grid_x, grid_y

    @property
    def cost_limit(self) -> float:
        """What the modules may cost together, rounding allowed for; infinite without a budget."""
        return inf if self.budget is None else self.budget * (1.0 + BUDGET_TOLERANCE)

    def cells(self) -> Iterator[Cell]:
        """Yield every cell, row by row."""
        return ((row, column) for row in range(self.rows) for column in range(self.columns))

    def cell_rectangle_m(self, cell: Cell) -> Rectangle:
        """Return the square that a cell covers."""
        row, column = cell
        corner = (
            self.corner_m[0] + column * MODULE_SIDE_M,
            self.corner_m[1] + row * MODULE_SIDE_M,
        )
        return Rectangle.from_corner(corner, (MODULE_SIDE_M, MODULE_SIDE_M))

    def cell_centre_m(self, cell: Cell) -> PointM:
        """Return the middle of the square that a cell covers."""
        return self.cell_rectangle_m(cell).centre

    def has(self, cell: Cell) -> bool:
        """Whether the grid has a cell."""
        return 0 <= cell[0] < self.rows and 0 <= cell[1] < self.columns


NO_ZONE: Final = BuildZone.model_construct(corner_m=(0.0, 0.0), rows=0, columns=0, stock=0)
"""What stands for the zone of a scenario without one where that is no error: it has no cells."""


Boxes = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Left, bottom, right and top of many rectangles; the four arrays broadcast."""


def source_bounds_m(source: AnySource) -> Rectangle:
    """Return the smallest rectangle around all the places that the charge's centre may be at."""
    if isinstance(source, RectangleSource):
        return source.rectangle_m
    (x0, y0), (x1, y1) = source.segment_m
    return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))


def distances_m(source: AnySource, boxes: Boxes) -> FloatArray:
    """Return how near the centre of a charge from this source can come to each rectangle."""
    if isinstance(source, PointSource | RectangleSource):
        return box_distances_m(source_bounds_m(source), boxes)
    return _segment_distances(*source.segment_m, boxes)


def distance_m(source: AnySource, rectangle: Rectangle) -> float:
    """Return how near the centre of a charge from this source can come to a rectangle."""
    left, bottom, right, top = (np.array(side) for side in rectangle)
    return float(distances_m(source, (left, bottom, right, top)))


def _gaps(box: Rectangle, boxes: Boxes) -> tuple[FloatArray, FloatArray]:
    """Return the gaps along x and y between one rectangle and others; 0 where they overlap."""
    left, bottom, right, top = boxes
    along_x = np.maximum(0.0, np.maximum(left - box.right, box.left - right))
    along_y = np.maximum(0.0, np.maximum(bottom - box.top, box.bottom - top))
    return along_x, along_y


def box_distances_m(box: Rectangle, boxes: Boxes) -> FloatArray:
    """Return the distances between one rectangle and others."""
    return np.hypot(*_gaps(box, boxes))


def _segment_distances(start: PointM, end: PointM, boxes: Boxes) -> FloatArray:
    """Return the distances between a segment and rectangles.

    Two convex figures that do not meet are nearest at a corner of one of them.
    """
    (x0, y0), (x1, y1) = start, end
    step_x, step_y = x1 - x0, y1 - y0
    square = step_x**2 + step_y**2
    nearest = np.minimum(
        box_distances_m(Rectangle(x0, y0, x0, y0), boxes),
        box_distances_m(Rectangle(x1, y1, x1, y1), boxes),
    )
    left, bottom, right, top = boxes
    sides = []
    for x, y in ((left, bottom), (left, top), (right, bottom), (right, top)):
        along = (x - x0) * step_x + (y - y0) * step_y
        share = np.clip(along / square, 0.0, 1.0) if square > 0.0 else np.zeros_like(along)
        nearest = np.minimum(nearest, np.hypot(x - x0 - share * step_x, y - y0 - share * step_y))
        sides.append((x - x0) * step_y - (y - y0) * step_x)
    both_sides = (np.minimum.reduce(sides) <= 0.0) & (np.maximum.reduce(sides) >= 0.0)
    bounds = Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    meets = both_sides & (box_distances_m(bounds, boxes) == 0.0)
    return np.where(meets, 0.0, nearest)


TOLERANCE_M: Final = 1e-9
"""Rectangles that overlap by less than this only touch, as in `Rectangle.overlaps`."""


@dataclass(frozen=True)
class Surroundings:
    """A build zone and everything that decides, before any module, which cells may be used.

    Attributes:
        zone: The build zone.
        structures: The structures on the site.
        sources: Where the charge may come from.
        charge_radius_m: Radius of the disc that the charge fills.
    """

    zone: BuildZone
    structures: tuple[AnyStructure, ...]
    sources: tuple[AnySource, ...]
    charge_radius_m: float


@dataclass(frozen=True)
class EmptyZone:
    """The cells of a build zone without modules; all arrays are read-only.

    Attributes:
        usable: Which cells may be used, shape (rows, columns).
        passable: Which cells no structure covers, shape (rows, columns).
        module_costs: What a module on each cell costs, shape (rows, columns).
    """

    usable: BoolArray
    passable: BoolArray
    module_costs: NDArray[np.float64]


@lru_cache(maxsize=16)
def empty_zone(surroundings: Surroundings) -> EmptyZone:
    """Return what holds for the cells; for the same surroundings, the same object."""
    zone = surroundings.zone
    boxes = _boxes(zone, np.arange(zone.rows), np.arange(zone.columns))
    usable = np.ones(zone.shape, dtype=bool)
    for _, blocked in _blocked(surroundings, boxes):
        usable &= ~blocked
    passable = np.ones_like(usable)
    for structure in surroundings.structures:
        passable &= ~_overlapping(structure.rectangle_m, boxes)
    costs = _module_costs(zone, boxes)
    for array in (usable, passable, costs):
        array.flags.writeable = False
    return EmptyZone(usable, passable, costs)


def reason_against(surroundings: Surroundings, cell: Cell) -> str | None:
    """Return why a cell of the grid may not be used, or `None` if it may."""
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
    """Yield each reason against cells, with the cells that it holds for."""
    zone, radius_m = surroundings.zone, surroundings.charge_radius_m
    for keep_out in zone.keep_outs:
        yield f"must stay empty: {keep_out.reason}", _overlapping(keep_out.rectangle_m, boxes)
    for structure in surroundings.structures:
        reason = f"overlaps the structure {structure.name!r}"
        yield reason, _overlapping(structure.rectangle_m, boxes)
    if zone.clearance_m > 0.0:
        yield from _too_close(surroundings, boxes)
    for index, source in enumerate(surroundings.sources):
        yield (
            f"is closer than the charge's radius of {radius_m:g} m to where the charge"
            f" may be (charge[{index}])",
            distances_m(source, boxes) < radius_m - TOLERANCE_M,
        )


def _too_close(surroundings: Surroundings, boxes: Boxes) -> Iterator[tuple[str, BoolArray]]:
    """Yield the cells without the clearance from each structure."""
    clearance_m = surroundings.zone.clearance_m
    for structure in surroundings.structures:
        distances = box_distances_m(structure.rectangle_m, boxes)
        yield (
            f"is closer than {clearance_m:g} m to the structure {structure.name!r}"
            f" ({distances.min():g} m)",
            distances < clearance_m - TOLERANCE_M,
        )


def _module_costs(zone: BuildZone, boxes: Boxes) -> NDArray[np.float64]:
    """Return what a module on each cell costs: the highest cost of the areas around it."""
    highest = np.zeros(zone.shape)
    for area in zone.cost_areas:
        inside = _overlapping(area.rectangle_m, boxes)
        highest[inside] = np.maximum(highest[inside], area.module_cost)
    return np.where(highest > 0.0, highest, zone.module_cost)


def _overlapping(rectangle: Rectangle, boxes: Boxes) -> BoolArray:
    """Return which squares overlap a rectangle; to touch is not to overlap."""
    left, bottom, right, top = boxes
    along_x = (left < rectangle.right - TOLERANCE_M) & (right > rectangle.left + TOLERANCE_M)
    along_y = (bottom < rectangle.top - TOLERANCE_M) & (top > rectangle.bottom + TOLERANCE_M)
    return along_x & along_y


def is_open(way: AccessWay, passable: BoolArray) -> bool:
    """Return whether the vehicle can cross the zone.

    Args:
        way: The way; no wider than the zone.
        passable: Which cells the vehicle may cover, shape (rows, columns).
    """
    return _Chains.of(way, passable).leave_a_way


def closing_cells(way: AccessWay, passable: BoolArray) -> BoolArray:
    """Return the cells on which a module would leave no way, shape (rows, columns).

    If there is no way already, those are all cells.

    Args:
        way: The way; no wider than the zone.
        passable: Which cells the vehicle may cover, shape (rows, columns).
    """
    chains = _Chains.of(way, passable)
    if not chains.leave_a_way:
        return np.ones_like(passable)
    width = way.width_cells
    closing = _beside(chains.below, width) & _beside(chains.above, width)
    return _along_columns(way, closing)


@dataclass(frozen=True)
class _Chains:
    """The places of the vehicle that chains of obstacles close, from either border.

    Place (i, j) is that of the vehicle with its lower left cell at row i - 1 and column j; the
    first and the last row are the borders, where the vehicle would leave the zone.

    Attributes:
        below: Places that hang together with the border below, shape (rows - width + 3,
            columns - width + 1).
        above: Places that hang together with the border above, of the same shape.
    """

    below: BoolArray
    above: BoolArray

    @classmethod
    def of(cls, way: AccessWay, passable: BoolArray) -> "_Chains":
        closed = _any_in_windows(~_along_columns(way, passable), way.width_cells)
        bordered = np.ones((closed.shape[0] + 2, closed.shape[1]), dtype=bool)
        bordered[1:-1] = closed
        labels, _ = label(bordered, structure=np.ones((3, 3), dtype=bool))
        return cls(below=labels == labels[0, 0], above=labels == labels[-1, 0])

    @property
    def leave_a_way(self) -> bool:
        """Whether no chain reaches from border to border."""
        return not self.below[-1, 0]


def _beside(chain: BoolArray, width: int) -> BoolArray:
    """Return the cells on which a module would close a place in or next to the chain.

    A module on cell (i, j) closes the places from (i - width + 2, j - width + 1) to (i + 1, j), as
    far as there are such.
    """
    rows, columns = chain.shape
    framed = np.zeros((rows + 2 * width - 2, columns + 2 * width), dtype=bool)
    framed[width - 1 : width - 1 + rows, width : width + columns] = chain
    return _any_in_windows(framed, width + 2)


def _any_in_windows(mask: BoolArray, side: int) -> BoolArray:
    """Return for each square of side x side cells whether anything in it is true."""
    counts = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int32)
    np.cumsum(np.cumsum(mask, axis=0, dtype=np.int32), axis=1, out=counts[1:, 1:])
    strips = counts[side:] - counts[:-side]
    return strips[:, side:] > strips[:, :-side]


def _along_columns(way: AccessWay, cells: BoolArray) -> BoolArray:
    """Return the cells turned such that the way runs along the columns, or turned back."""
    return cells if way.between == "left_right" else cells.T
