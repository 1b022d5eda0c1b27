"""A charge and the protected walls: all inputs of the surrogate that no layout changes."""

from dataclasses import dataclass
from functools import cache
from math import log, log10, sqrt
from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.curves.kingery_bulmash import CURVES_SCALED_M, curve_polynomial, kingery_bulmash
from blast_env.site.blast_site import Charge
from blast_env.surrogate.points import WallPoints
from blast_env.surrogate.relations import RELATIONS, put_relations
from blast_env.surrogate.rooms import FLOAT, Room, new_room
from blast_env.surrogate.ways import SHARES, Ways

_LEAST_HEIGHT_M: Final = 0.3
"""Least height of the centre of a charge above the ground."""

_LEAST_Z: Final = 0.2
"""Least scaled distance, m/kg^(1/3): nearer points have the reflected loads at this distance."""

_LN_10: Final = log(10.0)

_GEOMETRY: Final = 7

FEATURES: Final = _GEOMETRY + 2 * SHARES
"""Inputs of a network per point: geometry and path shares."""

INPUTS: Final = FEATURES + RELATIONS
"""Inputs per point, plus those per solid and point."""


@dataclass(frozen=True, eq=False)
class Approach:
    """The layout-independent data of a charge and the protected walls.

    Attributes:
        starts: Index of the first point of each structure (structures,).
        ways: Paths from the charge to the points.
        outward: Outward normals of their walls, in plan (points, 2).
        scale_m: Scaling length: the cube root of the charge's mass in kg.
        on_empty: Features of each point on the empty site (points, FEATURES): geometry, then open
            path shares without and with the barrier, which are equal here.
        solids: Relations of each structure to each point (solids, points, RELATIONS).
        log_impulse: Logarithm of Kingery and Bulmash's reflected impulse, Pa s (points,).
        log_peak: Logarithm of their reflected overpressure, Pa (points,).
        area_m2: Wall area represented by each point (points,).
    """

    starts: IntArray
    ways: Ways
    outward: FloatArray
    scale_m: float
    on_empty: FloatArray
    solids: FloatArray
    log_impulse: FloatArray
    log_peak: FloatArray
    area_m2: FloatArray

    @classmethod
    def between(
        cls, charge: Charge, points: WallPoints, solids: FloatArray, room: Room = new_room
    ) -> "Approach":
        """Return the data of a charge and the points of walls.

        Args:
            charge: The charge.
            points: The points.
            solids: Left, bottom, right, top and height of each structure, m (solids, 5).
            room: Gives the arrays.

        Raises:
            BlastEnvError: If a point is farther away than the curves reach.
        """
        # 1. The paths, and the relations of the structures.
        start_m = np.array((*charge.position_m, max(charge.height_m, _LEAST_HEIGHT_M)))
        scale_m, count = float(np.cbrt(charge.tnt_kg)), len(points.area_m2)
        ways = Ways.between(start_m, points.points_m, charge.tnt_kg, solids, room)
        relations = room("relations of structures", (len(solids), count, RELATIONS), FLOAT)
        put_relations(start_m, points.points_m, points.outward, scale_m, solids, relations)
        # 2. What each point knows of itself, and loads in the open that the networks correct.
        features = room("features", (count, FEATURES), FLOAT)
        logs = room("logs", (2, count), FLOAT)
        walls = points.points_m, points.outward, points.to_roof_m, points.to_edge_m
        farthest_m = _put_features(start_m, scale_m, *walls, *_curves(), features, logs)
        if farthest_m > scale_m * CURVES_SCALED_M[1]:  # this has the words for it
            kingery_bulmash("reflected_impulse", farthest_m, charge.tnt_kg)
        shares = room("shares", (count, SHARES), FLOAT)
        ways.put_shares(shares)
        features[:, _GEOMETRY : FEATURES - SHARES] = features[:, FEATURES - SHARES :] = shares
        known = features, relations, *logs, points.area_m2
        return cls(points.starts, ways, points.outward, scale_m, *known)

    @property
    def log_loads(self) -> tuple[FloatArray, FloatArray]:
        """The logarithms of impulses and of overpressures in the open."""
        return self.log_impulse, self.log_peak

    @property
    def nbytes(self) -> int:
        """Size in memory."""
        ways = self.ways
        arrays = ways.by_m, ways.stopped, ways.weights, self.on_empty, self.solids
        return sum(array.nbytes for array in arrays)

    def points_of(self, structure: int) -> slice:
        """Return the slice of a structure's points, by its index among the protected ones."""
        return slice(*[*self.starts.tolist(), len(self.area_m2)][structure : structure + 2])

    def features(self, barrier: FloatArray) -> FloatArray:
        """Return the features of all points behind a barrier (points, FEATURES).

        Args:
            barrier: Left, bottom, right, top and height of each piece, m (pieces, 5).
        """
        features = self.on_empty.copy()
        changed, shares = self.ways.behind(barrier)
        features[changed, FEATURES - SHARES :] = shares
        return features

    def relations(self, barrier: FloatArray, room: Room = new_room) -> FloatArray:
        """Return the relations of each piece to each point (pieces, points, RELATIONS).

        Args:
            barrier: As for `features`.
            room: Gives the array.
        """
        ways, shape = self.ways, (len(barrier), len(self.area_m2), RELATIONS)
        found: FloatArray = room("relations of pieces", shape, FLOAT)
        put_relations(ways.start_m, ways.points_m, self.outward, self.scale_m, barrier, found)
        return found


