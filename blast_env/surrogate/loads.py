"""Loads of layouts by the surrogate's networks, in compiled code.

What a piece says to a point depends on no other piece. Of each place in plan a piece stops the
lowest paths, so that several together stop as many as the one that stops most. Messages add up,
each weighted by how its piece stands to the others of the layout: these weights alone are found for
each layout anew.

Networks of impulses and of peaks pass one after the other as members of one stack.
"""

from math import exp, log, sqrt
from typing import Any, Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray
from blast_env.compilation import compiled
from blast_env.gas.simd import fill, lanes_at, load, own_frame, place, store
from blast_env.gas.state import FUSED
from blast_env.surrogate.approach import FEATURES, ApproachArrays, put_approach
from blast_env.surrogate.layers import (
    PARTS,
    ROWS_AT_ONCE,
    SingleArray,
    four_rows,
    four_sums,
    put_parts,
    put_sums,
    put_two_layers,
    whole,
)
from blast_env.surrogate.load_arrays import (
    BOX,
    Bench,
    LoadRequest,
    NetworkLayers,
    Pieces,
    Scales,
    SiteArrays,
)
from blast_env.surrogate.neighbours import TRAITS, put_traits
from blast_env.surrogate.points import WallPoints
from blast_env.surrogate.relations import (
    IN_PLAN,
    RELATIONS,
    RISING,
    is_above,
    put_relations,
)
from blast_env.surrogate.rooms import (
    Numbers,
)
from blast_env.surrogate.views import put_seen, put_seen_of
from blast_env.surrogate.ways import (
    PLACES,
    SHARES,
    put_shares_of,
    put_stopped_by,
)

LEAST_OVER: Final = -8.0
MOST_OVER: Final = 1.4
"""Bounds on the logarithm of the load at a point over Kingery and Bulmash's.

Points between walls have up to four times their load, those behind walls down to a thousandth: the
bounds leave room for both. Far outside its fit a single network may say anything.
"""


@compiled(nogil=True, error_model="numpy")
def put_charges(
    asked: LoadRequest,
    site: SiteArrays,
    scales: Scales,
    layers: NetworkLayers,
    own: ApproachArrays,
    base: SingleArray,
    none: Pieces,
    room: Pieces,
    bench: Bench,
    numbers: Numbers,
    found: FloatArray,
    farthest_m: FloatArray,
) -> None:
    """Put the logarithms of the loads of layouts against charges (members, layouts, parts).

    Args:
        asked: The charges and the layouts.
        site: The site.
        scales: The scales of inputs.
        layers: The networks.
        own: Room for what is known of a charge.
        base: The same.
        none: No pieces.
        room: Room for the pieces of the layouts of a charge.
        bench: Room for a moment.
        numbers: Room for the numbers of the pieces of a layout (most + 1,).
        found: The logarithms of loads.
        farthest_m: Largest distance of a point from each charge (charges,).
    """
    members, most, rows, length = room.messages.shape
    sight = room.seen.shape[3]
    flat = room.messages.reshape(members * most * rows * length)
    flat_seen = room.seen.reshape(members * most * rows * sight)
    for charge in range(len(asked.charges)):
        row = asked.charges[charge]
        start_m, scale_m, fall_m = row[:3], row[3], row[4]
        farthest_m[charge] = put_charge(
            start_m, scale_m, fall_m, site, scales, layers, own, base, bench
        )
        # The pieces of all its layouts at once, in the order of the layouts.
        before, after = asked.layouts[charge], asked.layouts[charge + 1]
        first, last = asked.pieces[before], asked.pieces[after]
        count = last - first
        messages = flat[: members * count * rows * length].reshape((members, count, rows, length))
        seen = flat_seen[: members * count * rows * sight].reshape((members, count, rows, sight))
        of_pieces = room.boxes[:count], room.stopped[:count], room.is_open[:count]
        pieces = Pieces(*of_pieces, messages, seen)
        boxes = asked.boxes[first:last]
        put_pieces(boxes, start_m, scale_m, site.points, scales, layers, own, bench, pieces)
        for layout in range(before, after):
            number = 0
            for piece in range(asked.pieces[layout], asked.pieces[layout + 1]):
                numbers[number] = first - piece - 1
                number += 1
            numbers[number] = 0
            put_loads(
                numbers.reshape((1, len(numbers))),
                start_m,
                scale_m,
                site,
                scales,
                layers,
                own,
                base,
                none,
                pieces,
                bench,
                layout,
                found,
            )


