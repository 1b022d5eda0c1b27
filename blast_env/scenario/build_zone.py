"""The section of a scenario that says where barrier modules may stand, and under which conditions.

All lengths are in metres, x to the right and y upwards from the lower left corner of the site.
"""

from collections.abc import Iterator
from math import inf
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, StrictFloat, StrictInt

from blast_env.geometry import Rectangle
from blast_env.scenario.sections import Cell, Count, PointM, Section, SizeM
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

    @property
    def rectangle_m(self) -> Rectangle:
        """The whole zone."""
        size = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size)

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
