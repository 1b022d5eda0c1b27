"""Obstruction of the paths from a charge to a wall: straight, over the top and round the ends.

A wave passes over the top and round the ends of a barrier, the weaker the longer its path is. From
the charge to each point on a wall lead the straight path and many detours, each by one place beside
or above the straight one; any solid on a path blocks it. The features are the shares of open paths,
weighted by the exponential of the detour's length: for detours near the charge, half way, and near
the wall, and for several decay lengths. Gaps, several rows and heights need no special rule.

A solid that blocks a path also blocks all lower paths by the same place in plan. So it suffices to
count the blocked ones, and the crossings in plan are found once for all of them, at all heights of
a wall.
"""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.surrogate.rooms import BOOL, BYTE, Counts

STATIONS: Final = (0.2, 0.5, 0.8)
"""Positions of the detours along the straight path, as shares of its length."""

ASIDE_M: Final = (0.0, 0.7, -0.7, 1.5, -1.5, 2.5, -2.5, 4.0, -4.0, 6.0, -6.0, 9.0, -9.0)
ABOVE_M: Final = np.array((0.0, 0.7, 1.5, 2.5, 4.0, 6.0))
"""Offsets of the detours beside (`ASIDE_M`) and above the straight path; ascending heights."""

FALLS_M: Final = (0.1, 0.3, 1.0, 3.0)
"""Decay lengths of the weight of a detour for 100 kg; Hopkinson-Cranz scaling for other charges."""

PLACES: Final = len(STATIONS) * len(ASIDE_M)
"""Number of places of detours in plan per point."""

SHARES: Final = len(STATIONS) * len(FALLS_M) + 1
"""Number of open shares per point: the last is 1 if the straight path is open, otherwise 0."""

REFERENCE_KG: Final = 100.0

_NO_WAY_M: Final = 1e-12
"""Shorter ways along an axis are none."""

_DOUBT_M: Final = 1e-6
"""Tolerance of the bounds on what a solid may stop, far above rounding: the paths decide."""

_FROM_LEFT: Final = np.argsort(ASIDE_M)
_ASIDE_M: Final = np.sort(ASIDE_M)
"""Numbers and offsets of the places aside, in the order of their offsets."""


