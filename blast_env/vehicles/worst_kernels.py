"""The choice of the worst places of a vehicle's charge, in compiled code."""

from math import hypot, inf, sqrt
from typing import Any, Final

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.vehicles.reach_kernels import reached_parts, with_edges
from blast_env.vehicles.vehicle import OTHER, SOLID, STOPS

_NEAR: Final = 1e-9
"""Relative error far above that of a squared distance: nearer to a bound, `hypot` decides."""


@compiled(nogil=True, error_model="numpy")
def chosen_places(
    places_m: FloatArray,
    distances_m: FloatArray,
    middles_m: FloatArray,
    most: int,
    least_apart_m: float,
    equal_m: float,
) -> IntArray:
    """Return the numbers of the worst places, the worst first.

    Args:
        places_m: The possible places (places, 2).
        distances_m: Their distances from each loaded wall (walls, places).
        middles_m: The middle of each wall (walls, 2).
        most: Most places to choose.
        least_apart_m: Least distance between them.
        equal_m: Tolerance within which distances are equal.
    """
    walls, count = distances_m.shape
    nearest_m = np.full(count, inf)
    for wall in range(walls):
        for place in range(count):
            nearest_m[place] = min(nearest_m[place], distances_m[wall, place])
    left = np.ones(count, dtype=np.bool_)
    measure_m = np.empty(count)
    chosen = np.empty(most, dtype=np.int64)
    for rank in range(most):
        # 1. The places that are left, as near as the nearest of them.
        best = _least(left, nearest_m, equal_m)
        if not best.any():
            return chosen[:rank]
        # 2. Of these, the nearest to the middle of its nearest wall; then the leftmost; then the
        #    lowest.
        for place in range(count):
            if not best[place]:
                continue
            measure_m[place] = inf
            for wall in range(walls):
                if distances_m[wall, place] <= nearest_m[place] + equal_m:
                    aside_m = hypot(
                        places_m[place, 0] - middles_m[wall, 0],
                        places_m[place, 1] - middles_m[wall, 1],
                    )
                    measure_m[place] = min(measure_m[place], aside_m)
        best = _least(best, measure_m, equal_m)
        for axis in range(2):
            best = _least(best, places_m[:, axis], equal_m)
        worst = np.flatnonzero(best)[0]
        chosen[rank] = worst
        # 3. The next one is apart from all before it.
        for place in range(count):
            if left[place]:
                apart_m = hypot(
                    places_m[place, 0] - places_m[worst, 0], places_m[place, 1] - places_m[worst, 1]
                )
                left[place] = apart_m >= least_apart_m - equal_m
    return chosen


@njit(error_model="numpy")
def _least(among: BoolArray, values: FloatArray, equal: float) -> BoolArray:
    """Return which of some places have the least value, within a tolerance."""
    least = inf
    for place in range(len(values)):
        if among[place]:
            least = min(least, values[place])
    found = np.zeros(len(values), dtype=np.bool_)
    for place in range(len(values)):
        found[place] = among[place] and values[place] <= least + equal
    return found


