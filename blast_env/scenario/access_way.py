"""Whether a vehicle can cross the build zone, and which further modules would stop it.

No way is searched for. A square vehicle that moves along rows and columns is stopped exactly if the
places at which it would touch an obstacle form a chain from one border of its way to the other,
each place being next to the one before it, corners included. So a module closes the way exactly if
it joins a chain from the one border to a chain from the other, and all such cells come out of a few
operations on whole arrays, without trying any.

In this file the way runs along the columns, from left to right; its borders are below and above.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from blast_env.scenario.build_zone import AccessWay

BoolArray = NDArray[np.bool_]


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
