"""The worst places of a vehicle's charge: those nearest to a loaded wall of a protected structure.

A loaded wall is one of a structure's `faces`, whose load counts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.geometry import Rectangle, Wall, WallLine, distances_between_m
from blast_env.sections import PointM
from blast_env.vehicles.reach import PER_M, ReachQuery, places_apart
from blast_env.vehicles.vehicle import Vehicle

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
        places_m: Possible places of its charge, at least one (places, 2).
        walls: The loaded walls of protected structures.
    """
    from blast_env.vehicles.worst_kernels import chosen_places  # Numba takes long to import

    distances_m = _distances_m(walls, places_m)
    chosen = chosen_places(
        np.ascontiguousarray(places_m),
        distances_m,
        _middles_m(walls),
        source.places,
        source.least_apart_m,
        _EQUAL_M,
    )
    # Of all loaded walls the nearest counts.
    of_chosen_m = distances_m[:, chosen].min(axis=0, initial=np.inf)
    places = tuple((x_m, y_m) for x_m, y_m in places_m[chosen].tolist())
    return WorstPlaces(source, places, tuple(of_chosen_m.tolist()))


@dataclass(frozen=True, eq=False)
class PlainGround:
    """A vehicle's surroundings as arrays, for its worst places against many layouts in turn.

    They are those of `worst_of` at all places of the reach, found without the reach.

    Attributes:
        query: Its reach on the empty site.
        walls_m: The loaded walls (walls, 4).
        middles_m: Their middles (walls, 2).
    """

    source: Vehicle
    query: ReachQuery
    walls_m: FloatArray
    middles_m: FloatArray

    @classmethod
    def of(cls, source: Vehicle, query: ReachQuery, walls: Sequence[Wall]) -> "PlainGround | None":
        """Return the same of loaded walls, or `None` unless all are parallel to the site's sides.

        Args:
            query: Its reach on the empty site.
        """
        if not walls or any(isinstance(wall, WallLine) for wall in walls):
            return None
        return cls(source, query, np.array(walls, dtype=np.float64), _middles_m(walls))

    @cached_property
    def _empty(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Cuts and places along x and along y on the empty site."""
        from blast_env.vehicles.reach_kernels import plane_of  # as in `worst`

        always, never, starts, level = self.query.boxes
        boxes, (width, height) = np.concatenate((always, never, starts)), self.query.ends
        along_x, along_y = (
            plane_of(boxes, level, self.query.half, end, places_apart(end), axis)
            for axis, end in enumerate((width, height))
        )
        return *along_x, *along_y

    def worst(
        self, closed_m: Sequence[Rectangle], solid_m: Sequence[Rectangle]
    ) -> WorstPlaces | None:
        """Return the worst places against further obstacles; `None` if there are no places.

        Args:
            closed_m: Obstacles that stop it.
            solid_m: Obstacles that it drives over.
        """
        from blast_env.vehicles.worst_kernels import worst_against  # Numba takes long to import

        always, never, starts, _ = self.query.boxes
        places_m, distances_m = worst_against(
            *(always, never, starts, self.query.half),
            np.array([*closed_m, *solid_m], dtype=np.float64).reshape(-1, 4),
            len(closed_m),
            *self._empty,
            *(PER_M, self.walls_m, self.middles_m),
            *(self.source.places, self.source.least_apart_m, _EQUAL_M),
        )
        if not len(places_m):
            return None
        places = tuple((x_m, y_m) for x_m, y_m in places_m.tolist())
        return WorstPlaces(self.source, places, tuple(distances_m.tolist()))

    def stand_offs_m(
        self,
        boxes_m: FloatArray,
        kinds: NDArray[np.uint8],
        layouts: IntArray,
        counts: IntArray,
    ) -> FloatArray:
        """Return the stand-off behind each of several layouts, m (layouts,).

        It is NaN where there are no places, or an element has its own rules. Arguments are those of
        `worst_of_many`.
        """
        _, distances_m, found = self._behind(boxes_m, kinds, layouts, counts, 1)
        return np.where(found, distances_m[:, 0], np.nan)

    def worst_of_many(
        self,
        boxes_m: FloatArray,
        kinds: NDArray[np.uint8],
        layouts: IntArray,
        counts: IntArray,
    ) -> list[WorstPlaces | None]:
        """Return the worst places behind each of several layouts (layouts,).

        They are `None` where there are none, or an element has its own rules.

        Args:
            boxes_m: Left, bottom, right and top of numbered elements (elements, 4).
            kinds: What they are (elements,).
            layouts: Numbers of the elements of each layout (layouts, most).
            counts: How many each has (layouts,).
        """
        arrays = self._behind(boxes_m, kinds, layouts, counts, self.source.places)
        lists = (array.tolist() for array in arrays)
        return [
            WorstPlaces(self.source, tuple(map(tuple, of_one[:count])), tuple(away_m[:count]))
            if count
            else None
            for of_one, away_m, count in zip(*lists, strict=True)
        ]

    def _behind(
        self,
        boxes_m: FloatArray,
        kinds: NDArray[np.uint8],
        layouts: IntArray,
        counts: IntArray,
        most: int,
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return the worst places, their distances and their number; see `put_worst`."""
        from blast_env.vehicles.worst_kernels import put_worst  # as in `worst`

        count = len(layouts)
        arrays = np.empty((count, most, 2)), np.empty((count, most)), np.empty(count, np.int64)
        always, never, starts, _ = self.query.boxes
        put_worst(
            *(boxes_m, kinds, layouts, counts, always, never, starts, self.query.half),
            *(*self._empty, PER_M, self.walls_m, self.middles_m),
            *(self.source.least_apart_m, _EQUAL_M, *arrays),
        )
        return arrays


def _middles_m(walls: Sequence[Wall]) -> FloatArray:
    """Return the middle of each wall (walls, 2)."""
    boxes_m = [wall.bounds_m if isinstance(wall, WallLine) else wall for wall in walls]
    return np.array([box.centre for box in boxes_m]).reshape(-1, 2)


def stand_off_m(walls: Iterable[Wall], position_m: PointM) -> float:
    """Return the distance of a place from the nearest loaded wall, m."""
    return float(least_distances_m(walls, np.array([position_m]))[0])


def least_distances_m(walls: Iterable[Wall], places_m: FloatArray) -> FloatArray:
    """Return the distances of places (places, 2) from the nearest loaded wall, m (places,)."""
    nearest_m: FloatArray = _distances_m(tuple(walls), places_m).min(axis=0, initial=np.inf)
    return nearest_m


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


def _distances_m(walls: Sequence[Wall], places_m: FloatArray) -> FloatArray:
    """Return the distances of places (places, 2) from walls, m (walls, places)."""
    found = np.empty((len(walls), len(places_m)))
    boxes_m = {k: wall for k, wall in enumerate(walls) if not isinstance(wall, WallLine)}
    left, bottom, right, top = np.array([*boxes_m.values()]).reshape(-1, 4).T[..., np.newaxis]
    x_m, y_m = np.ascontiguousarray(places_m.T)
    found[[*boxes_m]] = distances_between_m((left, bottom, right, top), (x_m, y_m, x_m, y_m))
    for own, wall in zip(found, walls, strict=True):
        if isinstance(wall, WallLine):
            own[:] = wall.distances_m(places_m)
    return found
