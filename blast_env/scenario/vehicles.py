"""Vehicles with a charge: where one can get to, and the worst places where its charge goes off.

A vehicle is a square of ground, `width_m` on a side, whose sides stay parallel to those of the
site. From the border it moves in any direction without a turn, and never covers a structure,
ground that is closed to it, a gate, or what stops it. To touch is allowed: it fits through a gap of
just its width, but not through one of a micrometre less, nor cornerwise between two things that
touch.

All of that is worked out without a grid, on the places of the vehicle's centre: obstacles grow by
half of the width on all sides, and cut the plane into rectangles, edges and corners, each of which
is open to the centre as a whole or not at all. Lengths are whole micrometres there.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import ceil, hypot
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Element, Rectangle, stacked_runs, standing
from blast_env.physics.scene import Charge, WallName
from blast_env.scenario.sections import (
    AnySource,
    AnyStructure,
    Entry,
    PointM,
    PointSource,
    Site,
    VehicleSource,
)
from blast_env.scenario.zone import BuildZone
from blast_env.units import MODULE_SIDE_M

_PER_M: Final = 1_000_000
"""Steps of length in a metre: micrometres, so that what is equal is equal to the last bit."""


_MOST_STEPS: Final = 1000
"""Most places along a side of the site at which the charge may go off, obstacles aside."""


_EQUAL_M: Final = 1e-6
"""Distances that differ by less are equal."""


_SAME_M: Final = 1e-9
"""Edges that differ by less are the same, as in `Rectangle.contains`."""


MOST_PLACES: Final = 3_000_000
"""Places of all vehicles at which their charges may go off: three vehicles on the largest site."""


@dataclass(frozen=True)
class VehicleCharge:
    """The charge of a vehicle before there is a layout; see `WorstPlaces.charge`.

    Attributes:
        source: The vehicle.
        rank: How many worse places there are than the one at which it goes off.
    """

    source: VehicleSource
    rank: int = 0

    @property
    def tnt_kg(self) -> float:
        """TNT-equivalent mass."""
        return self.source.tnt_kg

    @property
    def height_m(self) -> float:
        """Height of the charge's centre above the ground."""
        return self.source.height_m

    def with_charge(
        self, tnt_kg: float | None = None, height_m: float | None = None
    ) -> "VehicleCharge":
        """Return the same one with another mass or height of the charge; bounds are not checked."""
        changes = {"tnt_kg": tnt_kg, "height_m": height_m}
        given = {key: value for key, value in changes.items() if value is not None}
        return VehicleCharge(self.source.model_copy(update=given), self.rank)


AnyCharge = Charge | VehicleCharge
"""A charge at a place, or one that a vehicle brings as near as a layout lets it."""


def source_of(charge: AnyCharge) -> AnySource:
    """Return the source that has this charge alone: a point, or the vehicle.

    Raises:
        ValidationError: If the charge is out of bounds.
    """
    return charge.source if isinstance(charge, VehicleCharge) else PointSource.at(charge)


def ranked(charges: Iterable[AnyCharge]) -> tuple[AnyCharge, ...]:
    """Return charges with those of each vehicle at its worst place, its second worst, and so on."""
    met: dict[VehicleSource, int] = {}
    result: list[AnyCharge] = []
    for charge in charges:
        if isinstance(charge, VehicleCharge):
            rank = met.get(charge.source, 0)
            met[charge.source] = rank + 1
            result.append(VehicleCharge(charge.source, rank))
        else:
            result.append(charge)
    return tuple(result)


class Obstacles(NamedTuple):
    """What a layout puts in the way of a vehicle, rectangles in metres.

    Attributes:
        stops: What it cannot pass.
        solid: What it drives over; but no charge goes off inside of it.
    """

    stops: tuple[Rectangle, ...] = ()
    solid: tuple[Rectangle, ...] = ()


NOTHING: Final = Obstacles()
"""The empty site."""


