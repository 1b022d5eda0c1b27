"""Crash ratings: mass and speed of the vehicle that a barrier stopped in a test, and penetration.

A rating is the result of a test, and covers vehicles no heavier and no faster than the test
vehicle. It does not cover another vehicle of the same energy. Codes of three standards are
read: IWA 14-1, PAS 68, and ASTM F2656.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final

from pydantic import Field, StrictFloat, model_validator

from blast_env.errors import value_text
from blast_env.problems import Problem, ScenarioError
from blast_env.sections import FOR_PEOPLE, Section
from blast_env.vehicles.vehicle import Speed, VehicleMass

_ASTM_KG: Final[Mapping[str, float]] = MappingProxyType(
    {"C": 1100.0, "FS": 2100.0, "PU": 2300.0, "P": 2300.0, "M": 6800.0, "C7": 7200.0, "H": 29500.0}
)
"""Masses of ASTM F2656's test vehicles: small car, sedan, pickup, lorry, cab-over, heavy lorry."""

_ASTM_KM_H: Final[Mapping[str, float]] = MappingProxyType(
    {"30": 48.0, "40": 64.0, "50": 80.0, "60": 96.0}
)
"""Speeds in km/h, rounded down to whole numbers, by their codes in miles per hour."""

_ASTM_PENETRATION_M: Final[Mapping[str, float]] = MappingProxyType(
    {"P1": 1.0, "P2": 7.0, "P3": 30.0}
)

_ASTM: Final = re.compile(r"(C7|FS|PU|C|P|M|H)(\d\d)[/-]?(P[123])")

_IWA: Final = re.compile(
    r"(?:[VP]/)?(?P<kg>\d+) ?[\[(](?P<kind>[A-Z0-9]+)[\])]/(?P<km_h>\d+)/\d+(?:\.\d+)?"
    r"[:/](?P<m>-?\d+(?:\.\d+)?)(?:/.*)?"
)


class CrashRating(Section):
    """The result of a crash test.

    In a file it is a table with these keys, or the code of the test as text.

    Attributes:
        mass_kg: Mass of the test vehicle.
        speed_km_h: Speed of the test vehicle.
        penetration_m: Penetration of its load beyond the rear of the barrier; 0 if none.
        test: Description or code of the test, with the class of the vehicle, for readers.
    """

    mass_kg: VehicleMass
    speed_km_h: Speed
    penetration_m: Annotated[StrictFloat, Field(ge=0.0, le=100.0)] = 0.0
    test: Annotated[str, Field(max_length=100), FOR_PEOPLE] = ""

    @model_validator(mode="before")
    @classmethod
    def _from_code(cls, given: Any) -> Any:
        """Read the code of a test."""
        if not isinstance(given, str):
            return given
        code = given.strip()
        if (found := _ASTM.fullmatch(code)) and found[2] in _ASTM_KM_H:
            mass_kg, speed_km_h = _ASTM_KG[found[1]], _ASTM_KM_H[found[2]]
            penetration_m = _ASTM_PENETRATION_M[found[3]]
        elif found := _IWA.fullmatch(code):
            mass_kg, speed_km_h = float(found["kg"]), float(found["km_h"])
            penetration_m = max(float(found["m"]), 0.0)
        else:
            message = (
                f"is {value_text(given)}, must be a code such as 'V/7200[N2A]/64/90:1.2'"
                " (IWA 14-1, PAS 68) or 'M40/P1' (ASTM F2656), or a table with mass_kg, speed_km_h"
                " and penetration_m"
            )
            raise ScenarioError("crash_rating", [Problem("", message)])
        return {
            "mass_kg": mass_kg,
            "speed_km_h": speed_km_h,
            "penetration_m": penetration_m,
            "test": code,
        }

    def covers(self, mass_kg: float, speed_km_h: float) -> bool:
        """Return whether a vehicle of this mass at this speed is stopped."""
        return mass_kg <= self.mass_kg and speed_km_h <= self.speed_km_h

    @property
    def words(self) -> str:
        """Description of the rating for messages."""
        name = f" ({self.test})" if self.test else ""
        return f"rated {self.mass_kg:g} kg at {self.speed_km_h:g} km/h{name}"
