"""Sections of wall panels: their strength per metre of width, and the limits of their damage.

Damage levels are those of PDC-TR 06-08 (Single degree of freedom structural response limits for
antiterrorism design, US Army Corps of Engineers, 2008). Each limit gives its source.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, model_validator

from blast_env.arrays import FloatArray


class DamageLevel(IntEnum):
    """Damage of a component in the terms of PDC-TR 06-08; a lower value is better."""

    SUPERFICIAL = 0
    MODERATE = 1
    HEAVY = 2
    HAZARDOUS = 3
    BLOWOUT = 4


class Supports(StrEnum):
    """Support conditions of a panel."""

    SIMPLE = "simple"
    FIXED = "fixed"
    CANTILEVER = "cantilever"


@dataclass(frozen=True)
class Limits:
    """Limits between the levels of damage of a component.

    Attributes:
        ductility: Ductility at the end of superficial, moderate, heavy and hazardous damage; `None`
            without a limit.
        rotation_deg: Support rotation at these limits, degrees; `None` without a limit.
        source: Source of the limits, or a statement that they are assumptions.
        assumed: The levels of damage whose limits are assumptions.
    """

    ductility: tuple[float | None, float | None, float | None, float | None]
    rotation_deg: tuple[float | None, float | None, float | None, float | None]
    source: str
    assumed: frozenset[DamageLevel] = frozenset()

    def measure(self, ductility: FloatArray, rotation_deg: FloatArray) -> FloatArray:
        """Return the damage as a number: below 1 superficial, from 1 moderate, from 4 blowout.

        It increases linearly between limits, to give searches a gradient, and beyond the last
        one towards 5. If both ductility and rotation limit a level, the one exceeded first
        decides; if only one of them does, the damage in that level increases with that one.

        Args:
            ductility: Largest deflection over that at yield (components,).
            rotation_deg: Largest support rotation (components,).
        """
        result = np.zeros(len(ductility))
        for values, limits in ((ductility, self.ductility), (rotation_deg, self.rotation_deg)):
            first = next((level for level, limit in enumerate(limits) if limit is not None), None)
            if first is not None:
                measure = _measure(values, limits, first)
                counts = (measure >= first + 1) | (result >= first)
                result = np.where(counts, np.maximum(result, measure), result)
        return result


def _measure(values: FloatArray, limits: Sequence[float | None], first: int) -> FloatArray:
    # Linear between the limits that there are; beyond the last one 1 - limit / value, which tends
    # to the next number.
    at = [(0.0, float(first))]
    at += [(limit, level) for level, limit in enumerate(limits, start=1) if limit is not None]
    known, levels = (np.array(coordinate) for coordinate in zip(*at, strict=True))
    measure = np.interp(values, known, levels)
    if levels[-1] < DamageLevel.BLOWOUT:
        return measure
    return measure + 1.0 - known[-1] / np.maximum(values, known[-1])


_PDC_TABLES: Final = "PDC-TR 06-08, tables 3-1 and 3-3, as others quote them"

_BETWEEN: Final = "the limit of heavy damage is an assumption between those of the tables"

_NOT_READ: Final = "no public table could be read, so the limits are assumptions of this project"

CONCRETE_LIMITS: Final = Limits(
    (1.0, None, None, None),
    (None, 2.0, 5.0, 10.0),
    f"{_PDC_TABLES}: 1, 2 and 10 degrees; {_BETWEEN}",
    frozenset({DamageLevel.HEAVY}),
)
"""Reinforced concrete in bending, single reinforcement."""

MASONRY_LIMITS: Final = Limits(
    (1.0, None, None, None),
    (None, 1.5, 4.0, 8.0),
    f"{_PDC_TABLES}: 1, 1.5 and 8 degrees; {_BETWEEN}",
    frozenset({DamageLevel.HEAVY}),
)
"""Unreinforced masonry in bending."""

_ALL: Final = frozenset(DamageLevel) - {DamageLevel.BLOWOUT}

REINFORCED_MASONRY_LIMITS: Final = Limits(
    CONCRETE_LIMITS.ductility,
    CONCRETE_LIMITS.rotation_deg,
    f"{_NOT_READ}: those of reinforced concrete, safer than others in use (2, 8 and 15 degrees)",
    _ALL,
)

STEEL_LIMITS: Final = Limits(
    (0.5, 0.8, 0.9, 1.0),
    (None, None, None, None),
    f"{_NOT_READ}: those in use for studs with a slip track at the top, which buckle before they"
    " yield, safer than for studs tied at both ends (0.5, 1, 2 and 3)",
    _ALL,
)

TIMBER_LIMITS: Final = Limits((1.0, 2.0, 3.0, 4.0), (None, None, None, None), _NOT_READ, _ALL)

_CLASS_B: Final = 1.08

HARDENING_DEG: Final = (2.0, 6.0)
"""Support rotations beyond which the steel of concrete has a fourth and half of its hardening."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ReinforcedConcrete(_Section):
    """Reinforced concrete, with equal steel at both faces.

    The moment follows from equilibrium of the steel and a rectangular stress block of concrete, the
    stiffness from the mean of the uncracked and cracked sections (UFC 3-340-02, sections 4-9 and
    4-11), with dynamic strengths. Beyond yield the stress of the steel grows with the rotation of
    the supports (`design_stress_pa`); the lever arm stays that of the whole section.

    Attributes:
        steel_share: Area of tension steel over that of the section above the centre of the steel.
        cover_m: Depth of the centre of the steel below the face.
        concrete_pa: Compressive strength.
        steel_pa: Yield strength.
        steel_ultimate_pa: Ultimate strength; 1.08 times the yield strength unless given, the least
            of class B (EN 1992-1-1, annex C).
        dynamic_increase: Factor on concrete and on the yield strength at the strain rates of a
            blast.
        ultimate_increase: The same on the ultimate strength (UFC 3-340-02, table 4-1).
        tension_membrane: Whether both supports hold it in its plane, and all steel is continuous
            and anchored there: it then hangs as a membrane at large deflections.
    """

    kind: Literal["reinforced_concrete"] = "reinforced_concrete"
    thickness_m: Annotated[StrictFloat, Field(ge=0.01, le=3.0)]
    steel_share: Annotated[StrictFloat, Field(ge=1e-5, le=0.04)] = 0.003
    cover_m: Annotated[StrictFloat, Field(ge=0.001, le=1.0)] = 0.035
    concrete_pa: Annotated[StrictFloat, Field(ge=1e6, le=300e6)] = 30e6
    steel_pa: Annotated[StrictFloat, Field(ge=50e6, le=3e9)] = 500e6
    steel_ultimate_pa: Annotated[StrictFloat, Field(ge=50e6, le=5e9)] | None = None
    dynamic_increase: Annotated[StrictFloat, Field(ge=1.0, le=2.0)] = 1.17
    ultimate_increase: Annotated[StrictFloat, Field(ge=1.0, le=2.0)] = 1.05
    tension_membrane: StrictBool = False

    @model_validator(mode="after")
    def _check_steel(self) -> Self:
        """Refuse more steel than the concrete can balance: the block would exceed the section."""
        most = 0.85 * self.concrete_pa / self.steel_pa
        if self.steel_share > most:
            raise ValueError(
                f"steel_share is {self.steel_share:g}, must be at most {most:.3g}: 0.85 concrete_pa"
                " over steel_pa"
            )
        return self

    @property
    def mass_kg_m2(self) -> float:
        """Mass per area, at 2,500 kg/m3."""
        return 2500.0 * self.thickness_m

    @property
    def _depth_m(self) -> float:
        # A cover beyond half of the thickness is that of the other face.
        return max(self.thickness_m - self.cover_m, 0.5 * self.thickness_m)

    @property
    def moment_n(self) -> float:
        """Yield moment per metre of width."""
        return self.moment_at(0.0)

    def moment_at(self, rotation_deg: float) -> float:
        """Return the moment per metre of width that it has at a support rotation, N."""
        # Equilibrium: the force of the tension steel against a block of concrete at 0.85 f_c, and
        # its arm to the middle of that block.
        force = self.steel_share * self._depth_m * self.design_stress_pa(rotation_deg)
        block_m = force / (0.85 * self.concrete_pa * self.dynamic_increase)
        return force * (self._depth_m - 0.5 * block_m)

    def design_stress_pa(self, rotation_deg: float) -> float:
        """Return the dynamic stress of the steel at a support rotation, Pa.

        Up to 2 degrees it yields; up to 6 degrees, a fourth of the hardening is added, beyond half
        of it (UFC 3-340-02, table 4-2; TM 5-1300 has 5 degrees for 6). Steel whose dynamic ultimate
        strength is not above its dynamic yield strength does not harden.
        """
        yields_pa = self.steel_pa * self.dynamic_increase
        ultimate_pa = self.steel_ultimate_pa or _CLASS_B * self.steel_pa
        hardening_pa = max(ultimate_pa * self.ultimate_increase - yields_pa, 0.0)
        first, second = HARDENING_DEG
        share = 0.0 if rotation_deg <= first else 0.25 if rotation_deg <= second else 0.5
        return yields_pa + share * hardening_pa

    def membrane_n(self, rotation_deg: float) -> float:
        """Return the tension of the steel of both faces per metre of width, N/m."""
        steel_m = 2.0 * self.steel_share * self._depth_m
        return steel_m * self.design_stress_pa(rotation_deg) if self.tension_membrane else 0.0

    @property
    def bending_stiffness_n_m(self) -> float:
        """E I, the mean of the uncracked and cracked sections."""
        # E_c = 4,700 sqrt(f_c) in MPa (ACI 318). The neutral axis of the cracked section balances
        # the first moments of area, x^2 / 2 = n rho d (d - x).
        concrete_e = 4700e6 * np.sqrt(self.concrete_pa / 1e6)
        ratio = 200e9 / concrete_e
        share = ratio * self.steel_share
        neutral_m = self._depth_m * (np.sqrt(2.0 * share + share**2) - share)
        steel_m = self.steel_share * self._depth_m
        cracked = neutral_m**3 / 3.0 + ratio * steel_m * (self._depth_m - neutral_m) ** 2
        return float(0.5 * concrete_e * (self.thickness_m**3 / 12.0 + cracked))

    @property
    def limits(self) -> Limits:
        """PDC-TR 06-08, single reinforcement."""
        return CONCRETE_LIMITS