@compiled(nogil=True, error_model="numpy")
def worst_against(
    always: IntArray,
    never: IntArray,
    starts: IntArray,
    half: int,
    more_m: FloatArray,
    count: int,
    cuts_x: IntArray,
    places_x: IntArray,
    cuts_y: IntArray,
    places_y: IntArray,
    per_m: float,
    walls_m: FloatArray,
    middles_m: FloatArray,
    most: int,
    least_apart_m: float,
    equal_m: float,
) -> Any:
    """Return the worst places of a charge against obstacles (places, 2), and their distances.

    They are those that `chosen_places` finds among the places of the whole reach.

    Args:
        always: Grown obstacles of the empty site that stop it (boxes, 4).
        never: Those that it drives over (boxes, 4).
        starts: See `reached_parts`.
        half: Half of the width of the vehicle.
        more_m: Further obstacles, m (boxes, 4).
        count: Number of those that stop it, which are the first.
        cuts_x: Cuts along x on the empty site; see `plane_of`.
        places_x: Places along x on the empty site.
        cuts_y: The same along y.
        places_y: The same along y.
        per_m: Units in a metre.
        walls_m: Left, bottom, right and top of each loaded wall, at least one (walls, 4).
        middles_m: See `chosen_places`.
        most: See `chosen_places`.
        least_apart_m: See `chosen_places`.
        equal_m: See `chosen_places`.
    """
    more = np.empty(more_m.shape, dtype=np.int64)
    for box in range(len(more)):
        for side in range(4):  # as `grown_steps`
            more[box, side] = round(more_m[box, side] * per_m) + (half if side > 1 else -half)
    x, lattice_x = with_edges(cuts_x, more, 0), with_edges(places_x, more, 0)
    y, lattice_y = with_edges(cuts_y, more, 1), with_edges(places_y, more, 1)
    closed, solid = _joined(always, more, 0, count), _joined(never, more, count, len(more))
    _, reached, clear = reached_parts(x, y, closed, solid, starts)
    # 1. All places, row by row, and the squares of their distances from the nearest wall.
    free_m, nearest_m2 = _free_places(
        lattice_x / per_m,
        lattice_y / per_m,
        _parts(x, lattice_x),
        _parts(y, lattice_y),
        reached & clear,
        walls_m,
    )
    # 2. The worst of those that are left, until there are enough or none is left. What is beyond
    #    all doubt by the squares takes no part in the exact comparison.
    chosen_m, distances_m = np.empty((most, 2)), np.empty(most)
    for rank in range(most):
        if rank:
            _leave_apart(free_m, chosen_m[rank - 1], least_apart_m - equal_m, nearest_m2)
        least_m2 = _least_of(nearest_m2)
        if least_m2 == inf:
            return chosen_m[:rank], distances_m[:rank]
        bound_m2 = (sqrt(least_m2) * (1.0 + _NEAR) + 2.0 * equal_m) ** 2
        near_m = _up_to(free_m, nearest_m2, bound_m2)
        worst = chosen_places(
            near_m, _distances_m(walls_m, near_m), middles_m, np.int64(1), least_apart_m, equal_m
        )[0]
        chosen_m[rank, 0], chosen_m[rank, 1] = near_m[worst, 0], near_m[worst, 1]
        distances_m[rank] = _distances_m(walls_m, near_m[worst : worst + 1]).min()
    return chosen_m, distances_m


@compiled(nogil=True, error_model="numpy")
def put_worst(
    boxes_m: FloatArray,
    kinds: Any,
    layouts: IntArray,
    counts: IntArray,
    always: IntArray,
    never: IntArray,
    starts: IntArray,
    half: int,
    cuts_x: IntArray,
    places_x: IntArray,
    cuts_y: IntArray,
    places_y: IntArray,
    per_m: float,
    walls_m: FloatArray,
    middles_m: FloatArray,
    least_apart_m: float,
    equal_m: float,
    places_m: FloatArray,
    distances_m: FloatArray,
    found: IntArray,
) -> None:
    """Put the worst places behind each layout, and their number; see `PlainGround.worst_of_many`.

    Args:
        boxes_m: See `PlainGround.worst_of_many`.
        kinds: The same.
        layouts: The same.
        counts: The same.
        always: See `worst_against`, as the further ones up to `equal_m`.
        never: The same.
        starts: The same.
        half: The same.
        cuts_x: The same.
        places_x: The same.
        cuts_y: The same.
        places_y: The same.
        per_m: The same.
        walls_m: The same.
        middles_m: The same.
        least_apart_m: The same.
        equal_m: The same.
        places_m: The places, as many as there is room for (layouts, most, 2).
        distances_m: Their distances (layouts, most).
        found: How many there are; 0 where an element has its own rules (layouts,).
    """
    for layout in range(len(layouts)):
        more_m = np.empty((counts[layout], 4))
        after = stops = np.int64(0)  # a literal would be compiled for as well
        is_plain = True
        for kind in (STOPS, SOLID):
            for place in range(counts[layout]):
                number = layouts[layout, place]
                is_plain = is_plain and kinds[number] != OTHER
                if kinds[number] == kind:
                    for side in range(4):
                        more_m[after, side] = boxes_m[number, side]
                    after += 1
            stops = after if kind == STOPS else stops
        found[layout] = 0
        if is_plain:
            chosen_m, of_chosen_m = worst_against(
                always,
                never,
                starts,
                half,
                more_m[:after],
                stops,
                cuts_x,
                places_x,
                cuts_y,
                places_y,
                per_m,
                walls_m,
                middles_m,
                distances_m.shape[1],
                least_apart_m,
                equal_m,
            )
            found[layout] = len(of_chosen_m)
            for rank in range(len(of_chosen_m)):
                distances_m[layout, rank] = of_chosen_m[rank]
                places_m[layout, rank, 0] = chosen_m[rank, 0]
                places_m[layout, rank, 1] = chosen_m[rank, 1]


