"""The access way: a vehicle must always be able to cross the build zone."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    Field,
    SerializerFunctionWrapHandler,
    StrictFloat,
    model_serializer,
)

from blast_env.arrays import BoolArray
from blast_env.scenario.catalogue import Variant
from blast_env.scenario.crash_rating import CrashRating
from blast_env.scenario.sections import Ground, Section
from blast_env.units import MODULE_SIDE_M


def _check_whole_modules(width_m: float) -> float:
    """Refuse a width that is not a whole number of cells."""
    if abs(width_m - round(width_m / MODULE_SIDE_M) * MODULE_SIDE_M) > 1e-9:
        raise ValueError(f"must be a multiple of {MODULE_SIDE_M:g}, the side of a module")
    return width_m


class Gate(Ground):
    """Where a gate stands.

    Attributes:
        crash_rating: What it stops; without it, every vehicle.
    """

    crash_rating: CrashRating | None = None

    @model_serializer(mode="wrap")
    def _without_none(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out a rating that is not there."""
        return {key: value for key, value in handler(self).items() if value is not None}


class AccessWay(Section):
    """A way across the build zone that a vehicle must always be able to take.

    The vehicle is a square of whole cells. It moves along rows and columns, stays inside the
    zone, and covers neither a module nor a structure; keep-outs are open to it.

    Attributes:
        width_m: Side of the vehicle's square; whole modules.
        between: The two sides of the zone that the way connects.
        gate: Where a gate stands that opens for the way's vehicle alone: no module may stand
            there, and vehicles with a charge do not get through.
    """

    width_m: Annotated[
        StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0), AfterValidator(_check_whole_modules)
    ]
    between: Literal["left_right", "bottom_top"]
    gate: Gate | None = None

    @property
    def width_cells(self) -> int:
        """Side of the vehicle's square in cells."""
        return round(self.width_m / MODULE_SIDE_M)

    @property
    def description(self) -> str:
        """The way in words: `access way of 3 m from left to right`."""
        return f"access way of {self.width_m:g} m from {self.between.replace('_', ' to ')}"


def is_open(way: AccessWay, passable: BoolArray) -> bool:
    """Return whether the vehicle can cross the zone.

    Args:
        way: The way; no wider than the zone.
        passable: Which cells the vehicle may cover, shape (rows, columns).
    """
    return _Chains.of(way, passable).leave_a_way


def closing_places(
    way: AccessWay, passable: BoolArray, variants: Iterable[Variant]
) -> Iterator[BoolArray]:
    """Yield for each variant the lower left cells from which it leaves no way, (rows, columns).

    If there is no way already, those are all cells.

    Args:
        way: The way; no wider than the zone.
        passable: Which cells the vehicle may cover, shape (rows, columns).
        variants: What is set down.
    """
    chains = _Chains.of(way, passable)
    known: dict[tuple[int, int], BoolArray] = {}
    for variant in variants:
        if variant.is_measure:
            yield np.zeros_like(passable)
            continue
        size = variant.rows, variant.columns
        if size not in known:
            known[size] = chains.closed_by(size) if chains.leave_a_way else np.ones_like(passable)
        yield known[size]


@dataclass(frozen=True)
class _Chains:
    """The places of the vehicle that chains of obstacles close, from either border.

    Place (i, j) is that of the vehicle with its lower left cell at row i - 1 and column j; the
    first and the last row are the borders, where the vehicle would leave the zone.

    Attributes:
        way: The way.
        below: Places that hang together with the border below, shape (rows - width + 3,
            columns - width + 1).
        above: Places that hang together with the border above, of the same shape.
    """

    way: AccessWay
    below: BoolArray
    above: BoolArray

    @classmethod
    def of(cls, way: AccessWay, passable: BoolArray) -> "_Chains":
        from scipy.ndimage import label  # takes a third of a second to import

        width = way.width_cells
        closed = any_in_windows(counts_before(~_along_columns(way, passable)), width, width)
        bordered = np.ones((closed.shape[0] + 2, closed.shape[1]), dtype=bool)
        bordered[1:-1] = closed
        labels, _ = label(bordered, structure=np.ones((3, 3), dtype=bool))
        return cls(way, below=labels == labels[0, 0], above=labels == labels[-1, 0])

    @property
    def leave_a_way(self) -> bool:
        """Whether no chain reaches from border to border."""
        return not self.below[-1, 0]

    def closed_by(self, size: tuple[int, int]) -> BoolArray:
        """Return the lower left cells from which a piece joins the chains, (rows, columns)."""
        along = size if self.way.between == "left_right" else size[::-1]
        width = self.way.width_cells
        closing = _beside(self.below, width, *along) & _beside(self.above, width, *along)
        return _along_columns(self.way, closing)


def _beside(chain: BoolArray, width: int, rows: int, columns: int) -> BoolArray:
    """Return the lower left cells from which a piece closes a place in or next to the chain.

    A piece from cell (i, j) on closes the places from (i - width + 2, j - width + 1) to
    (i + rows, j + columns - 1), as far as there are such.

    Args:
        chain: Places of the vehicle, as in `_Chains`.
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


def counts_before(mask: BoolArray) -> NDArray[np.int32]:
    """Return how much is true below and to the left of each corner (rows + 1, columns + 1)."""
    counts = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int32)
    np.cumsum(np.cumsum(mask, axis=0, dtype=np.int32), axis=1, out=counts[1:, 1:])
    return counts


def any_in_windows(counts: NDArray[np.int32], rows: int, columns: int) -> BoolArray:
    """Return for each window of so many cells whether anything in it is true.

    Args:
        counts: Of the cells, `counts_before`.
        rows: Rows of a window.
        columns: Columns of a window.

    Returns:
        By lower left cell; nothing for windows that are larger than the grid.
    """
    strips = counts[rows:] - counts[:-rows]
    return strips[:, columns:] > strips[:, :-columns]


def _along_columns(way: AccessWay, cells: BoolArray) -> BoolArray:
    """Return the cells turned such that the way runs along the columns, or turned back."""
    return cells if way.between == "left_right" else cells.T
