"""A vehicle: its entries to the site, its ground, and its motion."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, StrictFloat, StrictInt

from blast_env.geometry import Rectangle, WallName
from blast_env.sections import Area, Ground, Length, PointM, Section, Site, SparseSection
from blast_env.units import MODULE_SIDE_M

VehicleMass = Annotated[StrictFloat, Field(ge=50.0, le=200_000.0)]
"""Mass of a vehicle, kg."""

Speed = Annotated[StrictFloat, Field(ge=1.0, le=300.0)]
"""Speed of a vehicle, km/h."""


class Entry(Section):
    """A part of the site's border through which a vehicle can drive.

    Attributes:
        start_m: One end of it.
        end_m: The other one, on the same side of the border.
    """

    start_m: PointM
    end_m: PointM

    @property
    def bounds_m(self) -> Rectangle:
        """The segment as a rectangle of width 0."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))

    @property
    def length_m(self) -> float:
        """Length of a segment along a side of the site."""
        left, bottom, right, top = self.bounds_m
        return max(right - left, top - bottom)

    def side(self, site: Site) -> WallName | None:
        """Return the side of the site on which the segment lies; `None` if on none."""
        bounds, border = self.bounds_m, site.rectangle_m
        if not border.contains(bounds):
            return None
        sides: tuple[tuple[WallName, float, float], ...] = (
            ("west", bounds.right, border.left),
            ("east", border.right, bounds.left),
            ("south", bounds.top, border.bottom),
            ("north", border.top, bounds.bottom),
        )
        return next((side for side, high, low in sides if high <= low + 1e-9), None)

    def strip_m(self, site: Site, side: WallName, width_m: float) -> Rectangle:
        """Return the ground just inside the border, as deep as a vehicle is wide."""
        left, bottom, right, top = self.bounds_m
        border = site.rectangle_m
        return {
            "west": Rectangle(border.left, bottom, border.left + width_m, top),
            "east": Rectangle(border.right - width_m, bottom, border.right, top),
            "south": Rectangle(left, border.bottom, right, border.bottom + width_m),
            "north": Rectangle(left, border.top - width_m, right, border.top),
        }[side]


_SlowSize = Annotated[StrictFloat, Field(ge=2.0, le=2000.0)]
"""Side of slow ground, m; a smaller one could lie between the places of the speed search."""


class SlowArea(Area):
    """Ground that limits a vehicle's speed, with the reason: a speed table, a chicane.

    Attributes:
        speed_km_h: Largest speed on it.
    """

    size_m: tuple[_SlowSize, _SlowSize]
    speed_km_h: Speed


class Motion(Section):
    """The motion of a vehicle, which decides its impact speed on barriers.

    Attributes:
        mass_kg: Its mass, with the load.
        max_speed_km_h: Its largest speed.
        acceleration_m_s2: Its acceleration at any speed.
        entry_speed_km_h: Its speed at entry to the site; the largest unless given.
        grip: Coefficient of friction between tyres and ground, which limits speed in turns.
        slow: Ground that limits its speed.
    """

    mass_kg: VehicleMass
    max_speed_km_h: Speed
    acceleration_m_s2: Annotated[StrictFloat, Field(ge=0.1, le=20.0)]
    entry_speed_km_h: Annotated[StrictFloat, Field(ge=0.0, le=300.0)] | None = None
    grip: Annotated[StrictFloat, Field(ge=0.1, le=2.0)] = 1.0
    slow: Annotated[tuple[SlowArea, ...], Field(max_length=100)] = ()

    @property
    def entry_km_h(self) -> float:
        """Its speed at entry to the site, at most the largest."""
        entry = self.max_speed_km_h if self.entry_speed_km_h is None else self.entry_speed_km_h
        return min(entry, self.max_speed_km_h)


class Vehicle(SparseSection):
    """A vehicle, and the ground on which it can drive.

    Attributes:
        kind: Mark of a vehicle among the sources of a charge.
        entries: Its entries to the site.
        width_m: Its width, and the side of its square on the ground.
        drivable: The ground on which it can drive; the whole site unless given.
        keep_outs: Ground that is closed to it nevertheless, with reasons.
        places: Number of worst places; successive charges go off at successive ones.
        apart_m: Least distance between two of them; the width unless given.
        motion: Its motion; without one, barriers that stop vehicles stop it at any speed.
    """

    sparse: ClassVar = frozenset({"motion"})

    kind: Literal["vehicle"]
    entries: Annotated[tuple[Entry, ...], Field(min_length=1, max_length=100)]
    width_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=100.0)]
    drivable: Annotated[tuple[Ground, ...], Field(max_length=100)] = ()
    keep_outs: Annotated[tuple[Area, ...], Field(max_length=100)] = ()
    places: Annotated[StrictInt, Field(ge=1, le=100)] = 4
    apart_m: Length | None = None
    motion: Motion | None = None

    @property
    def least_apart_m(self) -> float:
        """Least distance between two of the places."""
        return self.width_m if self.apart_m is None else self.apart_m
