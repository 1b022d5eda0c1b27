"""Evaluating layouts: loads under threats, and reductions with their uncertainty."""

from blast_env.evaluation.cache import BlastCache, BlastKey, LoadsCache
from blast_env.evaluation.disk_cache import DiskCache
from blast_env.evaluation.evaluate import evaluate_against, evaluate_layout
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.layout_evaluation import LayoutEvaluation, ThreatOutcome
from blast_env.evaluation.loads import BlastLoads, StructureLoad
from blast_env.evaluation.statistics import (
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)
from blast_env.evaluation.threats import Threat, draw_threats

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
