"""A charge and the protected walls: all inputs of the surrogate that no layout changes."""

from dataclasses import dataclass
from functools import cache
from math import log, log10, sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.compilation import compiled
from blast_env.curves.kingery_bulmash import CURVES_SCALED_M, curve_polynomial, kingery_bulmash
from blast_env.site.blast_site import Charge
from blast_env.surrogate.neighbours import TRAITS
from blast_env.surrogate.points import WallPoints
from blast_env.surrogate.relations import RELATIONS, put_relations, solid_relations
from blast_env.surrogate.rooms import BOOL, BYTE, FLOAT, Counts, Room
from blast_env.surrogate.ways import (
    ABOVE_M,
    ASIDE_M,
    FALLS_M,
    REFERENCE_KG,
    SHARES,
    STATIONS,
    Ways,
    put_open_shares,
    put_ways,
)

_LEAST_HEIGHT_M: Final = 0.3
"""Least height of the centre of a charge above the ground."""

_LEAST_Z: Final = 0.2
"""Least scaled distance, m/kg^(1/3): nearer points have the reflected loads at this distance."""

_LN_10: Final = log(10.0)

_GEOMETRY: Final = 7

FEATURES: Final = _GEOMETRY + 2 * SHARES
"""Inputs of a network per point: geometry and path shares."""

INPUTS: Final = FEATURES + RELATIONS + TRAITS
"""Inputs per point, those per solid and point, and those per piece."""


class ApproachArrays(NamedTuple):
    """The layout-independent data of a charge and points on walls, as compiled code puts it.

    Attributes:
        by_m: See `Ways`.
        by_height_m: See `Ways`.
        stopped: See `Ways`.
        is_straight_open: See `Ways`.
        weights: See `Ways`.
        relations: Relations of each structure to each point (structures, points, RELATIONS).
        features: Features of each point on the empty site (points, FEATURES).
        logs: Logarithms of the impulse, Pa s, and the peak, Pa, in the open (2, points).
    """

    by_m: FloatArray
    by_height_m: FloatArray
    stopped: Counts
    is_straight_open: BoolArray
    weights: FloatArray
    relations: FloatArray
    features: FloatArray
    logs: FloatArray

    @classmethod
    def in_room(cls, points: int, structures: int, room: Room) -> "ApproachArrays":
        """Return arrays with any content."""
        shape = points, len(STATIONS), len(ASIDE_M)
        left = *shape[:2], (len(ASIDE_M) + 1) // 2, len(ABOVE_M) + 1, len(FALLS_M)
        return cls(
            room("places", (*shape, 2), FLOAT),
            room("heights", shape[:2], FLOAT),
            room("stopped", shape, BYTE),
            room("open", shape[:1], BOOL),
            room("weights", left, FLOAT),
            room("relations of structures", (structures, points, RELATIONS), FLOAT),
            room("features", (points, FEATURES), FLOAT),
            room("logs", (2, points), FLOAT),
        )


def charge_row(charge: Charge) -> tuple[float, float, float, float, float]:
    """Return position, scaling length and longest decay length of a charge, m."""
    height_m = max(charge.height_m, _LEAST_HEIGHT_M)
    fall_m = FALLS_M[-1] * float(np.cbrt(charge.tnt_kg / REFERENCE_KG))
    return (*charge.position_m, height_m, float(np.cbrt(charge.tnt_kg)), fall_m)


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
    def between(cls, charge: Charge, points: WallPoints, solids: FloatArray) -> "Approach":
        """Return the data of a charge and the points of walls.

        Args:
            charge: The charge.
            points: The points.
            solids: Left, bottom, right, top and height of each structure, m (solids, 5).

        Raises:
            BlastEnvError: If a point is farther away than the curves reach.
        """
        row, count = charge_row(charge), len(points.area_m2)
        own = ApproachArrays.in_room(count, len(solids), Room())
        start_m, scale_m = np.array(row[:3]), row[3]
        farthest_m = put_approach(start_m, *row[3:], points, solids, curves(), own)
        check_within_curves(farthest_m, charge)
        known = own.features, own.relations, *own.logs, points.area_m2
        ways = Ways(start_m, points.points_m, *own[:5])
        return cls(points.starts, ways, points.outward, scale_m, *known)

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

    def relations(self, barrier: FloatArray) -> FloatArray:
        """Return the relations of each piece to each point (pieces, points, RELATIONS).

        Args:
            barrier: As for `features`.
        """
        ways = self.ways
        return solid_relations(
            ways.start_m, ways.points_m, self.outward, self.scale_m, np.ascontiguousarray(barrier)
        )


def check_within_curves(farthest_m: float, charge: Charge) -> None:
    """Refuse a charge with a point beyond the reach of the curves (`BlastEnvError`)."""
    if farthest_m > float(np.cbrt(charge.tnt_kg)) * CURVES_SCALED_M[1]:  # this has the words for it
        kingery_bulmash("reflected_impulse", farthest_m, charge.tnt_kg)


@cache
def curves() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the polynomials of impulses and peaks: coefficients, and a, b and ln(factor)."""
    impulse, peak = (
        curve_polynomial(quantity) for quantity in ("reflected_impulse", "reflected_overpressure")
    )
    of_both = [np.array((a, b, log(factor))) for a, b, _, factor in (impulse, peak)]
    return impulse[2], of_both[0], peak[2], of_both[1]


@compiled(nogil=True, error_model="numpy", inline="always")
def put_approach(
    start_m: FloatArray,
    scale_m: float,
    fall_m: float,
    points: WallPoints,
    solids: FloatArray,
    of_curves: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    own: ApproachArrays,
) -> float:
    """Put the layout-independent data of a charge; return the largest distance of a point.

    Args:
        start_m: Position of the charge (3,).
        scale_m: Scaling length.
        fall_m: Longest decay length of the weight of a detour.
        points: The points.
        solids: Left, bottom, right, top and height of each structure, m (solids, 5).
        of_curves: What `curves` returns.
        own: The arrays.
    """
    # 1. The paths, and the relations of the structures; 2. what each point knows of itself, and
    # loads in the open that the networks correct; 3. its open shares, equal without a barrier.
    put_ways(
        start_m,
        points.points_m,
        fall_m,
        solids,
        own.by_m,
        own.by_height_m,
        own.stopped,
        own.is_straight_open,
        own.weights,
    )
    put_relations(start_m, points.points_m, points.outward, scale_m, solids, own.relations)
    walls = points.points_m, points.outward, points.to_roof_m, points.to_edge_m
    features = own.features
    farthest_m: float = _put_features(start_m, scale_m, *walls, *of_curves, features, own.logs)
    every = np.arange(len(features))
    shares = np.empty((len(features), SHARES))
    put_open_shares(every, own.stopped, own.is_straight_open, own.weights, shares)
    for point in range(len(features)):
        for share in range(SHARES):
            features[point, _GEOMETRY + share] = shares[point, share]
            features[point, _GEOMETRY + SHARES + share] = shares[point, share]
    return farthest_m


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
