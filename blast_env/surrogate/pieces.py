"""What the surrogate keeps of the pieces of layouts: the paths that each stops, its messages.

Layouts have many pieces in common, and what a piece does to a point depends on no other piece. Of
each place in plan a piece stops the lowest paths, so that several together stop as many as the one
that stops most. Messages add up. So each piece is computed once per charge.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.surrogate.layers import SingleArray, padded
from blast_env.surrogate.ways import FALLS_M, SHARES, STATIONS, Ways

Box = tuple[float, ...]
"""Left, bottom, right, top and height of a piece, m."""

Counts = NDArray[np.uint8]
Numbers = NDArray[np.int32]

_MOST_BYTES: Final = 2**26
_FALLS: Final = len(FALLS_M)


class KnownPieces:
    """The structures of a site and the pieces met so far, for one charge.

    Args:
        ways: The paths from the charge to the points.
        features: Scaled features of the points on the empty site (points, FEATURES).
        mean: Mean of each open share (SHARES,).
        scale: Their standard deviations (SHARES,).
        most: Bound on the scaled values.
        sent: Returns the messages of the structures (`None`), or of each of several pieces, by each
            set of networks (pieces, members, points, MESSAGE).
    """

    def __init__(
        self,
        ways: Ways,
        features: FloatArray,
        mean: FloatArray,
        scale: FloatArray,
        most: float,
        sent: Callable[[FloatArray | None], list[SingleArray]],
    ) -> None:
        self._ways, self._sent, self._bounds = ways, sent, (mean, scale, most)
        self._features = features.astype(np.float32)
        self._numbers: dict[Box, int] = {}
        self._stopped: Counts = _of_places(ways.stopped[np.newaxis])
        self._is_open: BoolArray = ways.is_straight_open[np.newaxis]
        self._messages = sent(None)

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self._features)

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        of_messages = sum(each.nbytes for each in self._messages)
        return self._stopped.nbytes + self._is_open.nbytes + of_messages

    def numbers_of(self, layouts: Sequence[Sequence[Box]]) -> Numbers:
        """Return the number of each piece of layouts, 0 after the last (layouts, most pieces + 1).

        Pieces that are not known yet are computed.
        """
        numbers = self._numbers
        new = [box for each in layouts for box in each if box not in numbers]
        if new:
            self._meet(list(dict.fromkeys(new)))
        found: Numbers = np.zeros((len(layouts), max(map(len, layouts)) + 1), dtype=np.int32)
        for own, each in zip(found, layouts, strict=True):
            own[: len(each)] = [numbers[box] for box in each]
        return found

    def inputs(self, layouts: Numbers, networks: int) -> SingleArray:
        """Return the inputs of networks for layouts (members, rows, FEATURES + MESSAGE).

        Rows are the points of one layout after the other, then zeros up to a padded number.

        Args:
            layouts: See `numbers_of`.
            networks: Number of the set of networks.
        """
        messages = self._messages[networks]
        _, members, points, length = messages.shape
        count = padded(len(layouts) * points)
        found = np.zeros((members, count, self._features.shape[1] + length), dtype=np.float32)
        weights = self._ways.weights
        weights = weights.reshape(len(weights), -1, *weights.shape[3:])
        known = self._stopped, self._is_open, weights
        _put_inputs(layouts, *known, self._features, *self._bounds, messages, found)
        return found

    def _meet(self, boxes: Sequence[Box]) -> None:
        """Compute pieces."""
        first = len(self._numbers) + 1
        pieces = np.array(boxes)
        stopped, is_open = self._ways.stopped_by_each(pieces)
        sent = self._sent(pieces)
        self._numbers.update(zip(boxes, range(first, first + len(boxes)), strict=True))
        self._stopped = _with(self._stopped, _of_places(stopped), first)
        self._is_open = _with(self._is_open, is_open, first)
        pairs = zip(self._messages, sent, strict=True)
        self._messages = [_with(kept, more, first) for kept, more in pairs]


def _of_places(stopped: NDArray[Any]) -> Counts:
    """Return numbers of stopped paths by each place (pieces, points, stations x asides)."""
    return stopped.reshape(*stopped.shape[:2], -1).astype(np.uint8)


def _with(kept: NDArray[Any], more: NDArray[Any], first: int) -> NDArray[Any]:
    """Return an array with more entries from the first free one on; it grows by half at least."""
    if first + len(more) > len(kept):
        grown = np.empty((max(first + len(more), first * 3 // 2), *kept.shape[1:]), kept.dtype)
        grown[:first] = kept[:first]
        kept = grown
    kept[first : first + len(more)] = more
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def _put_inputs(
    layouts: Numbers,
    stopped: Counts,
    is_open: BoolArray,
    weights: FloatArray,
    features: SingleArray,
    mean: FloatArray,
    scale: FloatArray,
    most: float,
    messages: SingleArray,
    found: SingleArray,
) -> None:
    """Put features and the sum of messages of each point behind each layout; see `inputs`."""
    _, points, places = stopped.shape
    members, length = messages.shape[1], messages.shape[3]
    constant = features.shape[1] - SHARES
    asides = places // len(STATIONS)
    below = np.empty(places, dtype=np.uint8)
    shares = np.empty(SHARES)
    changing = np.empty(SHARES, dtype=np.float32)
    for layout in range(len(layouts)):
        pieces = 0
        while layouts[layout, pieces] > 0:
            pieces += 1
        for point in range(points):
            row = layout * points + point
            straight = is_open[0, point]
            for by in range(places):
                below[by] = stopped[0, point, by]
            for each in range(pieces):
                piece = layouts[layout, each]
                straight = straight and is_open[piece, point]
                for by in range(places):
                    below[by] = max(below[by], stopped[piece, point, by])
            shares[:] = 0.0
            shares[-1] = 1.0 if straight else 0.0
            for station in range(len(STATIONS)):
                for by in range(station * asides, (station + 1) * asides):
                    for fall in range(_FALLS):
                        shares[station * _FALLS + fall] += weights[point, by, below[by], fall]
            for share in range(SHARES):
                scaled = (shares[share] - mean[share]) / scale[share]
                changing[share] = min(max(scaled, -most), most)
            for member in range(members):
                for each in range(constant):
                    found[member, row, each] = features[point, each]
                for each in range(SHARES):
                    found[member, row, constant + each] = changing[each]
                for each in range(length):
                    found[member, row, constant + SHARES + each] = messages[0, member, point, each]
                for number in range(pieces):
                    piece = layouts[layout, number]
                    for each in range(length):
                        found[member, row, constant + SHARES + each] += messages[
                            piece, member, point, each
                        ]


class Memory:
    """The pieces known for each charge, cleared when they exceed a bound; copies begin empty.

    Args:
        most_bytes: The bound.
    """

    def __init__(self, most_bytes: int = _MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._kept: dict[Hashable, KnownPieces] = {}
        self._bytes: dict[Hashable, int] = {}
        self._total_bytes = 0

    def __reduce__(self) -> tuple[type["Memory"], tuple[int]]:
        """Pickle the bound alone."""
        return Memory, (self._most_bytes,)

    def numbers_of(
        self,
        key: Hashable,
        make: Callable[[], KnownPieces],
        layouts: Sequence[Sequence[Box]],
    ) -> tuple[KnownPieces, Numbers]:
        """Return the known pieces of a key, and the number of each piece of layouts.

        Args:
            key: The key.
            make: Makes the known pieces of the key, if there are none.
            layouts: The pieces of each layout.
        """
        if self._total_bytes > self._most_bytes:
            self._kept.clear()
            self._bytes.clear()
            self._total_bytes = 0
        known = self._kept.get(key)
        if known is None:
            known = self._kept[key] = make()
        numbers = known.numbers_of(layouts)
        self._total_bytes += known.nbytes - self._bytes.get(key, 0)
        self._bytes[key] = known.nbytes
        return known, numbers
