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

from blast_env.arrays import FloatArray, IntArray
from blast_env.compilation import compiled

RELATIONS: Final = 28
"""Number of relations per solid and point."""

RISING: Final = np.array((7, 12, 23, 27))
"""Indices of the relations that change with the height of a point on a wall."""

IN_PLAN: Final = np.setdiff1d(np.arange(RELATIONS), RISING)
"""Indices of the others, which points one above the other have in common."""

_LEAST_SCALED: Final = 0.05
"""Offset of scaled distances to a solid before their logarithm, m/kg^(1/3)."""

_MOST: Final = 6.0
"""Bound on the magnitude of all relations."""

_BEFORE_WALL: Final = 15
"""Index of the first relation to the wall of the point."""

_ECHO: Final = 4
_ECHOES: Final = (20, 20 + _ECHO)
"""Index of the first relation of the echo of a face along the wall, and of one across."""

_NEAR: Final = 1.0
"""Bound on the magnitude of how far an echo is within its face, in scaled lengths."""


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

    Then in the frame of the point's wall, which tells how a solid is turned: its distance before
    the wall, the distance of its centre along the wall to the side of the charge, half its extent
    off and along the wall, and the cosine between path and normal in plan. Then two echoes, of its
    face along the wall and of that across; see `_put_echo`.

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
        is_higher = is_above(points_m, outward, point)
        # 1. The axes of a point: ahead along the path in plan, aside to where its wall faces.
        way_m, (ahead_x, ahead_y), (aside_x, aside_y) = axes_of(
            start_m, points_m[point], outward[point]
        )
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
            # 3. The relations in plan, which points one above the other have in common.
            own = found[solid, point]
            if is_higher:
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
                _put_before_wall(
                    (outward[point, 0], outward[point, 1]),
                    (points_m[point, 0], points_m[point, 1]),
                    (start_m[0], start_m[1]),
                    way_m,
                    scale_m,
                    (left, bottom, right, top),
                    own,
                )
            # 4. The relations that depend on the height of the point.
            for echo in _ECHOES:
                if own[echo] > 0.0:
                    echo_m = start_m[2] + own[echo + 2] * (points_m[point, 2] - start_m[2])
                    own[echo + 3] = _near((height_m - echo_m) / scale_m)
            over_m = height_m - straight_m
            own[7] = min(max(over_m / scale_m, -_MOST), _MOST)
            own[12] = min(_detour_m(there_m, way_m, max(over_m, 0.0)) / scale_m, _MOST)


