"""The units that a report is written in."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from blast_env.errors import UnknownNameError
from blast_env.units import MS_PER_S, PA_PER_KPA, PA_PER_PSI


@dataclass(frozen=True)
class UnitSystem:
    """Units of loads; lengths are metres and masses kilograms in both.

    Attributes:
        name: How the command line calls it.
        impulse: Unit of impulses.
        pressure: Unit of overpressures.
        pa_s_per_impulse: Pascal seconds in a unit of impulse.
        pa_per_pressure: Pascals in a unit of pressure.
    """

    name: str
    impulse: str
    pressure: str
    pa_s_per_impulse: float
    pa_per_pressure: float

    def impulse_of(self, pa_s: float) -> float:
        """Return an impulse in Pa s in this unit."""
        return pa_s / self.pa_s_per_impulse

    def pressure_of(self, pa: float) -> float:
        """Return a pressure in Pa in this unit."""
        return pa / self.pa_per_pressure

    @classmethod
    def named(cls, name: str) -> "UnitSystem":
        """Return the units of a name.

        Raises:
            UnknownNameError: If there are none.
        """
        if name not in UNITS:
            raise UnknownNameError("units", name, UNITS)
        return UNITS[name]


UNITS: Final[Mapping[str, UnitSystem]] = MappingProxyType(
    {
        each.name: each
        for each in (
            UnitSystem("si", "Pa·s", "kPa", 1.0, PA_PER_KPA),
            UnitSystem("psi", "psi·ms", "psi", PA_PER_PSI / MS_PER_S, PA_PER_PSI),
        )
    }
)
"""The units by their names."""