@compiled(nogil=True, error_model="numpy", inline="always")
def put_charge(
    start_m: FloatArray,
    scale_m: float,
    fall_m: float,
    site: SiteArrays,
    scales: Scales,
    layers: NetworkLayers,
    own: ApproachArrays,
    base: SingleArray,
    bench: Bench,
) -> float:
    """Put what is known of a charge without any piece; return the largest distance of a point.

    Args:
        start_m: Position of the charge (3,).
        scale_m: Scaling length.
        fall_m: Longest decay length of the weight of a detour.
        site: The site.
        scales: The scales of inputs.
        layers: The networks.
        own: What no layout changes.
        base: Sums of the first layer over what no layout changes (members, rows, width).
        bench: Room for a moment.
    """
    solids = site.solids
    farthest_m: float = put_approach(
        start_m, scale_m, fall_m, site.points, solids, site.curves, own
    )
    said = bench.of_structures
    sending = layers.send, layers.send_bias, layers.message, layers.message_bias
    _put_messages(own.relations, site.points, scales, sending, bench, said)
    seen, given = bench.of_views, bench.constants
    bench.view_room.raster[:] = 0.0
    put_seen(start_m, site.points, scale_m, solids, layers.structure_view, bench.view_room, seen, 0)
    _put_base(own.features, scales, said, seen, layers.constant, layers.first_bias, given, base)
    return farthest_m


@compiled(nogil=True, error_model="numpy", inline="always")
def put_pieces(
    boxes: FloatArray,
    start_m: FloatArray,
    scale_m: float,
    points: WallPoints,
    scales: Scales,
    layers: NetworkLayers,
    own: ApproachArrays,
    bench: Bench,
    found: Pieces,
) -> None:
    """Put what is known of pieces, each of which depends on no other; see `put_charge`."""
    for piece in range(len(boxes)):
        for side in range(BOX):
            found.boxes[piece, side] = boxes[piece, side]
    put_stopped_by(
        start_m,
        points.points_m,
        own.by_m,
        own.by_height_m,
        boxes,
        own.stopped,
        own.is_straight_open,
        found.stopped,
        found.is_open,
    )
    relations = bench.relations[: len(boxes)]
    put_relations(start_m, points.points_m, points.outward, scale_m, boxes, relations)
    first = layers.piece_send, layers.piece_send_bias
    sending = *first, layers.piece_message, layers.piece_message_bias
    _put_messages(relations, points, scales, sending, bench, found.messages)
    bench.view_room.raster[:] = 0.0
    views = layers.piece_view
    for piece in range(len(boxes)):
        box = boxes[piece : piece + 1]
        put_seen(start_m, points, scale_m, box, views, bench.view_room, found.seen, piece)


@njit(error_model="numpy", forceinline=True)
def _scaled(value: float, scales: Scales, index: int) -> float:
    """Return an input, scaled and bounded, by its index among all."""
    own = (value - scales.mean[index]) * scales.by[index]
    return float(min(max(own, -scales.most), scales.most))


@njit(error_model="numpy")
def _put_messages(
    relations: FloatArray,
    points: WallPoints,
    scales: Scales,
    sending: tuple[SingleArray, SingleArray, SingleArray, SingleArray],
    bench: Bench,
    found: SingleArray,
) -> None:
    """Put the messages of solids (members, solids, rows, length); the last point fills up rows."""
    members, solids, rows, length = found.shape
    send, send_bias, message, message_bias = sending
    # The first layer is linear before its bend, so that sums over relations in plan are made once
    # for all points one above the other.
    count = _put_related(relations, points, scales, rows, bench)
    of_columns, width = whole(count), send.shape[2]
    in_plan = bench.in_plan[: of_columns * len(IN_PLAN)].reshape((of_columns, len(IN_PLAN)))
    rising = bench.rising[: solids * rows * len(RISING)].reshape((1, solids * rows, len(RISING)))
    sums = bench.sums[: of_columns * width].reshape((1, of_columns, width))
    said = found.reshape((members, solids * rows, length))
    for member in range(members):
        own = slice(member, member + 1)
        put_sums(in_plan, send[own], send_bias[own], sums)
        put_two_layers(
            rising,
            send[own],
            sums,
            bench.columns,
            message[own],
            message_bias[own],
            bench.middle,
            said[own],
        )


