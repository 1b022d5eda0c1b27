"""What a search is asked, and what it answers."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Protocol

import numpy as np
import pandas as pd

from blast_agents.rules import expected_charge
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Case, Threat
from blast_env.evaluation.cases import check_distinct
from blast_env.evaluation.comparison import check_something_arrives
from blast_env.geometry import Element, Layout, layout_text, standing
from blast_env.runner import check_workers
from blast_env.scenario import AnyCharge, Placement, Scenario
from blast_env.statistics import reductions


class BudgetError(BlastEnvError):
    """A search asks for more blasts than its budget has."""


@dataclass(eq=False)
class BlastMeter:
    """Counts distinct pairs of layout and threat, and refuses those beyond a budget.

    Attributes:
        budget: Most pairs.
    """

    budget: int
    _asked: set[tuple[Layout, Threat]] = field(default_factory=set, init=False, repr=False)

    @property
    def blasts(self) -> int:
        """Pairs that were asked for so far; one that comes again counts once."""
        return len(self._asked)

    def add(self, pairs: Iterable[tuple[Sequence[Element], Threat]]) -> None:
        """Count pairs.

        Raises:
            BudgetError: If the budget does not pay for all of them; none is counted then.
        """
        asked = {(tuple(sorted(standing(layout))), threat) for layout, threat in pairs}
        asked |= self._asked
        if len(asked) > self.budget:
            raise BudgetError(
                f"the search asks for {len(asked):,} blasts in all, the budget is {self.budget:,}"
            )
        self._asked = asked


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
        """Check that there is something to search."""
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

    @property
    def charge(self) -> AnyCharge:
        """The charge if it is known, else the middle of where the scenario lets one be."""
        return self.told or expected_charge(self.scenario.charge)

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
    """How far a search has come.

    Attributes:
        blasts: Blasts spent.
        budget: Most that it may spend.
        best: The best layout so far; `None` before the first.
    """

    blasts: int
    budget: int
    best: Candidate | None


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        method: Name of the method.
        layout: The best layout, its cells sorted; empty if the search ended before it had one.
        load: Its load over the threats that it has met, in the unit of the scenario's objective;
            `None` without a blast.
            The search chose it by these blasts, so that on others it will be somewhat more.
        threats: How many threats it has met.
        blasts: Blasts spent: distinct pairs of layout and threat that the search asked for,
            whatever a cache knew of them.
        budget: Most that it might have spent.
        seed: What decided everything that was drawn.
        history: The best layout each time that it changed.
        interrupted: Whether it was ended from outside (Ctrl-C) before it was through.
        front: The layouts of which none has both less load and fewer modules (or, with a
            catalogue, a lower cost), by that number; only of methods that search for it.
    """

    method: str
    layout: Layout
    load: float | None
    threats: int
    blasts: int
    budget: int
    seed: int
    history: tuple[Candidate, ...]
    interrupted: bool
    front: tuple[Candidate, ...] = ()

    def best_at(self, blasts: int) -> Candidate | None:
        """Return the best layout after so many blasts, or `None` if there was none yet.

        A search plans for its whole budget. What it has after part of it is less than what a
        search with that budget finds.
        """
        by_then = [each for each in self.history if each.blasts <= blasts]
        return by_then[-1] if by_then else None

    def history_table(self) -> pd.DataFrame:
        """Return one row each time that the best layout changed."""
        return _table(self.history)

    def front_table(self) -> pd.DataFrame:
        """Return one row a layout of the front."""
        return _table(self.front)


def _table(candidates: tuple[Candidate, ...]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            (
                each.blasts,
                each.load,
                each.threats,
                len(each.layout),
                each.cost,
                layout_text(each.layout),
            )
            for each in candidates
        ],
        columns=["blasts", "load", "threats", "modules", "cost", "layout"],
    )


LAYOUTS_PER_REALISATION: Final = 500
"""A known charge is met with one fan and air more for so many layouts that the budget pays for."""


CHARGES_PER_ROOT_BLAST: Final = 0.3
"""Of a hidden charge's places a layout meets so many times the square root of the budget."""


CONFIRMED_LAYOUTS: Final = 32
"""Layouts of which the blasts that are held back can pay for all threats."""


MOST_CONFIRMING_SHARE: Final = 0.2
"""Largest share of the budget that is held back to let the best layouts meet more threats."""


@dataclass(frozen=True)
class Plan:
    """How a search divides its blasts.

    Attributes:
        threats: How many threats a layout meets while the search explores.
        exploring_blasts: How many blasts it spends on exploring.
    """

    threats: int
    exploring_blasts: int

    @property
    def exploring_layouts(self) -> int:
        """How many layouts it can try, at least one."""
        return max(1, self.exploring_blasts // self.threats)

    @classmethod
    def of(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan for a budget.

        A layout's impulse differs little from one fan and air to the next, less than layouts do
        from each other: against a known charge it pays to try many layouts under one threat each,
        and to find out the lucky ones among the best at the end. It differs much from one place of
        the charge to the next: what stands well against one may do nothing against the others, so
        that against a hidden charge layouts meet several places from the start.
        """
        most = len(problem.threats)
        if len({threat.charge for threat in problem.threats}) == 1:
            wanted = budget // LAYOUTS_PER_REALISATION
        else:
            wanted = round(CHARGES_PER_ROOT_BLAST * budget**0.5)
        threats = max(1, min(wanted, most, budget))
        if threats == most:
            return cls.thorough(problem, budget)
        held_back = min(CONFIRMED_LAYOUTS * most, int(MOST_CONFIRMING_SHARE * budget))
        return cls(threats, budget - held_back)

    @classmethod
    def thorough(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan by which every layout meets every threat at once."""
        return cls(len(problem.threats), budget)


Report = Callable[[Progress], None]
"""Is told after every batch of blasts how far a search has come."""


class SearchMethod(Protocol):
    """Looks for the layout with the least load."""

    @property
    def name(self) -> str:
        """Name in tables and on the command line."""

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was found.

        The same arguments give the same result. Ctrl-C ends the search: the best so far is
        returned.

        Args:
            problem: What is minimised.
            budget: Most blasts that may be spent; see `SearchResult.blasts`.
            seed: Decides everything that is drawn.
            report: Is told how far it has come.

        Raises:
            BlastEnvError: If the method cannot do anything with the budget.
        """
