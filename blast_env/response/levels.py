"""Levels of protection, and damage as a number.

A damage increases within its level and from level to level: below 1 it allows a high level of
protection, from 1 medium, from 2 low, from 3 very low, from 4 to 5 none.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from blast_env.errors import UnknownNameError

MOST_DAMAGE: Final = 5.0
"""The largest damage."""


class LevelOfProtection(IntEnum):
    """Level of protection of a building in the terms of UFC 4-010-01; a higher value is better."""

    BELOW_STANDARDS = 0
    VERY_LOW = 1
    LOW = 2
    MEDIUM = 3
    HIGH = 4

    @property
    def label(self) -> str:
        """Name in lower case."""
        return self.name.lower().replace("_", " ")

    @property
    def title(self) -> str:
        """Name with a capital letter, for sentences."""
        return self.label.capitalize()

    @classmethod
    def named(cls, label: str) -> "LevelOfProtection":
        """Return the level with a label; `BELOW_STANDARDS` is not allowed as a target.

        Raises:
            UnknownNameError: If no level has that label; the message suggests the nearest one.
        """
        levels = {cl.label: cl for cl in cls if cl is not cls.BELOW_STANDARDS}
        if label not in levels:
            raise UnknownNameError("level of protection", label, levels)
        return levels[label]


@dataclass(frozen=True)
class BayDamage:
    """Damage of one bay under one blast.

    Attributes:
        glazed_m2: Area of its panes.
        damage: Damage by the name of the component, present or possible.
    """

    name: str
    structure: str
    area_m2: float
    glazed_m2: float
    damage: dict[str, float]


def level_of(worst_damage: float) -> LevelOfProtection:
    """Return the level of protection that corresponds to the worst damage of components."""
    return LevelOfProtection(max(4 - int(worst_damage), 0))


def worst(damages: Iterable[float]) -> float:
    """Return the largest damage; 0 if there is none."""
    return max(damages, default=0.0)


def fails_from(target: LevelOfProtection) -> float:
    """Return the damage from which a component no longer allows a level of protection."""
    return float(5 - target)