@njit(error_model="numpy")
def _put_related(
    relations: FloatArray, points: WallPoints, scales: Scales, rows: int, bench: Bench
) -> int:
    """Put the scaled relations of solids; return the number of columns of points, by each solid."""
    columns = number = in_plan = rising = 0
    for solid in range(len(relations)):
        for row in range(rows):
            point = min(row, relations.shape[1] - 1)
            own = relations[solid, point]
            if row == point and not is_above(points.points_m, points.outward, point):
                for index in IN_PLAN:
                    bench.in_plan[in_plan] = _scaled(own[index], scales, FEATURES + index)
                    in_plan += 1
                columns += 1
            for index in RISING:
                bench.rising[rising] = _scaled(own[index], scales, FEATURES + index)
                rising += 1
            bench.columns[number] = columns - 1
            number += 1
    for index in range(in_plan, whole(columns) * len(IN_PLAN)):  # up to a whole number of rows
        bench.in_plan[index] = 0.0
    return columns


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def _put_base(
    features: Any,
    scales: Scales,
    messages: Any,
    seen: Any,
    weights: Any,
    bias: Any,
    given: Any,
    base: Any,
) -> None:
    """Put the sums of the first layer; see `put_charge`."""
    own_frame()
    members, rows, width = base.shape
    solids, length, sight = messages.shape[1], messages.shape[3], seen.shape[3]
    constant, points, inputs = FEATURES - SHARES, len(features), given.shape[1]
    # The first layer is linear before its bend, so that the sums over inputs that no layout changes
    # are made once: W [c, s, m] = W_c c + W_s s + W_m m.
    to, at, said = place(base), place(given), place(messages)
    lanes, same = lanes_at(to), (0, 0, 0, 0)
    for row in range(rows):
        for index in range(constant):
            given[row, index] = _scaled(features[min(row, points - 1), index], scales, index)
    for member in range(members):
        for row in range(rows):
            for index in range(0, length, lanes):
                heard = fill(at, np.float32(0.0))
                for solid in range(solids):
                    entry = ((member * solids + solid) * rows + row) * length
                    heard = heard + load(said, entry + index)
                store(at, row * inputs + constant + index, heard)
            for index in range(sight):
                given[row, constant + length + index] = seen[member, 0, row, index]
        weight, biases = place(weights[member]), place(bias[member])
        for row in range(0, rows, ROWS_AT_ONCE):
            end = (member * rows + row) * width
            four_sums(at, row * inputs, inputs, weight, width, biases, same, to, end)


@njit(error_model="numpy")
def _put_shares(
    own: Any,
    charge: ApproachArrays,
    kept: Pieces,
    new: Pieces,
    scales: Scales,
    inputs: int,
    given: Any,
) -> None:
    """Put the scaled open shares of each row behind the pieces of a layout, before its messages."""
    points, rows = len(charge.stopped), whole(len(charge.stopped))
    places, shares = points * PLACES, np.empty(SHARES)
    below, straight = np.empty(places, dtype=np.uint8), np.empty(points, dtype=np.bool_)
    by_none = charge.stopped.reshape(places)
    for number in range(places):
        below[number] = by_none[number]
    for point in range(points):
        straight[point] = charge.is_straight_open[point]
    # 1. Several pieces stop as many detours by a place as the one that stops most.
    for piece in own:
        if piece == 0:
            break
        of, own_number = (kept, piece - 1) if piece > 0 else (new, -piece - 1)
        by_piece, is_open = of.stopped[own_number].reshape(places), of.is_open[own_number]
        for number in range(places):
            below[number] = max(below[number], by_piece[number])
        for point in range(points):
            straight[point] = straight[point] and is_open[point]
    # 2. The shares that are left, and 3. their scaled and bounded values.
    for point in range(points):
        first = point * PLACES
        own_below = below[first : first + PLACES]
        put_shares_of(own_below, straight[point], charge.weights[point], shares)
        for share in range(SHARES):
            index = FEATURES - SHARES + share
            given[point * inputs + share] = _scaled(shares[share], scales, index)
    for row in range(points, rows):
        for share in range(SHARES):
            given[row * inputs + share] = given[(points - 1) * inputs + share]


