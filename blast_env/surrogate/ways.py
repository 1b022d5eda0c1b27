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
from math import sqrt
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled

STATIONS: Final = (0.2, 0.5, 0.8)
"""Positions of the detours along the straight path, as shares of its length."""

ASIDE_M: Final = (0.0, 0.7, -0.7, 1.5, -1.5, 2.5, -2.5, 4.0, -4.0, 6.0, -6.0, 9.0, -9.0)
ABOVE_M: Final = np.array((0.0, 0.7, 1.5, 2.5, 4.0, 6.0))
"""Offsets of the detours beside (`ASIDE_M`) and above the straight path; ascending heights."""

FALLS_M: Final = (0.1, 0.3, 1.0, 3.0)
"""Decay lengths of the weight of a detour for 100 kg; Hopkinson-Cranz scaling for other charges."""

SHARES: Final = len(STATIONS) * len(FALLS_M) + 1
"""Number of open shares per point: the last is 1 if the straight path is open, otherwise 0."""

_REFERENCE_KG: Final = 100.0


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
            (points, stations, asides, heights + 1, decay lengths). Those of a station add up to 1
            if no path is blocked.
    """

    start_m: FloatArray
    points_m: FloatArray
    by_m: FloatArray
    by_height_m: FloatArray
    stopped: IntArray
    is_straight_open: BoolArray
    weights: FloatArray

    @classmethod
    def between(
        cls, start_m: FloatArray, points_m: FloatArray, tnt_kg: float, solids: FloatArray
    ) -> "Ways":
        """Return the paths from a charge to points.

        Args:
            start_m: Position of the charge (3,).
            points_m: The points (points, 3), none above or below the charge.
            tnt_kg: Mass of the charge.
            solids: Left, bottom, right, top, height of each structure, m (solids, 5).
        """
        points_m = np.ascontiguousarray(points_m)  # one kind of arrays is compiled once
        # 1. Places beside and above the straight path, at some stations of it.
        towards = points_m - start_m
        flat_m = np.hypot(towards[:, 0], towards[:, 1])
        across = np.stack((-towards[:, 1], towards[:, 0]), axis=1) / flat_m[:, np.newaxis]
        stations, asides = np.array(STATIONS), np.array(ASIDE_M)
        straight_m = start_m + stations[:, np.newaxis] * towards[:, np.newaxis]
        by_m = straight_m[:, :, np.newaxis, :2] + (
            asides[:, np.newaxis] * across[:, np.newaxis, np.newaxis]
        )
        by_height_m = np.ascontiguousarray(straight_m[..., 2])
        # 2. The weight of each detour falls with its extra length, in units that grow with the
        # charge (Hopkinson and Cranz).
        falls_m = np.array(FALLS_M) * np.cbrt(tnt_kg / _REFERENCE_KG)
        weights = _weights_left(start_m, points_m, by_m, by_height_m, falls_m)
        # 3. The detours that the structures stop, from the lowest up.
        stopped = np.zeros(by_m.shape[:3], dtype=np.int64)
        is_straight_open = np.ones(len(points_m), dtype=bool)
        ways = cls(start_m, points_m, by_m, by_height_m, stopped, is_straight_open, weights)
        ways._stop(solids, stopped, is_straight_open)
        return ways

    def shares(self, barrier: FloatArray | None = None) -> FloatArray:
        """Return the shares of open paths to each point (points, SHARES), from 0 to 1.

        Args:
            barrier: Left, bottom, right, top, height of each of its pieces, m (pieces, 5).
        """
        shares = _open_shares(self.every, self.stopped, self.is_straight_open, self.weights)
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
        return behind, _open_shares(behind, stopped, is_straight_open, self.weights)

    def stopped_by(self, solids: FloatArray) -> tuple[IntArray, BoolArray]:
        """Return what each solid alone stops beside the structures.

        Args:
            solids: As for `shares`.

        Returns:
            Number of stopped paths by each place, from the lowest up (solids, points, stations,
            asides), and whether the straight path is open (solids, points). Several solids
            together stop as many paths as the one that stops most.
        """
        stopped = np.repeat(self.stopped[np.newaxis], len(solids), axis=0)
        is_straight_open = np.repeat(self.is_straight_open[np.newaxis], len(solids), axis=0)
        by = (self.by_m, self.by_height_m)
        _stop_alone(self.start_m, self.points_m, *by, solids, stopped, is_straight_open)
        return stopped, is_straight_open

    @property
    def every(self) -> IntArray:
        """The indices of all points (points,)."""
        return np.arange(len(self.points_m))

    def _stop(
        self, solids: FloatArray, stopped: IntArray, is_straight_open: BoolArray
    ) -> BoolArray:
        """Mark the further paths that solids block; return the mask of their points (points,)."""
        is_behind = np.zeros(len(stopped), dtype=bool)
        by = (self.by_m, self.by_height_m)
        _stop(self.start_m, self.points_m, *by, solids, stopped, is_straight_open, is_behind)
        return is_behind


@compiled(nogil=True, error_model="numpy")
def _weights_left(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    falls_m: FloatArray,
) -> FloatArray:
    """Return `Ways.weights`."""
    points, stations, asides, _ = by_m.shape
    aboves, falls = len(ABOVE_M), len(falls_m)
    left = np.zeros((points, stations, asides, aboves + 1, falls))
    by_m1, own, per_all = 1.0 / falls_m, np.empty((asides, aboves, falls)), np.empty(falls)
    to_m2, from_m2 = np.empty((asides, aboves)), np.empty((asides, aboves))
    for point in range(points):
        end_m = points_m[point]
        straight_m = sqrt(_flat_m2(start_m, end_m) + (end_m[2] - start_m[2]) ** 2)
        for station in range(stations):
            # 1. exp(-extra length / fall) of each detour.
            for aside in range(asides):
                corner_m = by_m[point, station, aside]
                flat_to_m2, flat_from_m2 = _flat_m2(start_m, corner_m), _flat_m2(end_m, corner_m)
                for above in range(aboves):
                    z_m = by_height_m[point, station] + ABOVE_M[above]
                    to_m2[aside, above] = flat_to_m2 + (z_m - start_m[2]) ** 2
                    from_m2[aside, above] = flat_from_m2 + (z_m - end_m[2]) ** 2
            _put_exponents(straight_m, to_m2.reshape(-1), from_m2.reshape(-1), by_m1, own)
            _exponentiate(own.reshape(-1))
            # 2. Summed from the highest detour down: entry k is what is left if the k lowest are
            # stopped. 3. As shares of all detours of the station.
            of_station = left[point, station]
            per_all[:] = 0.0
            for aside in range(asides):
                for above in range(aboves - 1, -1, -1):
                    for fall in range(falls):
                        of_station[aside, above, fall] = (
                            of_station[aside, above + 1, fall] + own[aside, above, fall]
                        )
                for fall in range(falls):
                    per_all[fall] += of_station[aside, 0, fall]
            for fall in range(falls):
                per_all[fall] = 1.0 / per_all[fall]
            for aside in range(asides):
                for above in range(aboves):
                    for fall in range(falls):
                        of_station[aside, above, fall] *= per_all[fall]
    return left


@njit(error_model="numpy")
def _put_exponents(
    straight_m: float, to_m2: FloatArray, from_m2: FloatArray, by_m1: FloatArray, found: FloatArray
) -> None:
    """Put minus the extra lengths of detours, by each decay length (detours, decay lengths)."""
    for number in range(len(to_m2)):  # several roots at once
        to_m2[number] = straight_m - sqrt(to_m2[number]) - sqrt(from_m2[number])
    exponents = found.reshape(-1, len(by_m1))
    for number in range(len(to_m2)):
        for fall in range(len(by_m1)):
            exponents[number, fall] = to_m2[number] * by_m1[fall]


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
def _open_shares(
    chosen: IntArray, stopped: IntArray, is_straight_open: BoolArray, weights: FloatArray
) -> FloatArray:
    """Return the shares of open paths to some of the points (chosen, SHARES)."""
    _, stations, asides = stopped.shape
    falls = weights.shape[-1]
    shares = np.zeros((len(chosen), stations * falls + 1))
    for number, point in enumerate(chosen):
        for station in range(stations):
            for aside in range(asides):
                left = weights[point, station, aside, stopped[point, station, aside]]
                for fall in range(falls):
                    shares[number, station * falls + fall] += left[fall]
        shares[number, -1] = is_straight_open[point]
    return shares


@compiled(nogil=True, error_model="numpy")
def _stop_alone(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    solids: FloatArray,
    stopped: IntArray,
    is_straight_open: BoolArray,
) -> None:
    """Mark the paths that each solid blocks; see `Ways.stopped_by`."""
    is_behind = np.zeros(len(points_m), dtype=np.bool_)
    for number in range(len(solids)):
        _stop(
            start_m,
            points_m,
            by_m,
            by_height_m,
            solids[number : number + 1],
            stopped[number],
            is_straight_open[number],
            is_behind,
        )


@compiled(nogil=True, error_model="numpy")
def _stop(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    by_height_m: FloatArray,
    solids: FloatArray,
    stopped: IntArray,
    is_straight_open: BoolArray,
    is_behind: BoolArray,
) -> None:
    """Mark the paths that solids block, and the points with newly blocked paths.

    Paths that are blocked already are skipped.
    """
    points, stations, asides = stopped.shape
    met = np.empty((2 * len(solids), 3))
    first = 0
    while first < points:
        # 1. Points one above the other have the same paths in plan, which are cut once for all.
        last = first + 1
        while last < points and _flat_m2(points_m[first], points_m[last]) == 0.0:
            last += 1
        end_m = points_m[first]
        # 2. The straight path of each of them.
        straight = met[: _intersect(start_m, end_m, solids, met)]
        for point in range(first, last):
            if is_straight_open[point] and _is_stopped(start_m[2], points_m[point, 2], straight):
                is_straight_open[point] = False
                is_behind[point] = True
        # 3. The detours: to a place beside the path, then on to the point. A higher one clears
        # whatever a lower one does, so that the count of stopped ones only grows.
        for station in range(stations):
            for aside in range(asides):
                corner_m = by_m[first, station, aside]
                near = _intersect(start_m, corner_m, solids, met)
                far = near + _intersect(corner_m, end_m, solids, met[near:])
                if far == 0:
                    continue
                to, beyond = met[:near], met[near:far]
                for point in range(first, last):
                    above = stopped[point, station, aside]
                    while above < len(ABOVE_M):
                        z_m = by_height_m[point, station] + ABOVE_M[above]
                        if not _is_stopped(start_m[2], z_m, to) and not _is_stopped(
                            z_m, points_m[point, 2], beyond
                        ):
                            break
                        above += 1
                    if above > stopped[point, station, aside]:
                        stopped[point, station, aside] = above
                        is_behind[point] = True
        first = last


@compiled(nogil=True, error_model="numpy")
def _intersect(start_m: FloatArray, end_m: FloatArray, solids: FloatArray, met: FloatArray) -> int:
    """Record where a straight line in plan enters and leaves solids, with their heights.

    Uses the slab method; returns the number of solids on the line.
    """
    count = 0
    for solid in range(len(solids)):
        # The part of the line within both slabs of the box (Kay and Kajiya 1986).
        enter, leave = 0.0, 1.0
        for axis in range(2):
            way = end_m[axis] - start_m[axis]
            low, high = solids[solid, axis], solids[solid, axis + 2]
            if abs(way) < 1e-12:
                if start_m[axis] <= low or start_m[axis] >= high:
                    leave = -1.0
                continue
            one, other = (low - start_m[axis]) / way, (high - start_m[axis]) / way
            enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
        if enter < leave:
            met[count, 0], met[count, 1], met[count, 2] = enter, leave, solids[solid, 4]
            count += 1
    return count


@compiled(nogil=True, error_model="numpy")
def _is_stopped(start_m: float, end_m: float, met: FloatArray) -> bool:
    """Return whether a line between two heights is below the top of any solid it crosses."""
    rise_m = end_m - start_m
    for enter, leave, height_m in met:
        if min(start_m + enter * rise_m, start_m + leave * rise_m) < height_m:
            return True
    return False
