"""Vehicles with a charge: the obstacles that stop one, and the places of its charge.

A vehicle is a square of ground, `width_m` on a side, with sides parallel to those of the site. From
the border it moves in any direction without rotation, and never covers a structure, closed ground,
a gate, or an obstacle that stops it. Touching is allowed: it fits through a gap of exactly its
width, but not through one that is 1 micrometre narrower, nor diagonally between two touching
obstacles (`blast_env.vehicles.reach`).

A vehicle with a motion breaks through pieces whose crash rating does not cover its mass, or its
impact speed (`blast_env.vehicles.driving`), and drives on without loss of speed. Broken pieces open
ways to others and longer run-ups, so the search repeats until no further piece breaks.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import hypot
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle, Wall, WallName, stacked_runs
from blast_env.sections import PointM, Site
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.driving import STEP_M, SpeedField, WayPoint, places_in, places_shape
from blast_env.vehicles.reach import Reach, ReachQuery, steps_of
from blast_env.vehicles.vehicle import NOTHING, CrashPiece, Entry, Obstacles, Vehicle
from blast_env.vehicles.worst_places import PlainGround, WorstPlaces, least_distances_m, worst_of

_SAME_M: Final = 1e-9
"""Tolerance within which edges are equal, as in `Rectangle.contains`."""


@dataclass(frozen=True)
class VehicleGround:
    """A vehicle with its surroundings on the empty site.

    Attributes:
        standing_m: The rectangles of the structures that it cannot pass below.
        walls: The loaded walls of the protected structures.
        gates: Gates that stop it at any speed.
        rated_gates: Gates with a crash rating.
        charge_radius_m: Radius of the charge's disc.
    """

    source: Vehicle
    site: Site
    standing_m: tuple[Rectangle, ...] = ()
    walls: tuple[Wall, ...] = ()
    gates: tuple[Rectangle, ...] = ()
    rated_gates: tuple[CrashPiece, ...] = ()
    charge_radius_m: float = MODULE_SIDE_M

    def __hash__(self) -> int:
        """Return the hash of all attributes, computed once: caches ask for it at every layout."""
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the hash, which is another one in each process."""
        return {name: value for name, value in vars(self).items() if name != "_hash"}

    @cached_property
    def _hash(self) -> int:
        around = self.standing_m, self.walls, self.gates, self.rated_gates
        return hash((self.source, self.site, around, self.charge_radius_m))

    @property
    def entries(self) -> tuple[tuple[Entry, WallName], ...]:
        """The wide enough entries on the border, each with its side of the site."""
        return tuple(
            (entry, side)
            for entry in self.source.entries
            if (side := entry.side(self.site)) is not None
            and steps_of(entry.length_m) >= steps_of(self.source.width_m)
        )

    @cached_property
    def closed_m(self) -> tuple[Rectangle, ...]:
        """All closed rectangles, including gates with a crash rating."""
        return (*self.always_closed_m, *(gate.rectangle for gate in self.rated_gates))

    @cached_property
    def always_closed_m(self) -> tuple[Rectangle, ...]:
        """The rectangles that are closed at any speed."""
        return (
            *self.standing_m,
            *(area.rectangle_m for area in self.source.keep_outs),
            *self.gates,
            *_outside(
                self.site.rectangle_m, tuple(part.rectangle_m for part in self.source.drivable)
            ),
        )

    @cached_property
    def plain(self) -> PlainGround | None:
        """The same as arrays; `None` with a motion, oblique walls, or a gate that is penetrated."""
        if self.source.motion is not None or _any_penetrated(self.rated_gates):
            return None
        return PlainGround.of(self.source, _query(self, NOTHING, self.rated_gates, ()), self.walls)

    def drive(self, obstacles: Obstacles = NOTHING) -> "Drive":
        """Return the drive of the vehicle against obstacles, cached."""
        return _drive(self, obstacles)

    def reach(self, obstacles: Obstacles = NOTHING) -> Reach:
        """Return the reach of the vehicle against obstacles, cached."""
        return self.drive(obstacles).reach

    def worst_places(self, obstacles: Obstacles = NOTHING) -> WorstPlaces:
        """Return the worst places of its charge against obstacles, cached."""
        return _worst_places(self, obstacles)

    def explain(self, name: str, obstacles: Obstacles = NOTHING) -> str:
        """Return a sentence with the vehicle's stand-off, way and speeds, under a name."""
        worst, source = self.worst_places(obstacles), self.source
        x_m, y_m = worst.places_m[0]
        text = f"{name} comes as near as {worst.stand_off_m:.1f} m"
        if source.motion is None:
            stopped = "no speed is given: whatever stops vehicles stops it"
            return f"{text}, at ({x_m:g}, {y_m:g}) m; {stopped}"
        way, through = self.drive(obstacles).weakest_way
        steps = []
        if way:
            (from_x_m, from_y_m), speed_km_h = way[0]
            steps.append(f"in at ({from_x_m:g}, {from_y_m:g}) m with {speed_km_h:.0f} km/h")
        for piece, speed_km_h, _ in through:
            hit = f"hit at {speed_km_h:.0f} km/h but {piece.rating.words}"
            steps.append(f"through {piece.name.rstrip(',')}, {hit}")
        mass = f"{source.motion.mass_kg:g} kg"
        return f"{text} ({mass}): {', '.join((*steps, f'to ({x_m:g}, {y_m:g}) m'))}"

    @property
    def entry_stand_off_m(self) -> float:
        """Least distance of its centre, just after entry, from a loaded wall, m."""
        return float(least_distances_m(self.walls, self.reach().starts_m).min())


