"""How high what stands around a charge and before a wall rises, seen from there.

Ways tell what is open between a charge and a point. They tell neither what stands beside and behind
the charge, which throws the wave back, nor how steeply a wave must bend over what is near. From the
charge and from the point one looks in directions that are turned to each other, and notes how many
radians the highest edge is above the level. What stands to the left and to the right counts alike:
of each such pair the larger angle comes first.
"""

from math import atan2, cos, pi, sin
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray

_STEP: Final = pi / 6.0
_PAIRS_AROUND: Final = 5
"""Directions to each side of a charge, beside those to the point and away from it."""

_PAIRS_BEFORE: Final = 3
"""Directions to each side of a point, beside that to the charge."""

HORIZONS: Final = 2 * _PAIRS_AROUND + 2 + 2 * _PAIRS_BEFORE + 1
"""Numbers for each point."""

_FAR_M: Final = 60.0
"""What is farther away is not looked at."""

_NEAR_M: Final = 0.25
"""What is nearer is taken to be so far away."""


def horizons(start_m: FloatArray, points_m: FloatArray, solids: FloatArray) -> FloatArray:
    """Return the angles of elevation from a charge and from points (points, HORIZONS), rad.

    Args:
        start_m: Where the charge is (3,).
        points_m: The points (points, 3), none above or below the charge.
        solids: Left, bottom, right, top, height of what stands there, m (solids, 5).
    """
    points_m, solids = np.ascontiguousarray(points_m), np.ascontiguousarray(solids)
    to_point = points_m[:, :2] - start_m[:2]
    from_charge = np.ascontiguousarray(np.broadcast_to(start_m, points_m.shape))
    around = _elevations(from_charge, to_point, 2 * _PAIRS_AROUND + 2, solids)
    before = _elevations(points_m, -to_point, 2 * _PAIRS_BEFORE + 1, solids)
    return np.hstack((_paired(around, _PAIRS_AROUND), _paired(before, _PAIRS_BEFORE)))


def _paired(angles: FloatArray, pairs: int) -> FloatArray:
    """Return straight ahead, the larger and the smaller of each pair, and the rest behind."""
    left, right = angles[:, 1 : pairs + 1], angles[:, : -pairs - 1 : -1]
    behind = angles[:, pairs + 1 : len(angles[0]) - pairs]
    return np.hstack((angles[:, :1], np.maximum(left, right), np.minimum(left, right), behind))


@njit(cache=True, nogil=True, error_model="numpy")
def _elevations(
    from_m: FloatArray, ahead: FloatArray, directions: int, solids: FloatArray
) -> FloatArray:
    """Return the angle of the highest edge in each direction (points, directions).

    The first half of them turns left from straight ahead, step by step, the last ones right: the
    last is a step to the right.
    """
    found = np.zeros((len(from_m), directions))
    for point in range(len(from_m)):
        straight = atan2(ahead[point, 1], ahead[point, 0])
        for direction in range(directions):
            turns = direction if 2 * direction <= directions else direction - directions
            angle = straight + turns * _STEP
            way = (cos(angle), sin(angle))
            for solid in range(len(solids)):
                rise_m = solids[solid, 4] - from_m[point, 2]
                enter, leave = 0.0, _FAR_M
                for axis in range(2):
                    low = solids[solid, axis] - from_m[point, axis]
                    high = solids[solid, axis + 2] - from_m[point, axis]
                    if abs(way[axis]) < 1e-12:
                        if low >= 0.0 or high <= 0.0:
                            leave = -1.0
                        continue
                    one, other = low / way[axis], high / way[axis]
                    enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
                if enter < leave and rise_m > 0.0:
                    elevation = atan2(rise_m, max(enter, _NEAR_M))
                    found[point, direction] = max(found[point, direction], elevation)
    return found
