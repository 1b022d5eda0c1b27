"""The choice of the worst places of a vehicle's charge, in compiled code."""

from math import hypot, inf

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled


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