def obstacles_of(zone: BuildZone, layout: Iterable[Element]) -> Obstacles:
    """Return what a layout of a build zone puts in the way.

    Single modules stop a vehicle; of the items of a catalogue, those that are said to.

    Raises:
        LayoutError: If there is no such item, or it cannot be turned.
    """
    stops: list[Rectangle] = []
    solid: list[Rectangle] = []
    for element in sorted(standing(layout)):
        into = stops if zone.catalogue.variant(element).stops_vehicles else solid
        into.append(zone.element_rectangle_m(element))
    return Obstacles(tuple(stops), tuple(solid))


@dataclass(frozen=True)
class VehicleGround:
    """What a vehicle meets on the empty site.

    Attributes:
        source: The vehicle.
        site: The site.
        structures: The structures.
        gates: Gates that are closed to it.
    """

    source: VehicleSource
    site: Site
    structures: tuple[AnyStructure, ...]
    gates: tuple[Rectangle, ...] = ()

    @property
    def entries(self) -> tuple[tuple[Entry, WallName], ...]:
        """The entries on the border that are wide enough, with the side of the site."""
        return tuple(
            (entry, side)
            for entry in self.source.entries
            if (side := entry.side(self.site)) is not None
            and _steps(entry.length_m) >= _steps(self.source.width_m)
        )

    @property
    def closed_m(self) -> tuple[Rectangle, ...]:
        """Everything that it must not cover."""
        return (
            *(structure.rectangle_m for structure in self.structures),
            *(area.rectangle_m for area in self.source.keep_outs),
            *self.gates,
            *_outside(self.site.rectangle_m, [each.rectangle_m for each in self.source.drivable]),
        )

    def reach(self, obstacles: Obstacles = NOTHING) -> "Reach":
        """Return where the vehicle gets to; for equal arguments, the same object."""
        return _reach(self, obstacles)

    def worst_places(self, obstacles: Obstacles = NOTHING) -> "WorstPlaces":
        """Return where its charge goes off; for equal arguments, the same object."""
        return _worst_places(self, obstacles)

    @property
    def entry_stand_off_m(self) -> float:
        """How near to a protected structure it is when it has just entered."""
        return float(_nearest_wall(self.reach().starts_m, self.structures)[0].min())


def places_on(site: Site) -> int:
    """Return at how many places of a site a vehicle's charge may go off, obstacles aside."""
    along_x, along_y = (
        _steps(side_m) // _step(_steps(side_m)) for side_m in (site.width_m, site.height_m)
    )
    return along_x * along_y


def squares_of(site: Site) -> tuple[int, int]:
    """Return how many rows and columns of squares of 0.5 m cover a site."""
    rows, columns = (ceil(m / MODULE_SIDE_M - 1e-9) for m in (site.height_m, site.width_m))
    return rows, columns


@dataclass(frozen=True, eq=False)
class Reach:
    """Where a vehicle can get to.

    The plane of its centre is cut at `x_m` and `y_m` into corners, edges and rectangles: those of
    even row and column are corners, those of odd ones the rectangles between.

    Attributes:
        width_m: Side of its square.
        x_m: Cuts along x, rising (columns,).
        y_m: Cuts along y, rising (rows,).
        start: Where its centre is when it has just entered (2 rows - 1, 2 columns - 1).
        reached: Where its centre can get to, of the same shape.
        clear: Where it would cover nothing that it can drive over, of the same shape.
    """

    width_m: float
    x_m: FloatArray
    y_m: FloatArray
    start: BoolArray
    reached: BoolArray
    clear: BoolArray

    @property
    def enters(self) -> bool:
        """Whether it can enter at all."""
        return bool(self.reached.any())

    @cached_property
    def places_m(self) -> FloatArray:
        """Places where its charge may go off, (places, 2): corners that are clear."""
        return self._corners_m(self.reached & self.clear)

    @property
    def starts_m(self) -> FloatArray:
        """Those of the places where it has just entered, (places, 2)."""
        return self._corners_m(self.start)

    def _corners_m(self, where: BoolArray) -> FloatArray:
        rows, columns = np.nonzero(where[::2, ::2])
        return np.column_stack((self.x_m[columns], self.y_m[rows]))

    def ground(self, rows: int, columns: int) -> BoolArray:
        """Return which squares of 0.5 m from the lower left corner of the site it can cover.

        Args:
            rows: Squares upwards.
            columns: Squares to the right.
        """
        row, column = np.nonzero(self.reached)
        left, right = _squares(self.x_m, column, self.width_m, columns)
        bottom, top = _squares(self.y_m, row, self.width_m, rows)
        # Corners of many rectangles, added up twice: how many of them cover a square.
        counts = np.zeros((rows + 1, columns + 1), dtype=np.int64)
        for y, sign in ((bottom, 1), (top, -1)):
            np.add.at(counts, (y, left), sign)
            np.add.at(counts, (y, right), -sign)
        covered: BoolArray = counts.cumsum(axis=0).cumsum(axis=1)[:rows, :columns] > 0
        return covered


