"""Evaluating layouts: loads under threats, and reductions with their uncertainty."""

from blast_env.evaluation.cases import Threat, draw_threats
from blast_env.evaluation.comparison import (
    LayoutEvaluation,
    ThreatOutcome,
    evaluate_against,
    evaluate_layout,
)
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.loads import BlastLoads, StructureLoad
from blast_env.evaluation.store import BlastCache, BlastKey, DiskCache, LoadsCache
from blast_env.statistics import (
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)

__all__ = [
    "BlastCache",
    "BlastEvaluator",
    "BlastKey",
    "BlastLoads",
    "DiskCache",
    "Estimate",
    "LayoutEvaluation",
    "LoadsCache",
    "StructureLoad",
    "Threat",
    "ThreatOutcome",
    "conditional_value_at_risk",
    "draw_threats",
    "evaluate_against",
    "evaluate_layout",
    "mean_estimate",
    "reduction_estimate",
]
