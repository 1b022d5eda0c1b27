"""The access way: a path for vehicles across the build zone that must stay open."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat

from blast_env.arrays import BoolArray, any_in_windows, counts_before
from blast_env.hashing import HashMark
from blast_env.sections import Ground, Section, SparseSection
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
    def description(self) -> str:
        """Description for messages: `access way of 3 m from left to right`."""
        return f"access way of {self.width_m:g} m from {self.between.replace('_', ' to ')}"


def is_open(way: AccessWay, passable: BoolArray) -> bool:
    """Return whether the vehicle can cross the zone.

    Args:
        way: The way; no wider than the zone.
        passable: Cells that the vehicle may cover (rows, columns).
    """
    return _Chains.of(way, passable).leave_a_way


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
    chains = _Chains.of(way, passable)
    known: dict[tuple[int, int], BoolArray] = {}
    for size in sizes:
        if 0 in size:
            yield np.zeros_like(passable)
            continue
        if size not in known:
            known[size] = chains.closed_by(size) if chains.leave_a_way else np.ones_like(passable)
        yield known[size]


@dataclass(frozen=True)
class _Chains:
    """The positions of the vehicle blocked by chains of obstacles from either border.

    At position (i, j) the vehicle's lower left cell has row i - 1 and column j; the first and the
    last row are the borders, where the vehicle would leave the zone.

    Attributes:
        way: The way.
        below: Blocked positions connected to the lower border (rows - width + 3,
            columns - width + 1).
        above: Blocked positions connected to the upper border, of the same shape.
    """

    way: AccessWay
    below: BoolArray
    above: BoolArray

    @classmethod
    def of(cls, way: AccessWay, passable: BoolArray) -> "_Chains":
        from scipy.ndimage import label  # takes a third of a second to import

        # Discrete duality: a way of the vehicle's squares exists if no chain of blocked positions,
        # neighbours by side or corner, joins the two borders along the way. (1) Positions that a
        # closed cell blocks; (2) a blocked row beyond either border; (3) label chains; (4) those of
        # either border.
        width = way.width_cells
        closed = any_in_windows(counts_before(~_along_columns(way, passable)), width, width)
        bordered = np.ones((closed.shape[0] + 2, closed.shape[1]), dtype=bool)
        bordered[1:-1] = closed
        labels, _ = label(bordered, structure=np.ones((3, 3), dtype=bool))
        return cls(way, below=labels == labels[0, 0], above=labels == labels[-1, 0])

    @property
    def leave_a_way(self) -> bool:
        """Whether no chain connects both borders."""
        return not self.below[-1, 0]

    def closed_by(self, size: tuple[int, int]) -> BoolArray:
        """Return the lower left cells at which a piece connects the chains (rows, columns)."""
        # A piece closes the way where the positions that it blocks touch both chains.
        along = size if self.way.between == "left_right" else size[::-1]
        width = self.way.width_cells
        closing = _beside(self.below, width, *along) & _beside(self.above, width, *along)
        return _along_columns(self.way, closing)


def _beside(chain: BoolArray, width: int, rows: int, columns: int) -> BoolArray:
    """Return the lower left cells at which a piece blocks a position in or next to the chain.

    A piece with lower left cell (i, j) blocks the positions (i - width + 2, j - width + 1) to
    (i + rows, j + columns - 1), as far as they exist.

    Args:
        chain: Positions of the vehicle, as in `_Chains`.
        width: Side of the vehicle in cells.
        rows: Rows of cells of the piece.
        columns: Columns of cells of the piece.
    """
    places_up, places_right = chain.shape
    framed = np.zeros(
        (places_up + 2 * width - 3 + rows, places_right + 2 * width - 1 + columns), dtype=bool
    )
    framed[width - 1 : width - 1 + places_up, width : width + places_right] = chain
    return any_in_windows(counts_before(framed), width + 1 + rows, width + 1 + columns)


def _along_columns(way: AccessWay, cells: BoolArray) -> BoolArray:
    """Return the cells transposed so that the way runs along the columns, or back."""
    return cells if way.between == "left_right" else cells.T
