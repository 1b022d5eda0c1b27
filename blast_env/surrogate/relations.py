"""Positions of solids relative to a charge and a point on a wall.

Paths describe the open space between charge and point (`blast_env.surrogate.ways`).
Relations add the solids beside and behind the charge, which reflect the wave, the distance of each
solid and its extent beyond the detours. The axes follow the straight path in plan: ahead is from
the charge to the point, and aside is the side that the wall of the point faces, so that a mirrored
site has the same numbers. Lengths follow Hopkinson-Cranz scaling.
"""

from math import log, sqrt
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray
from blast_env.compilation import compiled

RELATIONS: Final = 15
"""Number of relations per solid and point."""

_LEAST_SCALED: Final = 0.05
"""Offset of scaled distances to a solid before their logarithm, m/kg^(1/3)."""

_MOST: Final = 6.0
"""Bound on the magnitude of all relations."""


def solid_relations(
    start_m: FloatArray,
    points_m: FloatArray,
    outward: FloatArray,
    scale_m: float,
    solids: FloatArray,
) -> FloatArray:
    """Return the relations of each solid to each point (solids, points, RELATIONS).

    In order: distance ahead of its centre, as a share of the path; scaled distances ahead of the
    charge and back from the point; distance aside of its centre; half its extent ahead and aside;
    its height; its height above the straight path; logarithms of its distances from charge and
    point; the detours round its far and near end, and over its top; the gap between it and the
    path; whether it crosses the path in plan.

    Args:
        start_m: Position of the charge (3,).
        points_m: The points (points, 3).
        outward: Outward normals of their walls, in plan (points, 2).
        scale_m: Scaling length: the cube root of the charge's mass in kg.
        solids: Left, bottom, right, top and height of each solid, m (solids, 5).
    """
    found = np.empty((len(solids), len(points_m), RELATIONS))
    put_relations(start_m, points_m, outward, scale_m, solids, found)
    return found


@compiled(nogil=True, error_model="numpy")
def put_relations(
    start_m: FloatArray,
    points_m: FloatArray,
    outward: FloatArray,
    scale_m: float,
    solids: FloatArray,
    found: FloatArray,
) -> None:
    """Put what `solid_relations` returns into an array."""
    for point in range(len(points_m)):
        # Points one above the other differ in height alone.
        is_above = point > 0
        for axis in range(2):
            is_above = is_above and points_m[point, axis] == points_m[point - 1, axis]
            is_above = is_above and outward[point, axis] == outward[point - 1, axis]
        # 1. The axes of a point: ahead along the path in plan, aside to where its wall faces.
        x_m, y_m = points_m[point, 0] - start_m[0], points_m[point, 1] - start_m[1]
        way_m = sqrt(x_m * x_m + y_m * y_m) + 1e-6
        ahead_x, ahead_y = x_m / way_m, y_m / way_m
        aside_x, aside_y = -ahead_y, ahead_x
        if outward[point, 0] * aside_x + outward[point, 1] * aside_y < 0.0:
            aside_x, aside_y = -aside_x, -aside_y
        for solid in range(len(solids)):
            # 2. Where its centre is along these axes, where it is abreast of the path, and how high
            # the straight path is there.
            left, bottom, right, top = (
                solids[solid, 0],
                solids[solid, 1],
                solids[solid, 2],
                solids[solid, 3],
            )
            height_m = solids[solid, 4]
            from_x, from_y = 0.5 * (left + right) - start_m[0], 0.5 * (bottom + top) - start_m[1]
            ahead_m = ahead_x * from_x + ahead_y * from_y
            there_m = min(max(ahead_m, 0.0), way_m)
            straight_m = start_m[2] + there_m / way_m * (points_m[point, 2] - start_m[2])
            own = found[solid, point]
            if is_above:
                for number in range(RELATIONS):
                    own[number] = found[solid, point - 1, number]
            else:
                _put_in_plan(
                    (ahead_x, ahead_y),
                    (aside_x, aside_y),
                    (from_x, from_y),
                    way_m,
                    (points_m[point, 0], points_m[point, 1]),
                    (start_m[0], start_m[1]),
                    scale_m,
                    (left, bottom, right, top, height_m),
                    own,
                )
            # 4. The relations that depend on the height of the point.
            over_m = height_m - straight_m
            own[7] = min(max(over_m / scale_m, -_MOST), _MOST)
            own[12] = min(_detour_m(there_m, way_m, max(over_m, 0.0)) / scale_m, _MOST)


@njit(error_model="numpy")
def _put_in_plan(
    ahead: tuple[float, float],
    aside: tuple[float, float],
    to_m: tuple[float, float],
    way_m: float,
    point_m: tuple[float, float],
    start_m: tuple[float, float],
    scale_m: float,
    solid: tuple[float, float, float, float, float],
    own: FloatArray,
) -> None:
    """Put the relations that do not depend on the height of the point."""
    left, bottom, right, top, height_m = solid
    # 3. Half extents; a turned rectangle reaches as far as its corners.
    half_x, half_y = 0.5 * (right - left), 0.5 * (top - bottom)
    ahead_m = ahead[0] * to_m[0] + ahead[1] * to_m[1]
    aside_m = aside[0] * to_m[0] + aside[1] * to_m[1]
    half_ahead_m = abs(ahead[0]) * half_x + abs(ahead[1]) * half_y
    half_aside_m = abs(aside[0]) * half_x + abs(aside[1]) * half_y
    there_m = min(max(ahead_m, 0.0), way_m)
    from_charge_m = _away_m(start_m[0], start_m[1], left, bottom, right, top)
    from_point_m = _away_m(point_m[0], point_m[1], left, bottom, right, top)
    crosses = ahead_m + half_ahead_m > 0.0 and ahead_m - half_ahead_m < way_m
    # The relations in their order, scaled and bounded: far solids are all alike.
    own[0] = ahead_m / way_m
    own[1] = ahead_m / scale_m
    own[2] = (way_m - ahead_m) / scale_m
    own[3] = aside_m / scale_m
    own[4] = half_ahead_m / scale_m
    own[5] = half_aside_m / scale_m
    own[6] = height_m / scale_m
    own[7] = 0.0
    own[8] = log(from_charge_m / scale_m + _LEAST_SCALED)
    own[9] = log(from_point_m / scale_m + _LEAST_SCALED)
    own[10] = _detour_m(there_m, way_m, aside_m + half_aside_m) / scale_m
    own[11] = _detour_m(there_m, way_m, aside_m - half_aside_m) / scale_m
    own[12] = 0.0
    own[13] = max(abs(aside_m) - half_aside_m, 0.0) / scale_m
    own[14] = 1.0 if crosses and abs(aside_m) < half_aside_m else 0.0
    for number in range(RELATIONS):
        own[number] = min(max(own[number], -_MOST), _MOST)


@njit(error_model="numpy")
def _away_m(x_m: float, y_m: float, left: float, bottom: float, right: float, top: float) -> float:
    """Return the distance in plan from a position to a solid."""
    beside_m = max(left - x_m, x_m - right, 0.0)
    before_m = max(bottom - y_m, y_m - top, 0.0)
    return sqrt(beside_m * beside_m + before_m * before_m)


@njit(error_model="numpy")
def _detour_m(there_m: float, way_m: float, off_m: float) -> float:
    """Return the excess length of a path that passes `off_m` from the straight one at `there_m`."""
    square, left_m = off_m * off_m, way_m - there_m
    return sqrt(there_m * there_m + square) + sqrt(left_m * left_m + square) - way_m