class Impact(NamedTuple):
    """The fastest impact of a vehicle on a piece with a crash rating.

    Attributes:
        speed_km_h: Largest impact speed.
        holds: Whether it stops the vehicle.
    """

    piece: CrashPiece
    speed_km_h: float
    holds: bool


@dataclass(frozen=True, eq=False)
class Drive:
    """The drive of a vehicle against a layout.

    Attributes:
        ground: The vehicle with its surroundings on the empty site.
        obstacles: The obstacles of the layout.
        reach: Its reach, through the broken pieces.
        held: The pieces with a crash rating that stop it, if it reaches them.
        broken: The pieces with a crash rating that do not.
    """

    ground: VehicleGround
    obstacles: Obstacles
    reach: Reach
    held: tuple[CrashPiece, ...]
    broken: tuple[CrashPiece, ...]

    @cached_property
    def speeds(self) -> SpeedField | None:
        """Its largest speed at each place; `None` if it has no motion."""
        if self.ground.source.motion is None:
            return None
        return _speeds(self.ground, self.reach.near(*_places_shape(self.ground), STEP_M))

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """Its impacts on pieces with a crash rating, broken ones first; none without a motion."""
        if self.speeds is None:
            return ()
        return tuple(
            Impact(piece, speed_km_h, holds)
            for pieces, holds in ((self.broken, False), (self.held, True))
            for piece in pieces
            if (speed_km_h := self.speeds.impact_km_h(piece.rectangle)) is not None
        )

    @cached_property
    def worst(self) -> WorstPlaces:
        """The worst places of its charge.

        Raises:
            ValueError: If the vehicle cannot enter, which a valid scenario excludes.
        """
        if not len(self.places_m):
            raise ValueError("the vehicle cannot enter, so its charge goes off nowhere")
        return worst_of(self.ground.source, self.places_m, self.ground.walls)

    @cached_property
    def weakest_way(self) -> tuple[tuple[WayPoint, ...], tuple[Impact, ...]]:
        """A way to the worst place with its speeds, and the impacts on the pieces it breaks.

        Both are in the order of the drive, and empty without a motion.
        """
        if self.speeds is None:
            return (), ()
        way = self.speeds.way_to(self.worst.places_m[0])
        met: dict[CrashPiece, None] = {}
        for x_m, y_m in _along(way):
            around = Rectangle(x_m, y_m, x_m, y_m).grown(self.reach.width_m / 2.0)
            met |= dict.fromkeys(
                rated_piece for rated_piece in self.broken if around.overlaps(rated_piece.rectangle)
            )
        hit = {impact.piece: impact for impact in self.impacts}
        return way, tuple(hit[piece] for piece in met if piece in hit)

    @cached_property
    def places_m(self) -> FloatArray:
        """Places of its charge, m (places, 2).

        They include places beyond a piece that stopped it, up to the penetration of the rating.
        """
        return np.concatenate([self.reach.places_m, *self._beyond_m()])

    def _beyond_m(self) -> Iterator[FloatArray]:
        # A piece that stops a vehicle still lets its load through by the penetration of its rating:
        # the charge may go off there, across from each side that the vehicle reaches.
        for piece in self.held:
            if piece.rating.penetration_m == 0.0:
                continue
            left, bottom, right, top = piece.rectangle
            for number in np.flatnonzero(self.reach.touches(piece.rectangle)):
                low, high = (bottom, top) if number % 2 == 0 else (left, right)
                along = np.linspace(low, high, max(round((high - low) / MODULE_SIDE_M), 1) + 1)
                for at_m in along.tolist():
                    yield self._flight_m(piece, int(number), at_m)

    def _flight_m(self, piece: CrashPiece, side: int, at_m: float) -> FloatArray:
        """Return the places of a load that was thrown straight over a piece (places, 2).

        It comes to rest before the first thing that stands in its way.

        Args:
            side: The side of the piece that the vehicle hits: left, lower, right, upper.
            at_m: Where along that side.
        """
        radius_m = self.ground.charge_radius_m
        # 1. The room beyond the rear, with lengths along the flight from there.
        axis, sign = side % 2, (1.0, 1.0, -1.0, -1.0)[side]
        rear_m = piece.rectangle[(side + 2) % 4]
        border_m = self.ground.site.rectangle_m[(side + 2) % 4]
        ends_m = [sign * (border_m - rear_m)]
        for box in (*self._standing_m, *(held.rectangle for held in self.held)):
            beside_m = max(box[1 - axis] - at_m, at_m - box[3 - axis])
            near_m, far_m = sorted(sign * (box[axis + k] - rear_m) for k in (0, 2))
            if beside_m < radius_m - _SAME_M and far_m > _SAME_M:
                ends_m.append(near_m)
        room_m = min(ends_m) - radius_m
        # 2. Places every half metre, and the farthest one; a charge keeps clear of the piece.
        most_m = min(max(piece.rating.penetration_m, radius_m), room_m)
        steps_m = np.append(np.arange(radius_m, most_m, MODULE_SIDE_M), most_m)
        places = np.full((len(steps_m), 2), at_m)
        places[:, axis] = rear_m + sign * steps_m
        return places[[most_m >= radius_m - _SAME_M and self._is_clear(spot) for spot in places]]

    @property
    def _standing_m(self) -> tuple[Rectangle, ...]:
        """What stops a load: structures, gates, and pieces without a rating."""
        return (*self.ground.standing_m, *self.ground.gates, *self.obstacles.stops)

    def _is_clear(self, place: FloatArray) -> bool:
        """Return whether a charge fits at a place: on the site, and in no piece."""
        x, y = place.tolist()
        around = Rectangle(x, y, x, y).grown(self.ground.charge_radius_m)
        inside = self.ground.site.rectangle_m.contains(around)
        pieces_m = [piece.rectangle for piece in (*self.held, *self.broken)]
        standing_m = (*self._standing_m, *self.obstacles.solid, *pieces_m)
        return inside and not any(around.overlaps(box) for box in standing_m)