def _squares(
    cuts_m: FloatArray, index: NDArray[np.intp], width_m: float, count: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first square that is covered from some part of the plane, and the one after."""
    low_m = cuts_m[index // 2] - width_m / 2.0
    high_m = cuts_m[(index + 1) // 2] + width_m / 2.0
    first = np.floor(low_m / MODULE_SIDE_M + 1e-5).astype(np.intp)
    after = np.ceil(high_m / MODULE_SIDE_M - 1e-5).astype(np.intp)
    return first.clip(0, count), after.clip(0, count)


@lru_cache(maxsize=8)
def _reach(ground: VehicleGround, obstacles: Obstacles) -> Reach:
    """Work out where a vehicle gets to."""
    from scipy.ndimage import label  # takes a third of a second to import

    half = _steps(ground.source.width_m) // 2
    plane = _Plane.of(ground, obstacles, half)
    closed = plane.covering((*ground.closed_m, *obstacles.stops))
    start = np.zeros_like(closed)
    for entry, side in ground.entries:
        start[plane.start(entry.strip_m(ground.site, side, ground.source.width_m))] = True
    start &= ~closed
    # Corners hang together along edges, and edges along rectangles: side by side, never cornerwise.
    labels, count = label(~closed)
    connected = np.zeros(count + 1, dtype=bool)
    connected[labels[start]] = True
    return Reach(
        width_m=ground.source.width_m,
        x_m=plane.x / _PER_M,
        y_m=plane.y / _PER_M,
        start=start,
        reached=connected[labels],
        clear=~plane.covering(obstacles.solid),
    )


@dataclass(frozen=True, eq=False)
class _Plane:
    """The plane of the centres of a vehicle, cut by all that it must not cover, micrometres.

    Attributes:
        x: Cuts along x, rising; the first and the last are where it touches the border.
        y: Cuts along y.
        half: Half of its width.
    """

    x: NDArray[np.int64]
    y: NDArray[np.int64]
    half: int

    @classmethod
    def of(cls, ground: VehicleGround, obstacles: Obstacles, half: int) -> "_Plane":
        grown = [_grown(each, half) for each in (*ground.closed_m, *obstacles.stops)]
        grown += [_grown(each, half) for each in obstacles.solid]
        inner = [
            _grown(entry.strip_m(ground.site, side, ground.source.width_m), -half)
            for entry, side in ground.entries
        ]
        # Nearest to a structure are places that touch it, or that are level with its corners.
        level = [_grown(each.rectangle_m, 0) for each in ground.structures]
        width, height = _steps(ground.site.width_m), _steps(ground.site.height_m)
        boxes = (*grown, *inner, *level)
        return cls(
            x=_cuts([edge for box in boxes for edge in box[0::2]], half, width),
            y=_cuts([edge for box in boxes for edge in box[1::2]], half, height),
            half=half,
        )

    def covering(self, rectangles_m: Iterable[Rectangle]) -> BoolArray:
        """Return where the vehicle would cover any of the rectangles; to touch is not to cover."""
        covered = np.zeros((2 * len(self.y) - 1, 2 * len(self.x) - 1), dtype=bool)
        for rectangle in rectangles_m:
            left, bottom, right, top = _grown(rectangle, self.half)
            covered[_between(self.y, bottom, top), _between(self.x, left, right)] = True
        return covered

    def start(self, strip_m: Rectangle) -> tuple[slice, slice]:
        """Return where the vehicle stands within the strip behind an entry."""
        left, bottom, right, top = _grown(strip_m, -self.half)
        return _within(self.y, bottom, top), _within(self.x, left, right)


Box = tuple[int, int, int, int]
"""Left, bottom, right and top in micrometres."""


def _steps(length_m: float) -> int:
    return round(length_m * _PER_M)


def _grown(rectangle: Rectangle, by: int) -> Box:
    left, bottom, right, top = map(_steps, rectangle)
    return left - by, bottom - by, right + by, top + by


def _cuts(edges: Sequence[int], half: int, end: int) -> NDArray[np.int64]:
    """Return where a direction is cut: at edges, and at regular places of the charge.

    Args:
        edges: Of what has grown by half of the width.
        half: Half of the width.
        end: Where the site ends.
    """
    last = max(end - half, half)
    regular = np.arange(half, last + 1, _step(end), dtype=np.int64)
    cuts = np.concatenate((regular, np.array([*edges, half, last], dtype=np.int64)))
    return np.unique(cuts[(cuts >= half) & (cuts <= last)])


def _step(end: int) -> int:
    """Return how far apart regular places of the charge are on a site that ends there."""
    module = _steps(MODULE_SIDE_M)
    return module * ceil(end / module / _MOST_STEPS)


def _between(cuts: NDArray[np.int64], low: int, high: int) -> slice:
    """Return the parts of a direction that lie strictly between two values.

    A value that is no cut lies beyond all of them.
    """
    first = 2 * int(np.searchsorted(cuts, low, side="right")) - 1
    after = 2 * int(np.searchsorted(cuts, high, side="left"))
    return slice(max(first, 0), after)


def _within(cuts: NDArray[np.int64], low: int, high: int) -> slice:
    """Return the parts of a direction from one cut to another one, both within the site."""
    first, last = np.searchsorted(cuts, np.clip([low, high], cuts[0], cuts[-1]))
    return slice(2 * int(first), 2 * int(last) + 1)


def _outside(site: Rectangle, inside: Sequence[Rectangle]) -> Iterator[Rectangle]:
    """Yield rectangles that cover the site but for some of it; nothing if that is all of it."""
    if not inside:
        return
    xs = np.unique([site.left, site.right, *(x for each in inside for x in each[0::2])])
    ys = np.unique([site.bottom, site.top, *(y for each in inside for y in each[1::2])])
    outside = np.ones((len(ys) - 1, len(xs) - 1), dtype=bool)
    for left, bottom, right, top in inside:
        first_x, first_y = (
            np.searchsorted(xs, left - _SAME_M),
            np.searchsorted(ys, bottom - _SAME_M),
        )
        after_x, after_y = (
            np.searchsorted(cuts, high + _SAME_M, "right") - 1
            for cuts, high in ((xs, right), (ys, top))
        )
        outside[first_y:after_y, first_x:after_x] = False
    for row, (bottom, top) in enumerate(pairwise(ys.tolist())):
        for _, first, _, count in stacked_runs(outside[row : row + 1]):
            yield Rectangle(float(xs[first]), bottom, float(xs[first + count]), top)


@dataclass(frozen=True)
class WorstPlaces:
    """Where the charge of a vehicle goes off, the worst place first.

    The first is the place nearest to a wall that counts of a protected structure; each further one
    is the nearest of those that are at least `VehicleSource.least_apart_m` away from all before it.
    The charge being the same everywhere, that is the order of the scaled distances. Of places that
    are as near, the one nearer to the middle of that wall comes first, then the one further to the
    left, then the lower one.

    Attributes:
        source: The vehicle.
        places_m: The places, at most `VehicleSource.places`, at least one.
        distances_m: How far each is from that wall.
    """

    source: VehicleSource
    places_m: tuple[PointM, ...]
    distances_m: tuple[float, ...]

    @property
    def stand_off_m(self) -> float:
        """How near the vehicle's centre gets to a protected structure."""
        return self.distances_m[0]

    def charge(self, rank: int) -> Charge:
        """Return the charge at a place; where there are no more of them, from the worst one on."""
        place_m = self.places_m[rank % len(self.places_m)]
        return Charge(place_m, self.source.tnt_kg, self.source.height_m)


@lru_cache(maxsize=1024)
def _worst_places(ground: VehicleGround, obstacles: Obstacles) -> WorstPlaces:
    """Work out where the charge goes off.

    Raises:
        ValueError: If the vehicle cannot enter; a scenario has none such.
    """
    source, reach = ground.source, ground.reach(obstacles)
    places_m = reach.places_m
    if not len(places_m):
        raise ValueError("the vehicle cannot enter, so its charge goes off nowhere")
    distance_m, middle_m = _nearest_wall(places_m, ground.structures)
    left = np.ones(len(places_m), dtype=bool)
    chosen: list[int] = []
    while left.any() and len(chosen) < source.places:
        # np.nonzero keeps the order of the places: by y, then by x.
        best = np.nonzero(left)[0]
        for measure in (distance_m, middle_m, places_m[:, 0], places_m[:, 1]):
            values = measure[best]
            best = best[values <= values.min() + _EQUAL_M]
        chosen.append(int(best[0]))
        apart_m = np.hypot(*(places_m - places_m[best[0]]).T)
        left &= apart_m >= source.least_apart_m - _EQUAL_M
    return WorstPlaces(
        source=source,
        places_m=tuple((float(x), float(y)) for x, y in places_m[chosen]),
        distances_m=tuple(float(distance_m[index]) for index in chosen),
    )


def stand_off_m(structures: Iterable[AnyStructure], position_m: PointM) -> float:
    """Return how far a place is from the nearest wall that counts of a protected structure."""
    distances_m, _ = _nearest_wall(np.array([position_m]), structures)
    return float(distances_m[0])


def nearest_point_m(structures: Iterable[AnyStructure], position_m: PointM) -> PointM:
    """Return the point of the walls that count of protected structures that is nearest to a place.

    Raises:
        ValueError: If no structure is protected.
    """
    x_m, y_m = position_m
    walls = [wall for each in structures if each.protected for wall in _walls(each)]
    points = [
        (min(max(x_m, left), right), min(max(y_m, bottom), top))
        for left, bottom, right, top in walls
    ]
    return min(points, key=lambda point: hypot(point[0] - x_m, point[1] - y_m))


def _nearest_wall(
    places_m: FloatArray, structures: Iterable[AnyStructure]
) -> tuple[FloatArray, FloatArray]:
    """Return how far places are from the nearest wall that counts, and from its middle.

    Args:
        places_m: The places (places, 2).
        structures: Of them, the protected ones count.
    """
    nearest_m, middle_m, most_m = np.full((3, len(places_m)), np.inf)
    # Many places share few coordinates; so it is cheap to tell to which ones a structure is near.
    x_m, column = np.unique(places_m[:, 0], return_inverse=True)
    y_m, row = np.unique(places_m[:, 1], return_inverse=True)
    protected = [each for each in structures if each.protected]

    def least_m(structure: AnyStructure) -> FloatArray:
        left, bottom, right, top = structure.rectangle_m
        across_m = np.maximum(np.maximum(left - x_m, x_m - right), 0.0)
        along_m = np.maximum(np.maximum(bottom - y_m, y_m - top), 0.0)
        distances_m: FloatArray = np.sqrt((across_m**2)[column] + (along_m**2)[row])
        return distances_m

    for structure in protected:
        left, bottom, right, top = structure.rectangle_m
        # No wall is further away than this from what is nearest to it.
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
    """Return `_nearest_wall` of what was nearest so far, and of one more structure."""
    x_m, y_m = places_m.T
    for left, bottom, right, top in _walls(structure):
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


def _walls(structure: AnyStructure) -> Iterator[Rectangle]:
    """Yield the walls whose load counts, as rectangles without a width."""
    left, bottom, right, top = structure.rectangle_m
    sides: dict[WallName, Rectangle] = {
        "west": Rectangle(left, bottom, left, top),
        "east": Rectangle(right, bottom, right, top),
        "south": Rectangle(left, bottom, right, bottom),
        "north": Rectangle(left, top, right, top),
    }
    return (sides[wall] for wall in structure.faces)
