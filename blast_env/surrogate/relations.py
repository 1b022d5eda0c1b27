"""Positions of solids relative to a charge and a point on a wall.

Paths describe the open space between charge and point (`blast_env.surrogate.ways`).
Relations add the solids beside and behind the charge, which reflect the wave, the distance of each
solid and its extent beyond the detours. The axes follow the straight path in plan: ahead is from
the charge to the point, and aside is the side that the wall of the point faces, so that a mirrored
site has the same numbers. Lengths follow Hopkinson-Cranz scaling.
"""

from math import hypot, log, sqrt
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.compilation import compiled

RELATIONS: Final = 15
"""Number of relations per solid and point."""

_LEAST_SCALED: Final = 0.05
"""Offset of scaled distances to a solid before their logarithm, m/kg^(1/3)."""

_MOST: Final = 6.0
"""Bound on the magnitude of all relations."""


@compiled(nogil=True, error_model="numpy")
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
    found = np.zeros((len(solids), len(points_m), RELATIONS))
    for point in range(len(points_m)):
        # 1. The axes of a point: ahead along the path in plan, aside to where its wall faces.
        x_m, y_m = points_m[point, 0] - start_m[0], points_m[point, 1] - start_m[1]
        way_m = hypot(x_m, y_m) + 1e-6
        ahead_x, ahead_y = x_m / way_m, y_m / way_m
        aside_x, aside_y = -ahead_y, ahead_x
        if outward[point, 0] * aside_x + outward[point, 1] * aside_y < 0.0:
            aside_x, aside_y = -aside_x, -aside_y
        for solid in range(len(solids)):
            # 2. Centre and half extents of a solid along these axes; a turned rectangle reaches as
            # far as its corners.
            left, bottom, right, top, height_m = solids[solid]
            from_x, from_y = 0.5 * (left + right) - start_m[0], 0.5 * (bottom + top) - start_m[1]
            half_x, half_y = 0.5 * (right - left), 0.5 * (top - bottom)
            ahead_m = ahead_x * from_x + ahead_y * from_y
            aside_m = aside_x * from_x + aside_y * from_y
            half_ahead_m = abs(ahead_x) * half_x + abs(ahead_y) * half_y
            half_aside_m = abs(aside_x) * half_x + abs(aside_y) * half_y
            # 3. Where it is abreast of the path, and how high the straight path is there.
            there_m = min(max(ahead_m, 0.0), way_m)
            straight_m = start_m[2] + there_m / way_m * (points_m[point, 2] - start_m[2])
            from_charge_m = _away_m(start_m[0], start_m[1], solids[solid])
            from_point_m = _away_m(points_m[point, 0], points_m[point, 1], solids[solid])
            crosses = ahead_m + half_ahead_m > 0.0 and ahead_m - half_ahead_m < way_m
            # 4. The relations in their order, scaled and bounded: far solids are all alike.
            own = found[solid, point]
            own[0] = ahead_m / way_m
            own[1] = ahead_m / scale_m
            own[2] = (way_m - ahead_m) / scale_m
            own[3] = aside_m / scale_m
            own[4] = half_ahead_m / scale_m
            own[5] = half_aside_m / scale_m
            own[6] = height_m / scale_m
            own[7] = (height_m - straight_m) / scale_m
            own[8] = log(from_charge_m / scale_m + _LEAST_SCALED)
            own[9] = log(from_point_m / scale_m + _LEAST_SCALED)
            own[10] = _detour_m(there_m, way_m, aside_m + half_aside_m) / scale_m
            own[11] = _detour_m(there_m, way_m, aside_m - half_aside_m) / scale_m
            own[12] = _detour_m(there_m, way_m, max(height_m - straight_m, 0.0)) / scale_m
            own[13] = max(abs(aside_m) - half_aside_m, 0.0) / scale_m
            own[14] = 1.0 if crosses and abs(aside_m) < half_aside_m else 0.0
            for number in range(RELATIONS):
                own[number] = min(max(own[number], -_MOST), _MOST)
    return found


@compiled(nogil=True, error_model="numpy")
def _away_m(x_m: float, y_m: float, solid: FloatArray) -> float:
    """Return the distance in plan from a position to a solid."""
    beside_m = max(solid[0] - x_m, x_m - solid[2], 0.0)
    before_m = max(solid[1] - y_m, y_m - solid[3], 0.0)
    return hypot(beside_m, before_m)


@compiled(nogil=True, error_model="numpy")
def _detour_m(there_m: float, way_m: float, off_m: float) -> float:
    """Return the excess length of a path that passes `off_m` from the straight one at `there_m`."""
    return sqrt(there_m**2 + off_m**2) + sqrt((way_m - there_m) ** 2 + off_m**2) - way_m
