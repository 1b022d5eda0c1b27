"""What takes part in a league."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from blast_agents.posts import VEHICLE_RULES
from blast_agents.proposal import LayoutAgent
from blast_agents.rules import ITEM_RULES, RULES, expected_charge, random_layout, sight_lines
from blast_agents.search import SearchMethod, find_search_method
from blast_agents.search.by_rule import MOST_SIGHT_LINES
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario


@dataclass(frozen=True)
class Training:
    """What an agent cost before its first case.

    Attributes:
        blasts: Blasts simulated, with those that its best weights were chosen by.
        seconds: Time that it took.
    """

    blasts: int
    seconds: float


@dataclass(frozen=True)
class NoBarrier:
    """Builds nothing: what all others are compared with."""

    name: str = "no barrier"

    def propose(self, case: Case) -> Layout:  # noqa: ARG002
        """Return the empty layout."""
        return ()


@dataclass(frozen=True)
class RandomLayout:
    """Puts every module on a random cell, a layout a case."""

    name: str = "random layout"

    def propose(self, case: Case) -> Layout:
        """Return a layout that the case's seed decides."""
        return random_layout(case.scenario, np.random.default_rng(case.seed))


@dataclass(frozen=True)
class Rule:
    """Follows a rule of thumb; against a hidden charge for the middle of where it may be.

    Attributes:
        rule: Gives the layout for a charge.
        name: In tables.
    """

    rule: Callable[[Scenario, AnyCharge], Layout]
    name: str

    def propose(self, case: Case) -> Layout:
        """Return the rule's layout.

        Raises:
            BlastEnvError: If there is no line of sight; see `line_of_sight_wall`.
        """
        return self.rule(case.scenario, case.charge or expected_charge(case.scenario.charge))


@dataclass(frozen=True)
class VisibilityLayout:
    """Cuts as many lines of sight as it can; see `sight_lines`.

    Attributes:
        name: In tables.
    """

    name: str = MOST_SIGHT_LINES

    def propose(self, case: Case) -> Layout:
        """Return the layout for the charge, or for all the places where a hidden one may be."""
        return sight_lines(case.scenario, case.charge)


@dataclass(frozen=True)
class Agent:
    """A trained agent.

    Attributes:
        agent: The agent.
        name: In tables.
        training: What it cost.
    """

    agent: LayoutAgent
    name: str
    training: Training

    def propose(self, case: Case) -> Layout:
        """Return the agent's layout; it is told the charge unless that is hidden."""
        return self.agent.propose(case.scenario, case.charge)


@dataclass(frozen=True)
class Search:
    """A search that spends blasts on every case.

    Attributes:
        method: The method.
        budget: Most blasts a case.
        first_engine: Engine for these blasts, a cheaper one; the engine that judges then decides
            among the best few layouts, by one more blast for each threat. `None` for the judge's.
        finalists: How many these are.
        has_learnt: Whether it begins with what an agent or a surrogate has learnt.
    """

    method: SearchMethod
    budget: int
    first_engine: str | None = None
    finalists: int = 8
    has_learnt: bool = False

    def __post_init__(self) -> None:
        """Check the budget.

        Raises:
            BlastEnvError: If it is below 1.
        """
        if self.budget < 1:
            raise BlastEnvError(f"budget is {self.budget} blasts, must be at least 1")

    @property
    def name(self) -> str:
        """Name in tables."""
        name = search_name(self.method.name, self.budget)
        if self.first_engine is None:
            return name
        return f"{name} of {self.first_engine}, the best {self.finalists} judged"


Instant = NoBarrier | RandomLayout | Rule | VisibilityLayout | Agent
"""Entries that spend no blast on a case."""

Entry = Instant | Search
"""All entries."""


def search_name(method: str, budget: int) -> str:
    """Return the name of a search with a budget."""
    return f"{method}, {budget:,} blasts"


def standard_entries(
    methods: Sequence[str], budgets: Sequence[int], vehicles: bool = False, items: bool = False
) -> tuple[Entry, ...]:
    """Return all entries but agents: no barrier, a random layout, rules, lines of sight, searches.

    Args:
        methods: Names of search methods.
        budgets: Blasts a case; each method enters with each.
        vehicles: Whether every case has a vehicle: the rules against them enter then.
        items: Whether every case has a catalogue: there are more rules then.

    Raises:
        UnknownNameError: If there is no such method; the message names the nearest one.
        BlastEnvError: If a budget is below 1.
    """
    named = {**(ITEM_RULES if items else RULES), **(VEHICLE_RULES if vehicles else {})}
    rules = (Rule(rule, name) for name, rule in named.items())
    found = [find_search_method(name) for name in methods]
    searches = (Search(method, budget) for method in found for budget in budgets)
    return (NoBarrier(), RandomLayout(), *rules, VisibilityLayout(), *searches)
