"""The objective: what a layout is to lower, a load or what becomes of the facades."""

from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import Field, StrictFloat, model_validator

from blast_env.arrays import FloatArray
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.damage import fails_from
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

    With kind `"response"` it is not a load that counts, but what becomes of the facades of the
    protected structures: the damage of their bays (`blast_env.response.damage`), weighted by area,
    a number from 0 to 5 without a unit. With a `target` it is the cheapest layout that reaches a
    level of protection: see `shortfall` and `counted`.

    Attributes:
        kind: Whether a load counts, or the response of facades; that needs the engine `gas`, or a
            surrogate of it.
        measure: Of the response: `"damage"` is that of the worse of window and wall panel in a
            bay, by the area of bays; `"glazing"` that of windows alone, by the area of panes.
        target: Of the response: the level of protection to reach under every charge.
        quantity: Which load counts; peaks need the engine `gas`.
        reference_impulse_pa_s: For `"both"`: the impulse that counts as 1.
        reference_peak_pa: For `"both"`: the peak overpressure that counts as 1.
        charges: How the loads of several charges become one: their mean, the mean of the worst
            ones (`"cvar"`), or the worst alone.
        cvar_level: For `"cvar"`: the worst share 1 - `cvar_level` counts; 0.8 unless given.
    """

    kind: Literal["load", "response"] = "load"
    measure: Literal["damage", "glazing"] = "damage"
    target: Literal["very low", "low", "medium", "high"] | None = None
    quantity: Literal["impulse", "peak", "both"] = "impulse"
    reference_impulse_pa_s: Reference | None = None
    reference_peak_pa: Reference | None = None
    charges: Literal["mean", "cvar", "worst"] = "mean"
    cvar_level: Level | None = None

    @model_validator(mode="after")
    def _check_keys_together(self) -> Self:
        """Refuse references without `both`, `both` without references, a level without `cvar`."""
        problems = []
        if self.is_response and self.quantity != "impulse":
            problems.append(Problem("quantity", "must be left out: kind is 'response'"))
        for key in ("measure", "target"):
            is_default = getattr(self, key) == type(self).model_fields[key].default
            if not self.is_response and not is_default:
                problems.append(Problem(key, f"must be left out: kind is {self.kind!r}"))
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
        return self.is_response or self.quantity != "impulse"

    @property
    def is_response(self) -> bool:
        """Whether the response of facades counts, and no load."""
        return self.kind == "response"

    @property
    def level(self) -> LevelOfProtection | None:
        """The level of protection to reach, if there is a target."""
        if self.target is None:
            return None
        return LevelOfProtection[self.target.upper().replace(" ", "_")]

    @property
    def unit(self) -> str:
        """Unit of loads in tables: `Pa s`, `Pa`, or none."""
        return "" if self.is_response else _UNITS[self.quantity]

    @property
    def noun(self) -> str:
        """What counts, in words: `impulse`, `damage`, with a target `shortfall`."""
        if self.target is not None:
            return "shortfall"
        if self.is_response:
            return "damage" if self.measure == "damage" else "glazing hazard"
        return _NOUNS[self.quantity]

    @property
    def term(self) -> str:
        """Name of the reward's term: `impulse` (psi s), `peak` (psi), `load` or `response`."""
        return "response" if self.is_response else _TERMS[self.quantity]

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
        if self.is_response or self.quantity == "both":
            return f"{load:.3g}"
        return f"{load:,.0f} {self.unit}"

    def paid(self, load: float) -> float:
        """Return a load, in `unit`, as rewards are paid: in psi s, psi, or without a unit."""
        return load if self.is_response or self.quantity == "both" else load / PA_PER_PSI

    def response(self, damage: FloatArray, area_m2: FloatArray) -> float:
        """Return what counts of the response of one structure's bays.

        That is the mean of their damage by area. With a target it is the mean of the shortfall:
        0 of a bay that reaches the level, else 1 and by how much its damage is beyond the limit.

        Args:
            damage: Of the bays (bays,).
            area_m2: What each counts for (bays,).
        """
        total_m2 = float(area_m2.sum())
        if self.level is not None:
            limit = fails_from(self.level)
            damage = np.where(damage >= limit, 1.0 + damage - limit, 0.0)
        return float(area_m2 @ damage) / total_m2 if total_m2 > 0.0 else 0.0

    def counted(self, combined: float, cost_share: float) -> float:
        """Return what a layout is worth, from what counts over all charges and what it costs.

        Without a target, the first of the two. With one, a layout that reaches it is worth the
        share of the budget that it takes, at most 1; any other one 1 and its shortfall.

        Args:
            combined: What counts, as one number over all charges.
            cost_share: Cost of the layout over the budget.
        """
        if self.target is None:
            return combined
        return 1.0 + combined if combined > 0.0 else cost_share

    def load(
        self,
        impulse_pa_s: float,
        peak_pa: float,
        weight: float,
        peak_weight: float,
        response: float | None = None,
    ) -> float:
        """Return the load of one structure that counts, in `unit`.

        Args:
            impulse_pa_s: Its impulse per area.
            peak_pa: Its peak overpressure.
            weight: How much its impulse or its response counts.
            peak_weight: How much its peak counts.
            response: What counts of its response; 0 for one without a facade.
        """
        if self.is_response:
            return weight * (response or 0.0)
        if self.quantity == "impulse":
            return weight * impulse_pa_s
        if self.quantity == "peak":
            return peak_weight * peak_pa
        assert self.reference_impulse_pa_s is not None
        assert self.reference_peak_pa is not None
        impulse_share = impulse_pa_s / self.reference_impulse_pa_s
        return weight * impulse_share + peak_weight * peak_pa / self.reference_peak_pa
