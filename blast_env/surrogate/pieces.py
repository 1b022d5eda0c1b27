"""What the surrogate keeps of the pieces of layouts: the paths that each stops, its messages.

Layouts have many pieces in common, and what a piece does to a point depends on no other piece. Of
each place in plan a piece stops the lowest paths, so that several together stop as many as the one
that stops most. Messages add up. So each piece is computed once per charge.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.compilation import compiled
from blast_env.gas.simd import place
from blast_env.gas.state import FUSED
from blast_env.surrogate.layers import ROWS_AT_ONCE, SingleArray, buffers, four_rows, four_sums
from blast_env.surrogate.ways import FALLS_M, SHARES, STATIONS, Ways

Box = tuple[float, ...]
"""Left, bottom, right, top and height of a piece, m."""

Counts = NDArray[np.uint8]
Numbers = NDArray[np.int32]

_MOST_BYTES: Final = 2**26
_FALLS: Final = len(FALLS_M)


class PointLayers(NamedTuple):
    """The layers of networks that predict at a point, and what they know without a layout.

    Attributes:
        base: Sums of the first layer over all inputs that no layout changes, and the messages of
            the structures (members, points, width).
        first: Its weights of open shares and messages (members, SHARES + length, width).
        second: Weights of the second layer (members, width, width).
        second_bias: Its biases (members, width).
        last: Weights of the last layer (members, width).
        last_bias: Its bias (members,).
    """

    base: SingleArray
    first: SingleArray
    second: SingleArray
    second_bias: SingleArray
    last: SingleArray
    last_bias: SingleArray


class PieceKnowledge:
    """The structures of a site and the pieces met so far, for one charge.

    Args:
        ways: The paths from the charge to the points.
        bounds: Mean and standard deviation of each open share (SHARES,), and the bound on the
            scaled values.
        layers: The layers of each set of networks.
        sent: Returns the messages of several pieces by each set of networks (pieces, members,
            points, length).
    """

    def __init__(
        self,
        ways: Ways,
        bounds: tuple[FloatArray, FloatArray, float],
        layers: Sequence[PointLayers],
        sent: Callable[[FloatArray], list[SingleArray]],
    ) -> None:
        self._ways, self._bounds, self._layers, self._sent = ways, bounds, layers, sent
        self._numbers: dict[Box, int] = {}
        self._stopped: Counts = _of_places(ways.stopped[np.newaxis])
        self._is_open: BoolArray = ways.is_straight_open[np.newaxis]
        empty = [
            (0, len(layer.base), self.points, len(layer.first[0]) - SHARES) for layer in layers
        ]
        self._messages = [np.zeros((1, *shape[1:]), dtype=np.float32) for shape in empty]

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self._ways.points_m)

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        of_messages = sum(message.nbytes for message in self._messages)
        of_messages += sum(layer.base.nbytes for layer in self._layers)
        return self._stopped.nbytes + self._is_open.nbytes + of_messages

    def numbers_of(self, layouts: Sequence[Sequence[Box]]) -> Numbers:
        """Return the number of each piece of layouts, 0 after the last (layouts, most pieces + 1).

        Pieces that are not known yet are computed.
        """
        numbers = self._numbers
        new = [box for layout in layouts for box in layout if box not in numbers]
        if new:
            self._meet(list(dict.fromkeys(new)))
        found: Numbers = np.zeros((len(layouts), max(map(len, layouts)) + 1), dtype=np.int32)
        for own, layout in zip(found, layouts, strict=True):
            own[: len(layout)] = [numbers[box] for box in layout]
        return found

    def differs(self, layouts: Numbers, networks: int) -> SingleArray:
        """Return the predictions at the points behind layouts (members, layouts x points).

        Args:
            layouts: See `numbers_of`.
            networks: Number of the set of networks.
        """
        weights, layers = self._ways.weights, self._layers[networks]
        members, points, width = layers.base.shape
        found = np.empty((members, len(layouts) * points), dtype=np.float32)
        arguments: tuple[Any, ...] = (
            *(
                layouts,
                self._stopped,
                self._is_open,
                weights.reshape(points, -1, *weights.shape[3:]),
            ),
            *(self._messages[networks], *self._bounds, *layers),
            *(*buffers(layers.first.shape[1], width, width), found),
        )
        _put_differs(*arguments)
        return found

    def _meet(self, boxes: Sequence[Box]) -> None:
        """Compute pieces."""
        # The blocked paths and the messages of a piece depend on no other piece: each is computed
        # once, and layouts are put together from them.
        first = len(self._numbers) + 1
        pieces = np.array(boxes)
        stopped, is_open = self._ways.stopped_by(pieces)
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


@njit(error_model="numpy")
def _put_shares(
    own: Any, stopped: Any, is_open: Any, weights: Any, mean: Any, scale: Any, most: Any, found: Any
) -> None:
    """Put the scaled open shares of each point behind the pieces of a layout (points, SHARES)."""
    _, points, places = stopped.shape
    asides = places // len(STATIONS)
    below = np.empty(places, dtype=np.uint8)
    shares = np.empty(SHARES)
    for point in range(points):
        straight = is_open[0, point]
        for by in range(places):
            below[by] = stopped[0, point, by]
        # 1. Several pieces stop as many detours by a place as the one that stops most.
        for piece in own:
            if piece == 0:
                break
            straight = straight and is_open[piece, point]
            for by in range(places):
                below[by] = max(below[by], stopped[piece, point, by])
        # 2. The shares that are left, and 3. their scaled and bounded values.
        shares[:] = 0.0
        shares[-1] = 1.0 if straight else 0.0
        for station in range(len(STATIONS)):
            for by in range(station * asides, (station + 1) * asides):
                for fall in range(_FALLS):
                    shares[station * _FALLS + fall] += weights[point, by, below[by], fall]
        for share in range(SHARES):
            scaled = (shares[share] - mean[share]) / scale[share]
            found[point, share] = min(max(scaled, -most), most)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def _put_differs(
    layouts: Any,
    stopped: Any,
    is_open: Any,
    weights: Any,
    messages: Any,
    mean: Any,
    scale: Any,
    most: Any,
    base: Any,
    first: Any,
    second: Any,
    second_bias: Any,
    last: Any,
    last_bias: Any,
    given: Any,
    middle: Any,
    end: Any,
    found: Any,
) -> None:
    """Find the predictions at the points behind each layout; see `PieceKnowledge.differs`."""
    members, points, width = base.shape
    inputs, length = first.shape[1], messages.shape[3]
    shares = np.empty((points, SHARES), dtype=np.float32)
    at, between, beyond = place(given), place(middle), place(end)
    same = 0, 0, 0, 0
    for layout in range(len(layouts)):
        _put_shares(layouts[layout], stopped, is_open, weights, mean, scale, most, shares)
        for member in range(members):
            bases, to_first = place(base[member]), place(first[member])
            to_second, bias = place(second[member]), place(second_bias[member])
            to_last = place(last[member])
            for point in range(0, points, ROWS_AT_ONCE):
                for number in range(ROWS_AT_ONCE):
                    row = min(point + number, points - 1)
                    for index in range(SHARES):
                        given[number, index] = shares[row, index]
                    for index in range(length):
                        given[number, SHARES + index] = np.float32(0.0)
                    for piece in layouts[layout]:
                        if piece == 0:
                            break
                        for index in range(length):
                            given[number, SHARES + index] += messages[piece, member, row, index]
                # Four points at once, from memory read once; the last ones repeat at the end.
                at_1, at_2 = min(point + 1, points - 1), min(point + 2, points - 1)
                at_3 = min(point + 3, points - 1)
                rows = point * width, at_1 * width, at_2 * width, at_3 * width
                four_rows(at, inputs, to_first, width, bases, rows, between)
                four_rows(between, width, to_second, width, bias, same, beyond)
                sums = four_sums(beyond, width, to_last, last_bias[member])
                for number in range(min(ROWS_AT_ONCE, points - point)):
                    found[member, layout * points + point + number] = sums[number]


class Memory:
    """The pieces known for each charge, cleared when they exceed a bound; copies begin empty."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, PieceKnowledge] = {}
        self._bytes: dict[Hashable, int] = {}
        self._total_bytes = 0

    def __reduce__(self) -> tuple[type["Memory"], tuple[()]]:
        """Pickle nothing."""
        return Memory, ()

    def numbers_of(
        self,
        key: Hashable,
        make: Callable[[], PieceKnowledge],
        layouts: Sequence[Sequence[Box]],
    ) -> tuple[PieceKnowledge, Numbers]:
        """Return the known pieces of a key, and the number of each piece of layouts.

        Args:
            key: The key.
            make: Makes the known pieces of the key, if there are none.
            layouts: The pieces of each layout.
        """
        if self._total_bytes > _MOST_BYTES:
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
