"""Evaluating layouts: loads under threats, and reductions with their uncertainty."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.evaluation.cases import LoadCase, LoadCaseSet, SeedRange, draw_threats
    from blast_env.evaluation.evaluate import compare, evaluate_layout
    from blast_env.evaluation.evaluator import (
        Assessment,
        BlastCounts,
        BlastEvaluator,
        BlastStore,
        Evaluators,
    )
    from blast_env.evaluation.problem import BudgetError, DesignProblem
    from blast_env.evaluation.questions.grid_error import GridError, convergence_index
    from blast_env.evaluation.questions.reduction import Evaluation, ThreatOutcome
    from blast_env.evaluation.record import BlastKey, BlastLoads, StructureLoad
    from blast_env.statistics import (
        CVAR_LEVEL,
        Estimate,
        conditional_value_at_risk,
        mean_estimate,
        reduction_estimate,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "CVAR_LEVEL",
    "Assessment",
    "BlastCounts",
    "BlastEvaluator",
    "BlastKey",
    "BlastLoads",
    "BlastStore",
    "BudgetError",
    "DesignProblem",
    "Estimate",
    "Evaluation",
    "Evaluators",
    "GridError",
    "LoadCase",
    "LoadCaseSet",
    "SeedRange",
    "StructureLoad",
    "ThreatOutcome",
    "compare",
    "conditional_value_at_risk",
    "convergence_index",
    "draw_threats",
    "evaluate_layout",
    "mean_estimate",
    "reduction_estimate",
]
