"""How the pieces of a layout stand to the charge and to each other.

Relations tell of one piece and one point, whatever stands beside it. But a wall behind another one
takes off less, and one that joins another takes off more. The traits of a piece tell both, and no
point changes them: they are found once per layout and charge. From them networks find by how much
each number of the piece's messages counts.
"""

from math import exp, log, sqrt
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray
from blast_env.compilation import compiled
from blast_env.surrogate.ways import cut

TRAITS: Final = 16
"""Number of traits per piece."""

_PLACES: Final = 5
"""Places along a piece to which the charge looks."""

_MOST_SCALED: Final = 2.0
"""Larger scaled gaps are all alike."""

_LEAST_SCALED: Final = 0.05
"""Offset of scaled lengths before their logarithm, m/kg^(1/3)."""

_NEAR_SCALED: Final = 0.7
"""Scaled distance at which the shadow of a piece counts by a third as near."""

_JOINED_M: Final = 0.01
"""Solids no farther apart than this join."""

_LEAST_SHARE: Final = 1e-3
_MOST_SHADED: Final = 3.0
_BESIDE: Final = 0.3
"""Share of its length that a solid off a long face has at least before it."""


def piece_traits(
    start_m: FloatArray, scale_m: float, solids: FloatArray, pieces: FloatArray
) -> FloatArray:
    """Return the traits of each piece of a layout (pieces, TRAITS).

    In order: the share of its height in the shadow of other pieces, as the charge sees it, mean
    over places along it; the same of structures; the first one, the less the farther away what
    shades it is; how much it shades other pieces; logarithms of the nearer and the farther gap at
    its ends, to what stands in its line; the height of what joins its ends, in its own heights;
    the same of its long faces; whether it joins a structure. Then of itself: the logarithm of its
    distance from the charge; the cosine between the way to it and the normal of its long faces;
    its height, its length and its width. Then logarithms of the gaps off its long faces, to the
    side of the charge and away from it.

    Args:
        start_m: Position of the charge (3,).
        scale_m: Scaling length: the cube root of the charge's mass in kg.
        solids: Left, bottom, right, top and height of each structure, m (structures, 5).
        pieces: The same of each piece (pieces, 5).
    """
    found = np.empty((len(pieces), TRAITS))
    put_traits(start_m, scale_m, solids, pieces, len(pieces), found)
    return found


@compiled(nogil=True, error_model="numpy")
def put_traits(
    start_m: FloatArray,
    scale_m: float,
    solids: FloatArray,
    pieces: FloatArray,
    count: int,
    found: FloatArray,
) -> None:
    """Put what `piece_traits` returns, for the first `count` pieces, into an array."""
    for number in range(count):
        for trait in range(TRAITS):
            found[number, trait] = 0.0
    for number in range(count):
        is_along_x = _put_itself(start_m, scale_m, pieces, number, found[number])
        _put_shadows(start_m, scale_m, solids, pieces, count, number, is_along_x, found)
        _put_gaps(start_m, scale_m, solids, pieces, count, number, is_along_x, found[number])
    for number in range(count):
        found[number, 3] = min(found[number, 3], _MOST_SHADED)


@njit(error_model="numpy")
def _put_itself(
    start_m: FloatArray, scale_m: float, pieces: FloatArray, number: int, own: FloatArray
) -> bool:
    """Put the traits of a piece alone; return whether it is longer along x than along y."""
    wide_m = pieces[number, 2] - pieces[number, 0]
    deep_m = pieces[number, 3] - pieces[number, 1]
    x_m = 0.5 * (pieces[number, 0] + pieces[number, 2]) - start_m[0]
    y_m = 0.5 * (pieces[number, 1] + pieces[number, 3]) - start_m[1]
    # A square one is as long as it is wide: it faces the charge.
    is_along_x = abs(y_m) >= abs(x_m)
    if abs(wide_m - deep_m) > _JOINED_M:
        is_along_x = wide_m > deep_m
    way_m = sqrt(x_m * x_m + y_m * y_m)
    own[9] = log(way_m / scale_m + _LEAST_SCALED)
    own[10] = (abs(y_m) if is_along_x else abs(x_m)) / (way_m + 1e-6)
    own[11] = pieces[number, 4] / scale_m
    own[12], own[13] = max(wide_m, deep_m) / scale_m, min(wide_m, deep_m) / scale_m
    return bool(is_along_x)