@lru_cache(maxsize=64)
def _drive(ground: VehicleGround, obstacles: Obstacles) -> Drive:
    """Compute the drive of a vehicle."""
    motion = ground.source.motion
    held = (*obstacles.rated, *ground.rated_gates)
    broken: tuple[CrashPiece, ...] = ()
    if motion is None:
        return Drive(ground, obstacles, _reach(ground, obstacles, held, broken), held, broken)
    # 1. Too light a rating for the mass: the piece breaks at any speed.
    broken = tuple(
        rated_piece for rated_piece in held if rated_piece.rating.mass_kg < motion.mass_kg
    )
    held = tuple(rated_piece for rated_piece in held if rated_piece not in broken)
    # 2. Of the rest, only pieces rated below the vehicle's largest speed can be hit too fast.
    slow = tuple(
        rated_piece for rated_piece in held if rated_piece.rating.speed_km_h < motion.max_speed_km_h
    )
    if slow:  # speeds are largest on the site without barriers, which is computed only once
        slow = _too_slow(slow, _free_speeds(ground))
    # 3. Broken pieces open ways and longer run-ups: repeat until no further piece breaks. Pieces
    # only ever break, so it ends after at most as many rounds as there are pieces.
    while True:
        reach = _reach(ground, obstacles, held, broken)
        weak: tuple[CrashPiece, ...] = ()
        if slow:
            is_open = reach.near(*_places_shape(ground), STEP_M)
            # The speeds on the empty site bound those on this one from above: they clear most
            # pieces without a search of their own.
            weak = _too_slow(slow, _free_speeds(ground), is_open)
            weak = weak and _weak_on(ground, _as_bits(is_open), weak)
        if not weak:
            return Drive(ground, obstacles, reach, held, broken)
        broken = (*broken, *weak)
        held, slow = (tuple(item for item in those if item not in weak) for those in (held, slow))