@cache
def _curves() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the polynomials of impulses and peaks: coefficients, and a, b and ln(factor)."""
    impulse, peak = (
        curve_polynomial(quantity) for quantity in ("reflected_impulse", "reflected_overpressure")
    )
    of_both = [np.array((a, b, log(factor))) for a, b, _, factor in (impulse, peak)]
    return impulse[2], of_both[0], peak[2], of_both[1]


@compiled(nogil=True, error_model="numpy")
def _put_features(
    start_m: FloatArray,
    scale_m: float,
    points_m: FloatArray,
    outward: FloatArray,
    to_roof_m: FloatArray,
    to_edge_m: FloatArray,
    impulse: FloatArray,
    of_impulse: FloatArray,
    peak: FloatArray,
    of_peak: FloatArray,
    features: FloatArray,
    logs: FloatArray,
) -> float:
    """Put what each point knows of itself, and its loads in the open; return the largest distance.

    Args:
        start_m: Position of the charge (3,).
        scale_m: Scaling length.
        points_m: See `WallPoints`.
        outward: See `WallPoints`.
        to_roof_m: See `WallPoints`.
        to_edge_m: See `WallPoints`.
        impulse: Coefficients of the curve of impulses.
        of_impulse: Its a, b and the logarithm of its factor.
        peak: The same of peaks.
        of_peak: The same of peaks.
        features: `Approach.on_empty`, of which the geometry is put.
        logs: Logarithms of impulses and peaks (2, points).
    """
    farthest_m = 0.0
    for point in range(len(points_m)):
        x_m, y_m = start_m[0] - points_m[point, 0], start_m[1] - points_m[point, 1]
        z_m = start_m[2] - points_m[point, 2]
        # 1. Distance, and the cosine of the angle between the ray and the normal in plan; in scaled
        # lengths (Hopkinson & Cranz).
        distance_m = sqrt(x_m * x_m + y_m * y_m + z_m * z_m)
        facing = (x_m * outward[point, 0] + y_m * outward[point, 1]) / distance_m
        own = features[point]
        own[0] = log(distance_m / scale_m)
        own[1] = facing
        own[2] = abs(facing)
        own[3] = points_m[point, 2] / scale_m
        own[4] = to_roof_m[point] / scale_m
        own[5] = to_edge_m[point] / scale_m
        own[6] = log(scale_m)
        # 2. The curves begin at a least scaled distance.
        log_z = log10(max(distance_m / scale_m, _LEAST_Z))
        logs[0, point] = _log_curve(impulse, of_impulse, log_z) + log(scale_m)
        logs[1, point] = _log_curve(peak, of_peak, log_z)
        farthest_m = max(farthest_m, distance_m)
    return farthest_m


@njit(error_model="numpy")
def _log_curve(coefficients: FloatArray, of_curve: FloatArray, log_z: float) -> float:
    """Return the natural logarithm of a curve; see `curve_polynomial`."""
    u, found = of_curve[0] + of_curve[1] * log_z, 0.0
    for number in range(len(coefficients) - 1, -1, -1):
        found = found * u + coefficients[number]
    return float(_LN_10 * found + of_curve[2])
