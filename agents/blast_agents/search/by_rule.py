"""The rules of thumb as search methods: each by itself, and the best of them by a blast each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from blast_agents.posts import VEHICLE_RULES, line_of_posts, posts_and_wall
from blast_agents.rules import (
    expected_charge,
    long_wall_near_building,
    long_wall_near_charge,
    ring_around_building,
    ring_around_charge,
    rules_for,
    sight_lines,
    wall_near_building,
    wall_near_charge,
)
from blast_agents.search.evolution import GeneticSearch
from blast_agents.search.methods import AnnealingSearch
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_agents.search.winners import WinnersSearch
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario

MOST_SIGHT_LINES: Final = "most sight lines cut"
"""Name of the layout that cuts as many lines of sight as it can."""


def layouts_by_rule(scenario: Scenario, charge: AnyCharge | None = None) -> Mapping[str, Layout]:
    """Return the layout of every rule that has one for a scenario, by name; no blast is run.

    Against a hidden charge the walls stand in the way of the middle of where it may be.

    Args:
        scenario: The scenario; it has a build zone.
        charge: Where the charge is, if that is known.
    """
    met = charge or expected_charge(scenario.charge)
    rules = {**rules_for(scenario), **(VEHICLE_RULES if scenario.vehicles else {})}
    proposals = {name: partial(rule, scenario, met) for name, rule in rules.items()}
    proposals[MOST_SIGHT_LINES] = partial(sight_lines, scenario, charge)
    layouts = {}
    for name, propose in proposals.items():
        try:
            layouts[name] = tuple(sorted(propose()))
        except BlastEnvError:  # as of a wall with no line of sight for it: there is no such layout
            continue
    return layouts


@dataclass(frozen=True)
class RuleSearch:
    """Proposes the layout of a rule; no blast is simulated.

    For a hidden charge the rule stands in the way of the middle of where one may be.

    Attributes:
        rule: Gives the layout for a charge.
        name: Name in tables and on the command line.
    """

    rule: Callable[[Scenario, AnyCharge], Layout]
    name: str

    def search(
        self,
        problem: LayoutProblem,
        budget: int,
        seed: int,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the rule's layout; budget and seed change nothing.

        Raises:
            BlastEnvError: If there is no line of sight; see `line_of_sight_wall`.
        """
        return SearchResult(
            method=self.name,
            layout=tuple(sorted(self.rule(problem.scenario, problem.charge))),
            load=None,
            threats=0,
            blasts=0,
            budget=budget,
            seed=seed,
            history=(),
            interrupted=False,
        )


@dataclass(frozen=True)
class SightLinesSearch:
    """Proposes the layout that cuts most lines of sight; no blast is simulated.

    Against a hidden charge it is one against all places where that may be.
    """

    name: str = "sight_lines"

    def search(
        self,
        problem: LayoutProblem,
        budget: int,
        seed: int,
        report: Report | None = None,
    ) -> SearchResult:
        """Return the rule's layout; budget and seed change nothing."""

        def rule(scenario: Scenario, _: AnyCharge) -> Layout:
            return sight_lines(scenario, problem.told)

        return RuleSearch(rule, self.name).search(problem, budget, seed, report)


RULE_SEARCHES: Final = (
    RuleSearch(wall_near_charge, "wall_near_charge"),
    RuleSearch(wall_near_building, "wall_near_building"),
    RuleSearch(long_wall_near_charge, "long_wall_near_charge"),
    RuleSearch(long_wall_near_building, "long_wall_near_building"),
    RuleSearch(ring_around_charge, "ring_around_charge"),
    RuleSearch(ring_around_building, "ring_around_building"),
    RuleSearch(line_of_posts, "line_of_posts"),
    RuleSearch(posts_and_wall, "posts_and_wall"),
    SightLinesSearch(),
)
"""The rules as methods; without a catalogue the long walls are the others."""


@dataclass(frozen=True)
class BestRuleSearch:
    """Lets the layouts of all rules meet the threats, and takes the best: a careful engineer.

    Of as many rules as the budget pays for; there are at most nine. Against a hidden charge each
    meets all threats if the budget lasts.
    """

    name: str = "best_rule"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best of the rules' layouts; the seed changes nothing."""
        layouts = list(dict.fromkeys(layouts_by_rule(problem.scenario, problem.told).values()))
        threats = max(1, min(len(problem.threats), budget // len(layouts)))
        session = SearchSession(problem, budget, Plan(threats, budget), report)

        def explore() -> None:
            session.assess(layouts)

        return session.result(self.name, seed, session.run(explore))


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

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return what the other search finds."""
        layouts = tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.told).values()))
        method = replace(self.method, initial=layouts)
        return replace(method.search(problem, budget, seed, report), method=self.name)
