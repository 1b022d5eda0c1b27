"""The worst places of a vehicle's charge: those nearest to a loaded wall of a protected structure.

A loaded wall is one of the structure's `faces`, whose load counts.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.geometry import Rectangle, WallLine
from blast_env.site.scene import Charge, WallName
from blast_env.site.sections import AnyStructure, PointM, VehicleSource

_EQUAL_M: Final = 1e-6
"""Tolerance within which distances are equal."""

_NEAR_M: Final = 1e-3
"""Largest excess over the least approximate distance of a candidate for the worst place."""


@dataclass(frozen=True)
class WorstPlaces:
    """The worst places of a vehicle's charge, in order.

    The first is the place nearest to a loaded wall; each further one is the nearest of those at
    least `VehicleSource.least_apart_m` from all before it. Since the charge is the same everywhere,
    this is also the order of scaled distances. Among equally near places the one nearest to the
    middle of its wall comes first, then the leftmost, then the lowest.

    Attributes:
        source: The vehicle.
        places_m: The places, at least one and at most `VehicleSource.places`.
        distances_m: Distance of each place from the nearest loaded wall.
    """

    source: VehicleSource
    places_m: tuple[PointM, ...]
    distances_m: tuple[float, ...]

    @property
    def stand_off_m(self) -> float:
        """Least distance of the vehicle's centre from a loaded wall."""
        return self.distances_m[0]

    def charge(self, rank: int) -> Charge:
        """Return the charge at a place by rank from 0; ranks wrap around at the last place."""
        place_m = self.places_m[rank % len(self.places_m)]
        return Charge(place_m, self.source.tnt_kg, self.source.height_m)


def worst_of(
    source: VehicleSource, places_m: FloatArray, structures: Sequence[AnyStructure]
) -> WorstPlaces:
    """Return the worst of some places.

    Args:
        source: The vehicle.
        places_m: Possible places of its charge, at least one (places, 2).
        structures: The structures.
    """
    rough_m = _rough_distance_m(places_m, structures)
    left = np.ones(len(places_m), dtype=bool)
    chosen: list[PointM] = []
    distances_m: list[float] = []
    while left.any() and len(chosen) < source.places:
        # Only the nearest are compared exactly; they stay ordered by y, then by x.
        near = np.flatnonzero(left & (rough_m <= rough_m[left].min() + _NEAR_M))
        distance_m, middle_m = nearest_wall(places_m[near], structures)
        best = np.arange(len(near))
        for measure in (distance_m, middle_m, places_m[near, 0], places_m[near, 1]):
            values = measure[best]
            best = best[values <= values.min() + _EQUAL_M]
        x_m, y_m = places_m[near[best[0]]]
        chosen.append((float(x_m), float(y_m)))
        distances_m.append(float(distance_m[best[0]]))
        if len(chosen) < source.places:
            apart_m = np.hypot(places_m[:, 0] - x_m, places_m[:, 1] - y_m)
            left &= apart_m >= source.least_apart_m - _EQUAL_M
    return WorstPlaces(source, tuple(chosen), tuple(distances_m))


def _rough_distance_m(places_m: FloatArray, structures: Iterable[AnyStructure]) -> FloatArray:
    """Return the distance of `nearest_wall` up to rounding (places,)."""
    x_m, y_m = np.ascontiguousarray(places_m.T)
    square_m2 = np.full(len(places_m), np.inf)
    for structure in structures:
        if structure.protected:
            for wall in _walls(structure):
                if isinstance(wall, WallLine):
                    np.minimum(square_m2, wall.distances_m(places_m) ** 2, out=square_m2)
                    continue
                left, bottom, right, top = wall
                across_m, along_m = x_m - x_m.clip(left, right), y_m - y_m.clip(bottom, top)
                np.minimum(square_m2, across_m**2 + along_m**2, out=square_m2)
    distance_m: FloatArray = np.sqrt(square_m2)
    return distance_m


def stand_off_m(structures: Iterable[AnyStructure], position_m: PointM) -> float:
    """Return the distance of a place from the nearest loaded wall, m."""
    distances_m, _ = nearest_wall(np.array([position_m]), structures)
    return float(distances_m[0])


