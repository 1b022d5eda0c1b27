"""The proposers that come with the package, by name: a new one is a file and a line here.

`blast-env search`, `propose` and `league`, the page and the studies list what is here.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Any, Final

from blast_agents.search.problem import LayoutProblem, Proposer, Report, SearchResult
from blast_env.engines.contract import load_plugin
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, AnyScenario, Scenario, find_scenario

Rule = Callable[[AnyScenario, AnyCharge | None], Layout]
"""Gives a layout for a charge, without a blast; `None`: the charge is not known."""

DEFAULT_BUDGET: Final = 200
"""Blasts of a search."""


class ProposerKind(Enum):
    """What a proposer is."""

    RULE = "rule"
    """Follows from the site alone: neither blasts nor training."""
    SEARCH = "search"
    """Spends blasts on the very case."""
    LEARNT = "learnt"
    """Goes by what blasts on other cases have taught it."""


class Need(Enum):
    """What a site must have for a proposer to be of use there."""

    CATALOGUE = "catalogue (build_zone.items)"
    VEHICLE = "vehicle (a source of kind 'vehicle')"

    def is_met(self, scenario: Scenario) -> bool:
        """Whether a scenario has it."""
        if self is Need.CATALOGUE:
            return bool(scenario.zone.items)
        return bool(scenario.vehicles)


@dataclass(frozen=True)
class ProposerRow:
    """A proposer, and what must be known of it before it is imported.

    Attributes:
        place: "module:name", as text: only what is used is imported. A rule is a function
            (`Rule`); else it is a `Proposer`, or its class.
        title: What people call it.
        kind: What it is.
        needs: What a site must have for it. Lists of what suits a site leave it out elsewhere.
        budget: Blasts unless told otherwise.
    """

    place: str
    title: str
    kind: ProposerKind = ProposerKind.SEARCH
    needs: Collection[Need] = ()
    budget: int = DEFAULT_BUDGET

    def suits(self, scenario: Scenario) -> bool:
        """Whether a scenario has what it needs."""
        return all(need.is_met(scenario) for need in self.needs)


def _rules(module: str, *titles: str, needs: Collection[Need] = ()) -> Mapping[str, ProposerRow]:
    """Return the rows of rules whose functions have the words of their titles for a name."""
    names = {re.sub(r" (the|a)(?= )", "", title).replace(" ", "_"): title for title in titles}
    return {
        name: ProposerRow(f"{module}:{name}", title, ProposerKind.RULE, needs, budget=0)
        for name, title in names.items()
    }


_METHODS: Final = "blast_agents.search.methods"
_EVOLUTION: Final = "blast_agents.search.evolution"
_RULES: Final = "blast_agents.rules"
_POSTS: Final = "blast_agents.posts"

_TABLE: Final[Mapping[str, ProposerRow]] = MappingProxyType(
    {
        "package": ProposerRow(
            "blast_agents.proposal:PackageProposer", "the package's proposal", ProposerKind.LEARNT
        ),
        "genetic": ProposerRow(f"{_EVOLUTION}:GeneticSearch", "genetic search"),
        "nsga2": ProposerRow(f"{_EVOLUTION}:Nsga2Search", "genetic search for load and cost"),
        "annealing": ProposerRow(f"{_METHODS}:AnnealingSearch", "annealing"),
        "winners": ProposerRow(f"{_METHODS}:WinnersSearch", "annealing by several walkers"),
        "greedy": ProposerRow(f"{_METHODS}:GreedySearch", "greedy search"),
        "random": ProposerRow(f"{_METHODS}:RandomSearch", "random search"),
        "exhaustive": ProposerRow(f"{_METHODS}:ExhaustiveSearch", "exhaustive search"),
        "best_rule": ProposerRow(f"{_METHODS}:BestRuleSearch", "the best rule"),
        "annealing_from_rules": ProposerRow(
            f"{_METHODS}:ANNEALING_FROM_RULES", "annealing from the rules"
        ),
        "winners_from_rules": ProposerRow(
            f"{_METHODS}:WINNERS_FROM_RULES", "annealing by several walkers from the rules"
        ),
        "genetic_from_rules": ProposerRow(
            f"{_METHODS}:GENETIC_FROM_RULES", "genetic search from the rules"
        ),
        "surrogate": ProposerRow(
            "blast_agents.surrogate.search:packaged_search",
            "search by the surrogate",
            ProposerKind.LEARNT,
            (Need.CATALOGUE,),
        ),
        **_rules(_RULES, "wall near the charge", "wall near the building"),
        **_rules(
            _RULES,
            "long wall near the charge",
            "long wall near the building",
            "ring around the charge",
            "ring around the building",
            needs=(Need.CATALOGUE,),
        ),
        **_rules(_POSTS, "line of posts", "posts and a wall", needs=(Need.VEHICLE,)),
        "sight_lines": ProposerRow(
            f"{_RULES}:sight_lines", "most sight lines cut", ProposerKind.RULE, budget=0
        ),
    }
)


def proposers(*kinds: ProposerKind, suiting: Iterable[Scenario] = ()) -> Mapping[str, ProposerRow]:
    """Return the proposers by name.

    Args:
        kinds: Only those of these kinds; of all unless given.
        suiting: Only those that suit all of these scenarios.
    """
    scenarios = tuple(suiting)
    return {
        name: row
        for name, row in _TABLE.items()
        if (not kinds or row.kind in kinds) and all(map(row.suits, scenarios))
    }


def proposer_row(name: str) -> ProposerRow:
    """Return what is known of a proposer.

    Raises:
        UnknownNameError: If there is none of that name; the message has the nearest one.
    """
    if name not in _TABLE:
        raise UnknownNameError("search method", name, _TABLE)
    return _TABLE[name]


def check_suits(name: str, scenario: Scenario) -> None:
    """Refuse a proposer for a site that lacks what it needs.

    Raises:
        BlastEnvError: If something is missing.
        UnknownNameError: As for `proposer_row`.
    """
    for need in proposer_row(name).needs:
        if not need.is_met(scenario):
            raise BlastEnvError(f"{scenario.name} has no {need.value}: {name} is of no use there")


def find_proposer(name: str, initial: tuple[Layout, ...] = ()) -> Proposer:
    """Return the proposer of a name, with its default settings.

    Args:
        name: One of `proposers()`.
        initial: Layouts that a search begins with, beside those that it draws.

    Raises:
        UnknownNameError: If there is none of that name; the message has the nearest one.
        BlastEnvError: If there are layouts to begin with, but it begins with none.
    """
    row = proposer_row(name)
    if row.kind is ProposerKind.RULE:
        found: Any = RuleProposer(name, load_plugin(row.place))
    else:
        found = load_plugin(row.place)
        found = found() if callable(found) else found
    if not initial:
        return found  # type: ignore[no-any-return]
    if not _begins_with_layouts(found):
        known = proposers(ProposerKind.SEARCH)
        names = ", ".join(each for each in known if _begins_with_layouts(find_proposer(each)))
        raise BlastEnvError(f"{name} begins with no layouts; methods that can: {names}")
    begun: Proposer = replace(found, initial=initial)
    return begun


def _begins_with_layouts(proposer: Any) -> bool:
    return is_dataclass(proposer) and "initial" in {each.name for each in fields(proposer)}


@dataclass(frozen=True)
class RuleProposer:
    """Proposes the layout of a rule; no blast is simulated.

    Attributes:
        name: Name of the rule.
        rule: Gives the layout.
    """

    name: str
    rule: Rule

    def propose(
        self,
        problem: LayoutProblem,
        budget: int = 0,
        seed: int = 0,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the rule's layout; budget and seed change nothing.

        Raises:
            BlastEnvError: If there is no such layout, as where there is no line of sight.
        """
        layout = tuple(sorted(self.rule(problem.scenario, problem.told)))
        return SearchResult(layout, self.name, budget=budget, seed=seed)


def layouts_by_rule(scenario: AnyScenario, charge: AnyCharge | None = None) -> dict[str, Layout]:
    """Return the layout of every rule that has one for a scenario, by title; no blast is run.

    Args:
        scenario: The scenario; it has a build zone.
        charge: Where the charge is, if that is known.
    """
    found, layouts = find_scenario(scenario), {}
    for row in proposers(ProposerKind.RULE, suiting=[found]).values():
        try:
            layouts[row.title] = tuple(sorted(load_plugin(row.place)(found, charge)))
        except BlastEnvError:  # as of a wall with no line of sight for it: there is no such layout
            continue
    return layouts
