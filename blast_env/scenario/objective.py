"""The objective: which load of the protected structures counts, and over which charges."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, StrictFloat, model_validator

from blast_env.scenario.problems import Problem, ScenarioError
from blast_env.scenario.sections import Section
from blast_env.statistics import (
    CVAR_LEVEL,
    ConditionalValueAtRisk,
    MeanRisk,
    Risk,
    WorstRisk,
)
from blast_env.units import PA_PER_PSI

Reference = Annotated[StrictFloat, Field(gt=0.0, le=1e12)]


Level = Annotated[StrictFloat, Field(ge=0.0, lt=1.0)]


_UNITS: Final = {"impulse": "Pa s", "peak": "Pa", "both": ""}


_NOUNS: Final = {"impulse": "impulse", "peak": "peak overpressure", "both": "load"}


_TERMS: Final = {"impulse": "impulse", "peak": "peak", "both": "load"}


class ObjectiveSection(Section):
    """What a layout is to lower.

    The load of a structure is its weight times its impulse (`"impulse"`, Pa s), its peak weight
    times its peak overpressure (`"peak"`, Pa), or the sum of both (`"both"`), each divided by its
    reference, which has no unit. The loads of the protected structures are added up, and those of
    several charges become one number.

    Attributes:
        quantity: Which load counts; peaks need the engine `gas`.
        reference_impulse_pa_s: For `"both"`: the impulse that counts as 1.
        reference_peak_pa: For `"both"`: the peak overpressure that counts as 1.
        charges: How the loads of several charges become one: their mean, the mean of the worst
            ones (`"cvar"`), or the worst alone.
        cvar_level: For `"cvar"`: the worst share 1 - `cvar_level` counts; 0.8 unless given.
    """

    quantity: Literal["impulse", "peak", "both"] = "impulse"
    reference_impulse_pa_s: Reference | None = None
    reference_peak_pa: Reference | None = None
    charges: Literal["mean", "cvar", "worst"] = "mean"
    cvar_level: Level | None = None

    @model_validator(mode="after")
    def _check_keys_together(self) -> Self:
        """Refuse references without `both`, `both` without references, a level without `cvar`."""
        problems = []
        for key in ("reference_impulse_pa_s", "reference_peak_pa"):
            is_given = getattr(self, key) is not None
            if self.quantity == "both" and not is_given:
                problems.append(Problem(key, "missing: quantity 'both' adds shares of it"))
            if self.quantity != "both" and is_given:
                problems.append(Problem(key, f"must be left out: quantity is {self.quantity!r}"))
        if self.charges != "cvar" and self.cvar_level is not None:
            problems.append(Problem("cvar_level", f"must be left out: charges is {self.charges!r}"))
        if problems:
            raise ScenarioError("objective", problems)
        return self

    @property
    def needs_peaks(self) -> bool:
        """Whether peak overpressures count, which particles do not have."""
        return self.quantity != "impulse"

    @property
    def unit(self) -> str:
        """Unit of loads in tables: `Pa s`, `Pa`, or none."""
        return _UNITS[self.quantity]

    @property
    def noun(self) -> str:
        """What counts, in words: `impulse`, `peak overpressure`, or `load`."""
        return _NOUNS[self.quantity]

    @property
    def term(self) -> str:
        """Name of the term of the reward: `impulse` (psi s), `peak` (psi) or `load` (no unit)."""
        return _TERMS[self.quantity]

    @property
    def risk(self) -> Risk:
        """How the loads of several charges become the one that counts."""
        if self.charges == "mean":
            return MeanRisk()
        if self.charges == "worst":
            return WorstRisk()
        return ConditionalValueAtRisk(CVAR_LEVEL if self.cvar_level is None else self.cvar_level)

    def text(self, load: float) -> str:
        """Return a load with its unit: `1,045 Pa s`, `2.31e+04 Pa`, `0.83`."""
        if self.quantity == "both":
            return f"{load:.3g}"
        return f"{load:,.0f} {self.unit}"

    def paid(self, load: float) -> float:
        """Return a load, in `unit`, as rewards are paid: in psi s, psi, or without a unit."""
        return load if self.quantity == "both" else load / PA_PER_PSI

    def load(self, impulse_pa_s: float, peak_pa: float, weight: float, peak_weight: float) -> float:
        """Return the load of one structure that counts, in `unit`.

        Args:
            impulse_pa_s: Its impulse per area.
            peak_pa: Its peak overpressure.
            weight: How much its impulse counts.
            peak_weight: How much its peak counts.
        """
        if self.quantity == "impulse":
            return weight * impulse_pa_s
        if self.quantity == "peak":
            return peak_weight * peak_pa
        assert self.reference_impulse_pa_s is not None
        assert self.reference_peak_pa is not None
        impulse_share = impulse_pa_s / self.reference_impulse_pa_s
        return weight * impulse_share + peak_weight * peak_pa / self.reference_peak_pa
