"""Usual charges by name, and the TNT equivalents of other explosives."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.values import plain_number

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
