"""The objective of a layout: a load, or the response of the facades."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal, Protocol, Self

import numpy as np
from pydantic import Field, StrictFloat, model_validator

from blast_env.arrays import FloatArray
from blast_env.problems import Problem, ScenarioError
from blast_env.response.levels import LevelOfProtection, fails_from
from blast_env.sections import HashMark, Section
from blast_env.statistics import CVAR_LEVEL, check_cvar_level, conditional_value_at_risk

Reference = Annotated[StrictFloat, Field(ge=1e-3, le=1e12)]
Probability = Annotated[StrictFloat, Field(gt=0.0, lt=1.0)]
Level = Annotated[StrictFloat, Field(ge=0.0, lt=1.0)]
_UNITS: Final = {"impulse": "Pa s", "peak": "Pa", "both": ""}
_NOUNS: Final = {"impulse": "impulse", "peak": "peak overpressure", "both": "load"}
_TERMS: Final = {"impulse": "impulse", "peak": "peak", "both": "load"}


class Risk(Protocol):
    """Reduces the loads of several threats to one."""

    def __call__(self, loads: FloatArray) -> float:
        """Return one load; `loads` has one value per threat (n,), n >= 1."""


@dataclass(frozen=True)
class MeanRisk:
    """All threats have equal weights."""

    def __call__(self, loads: FloatArray) -> float:
        """Return the mean."""
        return float(loads.sum()) / len(loads)


@dataclass(frozen=True)
class WorstRisk:
    """Only the worst threat counts."""

    def __call__(self, loads: FloatArray) -> float:
        """Return the largest load."""
        return float(loads.max())


@dataclass(frozen=True)
class ConditionalValueAtRisk:
    """Only the worst threats count; see `conditional_value_at_risk`.

    Attributes:
        level: At least 0 (the mean of all) and below 1 (the worst one alone, in the limit).

    Raises:
        BlastEnvError: If the level is out of bounds.
    """

    level: float

    def __post_init__(self) -> None:
        """Check the level."""
        check_cvar_level(self.level)

    def __call__(self, loads: FloatArray) -> float:
        """Return the mean of the worst share 1 - `level`."""
        return conditional_value_at_risk(loads, self.level)


class ObjectiveSection(Section):
    """The quantity that a layout is to minimise.

    The load of a structure is its weight times its impulse (`"impulse"`, Pa s), its peak weight
    times its peak overpressure (`"peak"`, Pa), or the sum of both, each divided by its reference
    (`"both"`, dimensionless). The loads of the protected structures are summed, and those of
    several charges combined into one number.

    With kind `"response"` the response of the protected structures' facades counts instead of a
    load: the damage of their bays (`blast_env.response.damage`), weighted by area, a dimensionless
    number from 0 to 5. With a `target` the objective is the cheapest layout that reaches a level of
    protection: see `response` and `objective_value`.

    Attributes:
        kind: Load or response of facades; the response needs the engine `gas`, or a surrogate of
            it.
        measure: Measure of the response: `"damage"` is that of the worse of window and wall panel
            in a bay, by the area of bays; `"glazing"` that of windows alone, by the area of panes.
        target: Level of protection of the response to reach under every charge.
        target_probability: Least probability of the target, in judgements of layouts
            (`blast_env.evaluation.questions.probability`); the objective does not depend on it.
        quantity: Quantity of the load; peaks need the engine `gas`.
        reference_impulse_pa_s: Impulse that counts as 1 with `"both"`.
        reference_peak_pa: Peak overpressure that counts as 1 with `"both"`.
        charges: Combination of the loads of several charges: their mean, the mean of the worst
            ones (`"cvar"`), or the worst alone.
        cvar_level: With `"cvar"`, the worst share 1 - `cvar_level` counts; 0.8 unless given.
    """

    kind: Annotated[Literal["load", "response"], HashMark.IF_SET] = "load"
    measure: Annotated[Literal["damage", "glazing"], HashMark.IF_SET] = "damage"
    target: Annotated[Literal["very low", "low", "medium", "high"] | None, HashMark.IF_SET] = None
    target_probability: Annotated[Probability | None, HashMark.NEVER] = None
    quantity: Literal["impulse", "peak", "both"] = "impulse"
    reference_impulse_pa_s: Reference | None = None
    reference_peak_pa: Reference | None = None
    charges: Literal["mean", "cvar", "worst"] = "mean"
    cvar_level: Level | None = None

    @model_validator(mode="after")
    def _check_keys_together(self) -> Self:
        """Refuse keys without effect on the objective, and `both` without its references."""
        problems = []
        if self.is_response and self.quantity != "impulse":
            problems.append(Problem("quantity", "must be left out: kind is 'response'"))
        for key in ("measure", "target"):
            is_default = getattr(self, key) == type(self).model_fields[key].default
            if not self.is_response and not is_default:
                problems.append(Problem(key, f"must be left out: kind is {self.kind!r}"))
        if self.target is None and self.target_probability is not None:
            problems.append(Problem("target_probability", "must be left out: there is no target"))
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
        """Whether peak overpressures count, which particle engines do not compute."""
        return self.is_response or self.quantity != "impulse"

    @property
    def is_response(self) -> bool:
        """Whether the response of facades counts instead of a load."""
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
        """Name of the quantity for readers: `impulse`, `damage`, with a target `shortfall`."""
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
        """The risk measure that combines the loads of several charges."""
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

    def response(self, damage: FloatArray, area_m2: FloatArray) -> float:
        """Return the response of one structure from the damage of its bays.

        It is their mean damage, weighted by area. With a target it is the mean shortfall: 0 for a
        bay that reaches the level, else 1 plus the excess of its damage over the limit.

        Args:
            damage: Damage of the bays (bays,).
            area_m2: Area of each (bays,).
        """
        # Beyond the limit a step of 1, so that one bay more below the level outweighs any excess.
        total_m2 = float(area_m2.sum())
        if self.level is not None:
            limit = fails_from(self.level)
            damage = np.where(damage >= limit, 1.0 + damage - limit, 0.0)
        return float(area_m2 @ damage) / total_m2 if total_m2 > 0.0 else 0.0

    def objective_value(self, combined: float, cost_share: float) -> float:
        """Return the objective value of a layout, to be minimised.

        Without a target it is `combined`. With a target it is `cost_share` for a layout that
        reaches it, at most 1, and 1 plus the shortfall for any other.

        Args:
            combined: Load, response or shortfall, combined over all charges.
            cost_share: Cost of the layout divided by the budget.
        """
        if self.target is None:
            return combined
        # Costs are shares of the budget and at most 1: any layout that reaches the target is better
        # than all that miss it.
        return cost_share if combined <= 0.0 else 1.0 + combined

    def load(
        self,
        impulse_pa_s: float,
        peak_pa: float,
        weight: float,
        peak_weight: float,
        response: float | None = None,
    ) -> float:
        """Return the weighted load or response of one structure, in `unit`.

        Args:
            impulse_pa_s: Its impulse per area.
            peak_pa: Its peak overpressure.
            weight: Weight of its impulse or its response.
            response: Its response; `None` counts as 0, for a structure without a facade.
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
