"""The proposers of the package, by name: a new one is a file and a line here.

`blast-env search` and `judge`, the page and the studies list these proposers.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Any, Final

from blast_env.design.search.problem import Proposer, Report, SearchResult
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import DesignProblem
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario

Rule = Callable[[AnyScenario, AnyCharge | None], Layout]
"""Returns a layout for a charge without a blast; `None` for an unknown charge."""

DEFAULT_BUDGET: Final = 200
"""Default budget of a search, in blasts."""


class ProposerKind(Enum):
    """Kinds of proposers."""

    RULE = "rule"
    """Follows from the site alone: neither blasts nor training."""
    SEARCH = "search"
    """Spends blasts on the case itself."""
    LEARNT = "learnt"
    """Was trained on blasts of other cases."""


class Need(Enum):
    """Properties that a proposer may require of a site."""

    CATALOGUE = "catalogue (build_zone.items)"
    VEHICLE = "vehicle (a source of kind 'vehicle')"
    HARDENING = "measure that hardens facades (build_zone.hardening)"

    def is_met(self, scenario: Scenario) -> bool:
        """Return whether a scenario has the property."""
        if self is Need.CATALOGUE:
            return bool(scenario.zone.items)
        if self is Need.HARDENING:
            return bool(scenario.zone.hardening)
        return bool(scenario.vehicles)


@dataclass(frozen=True)
class ProposerRow:
    """The description of a proposer, available before its import.

    Attributes:
        place: "module:name", as text, so that only the proposers in use are imported. For a rule,
            a function (`Rule`); otherwise a `Proposer` or its class.
        title: Name for readers.
        kind: Kind of the proposer.
        needs: Properties that it requires of a site. Lists for other sites omit it.
        budget: Default budget, in blasts.
    """

    place: str
    title: str
    kind: ProposerKind = ProposerKind.SEARCH
    needs: Collection[Need] = ()
    budget: int = DEFAULT_BUDGET

    def suits(self, scenario: Scenario) -> bool:
        """Return whether a scenario has all required properties."""
        return all(need.is_met(scenario) for need in self.needs)


def _rules(module: str, *titles: str, needs: Collection[Need] = ()) -> Mapping[str, ProposerRow]:
    """Return the rows of rules whose functions are named after their titles."""
    names = {re.sub(r" (the|a)(?= )", "", title).replace(" ", "_"): title for title in titles}
    return {
        name: ProposerRow(f"{module}:{name}", title, ProposerKind.RULE, needs, budget=0)
        for name, title in names.items()
    }


_METHODS: Final = "blast_env.design.search.methods"
_EVOLUTION: Final = "blast_env.design.search.evolution"
_RULES: Final = "blast_env.design.rules"
_POSTS: Final = "blast_env.design.bollards"

_TABLE: Final[Mapping[str, ProposerRow]] = MappingProxyType(
    {
        "package": ProposerRow(
            "blast_env.design.proposal:PackageProposer",
            "the package's proposal",
            ProposerKind.LEARNT,
        ),
        "genetic": ProposerRow(f"{_EVOLUTION}:GeneticSearch", "genetic search"),
        "nsga2": ProposerRow(f"{_EVOLUTION}:Nsga2Search", "genetic search for load and cost"),
        "population_annealing": ProposerRow(
            f"{_METHODS}:PopulationAnnealingSearch", "population annealing"
        ),
        "random": ProposerRow(f"{_METHODS}:RandomSearch", "random search"),
        "best_rule": ProposerRow(f"{_METHODS}:BestRuleSearch", "the best rule"),
        "surrogate": ProposerRow(
            "blast_env.design.search.learnt:packaged_search",
            "search by the surrogate",
            ProposerKind.LEARNT,
        ),
        **_rules(_RULES, "wall near the charge", "wall in the middle", "wall near the building"),
        **_rules(
            _RULES,
            "long wall near the charge",
            "long wall in the middle",
            "long wall near the building",
            "ring around the charge",
            "ring around the building",
            needs=(Need.CATALOGUE,),
        ),
        **_rules(_POSTS, "line of posts", "posts and a wall", needs=(Need.VEHICLE,)),
        "sight_lines": ProposerRow(
            f"{_RULES}:sight_lines", "most sight lines cut", ProposerKind.RULE, budget=0
        ),
        **_rules(_RULES, "hardening alone", "hardening and sight lines", needs=(Need.HARDENING,)),
    }
)


def proposers(*kinds: ProposerKind, suiting: Iterable[Scenario] = ()) -> Mapping[str, ProposerRow]:
    """Return the proposers by name.

    Args:
        kinds: Restricts the list to these kinds; all kinds by default.
        suiting: Restricts the list to proposers that suit all of these scenarios.
    """
    scenarios = tuple(suiting)
    return {
        name: row
        for name, row in _TABLE.items()
        if (not kinds or row.kind in kinds) and all(map(row.suits, scenarios))
    }


def proposer_row(name: str) -> ProposerRow:
    """Return the description of a proposer.

    Raises:
        UnknownNameError: If no proposer has that name; the message suggests the nearest one.
    """
    if name not in _TABLE:
        raise UnknownNameError("search method", name, _TABLE)
    return _TABLE[name]


def check_suits(name: str, scenario: Scenario) -> None:
    """Check that a site has the properties that a proposer requires.

    Raises:
        BlastEnvError: If a property is missing.
        UnknownNameError: As for `proposer_row`.
    """
    for need in proposer_row(name).needs:
        if not need.is_met(scenario):
            raise BlastEnvError(f"{scenario.name} has no {need.value}: {name} is of no use there")


def find_proposer(name: str, initial: tuple[Layout, ...] = ()) -> Proposer:
    """Return the proposer of a name, with its default settings.

    Args:
        name: One of `proposers()`.
        initial: Initial layouts of a search, in addition to random ones.

    Raises:
        UnknownNameError: If no proposer has that name; the message suggests the nearest one.
        BlastEnvError: If `initial` is not empty and the proposer takes no initial layouts.
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
    """Proposes the layout of a rule without simulating a blast.

    Attributes:
        name: Name of the rule.
        rule: Function that returns the layout.
    """

    name: str
    rule: Rule

    def propose(
        self,
        problem: DesignProblem,
        budget: int = 0,
        seed: int = 0,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the rule's layout, which is independent of budget and seed.

        Raises:
            BlastEnvError: If the rule has no layout for the site, for example without a line of
                sight.
        """
        layout = tuple(sorted(self.rule(problem.scenario, problem.known_charge)))
        by = "" if layout else why_nothing(problem.scenario, problem.known_charge)
        return SearchResult(layout, self.name, by, budget=budget, seed=seed)


def why_nothing(scenario: AnyScenario, charge: AnyCharge | None) -> str:
    """Return the reason why a rule places nothing."""
    from blast_env.design.rules import why_no_wall  # only for rules

    return why_no_wall(scenario, charge) or "no place is legal and of use for it"


def layouts_by_rule(scenario: AnyScenario, charge: AnyCharge | None = None) -> dict[str, Layout]:
    """Return the layout of each applicable rule, by title, without simulating a blast.

    Args:
        scenario: The scenario; it has a build zone.
        charge: The charge, if it is known.
    """
    found, layouts = find_scenario(scenario), {}
    for row in proposers(ProposerKind.RULE, suiting=[found]).values():
        try:
            layouts[row.title] = tuple(sorted(load_plugin(row.place)(found, charge)))
        except BlastEnvError:  # the rule has no layout, for example a wall without a line of sight
            continue
    return layouts


def rule_layouts(problem: DesignProblem) -> tuple[Layout, ...]:
    """Return the distinct layouts of the rules for a problem."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.known_charge).values()))
