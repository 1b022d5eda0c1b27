"""What the surrogate knows of a charge and of the pieces of layouts, and the loads behind them.

Layouts have many pieces in common, and what a piece does to a point depends on no other piece. Of
each place in plan a piece stops the lowest paths, so that several together stop as many as the one
that stops most. Messages add up. So each piece is computed once per charge.

Most charges and pieces of training are never met again. What is known of them is kept from the
second time on, that of pieces from the third; before, it is in room that the next charge takes.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from math import exp, log, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.compilation import compiled
from blast_env.gas.simd import fill, lanes_at, load, place, store
from blast_env.gas.state import FUSED
from blast_env.surrogate.approach import FEATURES, Approach
from blast_env.surrogate.layers import (
    PARTS,
    ROWS_AT_ONCE,
    SingleArray,
    four_rows,
    four_sums,
    put_parts,
    put_two_layers,
    whole,
)
from blast_env.surrogate.relations import RELATIONS
from blast_env.surrogate.rooms import BOOL, BYTE, SINGLE, Counts, KeptRoom, Room, new_room
from blast_env.surrogate.ways import ASIDE_M, FALLS_M, SHARES, STATIONS

Box = tuple[float, ...]
"""Left, bottom, right, top and height of a piece, m."""

Numbers = NDArray[np.int32]

_MOST_BYTES: Final = 2**26
_MOST_MET: Final = 4096
"""Charges that count as met before."""

_OFTEN: Final = 2
"""Times that a piece is met without being kept."""

_FALLS: Final = len(FALLS_M)


class NetworkLayers(NamedTuple):
    """The layers of a set of networks, in single precision.

    Attributes:
        sending: Weights and biases of the two layers of messages of structures, and of pieces.
        constant: Weights of the first layer at points, of inputs that no layout changes and of the
            messages of structures (members, n + length, width).
        first_bias: Its biases (members, width).
        first: Its weights of open shares and of the messages of pieces (members, SHARES + length,
            width).
        second: Weights of the second layer (members, width, width).
        second_bias: Its biases (members, width).
        last: Weights of the last layer (members, width).
        last_bias: Its bias (members,).
        power: Exponent of the mean over the walls.
    """

    sending: tuple[tuple[SingleArray, ...], tuple[SingleArray, ...]]
    constant: SingleArray
    first_bias: SingleArray
    first: SingleArray
    second: SingleArray
    second_bias: SingleArray
    last: SingleArray
    last_bias: SingleArray
    power: float


class Scales(NamedTuple):
    """Mean and standard deviation of inputs, and the bound on the scaled values.

    Attributes:
        mean: Means of features, then of relations.
        scale: Standard deviations.
        most: The bound.
    """

    mean: FloatArray
    scale: FloatArray
    most: float


class Pieces(NamedTuple):
    """What is known of some pieces.

    Attributes:
        stopped: Number of paths that each stops by each place (pieces, points, places).
        is_open: Whether the straight path is open (pieces, points).
        messages: Their messages by each set of networks (members, pieces, rows, length).
    """

    stopped: Counts
    is_open: BoolArray
    messages: list[SingleArray]

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        return sum(map(_nbytes, (self.stopped, self.is_open, *self.messages)))


class PieceKnowledge:
    """A charge, the structures of a site, and the pieces met so far.

    Args:
        approach: The charge and the walls.
        scales: The scales of inputs.
        networks: The sets of networks.
        room: Gives the arrays of the charge.
    """

    def __init__(
        self,
        approach: Approach,
        scales: Scales,
        networks: Sequence[NetworkLayers],
        room: Room = new_room,
    ) -> None:
        self.approach, self._scales, self._networks = approach, scales, networks
        self._numbers: dict[Box, int] = {}
        self._met: dict[Box, int] = {}
        self._points = len(approach.area_m2)
        self._rows = whole(self._points)
        sent = self._sent(approach.solids, 0, room, "of structures")
        pairs = zip(networks, sent, strict=True)
        self._bases = [self._base(number, *pair, room) for number, pair in enumerate(pairs)]
        self._pieces = Pieces(
            np.empty((0, self._points, _PLACES), dtype=BYTE),
            np.empty((0, self._points), dtype=BOOL),
            [np.ascontiguousarray(messages[:, :0]) for messages in sent],
        )

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        used = len(self._numbers) / max(len(self._pieces.stopped), 1)
        of_pieces = int(used * self._pieces.nbytes)
        return self.approach.nbytes + of_pieces + sum(map(_nbytes, self._bases))

    def log_loads(self, layouts: Sequence[Sequence[Box]], room: Room) -> list[FloatArray]:
        """Return the logarithm of the load on each structure (members, layouts, structures).

        Args:
            layouts: The pieces of each layout.
            room: Gives the arrays of pieces that are not kept.

        Returns:
            One array of each set of networks.
        """
        # 1. The pieces that are not kept are computed: numbers of these are below 0.
        numbers = self._numbers
        new = list(dict.fromkeys([b for boxes in layouts for b in boxes if b not in numbers]))
        fresh = self._new(new, room)
        of_new = {box: -number for number, box in enumerate(new, start=1)}
        found: Numbers = np.zeros((len(layouts), max(map(len, layouts)) + 1), dtype=np.int32)
        for own, boxes in zip(found, layouts, strict=True):
            own[: len(boxes)] = [numbers.get(box) or of_new[box] for box in boxes]
        # 2. The loads, and 3. pieces met for the third time are kept.
        loads = [self._loads(found, which, fresh, room) for which in range(len(self._networks))]
        self._keep(new, fresh)
        return loads

    def _new(self, boxes: Sequence[Box], room: Room) -> Pieces:
        """Return new pieces, each of which depends on no other."""
        if not boxes:
            return self._pieces  # no layout has a new one
        pieces, ways = np.array(boxes), self.approach.ways
        stopped = room("stopped by pieces", (len(boxes), *ways.stopped.shape), BYTE)
        is_open = room("open behind pieces", (len(boxes), self._points), BOOL)
        ways.put_stopped_by(pieces, stopped, is_open)
        sent = self._sent(self.approach.relations(pieces, room), 1, room, "of pieces")
        return Pieces(stopped.reshape(len(boxes), self._points, _PLACES), is_open, sent)

    def _keep(self, boxes: Sequence[Box], fresh: Pieces) -> None:
        """Keep those of the new pieces that have often been met."""
        met = self._met
        for box in boxes:
            met[box] = met.get(box, 0) + 1
        again = [number for number, box in enumerate(boxes) if met[box] > _OFTEN]
        if not again:
            return
        first, kept = len(self._numbers), self._pieces
        messages = [
            _with(old, more[:, again], first, axis=1)
            for old, more in zip(kept.messages, fresh.messages, strict=True)
        ]
        stopped = _with(kept.stopped, fresh.stopped[again], first)
        self._pieces = Pieces(stopped, _with(kept.is_open, fresh.is_open[again], first), messages)
        for number in again:
            del met[boxes[number]]
            self._numbers[boxes[number]] = len(self._numbers) + 1

    def _loads(self, layouts: Numbers, which: int, fresh: Pieces, room: Room) -> FloatArray:
        """Return the logarithms of loads by one set of networks."""
        approach, networks, base = self.approach, self._networks[which], self._bases[which]
        ways, kept, (members, _, width) = approach.ways, self._pieces, base.shape
        found = np.empty((members, len(layouts), len(approach.starts)))
        _put_loads(
            layouts,
            ways.stopped.reshape(-1, _PLACES),
            ways.is_straight_open,
            *(kept.stopped, kept.is_open, kept.messages[which]),
            *(fresh.stopped, fresh.is_open, fresh.messages[which]),
            ways.weights,
            *self._scales,
            base,
            *networks[3:8],
            approach.log_loads[which],
            approach.area_m2,
            approach.starts,
            networks.power,
            room("given", (self._rows, networks.first.shape[1]), SINGLE),
            room("between", (ROWS_AT_ONCE, width), SINGLE),
            room("beyond", (ROWS_AT_ONCE, width), SINGLE),
            room("parts", (ROWS_AT_ONCE, PARTS), SINGLE),
            found,
        )
        return found

    def _sent(self, relations: FloatArray, which: int, room: Room, name: str) -> list[SingleArray]:
        """Return the messages of solids by each set of networks (members, solids, rows, length)."""
        solids = len(relations)
        rows = room("related", (1, solids * self._rows, RELATIONS), SINGLE)
        _put_related(relations, *self._scales, rows.reshape(solids, self._rows, RELATIONS))
        found = []
        for number, networks in enumerate(self._networks):
            sending = networks.sending[which]
            second = sending[2]
            shape = len(second), solids * self._rows, second.shape[2]
            sent = room(f"messages {number} {name}", shape, SINGLE)
            middle = room("middle", (ROWS_AT_ONCE, second.shape[1]), SINGLE)
            put_two_layers(rows, *sending, middle, sent)
            found.append(sent.reshape(len(second), solids, self._rows, -1))
        return found

    def _base(
        self, number: int, networks: NetworkLayers, messages: SingleArray, room: Room
    ) -> SingleArray:
        """Return the sums of the first layer over what no layout changes (members, rows, width)."""
        members, inputs, width = networks.constant.shape
        base: SingleArray = room(f"base {number}", (members, self._rows, width), SINGLE)
        given = room("constants", (self._rows, inputs), SINGLE)
        layers = networks.constant, networks.first_bias
        _put_base(self.approach.on_empty, *self._scales, messages, *layers, given, base)
        return base


def _nbytes(array: NDArray[Any]) -> int:
    return array.nbytes


_LEAST_ROOM: Final = 32
"""Pieces of a charge for which there is room at first."""

_PLACES: Final = len(STATIONS) * len(ASIDE_M)


def _with(kept: NDArray[Any], more: NDArray[Any], first: int, axis: int = 0) -> NDArray[Any]:
    """Return an array with more entries from the first free one on; it doubles at least."""
    after = first + more.shape[axis]
    before = (slice(None),) * axis
    if after > kept.shape[axis]:
        most = max(after, 2 * first, _LEAST_ROOM)  # memory that nobody writes to costs nothing
        grown = np.empty((*kept.shape[:axis], most, *kept.shape[axis + 1 :]), kept.dtype)
        grown[(*before, slice(first))] = kept[(*before, slice(first))]
        kept = grown
    kept[(*before, slice(first, after))] = more
    return kept


@compiled(nogil=True, error_model="numpy")
def _put_related(relations: Any, mean: Any, scale: Any, most: Any, rows: Any) -> None:
    """Put scaled and bounded relations in rows, the last point again in rows beyond the points."""
    solids, points, inputs = relations.shape
    for solid in range(solids):
        for row in range(rows.shape[1]):
            for index in range(inputs):
                value = relations[solid, min(row, points - 1), index]
                scaled = (value - mean[FEATURES + index]) / scale[FEATURES + index]
                rows[solid, row, index] = min(max(scaled, -most), most)


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def _put_base(
    features: Any,
    mean: Any,
    scale: Any,
    most: Any,
    messages: Any,
    weights: Any,
    bias: Any,
    given: Any,
    base: Any,
) -> None:
    """Put the sums of the first layer; see `PieceKnowledge`."""
    members, rows, width = base.shape
    solids, length = messages.shape[1], messages.shape[3]
    constant, points, inputs = FEATURES - SHARES, len(features), given.shape[1]
    # The first layer is linear before its bend, so that the sums over inputs that no layout changes
    # are made once: W [c, s, m] = W_c c + W_s s + W_m m.
    to, at, said = place(base), place(given), place(messages)
    lanes, same = lanes_at(to), (0, 0, 0, 0)
    for row in range(rows):
        for index in range(constant):
            value = features[min(row, points - 1), index]
            scaled = (value - mean[index]) / scale[index]
            given[row, index] = min(max(scaled, -most), most)
    for member in range(members):
        for row in range(rows):
            for index in range(0, length, lanes):
                heard = fill(at, np.float32(0.0))
                for solid in range(solids):
                    entry = ((member * solids + solid) * rows + row) * length
                    heard = heard + load(said, entry + index)
                store(at, row * inputs + constant + index, heard)
        weight, biases = place(weights[member]), place(bias[member])
        for row in range(0, rows, ROWS_AT_ONCE):
            end = (member * rows + row) * width
            four_sums(at, row * inputs, inputs, weight, width, biases, same, to, end)


@njit(error_model="numpy")
def _put_shares(
    own: Any,
    stopped_before: Any,
    is_open_before: Any,
    stopped: Any,
    is_open: Any,
    new_stopped: Any,
    new_is_open: Any,
    weights: Any,
    mean: Any,
    scale: Any,
    most: Any,
    given: Any,
) -> None:
    """Put the scaled open shares of each row behind the pieces of a layout, before its messages."""
    points, rows = len(stopped_before), len(given)
    asides = _PLACES // len(STATIONS)
    below = np.empty(_PLACES, dtype=np.uint8)
    shares = np.empty(SHARES)
    for point in range(points):
        straight = is_open_before[point]
        for by in range(_PLACES):
            below[by] = stopped_before[point, by]
        # 1. Several pieces stop as many detours by a place as the one that stops most.
        for piece in own:
            if piece == 0:
                break
            if piece > 0:
                straight = straight and is_open[piece - 1, point]
                for by in range(_PLACES):
                    below[by] = max(below[by], stopped[piece - 1, point, by])
            else:
                straight = straight and new_is_open[-piece - 1, point]
                for by in range(_PLACES):
                    below[by] = max(below[by], new_stopped[-piece - 1, point, by])
        # 2. The shares that are left, and 3. their scaled and bounded values.
        shares[:] = 0.0
        shares[-1] = 1.0 if straight else 0.0
        for station in range(len(STATIONS)):
            for aside in range(asides):
                left = weights[point, station, (aside + 1) // 2, below[station * asides + aside]]
                for fall in range(_FALLS):
                    shares[station * _FALLS + fall] += left[fall]
        for share in range(SHARES):
            index = FEATURES - SHARES + share
            scaled = (shares[share] - mean[index]) / scale[index]
            given[point, share] = min(max(scaled, -most), most)
    for row in range(points, rows):
        for share in range(SHARES):
            given[row, share] = given[points - 1, share]


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def _put_loads(
    layouts: Any,
    stopped_before: Any,
    is_open_before: Any,
    stopped: Any,
    is_open: Any,
    messages: Any,
    new_stopped: Any,
    new_is_open: Any,
    new_messages: Any,
    weights: Any,
    mean: Any,
    scale: Any,
    most: Any,
    base: Any,
    first: Any,
    second: Any,
    second_bias: Any,
    last: Any,
    last_bias: Any,
    known: Any,
    area_m2: Any,
    starts: Any,
    power: Any,
    given: Any,
    between: Any,
    beyond: Any,
    parts: Any,
    found: Any,
) -> None:
    """Put the logarithms of loads; see `PieceKnowledge.log_loads`.

    Pieces are numbered from 1 if they are kept, and from -1 down if they are new; 0 ends a layout.
    """
    members, rows, width = base.shape
    kept, new, length = messages.shape[1], new_messages.shape[1], messages.shape[3]
    points, inputs = len(known), first.shape[1]
    at, to, beside = place(given), place(between), place(beyond)
    said, now_said, sums = place(messages), place(new_messages), place(parts)
    lanes, same = lanes_at(at), (0, 0, 0, 0)
    loads = np.empty(len(starts))
    areas_m2 = np.zeros(len(starts))
    for structure in range(len(starts)):
        after = starts[structure + 1] if structure + 1 < len(starts) else points
        for point in range(starts[structure], after):
            areas_m2[structure] += area_m2[point]
    for layout in range(len(layouts)):
        own = layouts[layout]
        before, then = (stopped_before, is_open_before), (stopped, is_open)
        now = new_stopped, new_is_open
        _put_shares(own, *before, *then, *now, weights, mean, scale, most, given)
        for member in range(members):
            bases, to_first = place(base[member]), place(first[member])
            to_second, bias = place(second[member]), place(second_bias[member])
            to_last = place(last[member])
            loads[:] = 0.0
            structure = 0
            for row in range(0, rows, ROWS_AT_ONCE):
                # 1. What the pieces say, added up.
                for number in range(row, row + ROWS_AT_ONCE):
                    for index in range(0, length, 2 * lanes):
                        low = high = fill(at, np.float32(0.0))
                        for piece in own:
                            if piece == 0:
                                break
                            if piece > 0:
                                entry = ((member * kept + piece - 1) * rows + number) * length
                                low = low + load(said, entry + index)
                                high = high + load(said, entry + index + lanes)
                            else:
                                entry = ((member * new - piece - 1) * rows + number) * length
                                low = low + load(now_said, entry + index)
                                high = high + load(now_said, entry + index + lanes)
                        store(at, number * inputs + SHARES + index, low)
                        store(at, number * inputs + SHARES + index + lanes, high)
                # 2. Four points through the layers, from memory read once.
                bases_of = row * width, (row + 1) * width, (row + 2) * width, (row + 3) * width
                four_rows(at, row * inputs, inputs, to_first, width, bases, bases_of, to, 0)
                four_rows(to, 0, width, to_second, width, bias, same, beside, 0)
                # 3. L = (sum of A L_i^p / sum of A)^(1 / p): p = 1 is the mean, a large p nearly
                # the largest.
                put_parts(beside, width, to_last, sums)
                for number in range(min(ROWS_AT_ONCE, points - row)):
                    differs = np.float32(0.0)
                    for part in range(PARTS):
                        differs += parts[number, part]
                    point = row + number
                    while structure + 1 < len(starts) and point >= starts[structure + 1]:
                        structure += 1
                    of_point = known[point] + (differs + last_bias[member])
                    loads[structure] += area_m2[point] * exp(power * of_point)
            for structure in range(len(starts)):
                of_structure = log(loads[structure] / areas_m2[structure]) / power
                found[member, layout, structure] = of_structure


def mean_and_spread(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the trimmed geometric mean over the networks, and the spread of logarithms (n,).

    Args:
        logs: Logarithms of loads by each network (members, n); see `network.agreed`.
    """
    mean, spread = np.empty((2, logs.shape[1]))
    _put_mean_and_spread(logs, np.empty(len(logs)), mean, spread)
    return mean, spread


