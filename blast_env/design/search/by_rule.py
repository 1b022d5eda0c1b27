"""The rules, which place by the site alone, and the table that describes them.

A new rule is a function and a line of `RULES`.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from blast_env.design import bollards, rules
from blast_env.design.by_atlas import word_on
from blast_env.design.search.problem import Report, SearchResult
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem
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
    """The description of a proposer.

    Attributes:
        make: Makes the proposer with its default settings, and imports what takes long to import.
        title: Name for readers.
        needs: Properties that it requires of a site. Lists for other sites omit it.
        budget: Default budget, in blasts.
    """

    make: Callable[[], Any]
    title: str
    kind: ProposerKind = ProposerKind.SEARCH
    needs: Collection[Need] = ()
    budget: int = DEFAULT_BUDGET

    def suits(self, scenario: Scenario) -> bool:
        """Return whether a scenario has all required properties."""
        return all(need.is_met(scenario) for need in self.needs)


@dataclass(frozen=True)
class RuleProposer:
    """Proposes the layout of a rule without simulating a blast.

    Attributes:
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

        `by` has a word if the layout takes nothing off by the atlas of shielding.

        Raises:
            BlastEnvError: If the rule has no layout for the site, for example without a line of
                sight.
        """
        layout = tuple(sorted(self.rule(problem.scenario, problem.known_charge)))
        if layout:
            by = word_on(problem, layout)
        else:
            by = why_nothing(problem.scenario, problem.known_charge)
        return SearchResult(layout, self.name, by, budget=budget, seed=seed)


def why_nothing(scenario: AnyScenario, charge: AnyCharge | None) -> str:
    """Return the reason why a rule places nothing."""
    return rules.why_no_wall(scenario, charge) or "no place is legal and of use for it"


def rule_row(title: str, rule: Rule, *needs: Need) -> ProposerRow:
    """Return the description of a rule, which has the name of its function."""
    make = partial(RuleProposer, rule.__name__, rule)
    return ProposerRow(make, title, ProposerKind.RULE, needs, budget=0)


_ROWS: Final = (
    rule_row("wall near the charge", rules.wall_near_charge),
    rule_row("wall in the middle", rules.wall_in_middle),
    rule_row("wall near the building", rules.wall_near_building),
    rule_row("long wall near the charge", rules.long_wall_near_charge, Need.CATALOGUE),
    rule_row("long wall in the middle", rules.long_wall_in_middle, Need.CATALOGUE),
    rule_row("long wall near the building", rules.long_wall_near_building, Need.CATALOGUE),
    rule_row("ring around the charge", rules.ring_around_charge, Need.CATALOGUE),
    rule_row("ring around the building", rules.ring_around_building, Need.CATALOGUE),
    rule_row("line of posts", bollards.line_of_posts, Need.VEHICLE),
    rule_row("posts and a wall", bollards.posts_and_wall, Need.VEHICLE),
    rule_row("most sight lines cut", rules.sight_lines),
    rule_row("hardening alone", rules.hardening_alone, Need.HARDENING),
    rule_row("hardening and sight lines", rules.hardening_and_sight_lines, Need.HARDENING),
)

RULES: Final[Mapping[str, ProposerRow]] = MappingProxyType({row.make().name: row for row in _ROWS})
"""The rules of the package, by name."""


def layouts_by_rule(scenario: AnyScenario, charge: AnyCharge | None = None) -> dict[str, Layout]:
    """Return the layout of each applicable rule, by title, without simulating a blast.

    Args:
        scenario: The scenario; it has a build zone.
        charge: The charge, if it is known.
    """
    found, layouts = find_scenario(scenario), {}
    for row in RULES.values():
        if not row.suits(found):
            continue
        try:
            layouts[row.title] = tuple(sorted(row.make().rule(found, charge)))
        except BlastEnvError:  # the rule has no layout, for example a wall without a line of sight
            continue
    return layouts


def rule_layouts(problem: DesignProblem) -> tuple[Layout, ...]:
    """Return the distinct layouts of the rules for a problem."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.known_charge).values()))
