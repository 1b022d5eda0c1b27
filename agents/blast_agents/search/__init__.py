"""Classical search for layouts: what a trained agent has to beat at equal cost in blasts."""

from blast_agents.search.by_rule import BestRuleSearch, FromRulesSearch, RuleSearch
from blast_agents.search.evolution import GeneticSearch, Nsga2Search
from blast_agents.search.methods import (
    AnnealingSearch,
    ExhaustiveSearch,
    GreedySearch,
    RandomSearch,
)
from blast_agents.search.problem import (
    BlastMeter,
    BudgetError,
    Candidate,
    LayoutProblem,
    Progress,
    Report,
    SearchMethod,
    SearchResult,
)
from blast_agents.search.registry import SEARCH_METHODS, find_search_method
from blast_agents.search.winners import WinnersSearch
from blast_env.geometry import Layout

__all__ = [
    "SEARCH_METHODS",
    "AnnealingSearch",
    "BestRuleSearch",
    "BlastMeter",
    "BudgetError",
    "Candidate",
    "ExhaustiveSearch",
    "FromRulesSearch",
    "GeneticSearch",
    "GreedySearch",
    "Layout",
    "LayoutProblem",
    "Nsga2Search",
    "Progress",
    "RandomSearch",
    "Report",
    "RuleSearch",
    "SearchMethod",
    "SearchResult",
    "WinnersSearch",
    "find_search_method",
]
