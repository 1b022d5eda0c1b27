"""Proposers: classical searches and rules, with their problem (`registry` lists all of them)."""

from blast_env.design.search.evolution import GeneticSearch, Nsga2Search
from blast_env.design.search.methods import (
    BestRuleSearch,
    PopulationAnnealingSearch,
    RandomSearch,
)
from blast_env.design.search.problem import (
    Candidate,
    LayoutAgent,
    Progress,
    Proposer,
    Report,
    SamplingAgent,
    SearchResult,
)
from blast_env.design.search.registry import (
    Need,
    ProposerKind,
    RuleProposer,
    find_proposer,
    layouts_by_rule,
    proposers,
)
from blast_env.design.search.session import Plan, Search, SearchSession
from blast_env.evaluation import DesignProblem
from blast_env.geometry import Layout

__all__ = [
    "BestRuleSearch",
    "Candidate",
    "DesignProblem",
    "GeneticSearch",
    "Layout",
    "LayoutAgent",
    "Need",
    "Nsga2Search",
    "Plan",
    "PopulationAnnealingSearch",
    "Progress",
    "Proposer",
    "ProposerKind",
    "RandomSearch",
    "Report",
    "RuleProposer",
    "SamplingAgent",
    "Search",
    "SearchResult",
    "SearchSession",
    "find_proposer",
    "layouts_by_rule",
    "proposers",
]
