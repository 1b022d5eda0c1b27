"""What a proposer is asked, and what it answers: a rule, a search, or something that has learnt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Annotated, ClassVar, Protocol

import numpy as np
from pydantic import ConfigDict, Field

from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastMeter, Case, Threat
from blast_env.evaluation.cases import check_distinct
from blast_env.evaluation.comparison import check_something_arrives
from blast_env.geometry import Element, Layout, layout_text
from blast_env.runner import check_workers
from blast_env.scenario import AnyCharge, Placement, Scenario
from blast_env.statistics import reductions

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


@dataclass(frozen=True, eq=False)
class LayoutProblem:
    """A case to search a layout for, and what runs its blasts.

    Attributes:
        evaluator: Runs the blasts and remembers them.
        case: What layouts meet, and how that becomes one number. A search may look at the first
            few threats alone, so different charges should come first.
        processes: Worker processes; they change nothing but the time.
        meter: Counts the blasts that are asked for; `None` counts none.

    Raises:
        BlastEnvError: If a threat is there twice, the scenario has no build zone, or `processes` is
            below 1.
    """

    evaluator: BlastEvaluator
    case: Case
    processes: int = 1
    meter: BlastMeter | None = None

    def __post_init__(self) -> None:
        check_distinct(self.case.threats)
        if self.scenario.build_zone is None:
            raise BlastEnvError(f"{self.scenario.name} has no build zone: no layout to search for")
        check_workers("processes", self.processes)

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.case.scenario

    @property
    def threats(self) -> tuple[Threat, ...]:
        """What layouts meet."""
        return self.case.threats

    @property
    def stock(self) -> int:
        """Most modules or pieces that a layout may have."""
        return self.scenario.zone.stock

    def price(self, layout: Layout) -> float:
        """Return what a layout takes: its modules or, with a catalogue, what its pieces cost."""
        return self.cost(layout) if self.scenario.zone.items else len(layout)

    def cost(self, layout: Layout) -> float:
        """Return what a legal layout costs, in the unit of the zone's budget."""
        return Placement(self.scenario, layout).cost

    @property
    def told(self) -> AnyCharge | None:
        """The charge if it is known: the same one in all threats."""
        known = set(self.case.charges)
        return known.pop() if len(known) == 1 else None

    def metered(self, budget: int) -> "LayoutProblem":
        """Return the same problem, which pays for so many blasts and no more.

        The loads without a barrier, `unprotected`, are free.
        """
        return replace(self, meter=BlastMeter(budget))

    @property
    def blasts_run(self) -> int:
        """Blasts that were asked for or, where those are more, simulated past the meter.

        Without those of `unprotected`. The evaluator has to be a fresh one that forgets nothing.
        """
        free = len(self.threats) if "unprotected" in vars(self) else 0
        asked = 0 if self.meter is None else self.meter.blasts
        return max(asked, self.evaluator.blasts - free)

    def loads(self, pairs: Sequence[tuple[Layout, Threat]]) -> list[float]:
        """Return the load that counts in each blast, in the unit of the scenario's objective.

        Raises:
            BudgetError: If the problem is metered, and its budget does not pay for them.
            LayoutError: If a layout does not fit the build zone.
        """
        if self.meter is not None:
            self.meter.add(pairs)
        return self._unmetered(pairs)

    def _unmetered(self, pairs: Sequence[tuple[Layout, Threat]]) -> list[float]:
        loads = self.evaluator.loads_of_many(pairs, self.processes)
        return [each.load(self.scenario.objective) for each in loads]

    def load(self, layout: Sequence[Element]) -> float:
        """Return the load with a layout over all threats, in that unit.

        Raises:
            BudgetError: As for `loads`.
            LayoutError: If the layout does not fit the build zone.
        """
        pairs = [(tuple(layout), threat) for threat in self.threats]
        return self.case.counted(self.loads(pairs), layout)

    @cached_property
    def unprotected(self) -> tuple[float, ...]:
        """The load without a barrier, in that unit, one a threat; it counts in no search's budget.

        Raises:
            BlastEnvError: If nothing arrives: there is nothing to reduce.
        """
        bare = self._unmetered([((), threat) for threat in self.threats])
        check_something_arrives([self.case], np.array(bare))
        return tuple(bare)

    def reduction(self, candidate: "Candidate") -> float:
        """Return by which share a layout lowers the load under the threats that it has met."""
        bare = self.case.counted(self.unprotected[: candidate.threats])
        return reductions(candidate.load, bare).item()


@dataclass(frozen=True)
class Candidate:
    """A layout and what the search knew of it.

    Attributes:
        blasts: Blasts that the search had spent by then.
        layout: Its cells or pieces, sorted.
        load: What the scenario's objective counts over the threats that it had met, in its unit.
        threats: How many threats that were, counted from the first.
        cost: What its modules or pieces cost, in the unit of the zone's budget.
    """

    blasts: int
    layout: Layout
    load: float
    threats: int
    cost: float


@dataclass(frozen=True)
class Progress:
    """How far a proposer has come.

    Attributes:
        blasts: Blasts spent.
        budget: Most that it may spend; 0 for one that spends none.
        best: The best layout so far by blasts; `None` before the first.
        guessed: Of a proposer that spends none, the share of its work that is done.
    """

    blasts: int
    budget: int
    best: Candidate | None = None
    guessed: float = 0.0

    @property
    def share(self) -> float:
        """Share of the work that is done, about."""
        return self.blasts / self.budget if self.budget else self.guessed


