"""The worst places of a vehicle's charge: those nearest to a loaded wall of a protected structure.

A loaded wall is one of a structure's `faces`, whose load counts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.geometry import Rectangle, WallLine, box_distances_m
from blast_env.sections import PointM
from blast_env.vehicles.vehicle import Vehicle

Wall = Rectangle | WallLine
"""A wall in plan; that of a rectangular structure is a rectangle of width 0."""

_EQUAL_M: Final = 1e-6
"""Tolerance within which distances are equal."""


@dataclass(frozen=True)
class WorstPlaces:
    """The worst places of a vehicle's charge, in order.

    The first is the place nearest to a loaded wall; each further one is the nearest of those at
    least `Vehicle.least_apart_m` from all before it. Since the charge is the same everywhere,
    this is also the order of scaled distances. Among equally near places the one nearest to the
    middle of its wall comes first, then the leftmost, then the lowest.

    Attributes:
        source: The vehicle.
        places_m: The places, at least one and at most `Vehicle.places`.
        distances_m: Distance of each place from the nearest loaded wall.
    """

    source: Vehicle
    places_m: tuple[PointM, ...]
    distances_m: tuple[float, ...]

    @property
    def stand_off_m(self) -> float:
        """Least distance of the vehicle's centre from a loaded wall."""
        return self.distances_m[0]

    def place_m(self, rank: int) -> PointM:
        """Return a place by its rank, from 0; ranks wrap around at the last place."""
        return self.places_m[rank % len(self.places_m)]


def worst_of(source: Vehicle, places_m: FloatArray, walls: Sequence[Wall]) -> WorstPlaces:
    """Return the worst of some places.

    Args:
        source: The vehicle.
        places_m: Possible places of its charge, at least one (places, 2).
        walls: The loaded walls of protected structures.
    """
    stand_offs_m = least_distances_m(walls, places_m)
    left = np.ones(len(places_m), dtype=bool)
    chosen: list[PointM] = []
    distances_m: list[float] = []
    while left.any() and len(chosen) < source.places:
        near = np.flatnonzero(left & (stand_offs_m <= stand_offs_m[left].min() + _EQUAL_M))
        middle_m = _from_middle_m(walls, places_m[near], stand_offs_m[near])
        best = np.arange(len(near))  # ordered by y, then by x
        for measure in (middle_m, *places_m[near].T):
            values = measure[best]
            best = best[values <= values.min() + _EQUAL_M]
        worst = near[best[0]]
        x_m, y_m = places_m[worst].tolist()
        chosen.append((x_m, y_m))
        distances_m.append(float(stand_offs_m[worst]))
        if len(chosen) < source.places:
            apart_m = np.hypot(places_m[:, 0] - x_m, places_m[:, 1] - y_m)
            left &= apart_m >= source.least_apart_m - _EQUAL_M
    return WorstPlaces(source, tuple(chosen), tuple(distances_m))


def stand_off_m(walls: Iterable[Wall], position_m: PointM) -> float:
    """Return the distance of a place from the nearest loaded wall, m."""
    return float(least_distances_m(walls, np.array([position_m]))[0])


def least_distances_m(walls: Iterable[Wall], places_m: FloatArray) -> FloatArray:
    """Return the distances of places (places, 2) from the nearest loaded wall, m (places,)."""
    nearest_m = np.full(len(places_m), np.inf)
    for wall in walls:
        np.minimum(nearest_m, _distances_m(wall, places_m), out=nearest_m)
    return nearest_m


def _from_middle_m(
    walls: Iterable[Wall], places_m: FloatArray, nearest_m: FloatArray
) -> FloatArray:
    """Return the distance of places from the middle of the nearest loaded wall, m (places,)."""
    middle_m = np.full(len(places_m), np.inf)
    for wall in walls:
        x_m, y_m = (wall.bounds_m if isinstance(wall, WallLine) else wall).centre
        aside_m = np.hypot(places_m[:, 0] - x_m, places_m[:, 1] - y_m)
        is_nearest = _distances_m(wall, places_m) <= nearest_m + _EQUAL_M
        np.minimum(middle_m, aside_m, out=middle_m, where=is_nearest)
    return middle_m


def nearest_point_m(walls: Iterable[Wall], position_m: PointM) -> PointM:
    """Return the point of the loaded walls nearest to a place.

    Raises:
        ValueError: If there is none.
    """
    x_m, y_m = position_m
    points = [_nearest_m(wall, position_m) for wall in walls]
    return min(points, key=lambda point: hypot(point[0] - x_m, point[1] - y_m))


def _nearest_m(wall: Wall, place_m: PointM) -> PointM:
    """Return the point of a wall nearest to a place."""
    if isinstance(wall, WallLine):
        return wall.point_at(float(wall.along_m(np.array([place_m]))[0].clip(0.0, wall.length_m)))
    left, bottom, right, top = wall
    return min(max(place_m[0], left), right), min(max(place_m[1], bottom), top)


def _distances_m(wall: Wall, places_m: FloatArray) -> FloatArray:
    """Return the distances of places (places, 2) from a wall, m (places,)."""
    if isinstance(wall, WallLine):
        return wall.distances_m(places_m)
    x_m, y_m = np.ascontiguousarray(places_m.T)
    return box_distances_m(wall, (x_m, y_m, x_m, y_m))
