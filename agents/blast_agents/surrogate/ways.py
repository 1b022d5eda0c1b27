"""How much of what goes from a charge to a wall is stopped: straight, over the top and round ends.

A wave that meets a barrier goes on over its top and round its ends, the weaker the longer that way
is. From the charge to each point on a wall lead the straight way and many that make a detour, each
by one place beside or above the straight one; a way is stopped by any solid that it meets. What
counts is the share of the ways that is open, in which a way weighs the less the longer its detour
is: for detours near the charge, half way, and near the wall, and for several lengths over which the
weight falls. Gaps, several rows and heights need no rule of their own.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray

STATIONS: Final = (0.2, 0.5, 0.8)
"""Where on the straight way a detour is made, as a share of it."""

_ASIDE_M: Final = (0.0, 0.7, -0.7, 1.5, -1.5, 2.5, -2.5, 4.0, -4.0, 6.0, -6.0, 9.0, -9.0)
_ABOVE_M: Final = (0.0, 0.7, 1.5, 2.5, 4.0, 6.0)
FALLS_M: Final = (0.1, 0.3, 1.0, 3.0)
"""Lengths of a detour, m, at which its weight is 1/e, for 100 kg; others as Hopkinson-Cranz."""

SHARES: Final = len(STATIONS) * len(FALLS_M) + 1
"""Numbers that say what is open to a point: the last is 1 if the straight way is."""

_REFERENCE_KG: Final = 100.0


@dataclass(frozen=True, eq=False)
class Ways:
    """The ways from a charge to points on walls of an empty site.

    Attributes:
        start_m: Where the charge is (3,).
        points_m: The points (points, 3).
        by_m: Where each way makes its detour (points, stations, ways, 3).
        is_open: Which ways no structure stops (points, stations, ways).
        is_straight_open: Whether none stops the straight one (points,).
        weights: Of the ways (points, stations, ways, falls); they add up to 1.
    """

    start_m: FloatArray
    points_m: FloatArray
    by_m: FloatArray
    is_open: BoolArray
    is_straight_open: BoolArray
    weights: FloatArray

    @classmethod
    def between(
        cls, start_m: FloatArray, points_m: FloatArray, tnt_kg: float, solids: FloatArray
    ) -> "Ways":
        """Lay the ways from a charge to points.

        Args:
            start_m: Where the charge is (3,).
            points_m: The points (points, 3), none above or below the charge.
            tnt_kg: Its mass.
            solids: Left, bottom, right, top, height of each structure, m (solids, 5).
        """
        towards = points_m - start_m
        flat_m = np.hypot(towards[:, 0], towards[:, 1])
        across = np.stack((-towards[:, 1], towards[:, 0]), axis=1) / flat_m[:, np.newaxis]
        aside, above = (each.ravel() for each in np.meshgrid(_ASIDE_M, _ABOVE_M, indexing="ij"))
        stations = np.array(STATIONS)[:, np.newaxis]
        by_m = np.empty((len(points_m), len(STATIONS), len(aside), 3))
        for axis in range(2):
            straight = start_m[axis] + stations * towards[:, axis, np.newaxis, np.newaxis]
            by_m[..., axis] = straight + aside * across[:, axis, np.newaxis, np.newaxis]
        by_m[..., 2] = start_m[2] + stations * towards[:, 2, np.newaxis, np.newaxis] + above
        to_m = np.linalg.norm(by_m - start_m, axis=3)
        from_m = np.linalg.norm(by_m - points_m[:, np.newaxis, np.newaxis], axis=3)
        longer_m = to_m + from_m - np.linalg.norm(towards, axis=1)[:, np.newaxis, np.newaxis]
        falls_m = np.array(FALLS_M) * np.cbrt(tnt_kg / _REFERENCE_KG)
        weights = np.exp(-longer_m[..., np.newaxis] / falls_m)
        weights /= weights.sum(axis=2, keepdims=True)
        is_open = np.ones(by_m.shape[:3], dtype=bool)
        is_straight_open = np.ones(len(points_m), dtype=bool)
        _close(start_m, points_m, by_m, solids, is_open, is_straight_open)
        return cls(start_m, points_m, by_m, is_open, is_straight_open, weights)

    def shares(self, barrier: FloatArray | None = None) -> FloatArray:
        """Return what is open to each point (points, SHARES), from 0 to 1.

        Args:
            barrier: Left, bottom, right, top, height of each piece of it, m (pieces, 5).
        """
        is_open, is_straight_open = self.is_open, self.is_straight_open
        if barrier is not None and len(barrier):
            is_open, is_straight_open = is_open.copy(), is_straight_open.copy()
            _close(self.start_m, self.points_m, self.by_m, barrier, is_open, is_straight_open)
        open_shares = np.einsum("psw,pswf->psf", is_open.astype(float), self.weights)
        flat = open_shares.reshape(len(self.points_m), -1)
        return np.hstack((flat, is_straight_open[:, np.newaxis]))


@njit(cache=True, nogil=True, error_model="numpy")
def _close(
    start_m: FloatArray,
    points_m: FloatArray,
    by_m: FloatArray,
    solids: FloatArray,
    is_open: BoolArray,
    is_straight_open: BoolArray,
) -> None:
    """Mark the ways as closed that meet a solid; those that are closed are not looked at."""
    points, stations, ways = is_open.shape
    for point in range(points):
        end_m = points_m[point]
        if is_straight_open[point] and _meets(start_m, end_m, solids):
            is_straight_open[point] = False
        for station in range(stations):
            for way in range(ways):
                if is_open[point, station, way]:
                    corner_m = by_m[point, station, way]
                    if _meets(start_m, corner_m, solids) or _meets(corner_m, end_m, solids):
                        is_open[point, station, way] = False


@njit(cache=True, nogil=True, error_model="numpy")
def _meets(start_m: FloatArray, end_m: FloatArray, solids: FloatArray) -> bool:
    """Return whether a straight line meets any solid: slab by slab, then its least height."""
    for solid in range(len(solids)):
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
        if enter >= leave:
            continue
        rise = end_m[2] - start_m[2]
        if min(start_m[2] + enter * rise, start_m[2] + leave * rise) < solids[solid, 4]:
            return True
    return False