Report = Callable[[Progress], None]
"""Is told after every batch of blasts how far a proposer has come."""


@dataclass(frozen=True)
class SearchResult:
    """What a proposer proposes, and how it came to that.

    Attributes:
        layout: The layout, its cells sorted; empty if a search ended before it had one.
        method: Name of the proposer.
        by: What has proposed it where a proposer asks others, in words.
        gain: Share of what counts that it is expected to take off, by what has proposed it; `None`
            where that expects nothing.
        load: Its load over the threats that it has met, in the unit of the scenario's objective;
            `None` without a blast. A search chose it by these blasts: on others it is somewhat
            more.
        threats: How many threats it has met.
        blasts: Blasts spent: distinct pairs of layout and threat that were asked for, whatever a
            cache knew of them.
        budget: Most that might have been spent.
        seed: What decided everything that was drawn.
        history: The best layout each time that it changed.
        interrupted: Whether it was ended from outside (Ctrl-C) before it was through.
        front: The layouts of which none has both less load and fewer modules (or, with a
            catalogue, a lower cost), by that number; only of methods that search for it.
    """

    layout: Layout
    method: str = ""
    by: str = ""
    gain: float | None = None
    load: float | None = None
    threats: int = 0
    blasts: int = 0
    budget: int = 0
    seed: int = 0
    history: tuple[Candidate, ...] = ()
    interrupted: bool = False
    front: tuple[Candidate, ...] = ()

    @property
    def expectation(self) -> str:
        """The gain that is expected, in words; empty where none is known."""
        return "" if self.gain is None else f"expected to take off {100.0 * self.gain:.1f} %"

    def best_at(self, blasts: int) -> Candidate | None:
        """Return the best layout after so many blasts, or `None` if there was none yet.

        A search plans for its whole budget. What it has after part of it is less than what a
        search with that budget finds.
        """
        by_then = [each for each in self.history if each.blasts <= blasts]
        return by_then[-1] if by_then else None

    def history_table(self) -> "pd.DataFrame":
        """Return one row each time that the best layout changed."""
        return _table(self.history)

    def front_table(self) -> "pd.DataFrame":
        """Return one row a layout of the front."""
        return _table(self.front)


def _table(candidates: tuple[Candidate, ...]) -> "pd.DataFrame":
    # Here, because it takes a third of a second to import.
    import pandas as pd

    rows = [
        (
            *(each.blasts, each.load, each.threats, len(each.layout), each.cost),
            layout_text(each.layout),
        )
        for each in candidates
    ]
    columns = ["blasts", "load", "threats", "modules", "cost", "layout"]
    return pd.DataFrame(rows, columns=columns)


class Proposer(Protocol):
    """Proposes a layout for a case: a rule, a search, or something that has learnt."""

    @property
    def name(self) -> str:
        """Name in tables and on the command line."""

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return a layout, for instance as `SearchResult(layout)`.

        The same arguments give the same layout. Ctrl-C ends a search: the best so far is returned.

        Args:
            problem: What is minimised. `problem.load` and `problem.loads` run blasts.
            budget: Most blasts that may be spent; see `SearchResult.blasts`.
            seed: Decides everything that is drawn.
            report: Is told how far it has come.

        Raises:
            BlastEnvError: If it cannot do anything with the budget or the site.
        """


class LayoutAgent(Protocol):
    """Proposes a layout for a site, at once: no blast is simulated."""

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None, /) -> Layout:
        """Return a layout that keeps every condition of the build zone; always the same one.

        Args:
            scenario: The scenario; it has a build zone.
            charge: Where the charge is, if that is known; otherwise the layout is for all the
                places where the scenario may have one.
        """


class SamplingAgent(LayoutAgent, Protocol):
    """Proposes a layout, and draws others."""

    def sample(
        self, scenario: Scenario, charge: AnyCharge | None = None, count: int = 8, seed: int = 0, /
    ) -> Sequence[Layout]:
        """Return layouts that it draws; some may be equal."""


@dataclass(frozen=True)
class Proposal:
    """A layout that was proposed, and what that took: what a league keeps.

    Attributes:
        layout: Its cells or pieces.
        seconds: Time until the layout was there.
        blasts: Blasts spent on it, of the engine that judges.
        other_blasts: Blasts of another engine spent on it, for a method's own purposes.
        cpu_s: Processor time that it took, of this process.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    layout: Layout
    seconds: Annotated[float, Field(ge=0.0)]
    blasts: Annotated[int, Field(ge=0)] = 0
    other_blasts: Annotated[int, Field(ge=0)] = 0
    cpu_s: Annotated[float, Field(ge=0.0)] = 0.0


def timed_proposal(propose: Callable[[], Layout]) -> Proposal:
    """Return a layout that takes no blast, and how long it took."""
    began_s, began_cpu_s = perf_counter(), process_time()
    layout = propose()
    seconds, cpu_s = perf_counter() - began_s, process_time() - began_cpu_s
    return Proposal(layout, seconds, cpu_s=cpu_s)
