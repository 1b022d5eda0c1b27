"""The sources of charges: points, lines, areas, and vehicles with their ways in."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    Field,
    StrictFloat,
    StrictInt,
    model_validator,
)

from blast_env.geometry import Rectangle
from blast_env.site.blast_site import Charge, WallName
from blast_env.site.presets import CHARGE_PRESETS, TNT_EQUIVALENTS, tnt_equivalent_kg
from blast_env.site.sections import (
    Area,
    Coordinate,
    Ground,
    Length,
    Name,
    PointM,
    Section,
    Site,
    SparseSection,
)
from blast_env.units import MODULE_SIDE_M

VehicleMass = Annotated[StrictFloat, Field(ge=50.0, le=200_000.0)]
"""Mass of a vehicle, kg."""

Speed = Annotated[StrictFloat, Field(ge=1.0, le=300.0)]
"""Speed of a vehicle, km/h."""


class ChargeSource(Section):
    """Base of the sources of a charge.

    Attributes:
        threat: Its name for readers, as `car`; no result depends on it. A preset of
            `blast_env.site.presets` gives the mass, if `tnt_kg` is missing.
        tnt_kg: TNT-equivalent mass of a charge from this source; a document may have `mass_kg` and
            `explosive` instead.
        weight: Probability of this source, relative to the others.
        height_m: Height of the charge's centre above the ground; at 0 it lies on the ground.
    """

    threat: Name | None = None
    tnt_kg: Annotated[StrictFloat, Field(ge=0.01, le=100_000.0)]
    weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] = 1.0
    height_m: Coordinate = 0.0

    @model_validator(mode="before")
    @classmethod
    def _with_mass(cls, given: Any) -> Any:
        """Add the mass of a preset, or that equivalent to another explosive."""
        if not isinstance(given, Mapping) or "tnt_kg" in given:
            return given
        rest = {key: value for key, value in given.items() if key not in ("mass_kg", "explosive")}
        preset_kg, _ = CHARGE_PRESETS.get(str(given.get("threat")), (None, ""))
        mass_kg, explosive = given.get("mass_kg"), given.get("explosive")
        if mass_kg is None or explosive is None:
            return given if preset_kg is None else {**given, "tnt_kg": preset_kg}
        if not isinstance(mass_kg, int | float) or explosive not in TNT_EQUIVALENTS:
            known = ", ".join(TNT_EQUIVALENTS)
            raise ValueError(f"must have a mass_kg in kg and an explosive of {known}")
        return {**rest, "tnt_kg": tnt_equivalent_kg(float(mass_kg), explosive)}


class PointSource(ChargeSource):
    """A charge at a fixed point."""

    kind: Literal["point"] = "point"
    position_m: PointM

    @classmethod
    def at(cls, charge: Charge) -> Self:
        """Return the source of one charge.

        Raises:
            ValidationError: If the charge is out of bounds.
        """
        return cls(position_m=charge.position_m, tnt_kg=charge.tnt_kg, height_m=charge.height_m)

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the diagonal that the source spans."""
        return self.position_m, self.position_m

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The point as a line without a length."""
        return (self.segment_m,)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:  # noqa: ARG002
        """Return the point; nothing is drawn."""
        return self.position_m


class SegmentSource(ChargeSource):
    """A charge uniformly distributed on a segment: a vehicle on a road."""

    kind: Literal["segment"]
    start_m: PointM
    end_m: PointM

    @property
    def segment_m(self) -> tuple[PointM, PointM]:
        """Start and end of the segment."""
        return self.start_m, self.end_m

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines of the charge's places."""
        return (self.segment_m,)

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the segment."""
        share = rng.random()
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


class RectangleSource(ChargeSource, Ground):
    """A charge uniformly distributed in a rectangle: a parking area."""

    kind: Literal["rectangle"]

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the rectangle."""
        x_share, y_share = rng.random(2)
        return (
            self.corner_m[0] + float(x_share) * self.size_m[0],
            self.corner_m[1] + float(y_share) * self.size_m[1],
        )


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


class VehicleSource(ChargeSource, SparseSection):
    """A charge in a vehicle, which goes off at one of the worst places within its reach.

    The reach depends on the layout: see `blast_env.site.vehicles`.

    Attributes:
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
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines of its entries."""
        return tuple((entry.start_m, entry.end_m) for entry in self.entries)

    @property
    def least_apart_m(self) -> float:
        """Least distance between two of the places."""
        return self.width_m if self.apart_m is None else self.apart_m


PlaceSource = PointSource | SegmentSource | RectangleSource
"""A source with places that do not depend on the layout."""

AnySource = Annotated[PlaceSource | VehicleSource, Field(discriminator="kind")]
