"""The sources of charges: usual masses, points, lines, areas, and vehicles with their ways in."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Field, StrictFloat, ValidationError, model_validator

from blast_env.arrays import FloatArray
from blast_env.documents import described
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import TOLERANCE_M
from blast_env.sections import Coordinate, Ground, HashMark, Name, PointM, Section
from blast_env.site.blast_site import Charge
from blast_env.values import plain_number
from blast_env.vehicles.vehicle import Vehicle

PRESETS_SOURCE: Final = (
    "NCTC, Bomb threat stand-off distances (2014): the most that such a container reasonably holds"
)
"""Source of `CHARGE_PRESETS`."""

CHARGE_PRESETS: Final[Mapping[str, tuple[float, str]]] = MappingProxyType(
    {
        "pipe_bomb": (2.3, "pipe bomb"),
        "vest": (9.2, "suicide vest"),
        "backpack": (23.0, "briefcase or suitcase"),
        "car": (227.0, "sedan"),
        "van": (454.0, "SUV or van"),
        "small_lorry": (1814.0, "small delivery truck"),
        "lorry": (4536.0, "container or water truck"),
        "semi_trailer": (27_216.0, "semi-trailer"),
    }
)
"""Mass, kg TNT, and the source's word for its container, by name."""

EQUIVALENTS_SOURCE: Final = (
    "averaged free-air equivalent weights, TM 5-855-1, as quoted by others: the original was not"
    " at hand"
)
"""Source of `TNT_EQUIVALENTS`."""

TNT_EQUIVALENTS: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "tnt": (1.0, 1.0),
        "anfo": (0.82, 0.82),
        "composition_b": (1.11, 0.98),
        "c4": (1.37, 1.19),
        "pentolite": (1.38, 1.14),
    }
)
"""Mass of TNT with the same peak, and with the same impulse, per mass, by explosive."""


def tnt_equivalent_kg(mass_kg: float, explosive: str) -> float:
    """Return the TNT-equivalent mass of an explosive, by the larger of both equivalents.

    Raises:
        UnknownNameError: If there is no such explosive; the message suggests the nearest one.
    """
    if explosive not in TNT_EQUIVALENTS:
        raise UnknownNameError("explosive", explosive, TNT_EQUIVALENTS)
    return mass_kg * max(TNT_EQUIVALENTS[explosive])


@dataclass(frozen=True)
class MassPreset:
    """A mass of TNT with a name.

    Attributes:
        tnt_kg: TNT-equivalent mass.
    """

    name: str
    tnt_kg: float

    @classmethod
    def parsed(cls, text: str) -> "MassPreset":
        """Return the charge of a text: `car`, `truck=800`, `truck=800,anfo`.

        Raises:
            BlastEnvError: If the text has another form, or the mass is not above 0.
            UnknownNameError: If there is no such preset or explosive.
        """
        name, sign, rest = text.partition("=")
        if not sign:
            if name not in CHARGE_PRESETS:
                raise UnknownNameError("charge", name, CHARGE_PRESETS)
            return cls(name, CHARGE_PRESETS[name][0])
        mass, _, explosive = rest.partition(",")
        mass_kg = plain_number("--mass", mass.strip())
        if not (name and mass_kg > 0.0):
            raise BlastEnvError(
                f"--mass is {text!r}, must be a preset ({', '.join(CHARGE_PRESETS)}) or"
                " NAME=KG[,EXPLOSIVE] with a mass above 0"
            )
        return cls(name, tnt_equivalent_kg(mass_kg, explosive.strip() or "tnt"))