def nearest_point_m(structures: Iterable[AnyStructure], position_m: PointM) -> PointM:
    """Return the point of the loaded walls nearest to a place.

    Raises:
        ValueError: If no structure is protected.
    """
    x_m, y_m = position_m
    walls = [wall for each in structures if each.protected for wall in _walls(each)]
    points = [_nearest_m(wall, position_m) for wall in walls]
    return min(points, key=lambda point: hypot(point[0] - x_m, point[1] - y_m))


def _nearest_m(wall: Rectangle | WallLine, place_m: PointM) -> PointM:
    """Return the point of a wall nearest to a place."""
    if isinstance(wall, WallLine):
        return wall.point_at(float(wall.along_m(np.array([place_m]))[0].clip(0.0, wall.length_m)))
    left, bottom, right, top = wall
    return min(max(place_m[0], left), right), min(max(place_m[1], bottom), top)


def nearest_wall(
    places_m: FloatArray, structures: Iterable[AnyStructure]
) -> tuple[FloatArray, FloatArray]:
    """Return the distance of places from the nearest loaded wall, and from its middle, m.

    Args:
        places_m: The places (places, 2).
        structures: The structures, of which the protected ones count.
    """
    nearest_m, middle_m, most_m = np.full((3, len(places_m)), np.inf)
    x_m, y_m = np.ascontiguousarray(places_m.T)
    protected = [each for each in structures if each.protected]

    def least_m(structure: AnyStructure) -> FloatArray:
        left, bottom, right, top = _around_m(structure)
        across_m = np.maximum(np.maximum(left - x_m, x_m - right), 0.0)
        along_m = np.maximum(np.maximum(bottom - y_m, y_m - top), 0.0)
        distances_m: FloatArray = np.sqrt(across_m**2 + along_m**2)
        return distances_m

    for structure in protected:
        left, bottom, right, top = _around_m(structure)
        # No wall of the structure is farther from a place than this.
        diagonal_m = hypot(right - left, top - bottom) + 2.0 * _EQUAL_M
        np.minimum(most_m, least_m(structure) + diagonal_m, out=most_m)
    for structure in protected:
        near = np.flatnonzero(least_m(structure) <= most_m)
        nearest_m[near], middle_m[near] = _nearer_wall(
            places_m[near], structure, nearest_m[near], middle_m[near]
        )
    return nearest_m, middle_m


def _nearer_wall(
    places_m: FloatArray, structure: AnyStructure, nearest_m: FloatArray, middle_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return both distances of `nearest_wall`, updated with one more structure."""
    x_m, y_m = places_m.T
    for wall in _walls(structure):
        if isinstance(wall, WallLine):
            left, bottom, right, top = wall.bounds_m
            wall_m = wall.distances_m(places_m)
        else:
            left, bottom, right, top = wall
            across_m = np.maximum(np.maximum(left - x_m, x_m - right), 0.0)
            along_m = np.maximum(np.maximum(bottom - y_m, y_m - top), 0.0)
            wall_m = np.hypot(across_m, along_m)
        aside_m = np.hypot(x_m - (left + right) / 2.0, y_m - (bottom + top) / 2.0)
        nearer = wall_m < nearest_m - _EQUAL_M
        as_near = np.abs(wall_m - nearest_m) <= _EQUAL_M
        middle_m = np.where(
            nearer, aside_m, np.where(as_near, np.minimum(middle_m, aside_m), middle_m)
        )
        nearest_m = np.minimum(nearest_m, wall_m)
    return nearest_m, middle_m


def _around_m(structure: AnyStructure) -> Rectangle:
    """Return the rectangle around the walls of a structure."""
    if structure.footprint is None:
        return structure.rectangle_m
    return Rectangle.around([each.bounds_m for each in structure.footprint.walls])


def _walls(structure: AnyStructure) -> Iterator[Rectangle | WallLine]:
    """Yield the loaded walls: of a rectangle as rectangles of width 0."""
    if structure.footprint is not None:
        yield from (each for each in structure.footprint.walls if each.side in structure.faces)
        return
    left, bottom, right, top = structure.rectangle_m
    sides: dict[WallName, Rectangle] = {
        "west": Rectangle(left, bottom, left, top),
        "east": Rectangle(right, bottom, right, top),
        "south": Rectangle(left, bottom, right, bottom),
        "north": Rectangle(left, top, right, top),
    }
    yield from (sides[wall] for wall in structure.faces)