@njit(error_model="numpy")
def _free_places(
    x_m: FloatArray,
    y_m: FloatArray,
    of_column: IntArray,
    of_row: IntArray,
    is_free: BoolArray,
    walls_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return where a charge may go off (places, 2), and the squares of the distances (places,).

    Args:
        x_m: Places along x.
        y_m: Places along y.
        of_column: The part of the plane that each place along x is in.
        of_row: The same along y.
        is_free: Whether a charge may go off in each part.
        walls_m: The walls, of which the nearest counts (walls, 4).
    """
    along_x, along_y = _along(x_m, walls_m, 0), _along(y_m, walls_m, 1)
    free_m, nearest_m2 = np.empty((len(x_m) * len(y_m), 2)), np.empty(len(x_m) * len(y_m))
    count = 0
    for row in range(len(y_m)):
        if not is_free[of_row[row]].any():
            continue
        for column in range(len(x_m)):
            if is_free[of_row[row], of_column[column]]:
                least_m2 = inf
                for wall in range(len(walls_m)):
                    least_m2 = min(least_m2, along_x[column, wall] + along_y[row, wall])
                free_m[count, 0], free_m[count, 1] = x_m[column], y_m[row]
                nearest_m2[count] = least_m2
                count += 1
    return free_m[:count], nearest_m2[:count]


@njit(error_model="numpy")
def _along(places_m: FloatArray, walls_m: FloatArray, axis: int) -> FloatArray:
    """Return the squares of distances from walls along an axis (places, walls)."""
    found = np.empty((len(places_m), len(walls_m)))
    for wall in range(len(walls_m)):
        low_m, high_m = walls_m[wall, axis], walls_m[wall, axis + 2]
        for place in range(len(places_m)):
            off_m = max(0.0, low_m - places_m[place], places_m[place] - high_m)
            found[place, wall] = off_m * off_m
    return found


@njit(error_model="numpy")
def _leave_apart(
    free_m: FloatArray, chosen_m: FloatArray, apart_m: float, nearest_m2: FloatArray
) -> None:
    """Leave only the places apart from a chosen one: others are at an infinite distance."""
    bound_m2 = apart_m * apart_m * (1.0 + _NEAR)
    for place in range(len(free_m)):
        x_m, y_m = free_m[place, 0] - chosen_m[0], free_m[place, 1] - chosen_m[1]
        if x_m * x_m + y_m * y_m <= bound_m2 and hypot(x_m, y_m) < apart_m:
            nearest_m2[place] = inf


@njit(error_model="numpy")
def _joined(boxes: IntArray, more: IntArray, first: int, after: int) -> IntArray:
    """Return boxes and some of others; slices would compile NumPy's messages too."""
    found = np.empty((len(boxes) + after - first, 4), dtype=np.int64)
    for box in range(len(found)):
        for side in range(4):
            own = boxes[box, side] if box < len(boxes) else more[first + box - len(boxes), side]
            found[box, side] = own
    return found


@njit(error_model="numpy")
def _least_of(values: FloatArray) -> float:
    least = inf
    for number in range(len(values)):
        least = min(least, values[number])
    return least


@njit(error_model="numpy")
def _up_to(free_m: FloatArray, nearest_m2: FloatArray, bound_m2: float) -> FloatArray:
    """Return the places up to a square of the distance, in their order (places, 2)."""
    found = np.empty((len(free_m), 2))
    count = 0
    for place in range(len(free_m)):
        if nearest_m2[place] <= bound_m2:
            found[count, 0], found[count, 1] = free_m[place, 0], free_m[place, 1]
            count += 1
    return found[:count]


@njit(error_model="numpy")
def _parts(cuts: IntArray, values: IntArray) -> IntArray:
    """Return the part of an axis in which each value lies: at a cut, or between two."""
    parts = np.empty(len(values), dtype=np.int64)
    cut = 0  # the last one that is not beyond the value
    for number in range(len(values)):
        while cut + 1 < len(cuts) and cuts[cut + 1] <= values[number]:
            cut += 1
        parts[number] = 2 * cut + (values[number] > cuts[cut])
    return parts


@njit(error_model="numpy")
def _distances_m(walls_m: FloatArray, places_m: FloatArray) -> FloatArray:
    """Return the distances of places from walls (walls, places), as `distances_between_m`."""
    found = np.empty((len(walls_m), len(places_m)))
    for wall in range(len(walls_m)):
        left, bottom, right, top = walls_m[wall]
        for place in range(len(places_m)):
            x_m, y_m = places_m[place]
            along_x = max(0.0, left - x_m, x_m - right)
            along_y = max(0.0, bottom - y_m, y_m - top)
            found[wall, place] = hypot(along_x, along_y)
    return found
