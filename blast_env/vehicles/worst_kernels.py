"""The choice of the worst places of a vehicle's charge, in compiled code."""

from math import hypot, inf, sqrt
from typing import Any, Final

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.vehicles.reach_kernels import plane_of, reached_parts

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
    closed: IntArray,
    solid: IntArray,
    starts: IntArray,
    level: IntArray,
    half: int,
    ends: tuple[int, int],
    steps: tuple[int, int],
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
        closed: See `reached_parts`.
        solid: See `reached_parts`.
        starts: See `reached_parts`.
        level: See `plane_of`.
        half: See `plane_of`.
        ends: Width and height of the site.
        steps: Spacing of regular places along x and y.
        per_m: Units in a metre.
        walls_m: Left, bottom, right and top of each loaded wall, at least one (walls, 4).
        middles_m: See `chosen_places`.
        most: See `chosen_places`.
        least_apart_m: See `chosen_places`.
        equal_m: See `chosen_places`.
    """
    boxes = np.concatenate((closed, solid, starts))
    x, lattice_x = plane_of(boxes, level, half, ends[0], steps[0], 0)
    y, lattice_y = plane_of(boxes, level, half, ends[1], steps[1], 1)
    _, reached, clear = reached_parts(x, y, closed, solid, starts)
    # 1. The places, with the squares of their distances from the nearest wall.
    is_open = reached & clear
    places_m = _open_places(x, y, lattice_x, lattice_y, is_open, per_m)
    count = len(places_m)
    nearest_m2 = np.full(count, inf)
    for wall in range(len(walls_m)):
        left, bottom, right, top = walls_m[wall]
        for place in range(count):
            along_x = max(0.0, left - places_m[place, 0], places_m[place, 0] - right)
            along_y = max(0.0, bottom - places_m[place, 1], places_m[place, 1] - top)
            nearest_m2[place] = min(nearest_m2[place], along_x * along_x + along_y * along_y)
    # 2. The worst of those that are left, until there are enough or none is left. What is beyond
    #    all doubt by the squares takes no part in the exact comparison.
    few = np.empty(count, dtype=np.int64)
    chosen_m, distances_m = np.empty((most, 2)), np.empty(most)
    for rank in range(most):
        least_m2 = nearest_m2[:count].min() if count else inf
        if least_m2 == inf:
            return chosen_m[:rank], distances_m[:rank]
        bound_m2 = (sqrt(least_m2) * (1.0 + _NEAR) + 2.0 * equal_m) ** 2
        among = 0
        for place in range(count):
            if nearest_m2[place] <= bound_m2:
                few[among] = place
                among += 1
        near_m = places_m[few[:among]]
        worst = chosen_places(
            near_m, _distances_m(walls_m, near_m), middles_m, 1, least_apart_m, equal_m
        )[0]
        chosen_m[rank] = near_m[worst]
        distances_m[rank] = _distances_m(walls_m, near_m[worst : worst + 1]).min()
        x_m, y_m, apart_m = near_m[worst, 0], near_m[worst, 1], least_apart_m - equal_m
        for place in range(count):
            along_x, along_y = places_m[place, 0] - x_m, places_m[place, 1] - y_m
            apart_m2 = along_x * along_x + along_y * along_y
            if apart_m2 <= apart_m * apart_m * (1.0 + _NEAR) and hypot(along_x, along_y) < apart_m:
                nearest_m2[place] = inf
    return chosen_m, distances_m


@njit(error_model="numpy")
def _open_places(
    x: IntArray,
    y: IntArray,
    lattice_x: IntArray,
    lattice_y: IntArray,
    is_open: BoolArray,
    per_m: float,
) -> FloatArray:
    """Return the points of a lattice that lie in open parts of a plane, row by row (places, 2)."""
    of_column, of_row = _parts(x, lattice_x), _parts(y, lattice_y)
    places_m = np.empty((len(lattice_x) * len(lattice_y), 2))
    count = 0
    for row in range(len(lattice_y)):
        for column in range(len(lattice_x)):
            if is_open[of_row[row], of_column[column]]:
                places_m[count, 0] = lattice_x[column] / per_m
                places_m[count, 1] = lattice_y[row] / per_m
                count += 1
    return places_m[:count]


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
