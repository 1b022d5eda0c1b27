"""Proposers: their descriptions, and what makes proposers of the rules of thumb."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any, Final

from blast_env.design.by_atlas import word_on
from blast_env.design.search.problem import Report, SearchResult
from blast_env.evaluation import DesignProblem
from blast_env.geometry import Layout
from blast_env.rules import RULES, Need, Rule, layouts_by_rule, why_no_wall
from blast_env.site import AnyCharge, AnyScenario, Scenario

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
    return why_no_wall(scenario, charge) or "no place is legal and of use for it"


def rule_rows() -> dict[str, ProposerRow]:
    """Return the descriptions of the rules of the package, by name."""
    return {
        name: ProposerRow(
            partial(RuleProposer, name, row.rule), row.title, ProposerKind.RULE, row.needs, budget=0
        )
        for name, row in RULES.items()
    }


def rule_layouts(problem: DesignProblem) -> tuple[Layout, ...]:
    """Return the distinct layouts of the rules for a problem."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.known_charge).values()))
