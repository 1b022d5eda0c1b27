"""Layouts, one a case, against no barrier on the same threats."""

import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from math import isnan
from typing import Any

import numpy as np
import pandas as pd

from blast_agents.training.held_out import Case
from blast_env.arrays import FloatArray
from blast_env.evaluation import ThreatOutcome
from blast_env.evaluation.comparison import CVAR_LEVEL
from blast_env.geometry import Layout
from blast_env.statistics import (
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)
from blast_env.units import PA_PER_PSI


@dataclass(frozen=True, eq=False)
class CaseOutcome:
    """What a layout does against the threat of its case.

    Attributes:
        case: The case.
        layout: The layout.
        outcome: With it and without a barrier, on the same threat.
    """

    case: Case
    layout: Layout
    outcome: ThreatOutcome


@dataclass(frozen=True, eq=False)
class CasesEvaluation:
    """Layouts, one a case, against no barrier on the same threats.

    Impulses are those of `BlastLoads.protected_impulse_psi_s`; estimates have 95 % intervals over
    the cases.

    Attributes:
        outcomes: One a case.
        cvar_level: Level of `cvar`: 0.8 is the mean of the worst 20 %.
    """

    outcomes: tuple[CaseOutcome, ...]
    cvar_level: float

    @cached_property
    def reduction(self) -> Estimate:
        """1 - mean impulse with the layouts / without; see `reduction_estimate`."""
        return reduction_estimate(self._impulse_pa_s, self._unprotected_pa_s)

    @property
    def impulse_pa_s(self) -> Estimate:
        """Mean impulse with the layouts, Pa*s."""
        return mean_estimate(self._impulse_pa_s)

    @property
    def unprotected_impulse_pa_s(self) -> Estimate:
        """Mean impulse without a barrier, Pa*s."""
        return mean_estimate(self._unprotected_pa_s)

    @property
    def cvar(self) -> float:
        """Mean impulse of the worst cases with the layouts, Pa*s."""
        return conditional_value_at_risk(self._impulse_pa_s, self.cvar_level)

    @property
    def unprotected_cvar(self) -> float:
        """Mean impulse of the worst cases without a barrier, Pa*s."""
        return conditional_value_at_risk(self._unprotected_pa_s, self.cvar_level)

    @property
    def worst(self) -> CaseOutcome:
        """The case with the largest impulse in spite of the layout."""
        return max(self.outcomes, key=lambda each: each.outcome.impulse_psi_s)

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a case: its threat, the number of modules, impulses and their reduction."""
        return pd.DataFrame([_row(each) for each in self.outcomes])

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data; numbers that do not exist are `None`."""
        evaluator = self.outcomes[0].case.evaluator
        return {
            "engine": evaluator.engine.name,
            "calibration": evaluator.calibration.name,
            "versions": {
                "blast_env": version("blast-env"),
                "engine": evaluator.engine.version,
                "python": platform.python_version(),
                "numpy": np.__version__,
            },
            "result": {
                "reduction": _estimate(self.reduction),
                "impulse_pa_s": _estimate(self.impulse_pa_s),
                "unprotected_impulse_pa_s": _estimate(self.unprotected_impulse_pa_s),
                "cvar_level": self.cvar_level,
                "cvar_pa_s": self.cvar,
                "unprotected_cvar_pa_s": self.unprotected_cvar,
            },
            "cases": [_case_record(each) for each in self.outcomes],
        }

    @cached_property
    def _impulse_pa_s(self) -> FloatArray:
        return PA_PER_PSI * np.array([each.outcome.impulse_psi_s for each in self.outcomes])

    @cached_property
    def _unprotected_pa_s(self) -> FloatArray:
        bare = [each.outcome.unprotected_impulse_psi_s for each in self.outcomes]
        return PA_PER_PSI * np.array(bare)


def evaluate_layouts(
    cases: Sequence[Case],
    layouts: Sequence[Layout],
    processes: int = 1,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] = lambda _: None,
) -> CasesEvaluation:
    """Hold layouts against no barrier, each on the threat of its case.

    Args:
        cases: At least one.
        layouts: One a case.
        processes: Worker processes; they change nothing but the time.
        cvar_level: The worst share 1 - `cvar_level` of the cases makes the CVaR.
        progress: Called with the share of the blasts that is done.

    Raises:
        BlastEnvError: If `processes` is out of bounds.
    """
    outcomes: dict[int, CaseOutcome] = {}
    for evaluator in dict.fromkeys(case.evaluator for case in cases):
        own = [index for index, case in enumerate(cases) if case.evaluator is evaluator]
        before = len(outcomes)
        pairs = [(each, cases[k].threat) for k in own for each in (layouts[k], ())]

        def tell(share: float, before: int = before, count: int = len(own)) -> None:
            progress((before + share * count) / len(cases))

        loads = evaluator.loads_of_many(pairs, processes, tell)
        for index, load, bare in zip(own, loads[0::2], loads[1::2], strict=True):
            case = cases[index]
            impulses = (load.protected_impulse_psi_s, bare.protected_impulse_psi_s)
            outcome = ThreatOutcome(case.threat, *impulses, load.in_range)
            outcomes[index] = CaseOutcome(case, layouts[index], outcome)
    return CasesEvaluation(tuple(outcomes[index] for index in range(len(cases))), cvar_level)


def _row(each: CaseOutcome) -> dict[str, Any]:
    threat, outcome = each.case.threat, each.outcome
    return {
        "scenario": each.case.evaluator.scenario.name,
        "seed": threat.seed,
        "charge_x_m": threat.charge.position_m[0],
        "charge_y_m": threat.charge.position_m[1],
        "tnt_kg": threat.charge.tnt_kg,
        "modules": len(each.layout),
        "impulse_pa_s": outcome.impulse_pa_s,
        "unprotected_impulse_pa_s": outcome.unprotected_impulse_pa_s,
        "reduction": outcome.reduction,
        "in_range": outcome.in_range,
    }


def _case_record(each: CaseOutcome) -> dict[str, Any]:
    row = {**_row(each), "reduction": _or_none(each.outcome.reduction)}
    layout = [list(cell) for cell in each.layout]
    scenario_hash = each.case.evaluator.scenario.content_hash
    return {**row, "scenario_hash": scenario_hash, "layout": layout}


def _estimate(estimate: Estimate) -> dict[str, float | None]:
    value, low, high = map(_or_none, estimate)
    return {"value": value, "ci95_low": low, "ci95_high": high}


def _or_none(value: float) -> float | None:
    return None if isnan(value) else value