@njit(error_model="numpy")
def _put_shadows(
    start_m: FloatArray,
    scale_m: float,
    solids: FloatArray,
    pieces: FloatArray,
    count: int,
    number: int,
    is_along_x: bool,
    found: FloatArray,
) -> None:
    """Put how much of a piece others hide from the charge, and add this to what they hide."""
    left, bottom = pieces[number, 0], pieces[number, 1]
    right, top, height_m = pieces[number, 2], pieces[number, 3], pieces[number, 4]
    own = found[number]
    for place in range(_PLACES):
        # 1. The way to a place in the middle of a part of its length.
        share = (place + 0.5) / _PLACES
        x_m = left + share * (right - left) if is_along_x else 0.5 * (left + right)
        y_m = 0.5 * (bottom + top) if is_along_x else bottom + share * (top - bottom)
        way_m = sqrt((x_m - start_m[0]) ** 2 + (y_m - start_m[1]) ** 2)
        # 2. Of the pieces that stand in it, the one with the highest shadow hides the place.
        highest = away_scaled = 0.0
        for other in range(count):
            if other == number:
                continue
            shadow, leave = _shadow(start_m, x_m, y_m, height_m, pieces, other)
            found[other, 3] += shadow / _PLACES
            if shadow > highest:
                highest, away_scaled = shadow, (1.0 - leave) * way_m / scale_m
        own[0] += highest / _PLACES
        own[2] += highest * exp(-away_scaled / _NEAR_SCALED) / _PLACES
        # 3. The same of structures.
        highest = 0.0
        for other in range(len(solids)):
            highest = max(highest, _shadow(start_m, x_m, y_m, height_m, solids, other)[0])
        own[1] += highest / _PLACES


@njit(error_model="numpy")
def _shadow(
    start_m: FloatArray, x_m: float, y_m: float, height_m: float, solids: FloatArray, solid: int
) -> tuple[float, float]:
    """Return the share of a height in the shadow of a solid, and where the way there leaves it."""
    enter, leave = cut(start_m[0], start_m[1], x_m, y_m, solids, solid)
    if enter >= leave:
        return 0.0, 1.0
    rise_m = (solids[solid, 4] - start_m[2]) / max(leave, _LEAST_SHARE)
    return min(max((start_m[2] + rise_m) / height_m, 0.0), 1.0), leave


@njit(error_model="numpy")
def _put_gaps(
    start_m: FloatArray,
    scale_m: float,
    solids: FloatArray,
    pieces: FloatArray,
    count: int,
    number: int,
    is_along_x: bool,
    own: FloatArray,
) -> None:
    """Put what a piece joins, and the gaps at its ends and off its long faces."""
    # 1. The piece along and across its length.
    along = 0 if is_along_x else 1
    low_m, high_m = pieces[number, along], pieces[number, 2 + along]
    near_m, far_m = pieces[number, 1 - along], pieces[number, 3 - along]
    height_m = pieces[number, 4]
    is_charge_below = start_m[1 - along] < 0.5 * (near_m + far_m)
    low_gap = high_gap = below = above = _MOST_SCALED
    at_low = at_high = at_faces = 0.0
    for other in range(count + len(solids)):
        if other == number:
            continue
        is_piece = other < count
        solid = pieces[other] if is_piece else solids[other - count]
        begin_m, end_m = solid[along], solid[2 + along]
        first_m, last_m = solid[1 - along], solid[3 - along]
        high = min(solid[4] / height_m, 1.0)
        # 2. What stands in its line has a gap to one of its ends; 3. what touches a long face has
        # none. 4. What is beside much of it has a gap to a long face.
        is_joined = False
        if first_m < far_m - _JOINED_M and last_m > near_m + _JOINED_M:
            if end_m <= low_m + _JOINED_M:
                gap = max(low_m - end_m, 0.0) / scale_m
                is_joined = low_m - end_m <= _JOINED_M
                low_gap = min(low_gap, gap)
                at_low = max(at_low, high if is_joined else 0.0)
            elif begin_m >= high_m - _JOINED_M:
                gap = max(begin_m - high_m, 0.0) / scale_m
                is_joined = begin_m - high_m <= _JOINED_M
                high_gap = min(high_gap, gap)
                at_high = max(at_high, high if is_joined else 0.0)
        elif begin_m < high_m + _JOINED_M and end_m > low_m - _JOINED_M:
            off_m = min(abs(first_m - far_m), abs(near_m - last_m))
            if off_m <= _JOINED_M:
                is_joined = True
                at_faces += high
        if is_joined and not is_piece:
            own[8] = 1.0
        if min(high_m, end_m) - max(low_m, begin_m) > _BESIDE * (high_m - low_m):
            if last_m <= near_m + _JOINED_M:
                below = min(below, max(near_m - last_m, 0.0) / scale_m)
            elif first_m >= far_m - _JOINED_M:
                above = min(above, max(first_m - far_m, 0.0) / scale_m)
    own[4] = log(min(low_gap, high_gap) + _LEAST_SCALED)
    own[5] = log(max(low_gap, high_gap) + _LEAST_SCALED)
    own[6], own[7] = at_low + at_high, at_faces
    to, away = (below, above) if is_charge_below else (above, below)
    own[14], own[15] = log(to + _LEAST_SCALED), log(away + _LEAST_SCALED)