@njit(error_model="numpy")
def _put_weights(
    own: Any,
    start_m: FloatArray,
    scale_m: float,
    solids: FloatArray,
    kept: Pieces,
    new: Pieces,
    scales: Scales,
    layers: NetworkLayers,
    bench: Bench,
) -> int:
    """Put the weights of the messages of the pieces of a layout; return the number of rows."""
    # 1. Where they stand, and their traits.
    count = 0
    for piece in own:
        if piece == 0:
            break
        for side in range(BOX):
            if piece > 0:
                bench.boxes[count, side] = kept.boxes[piece - 1, side]
            else:
                bench.boxes[count, side] = new.boxes[-piece - 1, side]
        count += 1
    put_traits(start_m, scale_m, solids, bench.boxes, count, bench.traits)
    # 2. Scaled and bounded; the last piece fills up rows. 3. Their weights, by each member.
    rows, number = whole(count), 0
    for row in range(rows):
        for trait in range(TRAITS):
            value = bench.traits[min(row, count - 1), trait]
            bench.told[number] = _scaled(value, scales, FEATURES + RELATIONS + trait)
            number += 1
        bench.columns[row] = 0
    members, width, length = layers.weight.shape
    put_two_layers(
        bench.told[:number].reshape((1, rows, TRAITS)),
        layers.trait,
        layers.trait_bias.reshape((members, 1, width)),
        bench.columns,
        layers.weight,
        layers.weight_bias,
        bench.middle,
        bench.weights[: members * rows * length].reshape((members, rows, length)),
    )
    return rows


@njit(error_model="numpy")
def _areas_m2(starts: Any, area_m2: FloatArray) -> FloatArray:
    """Return the area of the points of each part."""
    areas_m2 = np.zeros(len(starts))
    for part in range(len(starts)):
        after = starts[part + 1] if part + 1 < len(starts) else len(area_m2)
        for point in range(starts[part], after):
            areas_m2[part] += area_m2[point]
    return areas_m2


@njit(error_model="numpy", fastmath=FUSED)
def _put_heard(
    own: Any,
    member: int,
    first_row: int,
    inputs: int,
    kept: Any,
    new: Any,
    bench: Bench,
    first_weight: int,
) -> None:
    """Put what the pieces of a layout say to a few points, weighted and added up.

    Args:
        own: The layout; see `put_loads`.
        member: Number of the network.
        first_row: The first point.
        inputs: Numbers before a point's are over and the next one's begin.
        kept: Messages of the pieces that are kept (members, pieces, rows, length).
        new: Messages of the new ones.
        bench: Room for a moment, with the weights of the messages.
        first_weight: Where those of the member begin.
    """
    _, of_kept, rows, length = kept.shape
    of_new = new.shape[1]
    at, said, now_said = place(bench.given), place(kept), place(new)
    weights, lanes = place(bench.weights), lanes_at(at)
    for number in range(first_row, first_row + ROWS_AT_ONCE):
        for index in range(0, length, 2 * lanes):
            low = high = fill(at, np.float32(0.0))
            above, by = min(index + lanes, length - lanes), first_weight
            for piece in own:
                if piece == 0:
                    break
                by_low, by_high = load(weights, by + index), load(weights, by + above)
                by += length
                if piece > 0:
                    entry = ((member * of_kept + piece - 1) * rows + number) * length
                    low = load(said, entry + index) * by_low + low
                    high = load(said, entry + above) * by_high + high
                else:
                    entry = ((member * of_new - piece - 1) * rows + number) * length
                    low = load(now_said, entry + index) * by_low + low
                    high = load(now_said, entry + above) * by_high + high
            store(at, number * inputs + SHARES + index, low)
            store(at, number * inputs + SHARES + above, high)


