"""The search methods by name."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from blast_agents.search.by_rule import RULE_SEARCHES, BestRuleSearch, FromRulesSearch
from blast_agents.search.evolution import GeneticSearch, Nsga2Search
from blast_agents.search.methods import (
    AnnealingSearch,
    ExhaustiveSearch,
    GreedySearch,
    RandomSearch,
)
from blast_agents.search.problem import SearchMethod
from blast_agents.search.winners import WinnersSearch
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout

_FROM_LAYOUTS: Final[
    tuple[AnnealingSearch | GeneticSearch | Nsga2Search | RandomSearch | WinnersSearch, ...]
] = (
    RandomSearch(),
    AnnealingSearch(),
    WinnersSearch(),
    GeneticSearch(),
    Nsga2Search(),
)
_OTHERS: Final[tuple[SearchMethod, ...]] = (
    GreedySearch(),
    ExhaustiveSearch(),
    BestRuleSearch(),
    FromRulesSearch(AnnealingSearch()),
    FromRulesSearch(WinnersSearch()),
    FromRulesSearch(GeneticSearch()),
    *RULE_SEARCHES,
)

SEARCH_METHODS: Final[Mapping[str, SearchMethod]] = MappingProxyType(
    {method.name: method for method in (*_FROM_LAYOUTS, *_OTHERS)}
)
"""The search methods with their default settings, by name."""


def find_search_method(name: str, initial: tuple[Layout, ...] = ()) -> SearchMethod:
    """Return the search method of a name.

    Args:
        name: One of `SEARCH_METHODS`.
        initial: Layouts that the search begins with, beside those that it draws.

    Raises:
        UnknownNameError: If there is none of that name; the message has the nearest one.
        BlastEnvError: If there are layouts to begin with, but the method begins with none.
    """
    if name not in SEARCH_METHODS:
        raise UnknownNameError("search method", name, SEARCH_METHODS)
    if not initial:
        return SEARCH_METHODS[name]
    for method in _FROM_LAYOUTS:
        if method.name == name:
            return replace(method, initial=initial)
    names = ", ".join(method.name for method in _FROM_LAYOUTS)
    raise BlastEnvError(f"{name} begins with no layouts; methods that can: {names}")