def _too_slow(
    pieces: Iterable[CrashPiece], speeds: SpeedField, among: BoolArray | None = None
) -> tuple[CrashPiece, ...]:
    """Return the pieces with impact speeds above those of their crash ratings.

    Args:
        speeds: Speeds of the vehicle.
        among: Places from which it may hit them (rows, columns); the open ones unless given.
    """
    return tuple(
        piece
        for piece in pieces
        if (speeds.impact_km_h(piece.rectangle, among) or 0.0) > piece.rating.speed_km_h
    )


def _along(way: Sequence[WayPoint]) -> Iterator[PointM]:
    """Yield places along a way, at most about 0.5 m apart, between its points at ends of arcs."""
    for one, other in pairwise(way):
        (x_m, y_m), (to_x_m, to_y_m) = one.place_m, other.place_m
        steps = max(round(hypot(to_x_m - x_m, to_y_m - y_m) / MODULE_SIDE_M), 1)
        for step in range(steps + 1):
            share = step / steps
            yield x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m)


def _reach(
    ground: VehicleGround,
    obstacles: Obstacles,
    held: Iterable[CrashPiece],
    broken: Iterable[CrashPiece],
) -> Reach:
    return _query(ground, obstacles, held, broken).answer()


def _query(
    ground: VehicleGround,
    obstacles: Obstacles,
    held: Iterable[CrashPiece],
    broken: Iterable[CrashPiece],
) -> ReachQuery:
    source, site = ground.source, ground.site
    return ReachQuery(
        site,
        source.width_m,
        tuple(entry.strip_m(site, side, source.width_m) for entry, side in ground.entries),
        (
            *ground.always_closed_m,
            *obstacles.stops,
            *(rated_piece.rectangle for rated_piece in held),
        ),
        (*obstacles.solid, *(rated_piece.rectangle for rated_piece in broken)),
        ground.standing_m,
    )


_INWARDS: Final[Mapping[WallName, tuple[int, int]]] = MappingProxyType(
    {"west": (1, 0), "east": (-1, 0), "south": (0, 1), "north": (0, -1)}
)


