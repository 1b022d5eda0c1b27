"""Vehicles in a scenario: entries, ground and motion, what stops them, and the way kept open."""

import re
from collections.abc import Iterable, Iterator, Mapping
from math import radians, sin
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat, StrictInt, model_validator

from blast_env.arrays import BoolArray
from blast_env.errors import value_text
from blast_env.geometry import Rectangle, WallName
from blast_env.problems import Problem, ScenarioError
from blast_env.sections import (
    FOR_PEOPLE,
    Area,
    Ground,
    HashMark,
    Length,
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


# ---- Crash ratings: mass and speed of the vehicle that a barrier stopped, and penetration.

_ASTM_KG: Final[Mapping[str, float]] = MappingProxyType(
    {
        "C": 1100.0,
        "SC": 1100.0,
        "FS": 2100.0,
        "PU": 2300.0,
        "P": 2300.0,
        "M": 6800.0,
        "C7": 7200.0,
        "H": 29500.0,
    }
)
"""Masses of ASTM F2656's test vehicles: small car, sedan, pickup, lorry, cab-over, heavy lorry."""

_ASTM_KM_H: Final[Mapping[str, float]] = MappingProxyType(
    {"30": 48.0, "40": 64.0, "50": 80.0, "60": 96.0}
)
"""Speeds in km/h, rounded down to whole numbers, by their codes in miles per hour."""

_ASTM_CARS: Final = frozenset({"C", "PU", "P"})
"""Vehicles with tests at 60 miles per hour, in the edition of 2007; no other has them."""

_ASTM_PENETRATION_M: Final[Mapping[str, float]] = MappingProxyType(
    {"P1": 1.0, "P2": 7.0, "P3": 30.0}
)

_ASTM: Final = re.compile(
    r"(?:ASTM )?(?:F ?2656(?:/F ?2656M)?(?:-\d\d)?[:,]? )?"
    r"(SC|C7|FS|PU|C|P|M|H) ?(\d\d) ?[/-]? ?(P\d)"
)

_VEHICLE: Final = re.compile(
    r"(?:(?P<standard>IWA 14-1|ISO 22343-1|(?:BSI )?PAS 68)(?::\d{4})?,? "
    r"(?:[A-Za-z][A-Za-z -]* )?)?"
    r"(?:[VP]/)?(?P<kg>\d+) ?(?P<bracket>[\[(])(?P<kind>[MN]\d[A-H]?G?)[\])]"
    r"/(?P<km_h>\d+)/(?P<degrees>\d+(?:\.\d+)?)"
    r"[:/](?P<m>-?\d+(?:\.\d+)?)(?:/\d+(?:\.\d+)?)?"
)
"""ISO 22343-1 and IWA 14-1, with the class in square brackets, and PAS 68, with round ones."""


class CrashRating(Section):
    """The result of a crash test.

    It covers vehicles no heavier than the test vehicle, and no faster than its speed across the
    barrier: 80 km/h at 30 degrees cover 40 km/h. It does not cover another vehicle of the same
    energy. Codes of four standards are read: ISO 22343-1, IWA 14-1, PAS 68, and ASTM F2656.

    In a file it is a table with these keys, or the code of the test as text.

    Attributes:
        speed_km_h: Its speed across the barrier: in a test at an angle, less than along its way.
        penetration_m: Penetration of its load; 0 if none. Places of charges are that far beyond
            the rear of the barrier, which is on the safe side of a rating from the front.
        measured_from: The face of the barrier from which it is measured: the front one, on the
            side of the attack, in IWA 14-1 and ISO 22343-1, the rear one in PAS 68 and ASTM F2656.
        test: Description or code of the test, with the class of the vehicle, for readers.
    """

    mass_kg: VehicleMass
    speed_km_h: Speed
    penetration_m: Annotated[StrictFloat, Field(ge=0.0, le=100.0)] = 0.0
    measured_from: Annotated[Literal["front", "rear"], HashMark.NEVER] = "rear"
    test: Annotated[str, Field(max_length=100), FOR_PEOPLE, HashMark.NEVER] = ""

    @model_validator(mode="before")
    @classmethod
    def _from_code(cls, given: Any) -> Any:
        """Read the code of a test."""
        if not isinstance(given, str):
            return given
        code = " ".join(given.split())
        for pattern, read in ((_ASTM, _read_astm), (_VEHICLE, _read_vehicle)):
            if found := pattern.fullmatch(code):
                try:
                    return read(found) | {"test": code}
                except ValueError as error:
                    words = f"is {value_text(given)}, {error}"
                    raise ScenarioError("crash_rating", [Problem("", words)]) from None
        message = (
            f"is {value_text(given)}, must be a code such as 'V/7200[N2A]/64/90:1.2' (ISO 22343-1,"
            " IWA 14-1, PAS 68) or 'M40/P1' (ASTM F2656), or a table with mass_kg, speed_km_h and"
            " penetration_m"
        )
        raise ScenarioError("crash_rating", [Problem("", message)])

    def covers(self, mass_kg: float, speed_km_h: float) -> bool:
        """Return whether a vehicle of this mass at this speed is stopped."""
        return mass_kg <= self.mass_kg and speed_km_h <= self.speed_km_h

    @property
    def words(self) -> str:
        """Description of the rating for messages."""
        name = f" ({self.test})" if self.test else ""
        return f"rated {self.mass_kg:g} kg at {self.speed_km_h:g} km/h{name}"


def _read_astm(found: re.Match[str]) -> dict[str, float | str]:
    """Return the keys of a code of ASTM F2656."""
    vehicle, speed, penetration = found.groups()
    speeds = [
        speed_km_h for speed_km_h in _ASTM_KM_H if speed_km_h != "60" or vehicle in _ASTM_CARS
    ]
    if speed not in speeds:
        known = ", ".join(f"{vehicle}{speed}" for speed in speeds)
        raise ValueError(f"which ASTM F2656 does not have: its speeds are {known}")
    if penetration not in _ASTM_PENETRATION_M:
        known = ", ".join(_ASTM_PENETRATION_M)
        raise ValueError(f"which ASTM F2656 does not have: its penetrations are {known}")
    return {
        "mass_kg": _ASTM_KG[vehicle],
        "speed_km_h": _ASTM_KM_H[speed],
        "penetration_m": _ASTM_PENETRATION_M[penetration],
    }


def _read_vehicle(found: re.Match[str]) -> dict[str, float | str]:
    """Return the keys of a code of ISO 22343-1, IWA 14-1 or PAS 68."""
    degrees = float(found["degrees"])
    if not 0.0 < degrees <= 90.0:
        raise ValueError(f"whose angle is {degrees:g} degrees, must be above 0, at most 90")
    across = sin(radians(degrees))
    of_pas = "PAS" in found["standard"] if found["standard"] else found["bracket"] == "("
    return {
        "mass_kg": float(found["kg"]),
        "speed_km_h": round(float(found["km_h"]) * across, 3),
        "penetration_m": max(float(found["m"]), 0.0),
        "measured_from": "rear" if of_pas else "front",
    }


class CrashPiece(NamedTuple):
    """A piece or gate that stops the vehicles covered by its crash rating.

    Attributes:
        rectangle: Its rectangle, m.
        name: Its name in messages.
    """

    rectangle: Rectangle
    rating: CrashRating
    name: str


class Obstacles(NamedTuple):
    """The obstacles of a layout for vehicles, rectangles in m.

    Attributes:
        stops: Obstacles that stop every vehicle.
        solid: Obstacles that vehicles drive over, but inside which no charge goes off.
        rated: Obstacles with a crash rating.
    """

    stops: tuple[Rectangle, ...] = ()
    solid: tuple[Rectangle, ...] = ()
    rated: tuple[CrashPiece, ...] = ()


NOTHING: Final = Obstacles()
"""The empty site."""

STOPS: Final = 2
SOLID: Final = 3
OTHER: Final = 4
"""What an element of a layout is for a vehicle: it stops it, is driven over, or has its own rules.
Lower numbers are no obstacles."""


# ---- The access way, which must stay open across the build zone.


def _check_whole_modules(width_m: float) -> float:
    """Refuse a length that is not a whole number of modules."""
    if abs(width_m - round(width_m / MODULE_SIDE_M) * MODULE_SIDE_M) > 1e-9:
        raise ValueError(f"must be a multiple of {MODULE_SIDE_M:g}, the side of a module")
    return width_m


WholeModules: Final = AfterValidator(_check_whole_modules)
"""Annotation of a length of whole modules."""


class Gate(Ground, SparseSection):
    """The rectangle of a gate.

    Attributes:
        crash_rating: Its crash rating; without one, it stops every vehicle.
    """

    sparse: ClassVar = frozenset({"crash_rating"})

    crash_rating: Annotated[CrashRating | None, HashMark.IF_SET] = None


class AccessWay(Section):
    """A way across the build zone that must stay open for a vehicle.

    The vehicle is a square of whole cells. It moves along rows and columns, stays inside the
    zone, and covers neither a module nor a structure; no-build areas are open to it.

    Attributes:
        width_m: Side of the vehicle's square; whole modules.
        between: The two sides of the zone that the way connects.
        gate: A gate that opens for the way's vehicle alone: it is kept free of modules, and is
            closed to vehicles with a charge.
    """

    width_m: Annotated[StrictFloat, Field(ge=MODULE_SIDE_M, le=2000.0), WholeModules]
    between: Literal["left_right", "bottom_top"]
    gate: Annotated[Gate | None, HashMark.IF_SET] = None

    @property
    def width_cells(self) -> int:
        """Side of the vehicle's square in cells."""
        return round(self.width_m / MODULE_SIDE_M)

    @property
    def is_upwards(self) -> bool:
        """Whether the way runs from the lower to the upper side of the zone."""
        return self.between == "bottom_top"

    @property
    def description(self) -> str:
        """Description for messages: `access way of 3 m from left to right`."""
        return f"access way of {self.width_m:g} m from {self.between.replace('_', ' to ')}"


def is_open(way: AccessWay, passable: BoolArray) -> bool:
    """Return whether the vehicle can cross the zone.

    Args:
        way: The way; no wider than the zone.
        passable: Cells that the vehicle may cover (rows, columns).
    """
    from blast_env.vehicles.access_kernels import has_way  # Numba takes long to import

    return bool(has_way(_along_columns(way, passable), way.width_cells))


def closing_places(
    way: AccessWay, passable: BoolArray, sizes: Iterable[tuple[int, int]]
) -> Iterator[BoolArray]:
    """Yield for each size of piece the lower left cells at which it closes the way (rows, columns).

    If the way is closed already, these are all cells; for measures, of no size, none.

    Args:
        way: The way; no wider than the zone.
        passable: Cells that the vehicle may cover (rows, columns).
        sizes: Rows and columns of cells of the pieces to be placed.
    """
    from blast_env.vehicles.access_kernels import closing_cells  # Numba takes long to import

    wanted = [*sizes]
    distinct = [*dict.fromkeys(wanted)]
    along = np.array(distinct, dtype=np.int64).reshape(-1, 2)
    if way.is_upwards:
        along = np.ascontiguousarray(along[:, ::-1])
    closing = closing_cells(_along_columns(way, passable), along, way.width_cells)
    for size in wanted:
        yield _along_columns(way, closing[distinct.index(size)])


def _along_columns(way: AccessWay, cells: BoolArray) -> BoolArray:
    """Return the cells transposed so that the way runs along the columns, or back; a copy."""
    # Never read-only, for which Numba would compile anew.
    return np.array(cells.T if way.is_upwards else cells, order="C")
