"""Entries of a league: proposers, each with a budget."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from blast_env.design.rules import random_layout
from blast_env.design.search import (
    LayoutProblem,
    Proposer,
    ProposerKind,
    Report,
    SearchResult,
    find_proposer,
)
from blast_env.design.search.registry import proposers
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.site import Scenario
from blast_env.values import generator


@dataclass(frozen=True)
class Training:
    """Cost of the training of an entry before its first case.

    Attributes:
        blasts: Blasts simulated, including those for the selection of the best weights.
        seconds: Duration, in s.
    """

    blasts: int
    seconds: float


NO_TRAINING = Training(0, 0.0)


@dataclass(frozen=True)
class NoBarrier:
    """Builds nothing: the baseline of all other entries."""

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
    """Puts every module on a random cell, with one layout per case."""

    name: str = "random layout"

    def propose(
        self,
        problem: LayoutProblem,
        budget: int = 0,  # noqa: ARG002
        seed: int = 0,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return a random layout drawn by the seed."""
        return SearchResult(random_layout(problem.scenario, generator(seed)))


@dataclass(frozen=True)
class LeagueEntry:
    """A proposer with its budget.

    Attributes:
        proposer: The proposer.
        budget: Largest number of blasts per case; 0 for a proposer without blasts.
        title: Name in tables; by default that of the proposer.
        kind: Kind of the proposer.
        training: Cost of its training.
        first_engine: Cheaper engine for the budget's blasts; the judging engine then selects among
            the finalists by one further blast per threat. `None` for the judging engine.
        finalists: Number of finalists.

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
"""The baseline of all other entries."""


def search_name(method: str, budget: int) -> str:
    """Return the name of a search with a budget."""
    return f"{method}, {budget:,} blasts"


def standard_entries(
    scenarios: Iterable[Scenario], methods: Sequence[str] = (), budgets: Sequence[int] = ()
) -> tuple[LeagueEntry, ...]:
    """Return no barrier, a random layout, all rules that suit every scenario, and searches.

    Args:
        scenarios: Scenarios of the cases.
        methods: Names of proposers, or "module:object" for a custom one (`own_proposer`).
        budgets: Blasts per case; each method enters with each budget.

    Raises:
        UnknownNameError: If a method is unknown; the message names the nearest one.
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
    """Return a custom proposer.

    Args:
        place: "module:object": a `Proposer`, or a class or function that returns one.

    Raises:
        BlastEnvError: If the module or object does not exist or is not a proposer.
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