def _places_shape(ground: VehicleGround) -> tuple[int, int]:
    return places_shape(ground.site.width_m, ground.site.height_m)


_FEW_ARCS: Final = 6
"""Step of the arcs in the first search: successive radii grow by a factor of about three."""


@lru_cache(maxsize=256)
def _weak_on(
    ground: VehicleGround, bits: bytes, pieces: tuple[CrashPiece, ...]
) -> tuple[CrashPiece, ...]:
    """Return the pieces that break under a vehicle with the given open places.

    It is cached because many layouts have the same open places.

    Args:
        ground: The vehicle with its surroundings.
        bits: The open places, packed.
    """
    # Fewer arcs give speeds from below: what breaks by them breaks.
    if _too_slow(pieces, _speeds_on(ground, bits, _FEW_ARCS)) == pieces:
        return pieces
    return _too_slow(pieces, _speeds_on(ground, bits))


def _speeds(ground: VehicleGround, is_open: BoolArray) -> SpeedField:
    """Compute the speeds of a vehicle with a motion at the open places."""
    return _speeds_on(ground, _as_bits(is_open))


def _as_bits(is_open: BoolArray) -> bytes:
    return np.packbits(is_open).tobytes()


@lru_cache(maxsize=16)
def _speeds_on(ground: VehicleGround, bits: bytes, arc_step: int = 1) -> SpeedField:
    source, shape = ground.source, _places_shape(ground)
    assert source.motion is not None
    is_open = np.unpackbits(np.frombuffer(bits, np.uint8), count=shape[0] * shape[1])
    half_m = source.width_m / 2.0
    starts = []
    for entry, side in ground.entries:
        start = np.zeros(shape, dtype=bool)
        centres_m = entry.strip_m(ground.site, side, source.width_m).grown(-half_m)
        start[places_in(centres_m.grown(STEP_M / 2.0))] = True
        starts.append((start, _INWARDS[side]))
    return SpeedField.of(
        source.motion, half_m, is_open.reshape(shape).astype(bool), starts, arc_step
    )


@lru_cache(maxsize=8)
def _free_speeds(ground: VehicleGround) -> SpeedField:
    """Compute the speeds on the site without barriers, with all rated gates broken."""
    reach = _reach(ground, NOTHING, (), ground.rated_gates)
    return _speeds(ground, reach.near(*_places_shape(ground), STEP_M))


@lru_cache(maxsize=1024)
def _worst_places(ground: VehicleGround, obstacles: Obstacles) -> WorstPlaces:
    """Return the worst places; the cache is larger than that of drives, which take more memory."""
    if ground.plain is not None and not _any_penetrated(obstacles.rated):
        rated_m = [piece.rectangle for piece in obstacles.rated]
        found = ground.plain.worst((*obstacles.stops, *rated_m), obstacles.solid)
        if found is not None:
            return found
    return ground.drive(obstacles).worst


def _any_penetrated(pieces: Iterable[CrashPiece]) -> bool:
    """Return whether a load may pass any of some pieces that stop the vehicle."""
    return any(piece.rating.penetration_m != 0.0 for piece in pieces)


@lru_cache(maxsize=64)
def _outside(site: Rectangle, inside: tuple[Rectangle, ...]) -> tuple[Rectangle, ...]:
    """Return rectangles that cover the site outside some others; none if there are no others."""
    if not inside:
        return ()
    xs = np.unique([site.left, site.right, *(x for rectangle in inside for x in rectangle[0::2])])
    ys = np.unique([site.bottom, site.top, *(y for rectangle in inside for y in rectangle[1::2])])
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
    return tuple(
        Rectangle(float(xs[first]), bottom, float(xs[first + count]), top)
        for row, (bottom, top) in enumerate(pairwise(ys.tolist()))
        for _, first, _, count in stacked_runs(outside[row : row + 1])
    )