@njit(error_model="numpy")
def _add_loads(
    parts: SingleArray,
    bias: float,
    known: FloatArray,
    power: float,
    points: WallPoints,
    first_row: int,
    owner: int,
    loads: FloatArray,
) -> int:
    """Add the loads at a few points to those of their parts, by area; return the last part.

    Args:
        parts: Parts of the sums of the last layer (4, PARTS).
        bias: Its bias.
        known: Logarithms of Kingery and Bulmash's load (points,).
        power: Exponent of the mean.
        points: The points.
        first_row: The first of them.
        owner: Its part, or one before.
        loads: Sums of loads to the power, times areas (parts,).
    """
    starts, area_m2 = points.parts, points.area_m2
    for number in range(min(ROWS_AT_ONCE, len(area_m2) - first_row)):
        differs = np.float32(0.0)
        for part in range(PARTS):
            differs += parts[number, part]
        point = first_row + number
        while owner + 1 < len(starts) and point >= starts[owner + 1]:
            owner += 1
        over = min(max(differs + bias, LEAST_OVER), MOST_OVER)
        loads[owner] += area_m2[point] * exp(power * (known[point] + over))
    return owner


@compiled(nogil=True, error_model="numpy", fastmath=FUSED)
def put_loads(
    layouts: Any,
    start_m: FloatArray,
    scale_m: float,
    site: SiteArrays,
    scales: Scales,
    layers: NetworkLayers,
    charge: ApproachArrays,
    base: Any,
    kept: Pieces,
    new: Pieces,
    bench: Bench,
    first_layout: int,
    found: Any,
) -> None:
    """Put the logarithms of the loads of layouts against a charge (members, layouts, parts).

    `first_layout` is where the first of them is in `found`. Pieces are numbered from 1 if they are
    kept, and from -1 down if they are new; 0 ends a layout.
    """
    own_frame()
    starts, area_m2 = site.points.parts, site.points.area_m2
    members, rows, width = base.shape
    given = bench.given
    length, sight = new.messages.shape[3], new.seen.shape[3]
    at, to, beside = place(given), place(bench.between), place(bench.beyond)
    sums, weight_rows, same = place(bench.parts), 0, (0, 0, 0, 0)
    beyond = layers.second.shape[2]
    loads = np.empty(len(starts))
    areas_m2 = _areas_m2(starts, area_m2)
    for layout in range(len(layouts)):
        own = layouts[layout]
        # Nothing is said without a piece: the sums over messages are left out.
        is_bare = own[0] == 0
        inputs = SHARES if is_bare else SHARES + length + sight
        _put_shares(own, charge, kept, new, scales, inputs, given)
        if not is_bare:
            weight_rows = _put_weights(
                own, start_m, scale_m, site.solids, kept, new, scales, layers, bench
            )
        for member in range(members):
            bases, to_first = place(base[member]), place(layers.first[member])
            to_second, second = place(layers.second[member]), place(layers.second_bias[member])
            to_last = place(layers.last[member])
            power, known = layers.powers[member], charge.logs[layers.kinds[member]]
            loads[:] = 0.0
            owner = 0
            for row in range(0, rows, ROWS_AT_ONCE):
                # 1. What the pieces say, weighted and added up.
                if not is_bare:
                    by = member * weight_rows * length
                    _put_heard(own, member, row, inputs, kept.messages, new.messages, bench, by)
                    seen = kept.seen, new.seen
                    put_seen_of(site.points, own, member, row, inputs, *seen, given)
                # 2. Four points through the layers, from memory read once.
                bases_of = row * width, (row + 1) * width, (row + 2) * width, (row + 3) * width
                four_rows(at, row * inputs, inputs, to_first, width, bases, bases_of, to, 0)
                four_rows(to, 0, width, to_second, beyond, second, same, beside, 0)
                # 3. L = (sum of A L_i^p / sum of A)^(1 / p): p = 1 is the mean, a large p nearly
                # the largest.
                put_parts(beside, beyond, to_last, sums)
                bias = layers.last_bias[member]
                owner = _add_loads(bench.parts, bias, known, power, site.points, row, owner, loads)
            for owner in range(len(starts)):
                of_owner = log(loads[owner] / areas_m2[owner]) / power
                found[member, first_layout + layout, owner] = of_owner


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