class Masonry(_Section):
    """Unreinforced brick or block: it cracks, then rocks under its weight until it falls.

    Attributes:
        thickness_m: Thickness of the wall.
        density_kg_m3: Density of the wall as built.
        flexural_pa: Flexural strength at which it cracks.
        young_pa: Young's modulus.
    """

    kind: Literal["masonry"] = "masonry"
    thickness_m: Annotated[StrictFloat, Field(ge=0.01, le=2.0)]
    density_kg_m3: Annotated[StrictFloat, Field(ge=100.0, le=10_000.0)] = 1900.0
    flexural_pa: Annotated[StrictFloat, Field(ge=1e3, le=100e6)] = 0.7e6
    young_pa: Annotated[StrictFloat, Field(ge=1e7, le=1e12)] = 6e9

    @property
    def mass_kg_m2(self) -> float:
        """Mass per area."""
        return self.density_kg_m3 * self.thickness_m

    @property
    def moment_n(self) -> float:
        """Cracking moment per metre of width."""
        return self.flexural_pa * self.thickness_m**2 / 6.0

    @property
    def bending_stiffness_n_m(self) -> float:
        """E I of the uncracked section."""
        return self.young_pa * self.thickness_m**3 / 12.0

    @property
    def limits(self) -> Limits:
        """PDC-TR 06-08, unreinforced masonry."""
        return MASONRY_LIMITS


