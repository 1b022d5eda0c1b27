"""Whole buildings and people on the ground: probabilities from side-on pressure and impulse.

For neighbouring buildings without a facade description, and for contours on the ground. A probit Y
gives a probability P = normal(Y - 5); P_s is the side-on peak in Pa, i_s the side-on impulse in
Pa s:

    minor damage      Y = 5 - 0.26 ln[(4600 / P_s)^3.9 + (110 / i_s)^5.0]
    major damage      Y = 5 - 0.26 ln[(17500 / P_s)^8.4 + (290 / i_s)^9.3]
    collapse          Y = 5 - 0.22 ln[(40000 / P_s)^7.4 + (460 / i_s)^11.3]
    eardrum rupture   Y = -15.6 + 1.93 ln P_s

The first three: TNO, Methods for the determination of possible damage (Green Book), ordinary
masonry houses. The last: Eisenberg and others 1975, as in Crowl & Louvar, Chemical process safety.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.response.levels import LevelOfProtection
from blast_env.response.wall_sections import DamageLevel


@dataclass(frozen=True)
class _BuildingProbit:
    share: float
    peak_pa: float
    peak_power: float
    impulse_pa_s: float
    impulse_power: float


class BuildingDamage(StrEnum):
    """Damage to an ordinary masonry house in the terms of the Green Book."""

    MINOR = "minor"
    MAJOR = "major"
    COLLAPSE = "collapse"


_BUILDINGS = {
    BuildingDamage.MINOR: _BuildingProbit(0.26, 4600.0, 3.9, 110.0, 5.0),
    BuildingDamage.MAJOR: _BuildingProbit(0.26, 17500.0, 8.4, 290.0, 9.3),
    BuildingDamage.COLLAPSE: _BuildingProbit(0.22, 40000.0, 7.4, 460.0, 11.3),
}


def building_damage_probability(
    damage: BuildingDamage, peak_pa: FloatArray, impulse_pa_s: FloatArray
) -> FloatArray:
    """Return the probability that a house has at least the given damage.

    Args:
        peak_pa: Side-on peak overpressures (places,).
        impulse_pa_s: Side-on impulses of the positive phase (places,).
    """
    probit = _BUILDINGS[damage]
    with np.errstate(divide="ignore", over="ignore"):
        demand = (probit.peak_pa / np.asarray(peak_pa)) ** probit.peak_power
        demand = demand + (probit.impulse_pa_s / np.asarray(impulse_pa_s)) ** probit.impulse_power
        return _probability(5.0 - probit.share * np.log(demand))


def eardrum_peak_pa(probability: float) -> float:
    """Return the side-on peak overpressure for a probability of eardrum rupture, Pa."""
    from scipy.special import ndtri

    return float(np.exp((5.0 + ndtri(probability) + 15.6) / 1.93))


@dataclass(frozen=True)
class GroundThreshold:
    """A side-on peak overpressure from which an effect must be expected on the ground.

    Attributes:
        peak_pa: Least side-on peak overpressure for it.
        source: Source of the value.
    """

    words: str
    peak_pa: float
    source: str


_CLANCEY = (
    "V. J. Clancey, Diagnostic features of explosion damage, 1972, as listed by explosion-safety.jp"
)
_EISENBERG = "the probit of Eisenberg and others, 1975"


def ground_thresholds() -> tuple[GroundThreshold, ...]:
    """Return the thresholds for the choice of assembly points, the smallest peak first."""
    return (
        GroundThreshold("one window in ten broken", 2070.0, _CLANCEY),
        GroundThreshold("windows usually shattered", 3400.0, _CLANCEY),
        GroundThreshold("one eardrum in 100 ruptured", eardrum_peak_pa(0.01), _EISENBERG),
        GroundThreshold("half of all eardrums ruptured", eardrum_peak_pa(0.5), _EISENBERG),
    )


def _probability(probit: FloatArray) -> FloatArray:
    from scipy.special import ndtr  # a quarter of a second to import

    result: FloatArray = ndtr(probit - 5.0)
    return result


def level_of_protection(worst: DamageLevel) -> LevelOfProtection:
    """Return the level of protection that corresponds to a building's worst component damage.

    Superficial damage corresponds to a high level, moderate to medium, heavy to low, and hazardous
    failure to very low (PDC-TR 06-08 assigns the four levels of UFC 4-010-01 by the damage of the
    components; these are its bands for non-structural exterior walls).

    Args:
        worst: The worst damage among the components.
    """
    return LevelOfProtection(DamageLevel.BLOWOUT - worst)
