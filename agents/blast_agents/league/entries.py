"""What takes part in a league: proposers, each with a budget."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from blast_agents.rules import random_layout
from blast_agents.search import (
    LayoutProblem,
    Proposer,
    ProposerKind,
    Report,
    SearchResult,
    find_proposer,
)
from blast_agents.search.registry import proposers
from blast_env.engines.contract import load_plugin
from blast_env.errors import BlastEnvError
from blast_env.scenario import Scenario
from blast_env.values import generator


@dataclass(frozen=True)
class Training:
    """What has learnt cost so much before its first case.

    Attributes:
        blasts: Blasts simulated, with those that the best weights were chosen by.
        seconds: Time that it took.
    """

    blasts: int
    seconds: float


NO_TRAINING = Training(0, 0.0)


@dataclass(frozen=True)
class NoBarrier:
    """Builds nothing: what all others are compared with."""

    name: str = "no barrier"

    def propose(
        self,
        problem: LayoutProblem,  # noqa: ARG002
        budget: int = 0,  # noqa: ARG002
        seed: int = 0,  # noqa: ARG002
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the empty layout."""
        return SearchResult(())


@dataclass(frozen=True)
class RandomLayout:
    """Puts every module on a random cell, a layout a case."""

    name: str = "random layout"

    def propose(
        self,
        problem: LayoutProblem,
        budget: int = 0,  # noqa: ARG002
        seed: int = 0,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return a layout that the seed decides."""
        return SearchResult(random_layout(problem.scenario, generator(seed)))


@dataclass(frozen=True)
class LeagueEntry:
    """A proposer with its budget.

    Attributes:
        proposer: The proposer.
        budget: Most blasts a case; 0 for what proposes without a blast.
        title: Name in tables, that of the proposer unless given.
        kind: What it is.
        training: What it cost before its first case.
        first_engine: Engine for these blasts, a cheaper one; the engine that judges then decides
            among the best few layouts, by one more blast for each threat. `None` for the judge's.
        finalists: How many these are.

    Raises:
        BlastEnvError: If the budget is below 0.
    """

    proposer: Proposer
    budget: int = 0
    title: str = ""
    kind: ProposerKind = ProposerKind.SEARCH
    training: Training = NO_TRAINING
    first_engine: str | None = None
    finalists: int = 8

    def __post_init__(self) -> None:
        if self.budget < 0:
            raise BlastEnvError(f"budget is {self.budget} blasts, must be at least 0")

    @property
    def method(self) -> str:
        """Name of the proposer in tables."""
        return self.title or self.proposer.name

    @property
    def name(self) -> str:
        """Name in tables, with the budget if there is one."""
        if not self.budget:
            return self.method
        name = search_name(self.method, self.budget)
        if self.first_engine is None:
            return name
        return f"{name} of {self.first_engine}, the best {self.finalists} judged"


NO_BARRIER = LeagueEntry(NoBarrier())
"""What all others are compared with."""


def search_name(method: str, budget: int) -> str:
    """Return the name of a search with a budget."""
    return f"{method}, {budget:,} blasts"


def standard_entries(
    scenarios: Iterable[Scenario], methods: Sequence[str] = (), budgets: Sequence[int] = ()
) -> tuple[LeagueEntry, ...]:
    """Return no barrier, a random layout, all rules that suit every scenario, and searches.

    Args:
        scenarios: Of the cases.
        methods: Names of proposers, or "module:object" for one's own (`own_proposer`).
        budgets: Blasts a case; each method enters with each.

    Raises:
        UnknownNameError: If there is no such method; the message names the nearest one.
        BlastEnvError: If a budget is below 1.
    """
    rules = proposers(ProposerKind.RULE, suiting=scenarios)
    return (
        NO_BARRIER,
        LeagueEntry(RandomLayout()),
        *(
            LeagueEntry(find_proposer(name), 0, row.title, ProposerKind.RULE)
            for name, row in rules.items()
        ),
        *searches(methods, budgets),
    )


def searches(methods: Collection[str], budgets: Sequence[int]) -> tuple[LeagueEntry, ...]:
    """Return an entry for each method and budget; see `standard_entries`."""
    for budget in budgets:
        if budget < 1:
            raise BlastEnvError(f"budget is {budget} blasts, must be at least 1")
    entries: list[LeagueEntry] = []
    for name in methods:
        method = own_proposer(name) if ":" in name else find_proposer(name)
        has_learnt = name in proposers(ProposerKind.LEARNT)
        kind = ProposerKind.LEARNT if has_learnt else ProposerKind.SEARCH
        entries += (LeagueEntry(method, budget, kind=kind) for budget in budgets)
    return tuple(entries)


def own_proposer(place: str) -> Proposer:
    """Return a proposer of one's own.

    Args:
        place: "module:object": a `Proposer`, or a class or function that makes one.

    Raises:
        BlastEnvError: If there is no such module or object, or it is no proposer.
    """
    try:
        found: Any = load_plugin(place)
    except (ImportError, AttributeError, ValueError) as error:
        raise BlastEnvError(f"method {place!r} cannot be imported: {error}") from error
    if isinstance(found, type) or (callable(found) and not hasattr(found, "propose")):
        found = found()
    if not callable(getattr(found, "propose", None)) or not isinstance(
        getattr(found, "name", None), str
    ):
        raise BlastEnvError(
            f"method {place!r} is no proposer: it needs a name and a method "
            "propose(problem, budget, seed, report)"
        )
    return found  # type: ignore[no-any-return]