_Ductility = Annotated[StrictFloat, Field(gt=0.0, le=100.0)]


class Sheeting(_Section):
    """Other elastic-plastic sections: studs, timber, reinforced block.

    Attributes:
        moment_n: Yield moment per metre of width, N m per m.
        bending_stiffness_n_m: E I per metre of width.
        mass_kg_m2: Mass per area.
        material: Material, which determines the limits of damage.
        ductility: Other limits: the ductility at the end of superficial, moderate, heavy and
            hazardous damage.
    """

    kind: Literal["sheeting"] = "sheeting"
    moment_n: Annotated[StrictFloat, Field(ge=1.0, le=1e9)]
    bending_stiffness_n_m: Annotated[StrictFloat, Field(ge=1.0, le=1e12)]
    mass_kg_m2: Annotated[StrictFloat, Field(ge=0.1, le=1e5)]
    material: Literal["steel", "timber", "reinforced_masonry"]
    ductility: tuple[_Ductility, _Ductility, _Ductility, _Ductility] | None = None

    @model_validator(mode="after")
    def _check_ductility(self) -> Self:
        """Refuse limits that do not ascend."""
        if self.ductility is not None and list(self.ductility) != sorted({*self.ductility}):
            raise ValueError(f"ductility is {self.ductility}, must ascend")
        return self

    @property
    def limits(self) -> Limits:
        """The given limits, or those of the material."""
        if self.ductility is not None:
            return Limits(self.ductility, (None, None, None, None), "given")
        known = {
            "steel": STEEL_LIMITS,
            "timber": TIMBER_LIMITS,
            "reinforced_masonry": REINFORCED_MASONRY_LIMITS,
        }
        return known[self.material]