@dataclass(frozen=True, eq=False)
class Ways:
    """The paths from a charge to points on walls of an empty site.

    Attributes:
        start_m: Position of the charge (3,).
        points_m: The points; those above each other are consecutive (points, 3).
        by_m: Places of the detours in plan (points, stations, asides, 2).
        by_height_m: Height of the straight path at the stations (points, stations).
        stopped: Number of paths by each place that structures block, from the lowest up (points,
            stations, asides).
        is_straight_open: Whether the straight path is open (points,).
        weights: Total weight of the open paths by each place, for each number of blocked paths
            (points, stations, distances aside, heights + 1, decay lengths): on both sides of the
            straight path they are equal. Those of a station add up to 1 if no path is blocked.
    """

    start_m: FloatArray
    points_m: FloatArray
    by_m: FloatArray
    by_height_m: FloatArray
    stopped: Counts
    is_straight_open: BoolArray
    weights: FloatArray

    @classmethod
    def between(
        cls,
        start_m: FloatArray,
        points_m: FloatArray,
        tnt_kg: float,
        solids: FloatArray,
    ) -> "Ways":
        """Return the paths from a charge to points.

        Args:
            start_m: Position of the charge (3,).
            points_m: The points (points, 3), none above or below the charge.
            tnt_kg: Mass of the charge.
            solids: Left, bottom, right, top, height of each structure, m (solids, 5).
        """
        points_m = np.ascontiguousarray(points_m)  # one kind of arrays is compiled once
        shape = len(points_m), len(STATIONS), len(ASIDE_M)
        by_m, by_height_m = np.empty((*shape, 2)), np.empty(shape[:2])
        stopped, is_straight_open = np.empty(shape, dtype=BYTE), np.empty(shape[:1], dtype=BOOL)
        lefts = *shape[:2], (len(ASIDE_M) + 1) // 2, len(ABOVE_M) + 1, len(FALLS_M)
        weights = np.empty(lefts)
        # The weight of a detour falls with its extra length, in units that grow with the charge
        # (Hopkinson and Cranz).
        fall_m = FALLS_M[-1] * float(np.cbrt(tnt_kg / REFERENCE_KG))
        arrays = by_m, by_height_m, stopped, is_straight_open, weights
        put_ways(start_m, points_m, fall_m, solids, *arrays)
        return cls(start_m, points_m, *arrays)

    def shares(self, barrier: FloatArray | None = None) -> FloatArray:
        """Return the shares of open paths to each point (points, SHARES), from 0 to 1.

        Args:
            barrier: Left, bottom, right, top, height of each of its pieces, m (pieces, 5).
        """
        shares = np.empty((len(self.points_m), SHARES))
        self.put_shares(shares)
        if barrier is not None:
            behind, shares[behind] = self.behind(barrier)
        return shares

    def behind(self, barrier: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the points to which a barrier blocks paths, and their open shares.

        Args:
            barrier: As for `shares`.

        Returns:
            Indices of the points (behind,), and their shares (behind, SHARES).
        """
        stopped, is_straight_open = self.stopped.copy(), self.is_straight_open.copy()
        is_behind = self._stop(barrier, stopped, is_straight_open)
        behind: IntArray = np.flatnonzero(is_behind)
        shares = np.empty((len(behind), SHARES))
        put_open_shares(behind, stopped, is_straight_open, self.weights, shares)
        return behind, shares

    def stopped_by(self, solids: FloatArray) -> tuple[Counts, BoolArray]:
        """Return what each solid alone stops beside the structures.

        Args:
            solids: As for `shares`.

        Returns:
            Number of stopped paths by each place, from the lowest up (solids, points, stations,
            asides), and whether the straight path is open (solids, points). Several solids
            together stop as many paths as the one that stops most.
        """
        stopped = np.empty((len(solids), *self.stopped.shape), dtype=BYTE)
        is_straight_open = np.empty((len(solids), len(self.points_m)), dtype=BOOL)
        put_stopped_by(
            *(self.start_m, self.points_m, self.by_m, self.by_height_m, solids),
            *(self.stopped, self.is_straight_open, stopped, is_straight_open),
        )
        return stopped, is_straight_open

    def put_shares(self, shares: FloatArray) -> None:
        """Put what `shares` returns without a barrier into an array."""
        every = np.arange(len(self.points_m))
        put_open_shares(every, self.stopped, self.is_straight_open, self.weights, shares)

    def _stop(self, solids: FloatArray, stopped: Counts, is_straight_open: BoolArray) -> BoolArray:
        """Mark the further paths that solids block; return the mask of their points (points,)."""
        is_behind = np.zeros(len(stopped), dtype=BOOL)
        by, of_all = (
            (self.by_m, self.by_height_m),
            (stopped[np.newaxis], is_straight_open[np.newaxis]),
        )
        _stop(self.start_m, self.points_m, *by, solids, *of_all, is_behind)
        return is_behind


@compiled(nogil=True, error_model="numpy", inline="always")
def put_ways(
    start_m: FloatArray,
    points_m: FloatArray,
    fall_m: float,
    solids: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    stopped: Counts,
    is_straight_open: BoolArray,
    weights: FloatArray,
) -> None:
    """Put the attributes of `Ways`, where `fall_m` is the longest decay length."""
    # 1. Places beside and above the straight path, at some stations of it; 2. the weights of the
    # detours; 3. those that the structures stop, from the lowest up.
    _put_places(start_m, points_m, by_m, by_height_m)
    _put_weights(start_m, points_m, by_height_m, fall_m, weights)
    of_all = stopped.reshape((1, *stopped.shape)), is_straight_open.reshape((1, len(points_m)))
    for point in range(len(points_m)):
        is_straight_open[point] = True
        for station in range(stopped.shape[1]):
            for aside in range(stopped.shape[2]):
                stopped[point, station, aside] = 0
    is_behind = np.empty(len(points_m), dtype=np.bool_)
    _stop(start_m, points_m, by_m, by_height_m, solids, *of_all, is_behind)


@compiled(nogil=True, error_model="numpy", inline="always")
def put_stopped_by(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    solids: FloatArray,
    stopped: Counts,
    is_straight_open: BoolArray,
    found: Counts,
    is_open: BoolArray,
) -> None:
    """Put what `Ways.stopped_by` returns into `found` and `is_open`."""
    by_none, by_each = stopped.reshape(stopped.size), found.reshape((len(found), stopped.size))
    for solid in range(len(solids)):  # slices would compile NumPy's messages too
        for point in range(len(points_m)):
            is_open[solid, point] = is_straight_open[point]
        for place in range(len(by_none)):
            by_each[solid, place] = by_none[place]
    is_behind = np.empty(len(points_m), dtype=np.bool_)
    _stop(start_m, points_m, by_m, by_height_m, solids, found, is_open, is_behind)


@compiled(nogil=True, error_model="numpy")
def _put_places(
    start_m: FloatArray, points_m: FloatArray, by_m: FloatArray, by_height_m: FloatArray
) -> None:
    """Put `Ways.by_m` and `Ways.by_height_m`."""
    for point in range(len(points_m)):
        x_m, y_m = points_m[point, 0] - start_m[0], points_m[point, 1] - start_m[1]
        flat_m = sqrt(x_m * x_m + y_m * y_m)
        across_x, across_y = -y_m / flat_m, x_m / flat_m
        for station in range(by_m.shape[1]):
            share, of_station = STATIONS[station], by_m[point, station]
            for aside in range(by_m.shape[2]):
                of_station[aside, 0] = start_m[0] + share * x_m + ASIDE_M[aside] * across_x
                of_station[aside, 1] = start_m[1] + share * y_m + ASIDE_M[aside] * across_y
            by_height_m[point, station] = start_m[2] + share * (points_m[point, 2] - start_m[2])


_WIDE: Final = 128
"""Detours of a point at all stations, rounded up, so that a processor weights several at once."""


@compiled(nogil=True, error_model="numpy")
def _put_weights(
    start_m: FloatArray,
    points_m: FloatArray,
    by_height_m: FloatArray,
    fall_m: float,
    left: FloatArray,
) -> None:
    """Put `Ways.weights`, where `fall_m` is the longest decay length."""
    points, stations, asides, _, falls = left.shape
    aboves = len(ABOVE_M)
    own, to_m2, from_m2 = np.zeros((falls, _WIDE)), np.zeros(_WIDE), np.zeros(_WIDE)
    for point in range(points):
        end_m = points_m[point]
        flat_m2 = _flat_m2(start_m, end_m)
        straight_m = sqrt(flat_m2 + (end_m[2] - start_m[2]) ** 2)
        # 1. The squares of the lengths to each place of a detour, and from it.
        number = 0
        for station in range(stations):
            to_share, from_share = STATIONS[station] ** 2, (1.0 - STATIONS[station]) ** 2
            for aside in range(asides):
                aside_m2 = ASIDE_M[2 * aside] ** 2
                for above in range(aboves):
                    z_m = by_height_m[point, station] + ABOVE_M[above]
                    to_m2[number] = to_share * flat_m2 + aside_m2 + (z_m - start_m[2]) ** 2
                    from_m2[number] = from_share * flat_m2 + aside_m2 + (z_m - end_m[2]) ** 2
                    number += 1
        # 2. exp(-extra length / decay length), for each of these.
        _put_falls(straight_m, to_m2, from_m2, 1.0 / fall_m, own)
        number = 0
        for station in range(stations):
            _put_left(own, number, left[point, station])
            number += asides * aboves


@njit(error_model="numpy")
def _put_falls(
    straight_m: float, to_m2: FloatArray, from_m2: FloatArray, by_m1: float, found: FloatArray
) -> None:
    """Put the weights of detours, by each decay length (decay lengths, detours)."""
    # The decay lengths are whole parts of the longest one, a thirtieth, a tenth and a third: powers
    # of its exponential give the others.
    longest = found[3]
    for number in range(_WIDE):
        away_m = sqrt(to_m2[number]) + sqrt(from_m2[number])
        longest[number] = min((straight_m - away_m) * by_m1, 0.0)
    _exponentiate(longest)
    for number in range(_WIDE):
        one = longest[number]
        three = one * one * one
        ten = three * three * three * one
        found[2, number], found[1, number], found[0, number] = three, ten, ten * ten * ten


@njit(error_model="numpy")
def _put_left(own: FloatArray, first: int, of_station: FloatArray) -> None:
    """Put what is left at a station if the lowest detours by a place are stopped, as shares."""
    asides, aboves, _ = of_station.shape
    aboves -= 1
    # Summed from the highest detour down, four decay lengths side by side. Detours aside are there
    # twice, on both sides.
    all_0 = all_1 = all_2 = all_3 = 0.0
    for aside in range(asides):
        left_0 = left_1 = left_2 = left_3 = 0.0
        left = of_station[aside]
        left[aboves, 0] = left[aboves, 1] = left[aboves, 2] = left[aboves, 3] = 0.0
        for above in range(aboves - 1, -1, -1):
            number = first + aside * aboves + above
            left_0, left_1 = left_0 + own[0, number], left_1 + own[1, number]
            left_2, left_3 = left_2 + own[2, number], left_3 + own[3, number]
            left[above, 0], left[above, 1] = left_0, left_1
            left[above, 2], left[above, 3] = left_2, left_3
        sides = 1.0 if aside == 0 else 2.0
        all_0, all_1 = all_0 + sides * left_0, all_1 + sides * left_1
        all_2, all_3 = all_2 + sides * left_2, all_3 + sides * left_3
    share_0, share_1, share_2, share_3 = 1.0 / all_0, 1.0 / all_1, 1.0 / all_2, 1.0 / all_3
    for aside in range(asides):
        left = of_station[aside]
        for above in range(aboves):
            left[above, 0] *= share_0
            left[above, 1] *= share_1
            left[above, 2] *= share_2
            left[above, 3] *= share_3


_LEAST: Final = -64.0
"""Least exponent that counts: shares of 1e-28 and less are equal."""


@njit(error_model="numpy")
def _exponentiate(values: FloatArray) -> None:
    """Put exp(x) in the place of numbers x up to 0, without branches: several at once.

    It is the series at x / 1024 (relative error 1e-16), squared ten times (1e-13).
    """
    for number in range(len(values)):
        x = values[number] if values[number] > _LEAST else _LEAST
        x *= 1.0 / 1024.0
        value = 1.0 / 720.0 + x * (1.0 / 5040.0 + x * (1.0 / 40320.0))
        value = 1.0 / 24.0 + x * (1.0 / 120.0 + x * value)
        value = 1.0 / 2.0 + x * (1.0 / 6.0 + x * value)
        value = 1.0 + x * (1.0 + x * value)
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        value *= value
        values[number] = value


@compiled(nogil=True, error_model="numpy")
def _flat_m2(one_m: FloatArray, other_m: FloatArray) -> float:
    """Return the square of a distance in plan."""
    return float((other_m[0] - one_m[0]) ** 2 + (other_m[1] - one_m[1]) ** 2)


@compiled(nogil=True, error_model="numpy")
def put_open_shares(
    chosen: IntArray,
    stopped: Counts,
    is_straight_open: BoolArray,
    weights: FloatArray,
    shares: FloatArray,
) -> None:
    """Put the shares of open paths to some of the points (chosen, SHARES)."""
    below = stopped.reshape((len(stopped), PLACES))
    for number in range(len(chosen)):
        point = chosen[number]
        put_shares_of(below[point], is_straight_open[point], weights[point], shares[number])


@njit(error_model="numpy")
def put_shares_of(
    below: Counts, is_straight_open: bool, weights: FloatArray, shares: FloatArray
) -> None:
    """Put the shares of open paths to a point (SHARES,).

    Args:
        below: Number of stopped paths by each place (PLACES,).
        is_straight_open: Whether the straight path is open.
        weights: Those of `Ways.weights` to the point.
        shares: The shares.
    """
    # The four decay lengths side by side.
    for station in range(len(STATIONS)):
        all_0 = all_1 = all_2 = all_3 = 0.0
        for aside in range(len(ASIDE_M)):
            left = weights[station, (aside + 1) // 2, below[station * len(ASIDE_M) + aside]]
            all_0, all_1 = all_0 + left[0], all_1 + left[1]
            all_2, all_3 = all_2 + left[2], all_3 + left[3]
        first = station * len(FALLS_M)
        shares[first], shares[first + 1] = all_0, all_1
        shares[first + 2], shares[first + 3] = all_2, all_3
    shares[SHARES - 1] = 1.0 if is_straight_open else 0.0


@compiled(nogil=True, error_model="numpy")
def _stop(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    solids: FloatArray,
    stopped: Counts,
    is_straight_open: BoolArray,
    is_behind: BoolArray,
) -> None:
    """Mark the paths that solids block, and the points with newly blocked paths.

    Paths that are blocked already are skipped.

    Args:
        start_m: See `Ways`.
        points_m: See `Ways`.
        by_m: See `Ways`.
        by_height_m: See `Ways`.
        solids: Left, bottom, right, top, height of each solid, m (solids, 5).
        stopped: `Ways.stopped` by each solid, or by all together (solids or 1, points, ...).
        is_straight_open: The same of the straight path (solids or 1, points).
        is_behind: The points (points,).
    """
    start_x_m, start_y_m, start_z_m = start_m[0], start_m[1], start_m[2]
    first = 0
    while first < len(points_m):
        # 1. Points one above the other have the same paths in plan, which are cut once for all.
        last = first + 1
        while last < len(points_m) and _flat_m2(points_m[first], points_m[last]) == 0.0:
            last += 1
        end_x_m, end_y_m = points_m[first, 0], points_m[first, 1]
        way_m = sqrt((end_x_m - start_x_m) ** 2 + (end_y_m - start_y_m) ** 2)
        for solid in range(len(solids)):
            # 2. No path goes back or beyond the point; the straight one of each of the points.
            near_m, far_m, low, high, low_back, high_back = _span(
                start_x_m, start_y_m, end_x_m, end_y_m, way_m, solids, solid
            )
            if far_m < -_DOUBT_M or near_m > way_m + _DOUBT_M:
                continue
            number, height_m = min(solid, len(stopped) - 1), solids[solid, 4]
            enter, leave = cut(start_x_m, start_y_m, end_x_m, end_y_m, solids, solid)
            for point in range(first, last if enter < leave else first):
                rise_m, is_open = points_m[point, 2] - start_z_m, is_straight_open[number, point]
                if is_open and _lowest_m(start_z_m, rise_m, enter, leave) < height_m:
                    is_straight_open[number, point] = False
                    is_behind[point] = True
            # 3. The detours: to a place beside the path, then on to the point. A higher one clears
            # whatever a lower one does, so that the count of stopped ones only grows.
            for station in range(by_m.shape[1]):
                to_m = STATIONS[station] * way_m
                may_there, may_on = near_m < to_m + _DOUBT_M, far_m > to_m - _DOUBT_M
                least_m, most_m = inf, -inf
                if may_there:
                    least_m, most_m = low * to_m, high * to_m
                if may_on:
                    least_m = min(least_m, low_back * (way_m - to_m))
                    most_m = max(most_m, high_back * (way_m - to_m))
                for place in range(len(_ASIDE_M)):
                    if _ASIDE_M[place] < least_m - _DOUBT_M:
                        continue
                    if _ASIDE_M[place] > most_m + _DOUBT_M:
                        break
                    aside = _FROM_LEFT[place]
                    x_m, y_m = by_m[first, station, aside, 0], by_m[first, station, aside, 1]
                    enter, leave, enters, leaves = 1.0, 0.0, 1.0, 0.0
                    if may_there:
                        enter, leave = cut(start_x_m, start_y_m, x_m, y_m, solids, solid)
                    if may_on:
                        enters, leaves = cut(x_m, y_m, end_x_m, end_y_m, solids, solid)
                    if enter >= leave and enters >= leaves:
                        continue
                    for point in range(first, last):
                        before = stopped[number, point, station, aside]
                        above = _first_clear(
                            before,
                            by_height_m[point, station],
                            (start_z_m, points_m[point, 2]),
                            (enter, leave),
                            (enters, leaves),
                            height_m,
                        )
                        if above > before:
                            stopped[number, point, station, aside] = above
                            is_behind[point] = True
        first = last


@njit(error_model="numpy", forceinline=True)
def _first_clear(
    above: int,
    low_m: float,
    ends_m: tuple[float, float],
    there: tuple[float, float],
    on: tuple[float, float],
    height_m: float,
) -> int:
    """Return the lowest of the detours by a place, from `above` on, that clears a solid.

    Args:
        above: Number of the first height in `ABOVE_M`.
        low_m: What these heights count from.
        ends_m: Height of the charge and of the point.
        there: Where the way to the place enters and leaves the solid in plan, as `cut` has it.
        on: The same of the way on to the point.
        height_m: Height of the solid.
    """
    clears, clears_on = there[0] >= there[1], on[0] >= on[1]
    while above < len(ABOVE_M):
        z_m = low_m + ABOVE_M[above]
        rise_m, on_m = z_m - ends_m[0], ends_m[1] - z_m
        if (clears or _lowest_m(ends_m[0], rise_m, there[0], there[1]) >= height_m) and (
            clears_on or _lowest_m(z_m, on_m, on[0], on[1]) >= height_m
        ):
            break
        above += 1
    return above


@njit(error_model="numpy", forceinline=True)
def _span(
    start_x_m: float,
    start_y_m: float,
    end_x_m: float,
    end_y_m: float,
    way_m: float,
    solids: FloatArray,
    solid: int,
) -> tuple[float, float, float, float, float, float]:
    """Return where a solid is along the straight path, and how far aside as seen from its ends.

    Returns:
        Least and largest distance ahead of the charge, least and largest slope from the charge,
        and from the point.
    """
    ahead_x, ahead_y = (end_x_m - start_x_m) / way_m, (end_y_m - start_y_m) / way_m
    near_m, far_m = inf, -inf
    low, high, low_back, high_back = inf, -inf, inf, -inf
    for side_x in (0, 2):
        for side_y in (1, 3):
            x_m, y_m = solids[solid, side_x] - start_x_m, solids[solid, side_y] - start_y_m
            ahead_m, aside_m = x_m * ahead_x + y_m * ahead_y, y_m * ahead_x - x_m * ahead_y
            slope, slope_back = aside_m / ahead_m, aside_m / (way_m - ahead_m)
            near_m, far_m = min(near_m, ahead_m), max(far_m, ahead_m)
            low, high = min(low, slope), max(high, slope)
            low_back, high_back = min(low_back, slope_back), max(high_back, slope_back)
    # Slopes of a solid beside or around an end are unbounded.
    if near_m < _DOUBT_M:
        low, high = -inf, inf
    if far_m > way_m - _DOUBT_M:
        low_back, high_back = -inf, inf
    return near_m, far_m, low, high, low_back, high_back


@njit(error_model="numpy", forceinline=True)
def cut(
    start_x_m: float,
    start_y_m: float,
    end_x_m: float,
    end_y_m: float,
    solids: FloatArray,
    solid: int,
) -> tuple[float, float]:
    """Return where a line in plan enters and leaves a solid, as shares; (1, 0) if it does not."""
    left, bottom, right, top = (
        solids[solid, 0],
        solids[solid, 1],
        solids[solid, 2],
        solids[solid, 3],
    )
    # Most solids are off the line altogether: no division, and one branch.
    off_x = (min(start_x_m, end_x_m) >= right) | (max(start_x_m, end_x_m) <= left)
    off_y = (min(start_y_m, end_y_m) >= top) | (max(start_y_m, end_y_m) <= bottom)
    if off_x | off_y:
        return 1.0, 0.0
    # The part of the line within both slabs of the box (Kay and Kajiya 1986).
    enter, leave = 0.0, 1.0
    way = end_x_m - start_x_m
    if abs(way) >= _NO_WAY_M:
        one, other = (left - start_x_m) / way, (right - start_x_m) / way
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    way = end_y_m - start_y_m
    if abs(way) >= _NO_WAY_M:
        one, other = (bottom - start_y_m) / way, (top - start_y_m) / way
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    return enter, leave


@njit(error_model="numpy", forceinline=True)
def _lowest_m(start_m: float, rise_m: float, enter: float, leave: float) -> float:
    """Return the least height of a line between two shares of it."""
    return min(start_m + enter * rise_m, start_m + leave * rise_m)
