"""A fixed, versioned set of problems: `make`, `evaluate`, `play`, `judge`, and the standings."""

from blast_env.benchmark.definitions import (
    BUDGETS,
    DEFINITIONS,
    SEEDS,
    Definition,
    secret_sites,
    site_problems,
)
from blast_env.benchmark.judging import (
    JUDGE_CELL_M,
    RunJudgement,
    SubmissionJudgement,
    judge,
    shipped_standings,
)
from blast_env.benchmark.problem import BenchmarkProblem, LayoutValue, make
from blast_env.benchmark.references import ReferenceLayout, ScoreReference, stored_references
from blast_env.benchmark.space import LayoutSpace
from blast_env.benchmark.standings import standings_page, standings_tables
from blast_env.benchmark.submissions import Method, Run, RunGrid, Submission, play

__all__ = [
    "BUDGETS",
    "DEFINITIONS",
    "JUDGE_CELL_M",
    "SEEDS",
    "BenchmarkProblem",
    "Definition",
    "LayoutSpace",
    "LayoutValue",
    "Method",
    "ReferenceLayout",
    "Run",
    "RunGrid",
    "RunJudgement",
    "ScoreReference",
    "Submission",
    "SubmissionJudgement",
    "judge",
    "make",
    "play",
    "secret_sites",
    "shipped_standings",
    "site_problems",
    "standings_page",
    "standings_tables",
    "stored_references",
]
