"""Searches that begin with the rules of thumb."""

from dataclasses import dataclass, replace
from typing import Final

from blast_agents.search.evolution import GeneticSearch
from blast_agents.search.methods import AnnealingSearch, WinnersSearch
from blast_agents.search.problem import LayoutProblem, Report, SearchResult
from blast_agents.search.registry import layouts_by_rule
from blast_agents.search.session import Plan, Search, SearchSession
from blast_env.geometry import Layout


@dataclass(frozen=True)
class BestRuleSearch(Search):
    """Lets the layouts of all rules meet the threats, and takes the best: a careful engineer.

    Of as many rules as the budget pays for; there are at most nine. Against a hidden charge each
    meets all threats if the budget lasts.
    """

    name: str = "best_rule"

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Let each layout meet as many threats as the budget pays for."""
        layouts = len(_layouts(problem))
        return Plan(max(1, min(len(problem.threats), budget // layouts)), budget)

    def explore(self, session: SearchSession) -> None:
        """Try all of them."""
        session.assess(_layouts(session.problem))


@dataclass(frozen=True)
class FromRulesSearch:
    """Lets another search begin with the layouts of all rules.

    Attributes:
        method: The other search.
    """

    method: AnnealingSearch | GeneticSearch | WinnersSearch

    @property
    def name(self) -> str:
        """Name of the other one, and that it begins with the rules."""
        return f"{self.method.name}_from_rules"

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return what the other search finds."""
        method = replace(self.method, initial=_layouts(problem))
        return replace(method.propose(problem, budget, seed, report), method=self.name)


ANNEALING_FROM_RULES: Final = FromRulesSearch(AnnealingSearch())
WINNERS_FROM_RULES: Final = FromRulesSearch(WinnersSearch())
GENETIC_FROM_RULES: Final = FromRulesSearch(GeneticSearch())


def _layouts(problem: LayoutProblem) -> tuple[Layout, ...]:
    """Return the rules' layouts, each once."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.told).values()))
