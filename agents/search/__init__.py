"""Classical search for layouts: what a trained agent has to beat at equal cost in blasts."""

from agents.search.annealing import AnnealingSearch
from agents.search.exhaustive import ExhaustiveSearch
from agents.search.genetic import GeneticSearch
from agents.search.greedy import GreedySearch
from agents.search.method import Report, SearchMethod
from agents.search.nsga2 import Nsga2Search
from agents.search.problem import Layout, LayoutProblem, hidden_threats, visible_threats
from agents.search.random_search import RandomSearch
from agents.search.registry import SEARCH_METHODS, find_search_method
from agents.search.result import Candidate, Progress, SearchResult
from agents.search.rule_search import RuleSearch

__all__ = [
    "SEARCH_METHODS",
    "AnnealingSearch",
    "Candidate",
    "ExhaustiveSearch",
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
    "find_search_method",
    "hidden_threats",
    "visible_threats",
]
