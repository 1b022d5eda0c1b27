"""Crash ratings: mass and speed of the vehicle that a barrier stopped in a test, and penetration.

A rating is the result of a test, and covers vehicles no heavier than the test vehicle, and no
faster than its speed across the barrier: 80 km/h at 30 degrees cover 40 km/h. It does not cover
another vehicle of the same energy. Codes of four standards are read: ISO 22343-1, IWA 14-1, PAS 68,
and ASTM F2656.
"""

import re
from collections.abc import Mapping
from math import radians, sin
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field, StrictFloat, model_validator

from blast_env.errors import value_text
from blast_env.geometry import Rectangle
from blast_env.problems import Problem, ScenarioError
from blast_env.sections import FOR_PEOPLE, HashMark, Section
from blast_env.vehicles.vehicle import Speed, VehicleMass

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
