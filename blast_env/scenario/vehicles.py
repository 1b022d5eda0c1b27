"""Vehicles with a charge: what stops one, and where its charge goes off.

A vehicle is a square of ground, `width_m` on a side, whose sides stay parallel to those of the
site. From the border it moves in any direction without a turn, and never covers a structure,
ground that is closed to it, a gate, or what stops it. To touch is allowed: it fits through a gap of
just its width, but not through one of a micrometre less, nor cornerwise between two things that
touch (`blast_env.scenario.reach`).

A vehicle that has a speed breaks what has a crash rating that does not cover its mass, or its speed
where it hits it (`blast_env.scenario.driving`), and drives on, no slower. What gives way opens ways
to other pieces, and longer run-ups; so that is asked again until nothing more gives way.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import hypot
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Element, Rectangle, stacked_runs, standing
from blast_env.physics.scene import Charge, WallName
from blast_env.scenario.catalogue import element_text
from blast_env.scenario.crash_rating import CrashRating
from blast_env.scenario.driving import STEP_M, SpeedField, WayPoint, places_in, places_shape
from blast_env.scenario.reach import Reach, ReachQuery, steps_of
from blast_env.scenario.sections import (
    AnySource,
    AnyStructure,
    Entry,
    PointM,
    PointSource,
    Site,
    VehicleSource,
)
from blast_env.scenario.terraces import ground_below_m
from blast_env.scenario.worst_places import WorstPlaces, nearest_wall, worst_of
from blast_env.scenario.zone import BuildZone
from blast_env.units import MODULE_SIDE_M

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


class RatedPiece(NamedTuple):
    """Something that stops the vehicles that its crash rating covers.

    Attributes:
        rectangle: What it covers, metres.
        rating: Its crash rating.
        name: What it is called.
    """

    rectangle: Rectangle
    rating: CrashRating
    name: str


class Obstacles(NamedTuple):
    """What a layout puts in the way of a vehicle, rectangles in metres.

    Attributes:
        stops: What it cannot pass.
        solid: What it drives over; but no charge goes off inside of it.
        rated: What stops it as far as a crash rating goes.
    """

    stops: tuple[Rectangle, ...] = ()
    solid: tuple[Rectangle, ...] = ()
    rated: tuple[RatedPiece, ...] = ()


NOTHING: Final = Obstacles()
"""The empty site."""


def obstacles_of(
    zone: BuildZone, layout: Iterable[Element], structures: Sequence[AnyStructure]
) -> Obstacles:
    """Return what a layout of a build zone puts in the way.

    Single modules stop a vehicle; of the items of a catalogue, those that are said to. What stands
    on a terrace no vehicle meets.

    Raises:
        LayoutError: If there is no such item, or it cannot be turned.
    """
    terraces = [each for each in structures if each.carries]
    stops: list[Rectangle] = []
    solid: list[Rectangle] = []
    rated: list[RatedPiece] = []
    for element in sorted(standing(layout)):
        variant, rectangle = zone.catalogue.variant(element), zone.element_rectangle_m(element)
        if ground_below_m(terraces, rectangle) > 0.0:
            continue
        if variant.crash_rating is not None:
            rated.append(RatedPiece(rectangle, variant.crash_rating, element_text(element)))
        else:
            (stops if variant.stops_vehicles else solid).append(rectangle)
    return Obstacles(tuple(stops), tuple(solid), tuple(rated))


@dataclass(frozen=True)
class VehicleGround:
    """What a vehicle meets on the empty site.

    Attributes:
        source: The vehicle.
        site: The site.
        structures: The structures.
        gates: Gates that are closed to it, whatever its speed.
        rated_gates: Gates that are closed to it as far as their crash ratings go.
        charge_radius_m: Radius of the disc that the charge fills.
    """

    source: VehicleSource
    site: Site
    structures: tuple[AnyStructure, ...]
    gates: tuple[Rectangle, ...] = ()
    rated_gates: tuple[RatedPiece, ...] = ()
    charge_radius_m: float = MODULE_SIDE_M

    @property
    def entries(self) -> tuple[tuple[Entry, WallName], ...]:
        """The entries on the border that are wide enough, with the side of the site."""
        return tuple(
            (entry, side)
            for entry in self.source.entries
            if (side := entry.side(self.site)) is not None
            and steps_of(entry.length_m) >= steps_of(self.source.width_m)
        )

    @cached_property
    def closed_m(self) -> tuple[Rectangle, ...]:
        """Everything that it must not cover; gates that may give way are among it."""
        return (*self.always_closed_m, *(gate.rectangle for gate in self.rated_gates))

    @cached_property
    def standing_m(self) -> tuple[Rectangle, ...]:
        """The structures that it does not pass below."""
        return tuple(each.rectangle_m for each in self.structures if not each.lets_through)

    @cached_property
    def always_closed_m(self) -> tuple[Rectangle, ...]:
        """Everything that it must not cover, at any speed."""
        return (
            *self.standing_m,
            *(area.rectangle_m for area in self.source.keep_outs),
            *self.gates,
            *_outside(
                self.site.rectangle_m, tuple(each.rectangle_m for each in self.source.drivable)
            ),
        )

    def drive(self, obstacles: Obstacles = NOTHING) -> "Drive":
        """Return what stops the vehicle, and what not; for equal arguments, the same object."""
        return _drive(self, obstacles)

    def reach(self, obstacles: Obstacles = NOTHING) -> Reach:
        """Return where the vehicle gets to; for equal arguments, the same object."""
        return self.drive(obstacles).reach

    def worst_places(self, obstacles: Obstacles = NOTHING) -> WorstPlaces:
        """Return where its charge goes off; for equal arguments, the same object."""
        return _worst_places(self, obstacles)

    def explain(self, obstacles: Obstacles = NOTHING) -> str:
        """Return in words how near the vehicle comes, and by which way."""
        worst, source = self.worst_places(obstacles), self.source
        x_m, y_m = worst.places_m[0]
        name = f"the vehicle with {source.tnt_kg:g} kg TNT"
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
        """How near to a protected structure it is when it has just entered."""
        return float(nearest_wall(self.reach().starts_m, self.structures)[0].min())


class Impact(NamedTuple):
    """Where a vehicle hits a piece with a crash rating, at its fastest.

    Attributes:
        piece: The piece.
        speed_km_h: The largest speed at which the vehicle hits it.
        holds: Whether it stops the vehicle.
    """

    piece: RatedPiece
    speed_km_h: float
    holds: bool


@dataclass(frozen=True, eq=False)
class Drive:
    """What a vehicle does against a layout.

    Attributes:
        ground: The vehicle, and what it meets on the empty site.
        reach: Where it gets to, through what gives way.
        held: The pieces with a crash rating that stop it, if it gets to them.
        broken: Those that do not.
    """

    ground: VehicleGround
    reach: Reach
    held: tuple[RatedPiece, ...]
    broken: tuple[RatedPiece, ...]

    @cached_property
    def speeds(self) -> SpeedField | None:
        """How fast it is where; `None` if it has no speed."""
        if self.ground.source.motion is None:
            return None
        return _speeds(self.ground, self.reach.near(*_places_shape(self.ground), STEP_M))

    @cached_property
    def impacts(self) -> tuple[Impact, ...]:
        """The pieces with a crash rating that it hits, those that give way first."""
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
        """Where its charge goes off.

        Raises:
            ValueError: If the vehicle cannot enter; a scenario has none such.
        """
        if not len(self.places_m):
            raise ValueError("the vehicle cannot enter, so its charge goes off nowhere")
        return worst_of(self.ground.source, self.places_m, self.ground.structures)

    @cached_property
    def weakest_way(self) -> tuple[tuple[WayPoint, ...], tuple[Impact, ...]]:
        """A way to the worst place with its speeds, and what it breaks through, in that order.

        Both are empty if it has no speed.
        """
        if self.speeds is None:
            return (), ()
        way = self.speeds.way_to(self.worst.places_m[0])
        met: dict[RatedPiece, None] = {}
        for x_m, y_m in _along(way):
            around = Rectangle(x_m, y_m, x_m, y_m).grown(self.reach.width_m / 2.0)
            met |= dict.fromkeys(each for each in self.broken if around.overlaps(each.rectangle))
        hit = {impact.piece: impact for impact in self.impacts}
        return way, tuple(hit[piece] for piece in met if piece in hit)

    @cached_property
    def places_m(self) -> FloatArray:
        """Places where its charge may go off, (places, 2).

        Also those beyond a piece that stopped the vehicle: its load gets as far as the rating says.
        """
        return np.concatenate([self.reach.places_m, *self._beyond_m()])

    def _beyond_m(self) -> Iterator[FloatArray]:
        radius_m = self.ground.charge_radius_m
        standing = [piece.rectangle for piece in (*self.held, *self.broken)]
        standing += self.ground.standing_m
        for piece in self.held:
            if piece.rating.penetration_m == 0.0:
                continue
            beyond_m = max(piece.rating.penetration_m, radius_m)
            left, bottom, right, top = piece.rectangle
            sides = (right + beyond_m, top + beyond_m, left - beyond_m, bottom - beyond_m)
            for number in np.flatnonzero(self.reach.touches(piece.rectangle)):
                low, high = (bottom, top) if number % 2 == 0 else (left, right)
                along = np.linspace(low, high, max(round((high - low) / MODULE_SIDE_M), 1) + 1)
                across = np.full_like(along, sides[number])
                places = np.column_stack((across, along) if number % 2 == 0 else (along, across))
                yield places[[self._is_clear(place, radius_m, standing) for place in places]]

    def _is_clear(self, place: FloatArray, radius_m: float, standing: Sequence[Rectangle]) -> bool:
        """Return whether a charge fits there."""
        x, y = place.tolist()
        around = Rectangle(x, y, x, y).grown(radius_m)
        inside = self.ground.site.rectangle_m.contains(around)
        return inside and not any(around.overlaps(each) for each in standing)


@lru_cache(maxsize=64)
def _drive(ground: VehicleGround, obstacles: Obstacles) -> Drive:
    """Work out what stops a vehicle."""
    motion = ground.source.motion
    held = (*obstacles.rated, *ground.rated_gates)
    broken: tuple[RatedPiece, ...] = ()
    if motion is None:
        return Drive(ground, _reach(ground, obstacles, held, broken), held, broken)
    broken = tuple(each for each in held if each.rating.mass_kg < motion.mass_kg)
    held = tuple(each for each in held if each not in broken)
    slow = tuple(each for each in held if each.rating.speed_km_h < motion.max_speed_km_h)
    if slow:  # nothing is faster than on the site without barriers, which is known once for all
        slow = _too_slow(slow, _free_speeds(ground))
    while True:
        reach = _reach(ground, obstacles, held, broken)
        weak: tuple[RatedPiece, ...] = ()
        if slow:
            is_open = reach.near(*_places_shape(ground), STEP_M)
            weak = _too_slow(slow, _free_speeds(ground), is_open)
            weak = weak and _weak_on(ground, _as_bits(is_open), weak)
        if not weak:
            return Drive(ground, reach, held, broken)
        broken = (*broken, *weak)
        held, slow = (tuple(each for each in those if each not in weak) for those in (held, slow))


def _too_slow(
    pieces: Iterable[RatedPiece], speeds: SpeedField, among: BoolArray | None = None
) -> tuple[RatedPiece, ...]:
    """Return the pieces that a vehicle hits faster than their crash ratings cover.

    Args:
        pieces: The pieces.
        speeds: Its speeds.
        among: From which places of those it hits them; from all, unless given.
    """
    return tuple(
        each
        for each in pieces
        if (speeds.impact_km_h(each.rectangle, among) or 0.0) > each.rating.speed_km_h
    )


def _along(way: Sequence[WayPoint]) -> Iterator[PointM]:
    """Yield places along a way, half a metre apart or less; its own lie at the ends of arcs."""
    for one, other in pairwise(way):
        (x_m, y_m), (to_x_m, to_y_m) = one.place_m, other.place_m
        steps = max(round(hypot(to_x_m - x_m, to_y_m - y_m) / MODULE_SIDE_M), 1)
        for step in range(steps + 1):
            share = step / steps
            yield x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m)


def _reach(
    ground: VehicleGround,
    obstacles: Obstacles,
    held: Iterable[RatedPiece],
    broken: Iterable[RatedPiece],
) -> Reach:
    source, site = ground.source, ground.site
    return ReachQuery(
        site,
        source.width_m,
        tuple(entry.strip_m(site, side, source.width_m) for entry, side in ground.entries),
        (*ground.always_closed_m, *obstacles.stops, *(each.rectangle for each in held)),
        (*obstacles.solid, *(each.rectangle for each in broken)),
        ground.standing_m,
    ).answer()


_INWARDS: Final[Mapping[WallName, tuple[int, int]]] = MappingProxyType(
    {"west": (1, 0), "east": (-1, 0), "south": (0, 1), "north": (0, -1)}
)


def _places_shape(ground: VehicleGround) -> tuple[int, int]:
    return places_shape(ground.site.width_m, ground.site.height_m)


_FEW_ARCS: Final = 6
"""Of so many arcs one is taken for a first look: their radii grow by a factor of three, about."""


@lru_cache(maxsize=256)
def _weak_on(
    ground: VehicleGround, bits: bytes, pieces: tuple[RatedPiece, ...]
) -> tuple[RatedPiece, ...]:
    """Return which pieces give way to a vehicle that gets to some places; many layouts leave these.

    Args:
        ground: The vehicle, and what it meets.
        bits: The places.
        pieces: The pieces.
    """
    if _too_slow(pieces, _speeds_on(ground, bits, _FEW_ARCS)) == pieces:
        return pieces
    return _too_slow(pieces, _speeds_on(ground, bits))


def _speeds(ground: VehicleGround, is_open: BoolArray) -> SpeedField:
    """Work out how fast a vehicle with a speed is where it gets to."""
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
    """Work out the speeds on the site without barriers, with gates that give way."""
    reach = _reach(ground, NOTHING, (), ground.rated_gates)
    return _speeds(ground, reach.near(*_places_shape(ground), STEP_M))


@lru_cache(maxsize=1024)
def _worst_places(ground: VehicleGround, obstacles: Obstacles) -> WorstPlaces:
    """Return where the charge goes off; kept for longer than the reach, which takes more memory."""
    return ground.drive(obstacles).worst


@lru_cache(maxsize=64)
def _outside(site: Rectangle, inside: tuple[Rectangle, ...]) -> tuple[Rectangle, ...]:
    """Return rectangles that cover the site but for some of it; none if that is all of it."""
    if not inside:
        return ()
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
    return tuple(
        Rectangle(float(xs[first]), bottom, float(xs[first + count]), top)
        for row, (bottom, top) in enumerate(pairwise(ys.tolist()))
        for _, first, _, count in stacked_runs(outside[row : row + 1])
    )