@njit(error_model="numpy")
def axes_of(
    start_m: FloatArray, point_m: FloatArray, outward: FloatArray
) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Return the length of the straight path in plan, m, and the axes ahead and aside.

    Args:
        start_m: Position of the charge (3,).
        point_m: The point (3,).
        outward: Outward normal of its wall, in plan (2,).
    """
    x_m, y_m = point_m[0] - start_m[0], point_m[1] - start_m[1]
    way_m = sqrt(x_m * x_m + y_m * y_m) + 1e-6
    ahead_x, ahead_y = x_m / way_m, y_m / way_m
    aside_x, aside_y = -ahead_y, ahead_x
    if outward[0] * aside_x + outward[1] * aside_y < 0.0:
        aside_x, aside_y = -aside_x, -aside_y
    return way_m, (ahead_x, ahead_y), (aside_x, aside_y)


@njit(error_model="numpy")
def is_above(points_m: FloatArray, outward: FloatArray, point: int) -> bool:
    """Return whether a point differs from the one before it in height alone."""
    if point == 0:
        return False
    for axis in range(2):
        if (
            points_m[point, axis] != points_m[point - 1, axis]
            or outward[point, axis] != outward[point - 1, axis]
        ):
            return False
    return True


def columns_of(points_m: FloatArray, outward: FloatArray) -> IntArray:
    """Return the number of the column of each point: those above each other have one (points,)."""
    starts = [not is_above(points_m, outward, point) for point in range(len(points_m))]
    found: IntArray = np.cumsum(starts) - 1
    return found


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
    for number in range(_BEFORE_WALL):
        own[number] = min(max(own[number], -_MOST), _MOST)


@njit(error_model="numpy")
def _put_before_wall(
    outward: tuple[float, float],
    point_m: tuple[float, float],
    start_m: tuple[float, float],
    way_m: float,
    scale_m: float,
    solid: tuple[float, float, float, float],
    own: FloatArray,
) -> None:
    """Put the relations in the frame of the point's wall, and the echoes."""
    left, bottom, right, top = solid
    out_x, out_y = outward
    to_x, to_y = start_m[0] - point_m[0], start_m[1] - point_m[1]
    # The wall's own direction, to the side of the charge.
    along_x, along_y = -out_y, out_x
    if along_x * to_x + along_y * to_y < 0.0:
        along_x, along_y = -along_x, -along_y
    half_x, half_y = 0.5 * (right - left), 0.5 * (top - bottom)
    off_x, off_y = 0.5 * (left + right) - point_m[0], 0.5 * (bottom + top) - point_m[1]
    half_out_m = abs(out_x) * half_x + abs(out_y) * half_y
    own[15] = (out_x * off_x + out_y * off_y - half_out_m) / scale_m
    own[16] = (along_x * off_x + along_y * off_y) / scale_m
    own[17] = half_out_m / scale_m
    own[18] = (abs(along_x) * half_x + abs(along_y) * half_y) / scale_m
    own[19] = (out_x * to_x + out_y * to_y) / way_m
    for number in range(_BEFORE_WALL, _ECHOES[0]):
        own[number] = min(max(own[number], -_MOST), _MOST)
    # Faces along the wall are those whose normal is nearer to its own.
    of_x, of_y = (_ECHOES[0], _ECHOES[1]) if abs(out_x) >= abs(out_y) else (_ECHOES[1], _ECHOES[0])
    _put_echo(
        start_m[0],
        start_m[1],
        point_m[0],
        point_m[1],
        (left, right, bottom, top),
        way_m,
        scale_m,
        of_x,
        own,
    )
    _put_echo(
        start_m[1],
        start_m[0],
        point_m[1],
        point_m[0],
        (bottom, top, left, right),
        way_m,
        scale_m,
        of_y,
        own,
    )


@njit(error_model="numpy")
def _put_echo(
    start_m: float,
    start_along_m: float,
    point_m: float,
    point_along_m: float,
    solid: tuple[float, float, float, float],
    way_m: float,
    scale_m: float,
    first: int,
    own: FloatArray,
) -> None:
    """Put the echo of a face of a solid, if charge and point are before it: by an image charge.

    In order: length of the path over that of the echo (0 if there is none), how far the echo is
    within the face, where on its way it is reflected, and how far below the top.

    Args:
        start_m: Position of the charge across the face.
        start_along_m: The same along the face.
        point_m: Position of the point across the face.
        point_along_m: The same along the face.
        solid: Low and high end of the solid across the face, and along it.
        way_m: Length of the path in plan.
        scale_m: Scaling length.
        first: Index of the first number.
        own: The relations.
    """
    low, high, begin, end = solid
    to_m, from_m = start_m - high, point_m - high
    if to_m < 0.0 or from_m < 0.0:
        to_m, from_m = low - start_m, low - point_m
    if to_m < 0.0 or from_m < 0.0:
        own[first], own[first + 1], own[first + 2], own[first + 3] = 0.0, -_NEAR, 0.0, -_NEAR
        return
    share = to_m / (to_m + from_m + 1e-6)
    aside_m = point_along_m - start_along_m
    at_m = start_along_m + share * aside_m
    own[first] = way_m / sqrt((to_m + from_m) ** 2 + aside_m**2 + 1e-6)
    within_m = 0.5 * (end - begin) - abs(at_m - 0.5 * (begin + end))
    own[first + 1], own[first + 2] = _near(within_m / scale_m), share


@njit(error_model="numpy")
def _near(scaled: float) -> float:
    return float(min(max(scaled, -_NEAR), _NEAR))


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