@compiled(nogil=True, error_model="numpy")
def _put_mean_and_spread(logs: Any, own: Any, mean: Any, spread: Any) -> None:
    members, loads = logs.shape
    cut = 1 if members > 2 else 0
    for number in range(loads):
        # 1. In rising order, by insertion; 2. the mean without the highest and the lowest.
        total = 0.0
        for member in range(members):
            value, at = logs[member, number], member
            total += value
            while at and own[at - 1] > value:
                own[at] = own[at - 1]
                at -= 1
            own[at] = value
        middle = 0.0
        for member in range(cut, members - cut):
            middle += own[member]
        mean[number] = exp(middle / (members - 2 * cut))
        # 3. The standard deviation of all.
        total /= members
        squares = 0.0
        for member in range(members):
            squares += (own[member] - total) ** 2
        spread[number] = sqrt(squares / members)


class Memory:
    """What is known of each charge from the second time on, up to a bound; copies begin empty."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, PieceKnowledge] = OrderedDict()
        self._counted: dict[Hashable, int] = {}
        self._bytes = 0
        self._met: OrderedDict[Hashable, None] = OrderedDict()
        self._spare: list[KeptRoom] = []

    def __reduce__(self) -> tuple[type["Memory"], tuple[()]]:
        """Pickle nothing."""
        return Memory, ()

    @contextmanager
    def known(
        self, key: Hashable, make: Callable[[Room], PieceKnowledge]
    ) -> Iterator[tuple[PieceKnowledge, Room]]:
        """Give what is known of a charge, and room for a moment, for as long as the block lasts.

        Args:
            key: The key of the charge.
            make: Makes what is known without any piece, with the room for it.
        """
        room = self._spare.pop() if self._spare else KeptRoom()  # each thread has its own
        if key in self._met or key in self._kept:
            yield self._again(key, make), room
        else:
            self._met[key] = None
            if len(self._met) > _MOST_MET:
                self._met.popitem(last=False)
            yield make(room), room
        if room.nbytes <= _MOST_BYTES:
            self._spare.append(room)

    def _again(self, key: Hashable, make: Callable[[Room], PieceKnowledge]) -> PieceKnowledge:
        """Return what is kept of a charge."""
        known = self._kept.get(key)
        if known is None:
            known = self._kept[key] = make(new_room)
            self._met.pop(key, None)
        self._kept.move_to_end(key)
        # Pieces that it has come to know since are counted now.
        self._bytes += known.nbytes - self._counted.get(key, 0)
        self._counted[key] = known.nbytes
        while self._bytes > _MOST_BYTES and len(self._kept) > 1:
            self._bytes -= self._counted.pop(self._kept.popitem(last=False)[0])
        return known