class ChargeSource(Section):
    """Base of the sources of a charge.

    Attributes:
        threat: Its name for readers, as `car`; no result depends on it. A preset of
            `CHARGE_PRESETS` gives the mass, if `tnt_kg` is missing.
        tnt_kg: TNT-equivalent mass of a charge from this source; a document may have `mass_kg` and
            `explosive` instead.
        weight: Probability of this source, relative to the others.
        height_m: Height of the charge's centre above the ground; at 0 it lies on the ground.
    """

    threat: Annotated[Name | None, HashMark.NEVER] = None
    tnt_kg: Annotated[StrictFloat, Field(ge=0.01, le=100_000.0)]
    weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] = 1.0
    height_m: Annotated[Coordinate, HashMark.IF_SET] = 0.0

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
        return ((self.position_m, self.position_m),)

    def nearest_m(self, points_m: FloatArray) -> FloatArray:
        """Return its place nearest to each of some points (points, 2)."""
        return np.broadcast_to(np.array(self.position_m), points_m.shape)

    def has_place(self, position_m: PointM) -> bool:
        """Return whether it is the point."""
        return position_m == self.position_m

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
        return ((self.start_m, self.end_m),)

    def nearest_m(self, points_m: FloatArray) -> FloatArray:
        """Return its place nearest to each of some points (points, 2)."""
        start_m, way_m = np.array(self.start_m), np.subtract(self.end_m, self.start_m)
        shares = (points_m - start_m) @ way_m / max(float(way_m @ way_m), TOLERANCE_M**2)
        return np.asarray(start_m + shares.clip(0.0, 1.0)[:, np.newaxis] * way_m)

    def has_place(self, position_m: PointM) -> bool:
        """Return whether the segment has a point, but for rounding."""
        (x_m, y_m), (x0, y0), (x1, y1) = position_m, self.start_m, self.end_m
        length_m = hypot(x1 - x0, y1 - y0)
        if length_m <= TOLERANCE_M:
            return position_m == self.start_m
        along_m = ((x_m - x0) * (x1 - x0) + (y_m - y0) * (y1 - y0)) / length_m
        aside_m = ((x_m - x0) * (y1 - y0) - (y_m - y0) * (x1 - x0)) / length_m
        is_along = -TOLERANCE_M <= along_m <= length_m + TOLERANCE_M
        return is_along and abs(aside_m) <= TOLERANCE_M

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the segment."""
        share = rng.random()
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


class RectangleSource(ChargeSource, Ground):
    """A charge uniformly distributed in a rectangle: a parking area."""

    kind: Literal["rectangle"]

    def nearest_m(self, points_m: FloatArray) -> FloatArray:
        """Return its place nearest to each of some points (points, 2)."""
        left, bottom, right, top = self.rectangle_m
        return points_m.clip((left, bottom), (right, top))

    def has_place(self, position_m: PointM) -> bool:
        """Return whether the rectangle has a point, but for rounding."""
        x_m, y_m = position_m
        left, bottom, right, top = self.rectangle_m.grown(TOLERANCE_M)
        return left <= x_m <= right and bottom <= y_m <= top

    def sample_position_m(self, rng: np.random.Generator) -> PointM:
        """Draw a point of the rectangle."""
        x_share, y_share = rng.random(2)
        return (
            self.corner_m[0] + float(x_share) * self.size_m[0],
            self.corner_m[1] + float(y_share) * self.size_m[1],
        )


class VehicleSource(Vehicle, ChargeSource):
    """A charge in a vehicle, which goes off at one of the worst places within its reach.

    The reach depends on the layout: see `blast_env.vehicles`.
    """

    @property
    def lines_m(self) -> tuple[tuple[PointM, PointM], ...]:
        """The lines of its entries."""
        return tuple((entry.start_m, entry.end_m) for entry in self.entries)


PlaceSource = PointSource | SegmentSource | RectangleSource
"""A source with places that do not depend on the layout."""

AnySource = Annotated[PlaceSource | VehicleSource, Field(discriminator="kind")]


@dataclass(frozen=True)
class VehicleCharge:
    """The charge of a vehicle without a layout; see `WorstPlaces`.

    Attributes:
        rank: Rank of its place among the worst places, from 0.
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
        """Return a copy with another mass, kg, or height, m; bounds are not checked."""
        changes = {"tnt_kg": tnt_kg, "height_m": height_m}
        given = {key: value for key, value in changes.items() if value is not None}
        return VehicleCharge(self.source.model_copy(update=given), self.rank)


AnyCharge = Charge | VehicleCharge
"""A charge at a place, or one in a vehicle, with a place that depends on the layout."""


def charge_from(given: Any) -> AnyCharge:
    """Return a charge in plain Python numbers, which can be hashed and written.

    Args:
        given: A charge, ((x, y) in m, kg of TNT), with or without a height in m; or that of a
            vehicle.

    Raises:
        BlastEnvError: If it has another form.
    """
    if isinstance(given, VehicleCharge):
        return given
    try:
        (x_m, y_m), tnt_kg, *height_m = given
        return Charge((float(x_m), float(y_m)), float(tnt_kg), *map(float, height_m))
    except (TypeError, ValueError):
        raise BlastEnvError(f"charge is {given!r}, must be ((x, y) in m, kg of TNT)") from None


def source_of(charge: AnyCharge) -> AnySource:
    """Return the source of a single charge: a point, or the vehicle.

    Raises:
        BlastEnvError: If it is no charge, or out of bounds.
    """
    plain = charge if isinstance(charge, Charge | VehicleCharge) else charge_from(charge)
    if isinstance(plain, VehicleCharge):
        return plain.source
    try:
        return PointSource.at(plain)
    except ValidationError as error:
        raise BlastEnvError(f"charge: {described(error)}") from error


def ranked(charges: Iterable[AnyCharge]) -> tuple[AnyCharge, ...]:
    """Return charges with rising ranks for those of each vehicle."""
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
