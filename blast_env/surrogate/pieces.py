"""What the surrogate knows of a charge and of the pieces of layouts, and the loads behind them.

Layouts have many pieces in common, and what a piece says to a point depends on no other piece. So
each piece is computed once per charge; how much it counts, once per layout.

Most charges and pieces of training are never met again. What is known of them is kept from the
second time on, that of pieces from the fifth; before, it is in room that the next charge takes.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from itertools import accumulate
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.site.blast_site import Charge
from blast_env.surrogate.approach import ApproachArrays, charge_row, check_within_curves
from blast_env.surrogate.layers import SingleArray, whole
from blast_env.surrogate.load_arrays import (
    Bench,
    LoadRequest,
    NetworkLayers,
    Pieces,
    Scales,
    SiteArrays,
)
from blast_env.surrogate.loads import put_charge, put_charges, put_loads, put_pieces
from blast_env.surrogate.rooms import INTEGER, SINGLE, KeptRoom, Numbers, Room, in_lines

Box = tuple[float, ...]
"""Left, bottom, right, top and height of a piece, m."""

_MOST_BYTES: Final = 2**26
_MOST_MET: Final = 4096
"""Charges that count as met before."""

_OFTEN: Final = 4
"""Times that a piece is met without being kept."""


def log_loads_of(
    site: SiteArrays,
    scales: Scales,
    layers: NetworkLayers,
    charges: Sequence[Charge],
    layouts: Sequence[Sequence[Sequence[Box]]],
    room: Room,
) -> FloatArray:
    """Return the logarithms of loads against charges of which nothing is known or kept.

    Args:
        site: The site.
        scales: The scales of inputs.
        layers: The networks.
        charges: The charges.
        layouts: The pieces of each layout against each charge.
        room: Gives arrays for a moment.

    Returns:
        Those of all layouts, in the order of the charges (members, layouts, parts).
    """
    counts = [len(boxes) for of_charge in layouts for boxes in of_charge]
    most = max(sum(map(len, of_charge)) for of_charge in layouts)
    all_boxes = [box for of_charge in layouts for boxes in of_charge for box in boxes]
    asked = LoadRequest(
        np.array([charge_row(charge) for charge in charges]),
        np.array([0, *accumulate(map(len, layouts))]),
        np.array(all_boxes, dtype=np.float64).reshape(-1, 5),
        np.array([0, *accumulate(counts)]),
    )
    points, structures = len(site.points.area_m2), len(site.solids)
    members, _, width = layers.constant.shape
    found = np.empty((members, len(counts), len(site.points.parts)))
    farthest_m = np.empty(len(charges))

    def make(room: Room) -> tuple[ApproachArrays, SingleArray, Pieces, Pieces, Bench, Numbers]:
        return (
            ApproachArrays.in_room(points, structures, room),
            room("base", (members, whole(points), width), SINGLE),
            Pieces.in_room(points, layers, Room(), 0),
            Pieces.in_room(points, layers, room, most),
            Bench.in_room(points, structures, layers, room, most, max(counts)),
            room("numbers", (most + 1,), INTEGER),
        )

    arrays = room.together(("charges", points, structures, members, most, max(counts)), make)
    put_charges(asked, site, scales, layers, *arrays, found, farthest_m)
    for charge, away_m in zip(charges, farthest_m.tolist(), strict=True):
        check_within_curves(away_m, charge)
    return found


class PieceKnowledge:
    """A charge, the structures of a site, and the pieces met so far.

    Args:
        charge: The charge.
        site: The site.
        scales: The scales of inputs.
        layers: The networks.
        room: Gives the arrays of the charge.
    """

    def __init__(
        self,
        charge: Charge,
        site: SiteArrays,
        scales: Scales,
        layers: NetworkLayers,
        room: Room,
    ) -> None:
        self._site, self._scales, self._layers = site, scales, layers
        self._numbers: dict[Box, int] = {}
        self._met: dict[Box, int] = {}
        self._points, structures = len(site.points.area_m2), len(site.solids)
        members, _, width = layers.constant.shape
        *start_m, self._scale_m, fall_m = charge_row(charge)
        self._start_m = np.array(start_m)
        self._own = ApproachArrays.in_room(self._points, structures, room)
        self._base = room("base", (members, whole(self._points), width), SINGLE)
        bench = Bench.in_room(self._points, structures, layers, Room(), 0, 0)
        farthest_m = put_charge(
            *(self._start_m, self._scale_m, fall_m, site, scales, layers),
            *(self._own, self._base, bench),
        )
        check_within_curves(farthest_m, charge)
        self._pieces = Pieces.in_room(self._points, layers, Room(), 0)
        of_piece = Pieces.in_room(self._points, layers, Room(), 1)
        self._bytes = self._base.nbytes + sum([array.nbytes for array in self._own])
        self._bytes_of_piece = sum([array.nbytes for array in of_piece])

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        return self._bytes + len(self._numbers) * self._bytes_of_piece

    def log_loads(self, layouts: Sequence[Sequence[Box]], room: Room) -> FloatArray:
        """Return the logarithm of the load on each structure (members, layouts, parts).

        Args:
            layouts: The pieces of each layout.
            room: Gives the arrays of pieces that are not kept.
        """
        # 1. The pieces that are not kept are computed: numbers of these are below 0.
        numbers, site = self._numbers, self._site
        of_new: dict[Box, int] = {}
        found: Numbers = np.zeros((len(layouts), max(map(len, layouts)) + 1), dtype=np.int32)
        for own, boxes in zip(found, layouts, strict=True):
            own[: len(boxes)] = [
                numbers.get(box) or of_new.setdefault(box, -1 - len(of_new)) for box in boxes
            ]
        new = list(of_new)
        sizes = (self._points, len(site.solids), len(self._base), len(new), found.shape[1])

        def make(room: Room) -> tuple[Bench, Pieces]:
            points, structures, _, pieces, most = sizes
            bench = Bench.in_room(points, structures, self._layers, room, pieces, most)
            return bench, Pieces.in_room(points, self._layers, room, pieces)

        bench, fresh = room.together(("pieces", *sizes), make)
        if new:
            put_pieces(
                *(np.array(new), self._start_m, self._scale_m, site.points, self._scales),
                *(self._layers, self._own, bench, fresh),
            )
        # 2. The loads, and 3. pieces met for the fifth time are kept.
        loads = np.empty((len(self._base), len(layouts), len(site.points.parts)))
        put_loads(
            *(found, self._start_m, self._scale_m, site, self._scales, self._layers),
            *(self._own, self._base),
            *(self._pieces, fresh, bench, 0, loads),
        )
        self._keep(new, fresh)
        return loads

    def _keep(self, boxes: Sequence[Box], fresh: Pieces) -> None:
        """Keep those of the new pieces that have often been met."""
        met, again = self._met, list[int]()
        for number, box in enumerate(boxes):
            times = met[box] = met.get(box, 0) + 1
            if times > _OFTEN:
                again.append(number)
        if not again:
            return
        first, kept = len(self._numbers), self._pieces
        self._pieces = Pieces(
            _with(kept.boxes, fresh.boxes[again], first),
            _with(kept.stopped, fresh.stopped[again], first),
            _with(kept.is_open, fresh.is_open[again], first),
            _with(kept.messages, fresh.messages[:, again], first, axis=1),
            _with(kept.seen, fresh.seen[:, again], first, axis=1),
        )
        for number in again:
            del met[boxes[number]]
            self._numbers[boxes[number]] = len(self._numbers) + 1


_LEAST_ROOM: Final = 32
"""Pieces of a charge for which there is room at first."""


def _with(kept: NDArray[Any], more: NDArray[Any], first: int, axis: int = 0) -> NDArray[Any]:
    """Return an array with more entries from the first free one on; it doubles at least."""
    after = first + more.shape[axis]
    before = (slice(None),) * axis
    if after > kept.shape[axis]:
        most = max(after, 2 * first, _LEAST_ROOM)  # memory that nobody writes to costs nothing
        grown = in_lines((*kept.shape[:axis], most, *kept.shape[axis + 1 :]), kept.dtype)
        grown[(*before, slice(first))] = kept[(*before, slice(first))]
        kept = grown
    kept[(*before, slice(first, after))] = more
    return kept


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

    def known(
        self, key: Hashable, make: Callable[[Room], PieceKnowledge], room: Room
    ) -> PieceKnowledge:
        """Return what is known of a charge.

        Args:
            key: The key of the charge.
            make: Makes what is known without any piece, with the room for it.
            room: Room for a charge that is met for the first time.
        """
        return make(room) if self.is_first(key) else self._again(key, make)

    def take_room(self) -> KeptRoom:
        """Return room for a moment; each thread has its own until `return_room`."""
        return self._spare.pop() if self._spare else KeptRoom()

    def return_room(self, room: KeptRoom) -> None:
        """Keep the room for the next one who asks, up to a size."""
        if room.nbytes <= _MOST_BYTES:
            self._spare.append(room)

    def is_first(self, key: Hashable) -> bool:
        """Return whether a charge is met for the first time, and note it."""
        if key in self._met or key in self._kept:
            return False
        self._met[key] = None
        if len(self._met) > _MOST_MET:
            self._met.popitem(last=False)
        return True

    def _again(self, key: Hashable, make: Callable[[Room], PieceKnowledge]) -> PieceKnowledge:
        """Return what is kept of a charge."""
        known = self._kept.get(key)
        if known is None:
            known = self._kept[key] = make(Room())
            self._met.pop(key, None)
        self._kept.move_to_end(key)
        # Pieces that it has come to know since are counted now.
        self._bytes += known.nbytes - self._counted.get(key, 0)
        self._counted[key] = known.nbytes
        while self._bytes > _MOST_BYTES and len(self._kept) > 1:
            self._bytes -= self._counted.pop(self._kept.popitem(last=False)[0])
        return known
