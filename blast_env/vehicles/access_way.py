"""The access way: a path for vehicles across the build zone that must stay open."""

from collections.abc import Iterable, Iterator
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat

from blast_env.arrays import BoolArray
from blast_env.sections import Ground, HashMark, Section, SparseSection
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.crash_rating import CrashRating


def _check_whole_modules(width_m: float) -> float:
    """Refuse a length that is not a whole number of modules."""
    if abs(width_m - round(width_m / MODULE_SIDE_M) * MODULE_SIDE_M) > 1e-9:
        raise ValueError(f"must be a multiple of {MODULE_SIDE_M:g}, the side of a module")
    return width_m


WholeModules: Final = AfterValidator(_check_whole_modules)
"""Annotation of a length of whole modules."""


class Gate(Ground, SparseSection):
    """The rectangle of a gate.

    Attributes:
        crash_rating: Its crash rating; without one, it stops every vehicle.
    """

    sparse: ClassVar = frozenset({"crash_rating"})

    crash_rating: Annotated[CrashRating | None, HashMark.IF_SET] = None


class AccessWay(Section):
    """A way across the build zone that must stay open for a vehicle.

    The vehicle is a square of whole cells. It moves along rows and columns, stays inside the
    zone, and covers neither a module nor a structure; no-build areas are open to it.

    Attributes:
        width_m: Side of the vehicle's square; whole modules.
        between: The two sides of the zone that the way connects.
        gate: A gate that opens for the way's vehicle alone: it is kept free of modules, and is
            closed to vehicles with a charge.
    """

    width_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0), WholeModules]
    between: Literal["left_right", "bottom_top"]
    gate: Annotated[Gate | None, HashMark.IF_SET] = None

    @property
    def width_cells(self) -> int:
        """Side of the vehicle's square in cells."""
        return round(self.width_m / MODULE_SIDE_M)

    @property
    def is_upwards(self) -> bool:
        """Whether the way runs from the lower to the upper side of the zone."""
        return self.between == "bottom_top"

    @property
    def description(self) -> str:
        """Description for messages: `access way of 3 m from left to right`."""
        return f"access way of {self.width_m:g} m from {self.between.replace('_', ' to ')}"


def is_open(way: AccessWay, passable: BoolArray) -> bool:
    """Return whether the vehicle can cross the zone.

    Args:
        way: The way; no wider than the zone.
        passable: Cells that the vehicle may cover (rows, columns).
    """
    from blast_env.vehicles.access_kernels import has_way  # Numba takes long to import

    return bool(has_way(_along_columns(way, passable), way.width_cells))


def closing_places(
    way: AccessWay, passable: BoolArray, sizes: Iterable[tuple[int, int]]
) -> Iterator[BoolArray]:
    """Yield for each size of piece the lower left cells at which it closes the way (rows, columns).

    If the way is closed already, these are all cells; for measures, of no size, none.

    Args:
        way: The way; no wider than the zone.
        passable: Cells that the vehicle may cover (rows, columns).
        sizes: Rows and columns of cells of the pieces to be placed.
    """
    from blast_env.vehicles.access_kernels import closing_cells  # Numba takes long to import

    wanted = [*sizes]
    distinct = [*dict.fromkeys(wanted)]
    along = np.array(distinct, dtype=np.int64).reshape(-1, 2)
    if way.is_upwards:
        along = np.ascontiguousarray(along[:, ::-1])
    closing = closing_cells(_along_columns(way, passable), along, way.width_cells)
    for size in wanted:
        yield _along_columns(way, closing[distinct.index(size)])


def _along_columns(way: AccessWay, cells: BoolArray) -> BoolArray:
    """Return the cells transposed so that the way runs along the columns, or back."""
    return np.ascontiguousarray(cells.T if way.is_upwards else cells)
