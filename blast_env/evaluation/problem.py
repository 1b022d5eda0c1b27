"""Problems: a case to find a layout for, with the blasts that a search may spend."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import (
    LoadCase,
    LoadCaseSet,
    check_distinct,
    check_something_arrives,
)
from blast_env.evaluation.evaluator import Assessment, BlastEvaluator
from blast_env.evaluation.record import BlastLoads
from blast_env.geometry import Element, Layout
from blast_env.layout import LayoutState
from blast_env.layout.placement import load_relevant
from blast_env.runner import check_workers
from blast_env.site import AnyCharge, Scenario


class BudgetError(BlastEnvError):
    """A search requests more blasts than its budget allows."""


@dataclass(eq=False)
class DesignProblem:
    """A case to find a layout for, the evaluator that runs its blasts, and their budget.

    It serves searches and the benchmark.

    Attributes:
        evaluator: Runs the blasts and caches their loads.
        case: The scenario and the threats, and how their loads combine into one number. A search
            may use only the first few threats, so different charges should come first.
        processes: Worker processes; results do not depend on their number.
        budget: Most blasts, each a distinct pair of layout and threat; `None` for any number.

    Raises:
        BlastEnvError: If a threat is repeated, the scenario has no build zone, or `processes` is
            below 1.
    """

    evaluator: BlastEvaluator
    case: LoadCaseSet
    processes: int = 1
    budget: int | None = None
    _asked: set[tuple[Layout, LoadCase]] = field(default_factory=set, init=False, repr=False)
    _assessed: dict[Layout, Assessment] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        check_distinct(self.case.threats)
        if self.scenario.build_zone is None:
            raise BlastEnvError(f"{self.scenario.name} has no build zone: no layout to search for")
        check_workers("processes", self.processes)

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.evaluator.scenario

    @property
    def threats(self) -> tuple[LoadCase, ...]:
        """The threats of the case."""
        return self.case.threats

    @property
    def stock(self) -> int:
        """Largest number of modules or pieces in a layout."""
        return self.scenario.zone.stock

    def price(self, layout: Layout) -> float:
        """Return the number of modules of a layout or, with a catalogue, the cost of its pieces."""
        return self.cost(layout) if self.scenario.zone.items else len(layout)

    def cost(self, layout: Layout) -> float:
        """Return the cost of a legal layout, in the unit of the zone's budget."""
        return LayoutState(self.scenario, layout).cost

    @property
    def known_charge(self) -> AnyCharge | None:
        """The charge if it is known, that is, the same in all threats; otherwise `None`."""
        # Realisations of one charge are one charge.
        known = set(self.case.charges)
        return known.pop() if len(known) == 1 else None

    @property
    def blasts(self) -> int:
        """Blasts spent, whether cached or not; those of `unprotected` are free."""
        return len(self._asked)

    def spend(self, pairs: Iterable[tuple[Layout, LoadCase]]) -> None:
        """Count blasts that have not been spent before.

        Raises:
            BudgetError: If the total would exceed the budget; none is counted then.
        """
        # The order of a layout and its measures change no load: such pairs are one blast.
        asked = {(tuple(sorted(load_relevant(layout))), threat) for layout, threat in pairs}
        asked |= self._asked
        if self.budget is not None and len(asked) > self.budget:
            raise BudgetError(
                f"the search asks for {len(asked):,} blasts in all, the budget is {self.budget:,}"
            )
        self._asked = asked

    def loads(self, pairs: Sequence[tuple[Layout, LoadCase]]) -> list[float]:
        """Return the load of each blast, in the unit of the scenario's objective.

        Raises:
            BudgetError: If the blasts exceed the budget.
            LayoutError: If a layout does not fit the build zone.
        """
        self.spend(pairs)
        return self._free(pairs)

    def _free(self, pairs: Sequence[tuple[Layout, LoadCase]]) -> list[float]:
        return self._objectives(self.evaluator.loads_of_many(pairs, self.processes))

    def _objectives(self, loads: Iterable[BlastLoads]) -> list[float]:
        return [load.load(self.scenario.objective) for load in loads]

    def loads_with(self, layout: Sequence[Element]) -> list[BlastLoads]:
        """Return the loads with a layout, one per threat; errors as for `loads`."""
        cells = layout if isinstance(layout, tuple) else tuple(layout)  # may be a LegalLayout
        pairs = [(cells, threat) for threat in self.threats]
        self.spend(pairs)
        return self.evaluator.loads_of_many(pairs, self.processes)

    def assess(self, layout: Sequence[Element]) -> Assessment:
        """Return the loads and the objective value of a layout, computed once."""
        key = tuple(sorted(layout))
        if key not in self._assessed:
            loads = self.loads_with(layout)
            self._assessed[key] = Assessment.of(self.case, layout, loads)
        return self._assessed[key]

    def load(self, layout: Sequence[Element]) -> float:
        """Return the load of a layout over all threats, in the unit of the objective."""
        return self.assess(layout).load

    @cached_property
    def unprotected(self) -> tuple[float, ...]:
        """The load without a barrier, one per threat, in the unit of the objective.

        These blasts are not charged to any budget.

        Raises:
            BlastEnvError: If nothing arrives: there is nothing to reduce.
        """
        pairs = [((), threat) for threat in self.threats]
        loads = self.evaluator.loads_of_many(pairs, self.processes)
        unprotected = self._objectives(loads)
        check_something_arrives([self.case], np.array(unprotected), [loads[0].without_load])
        return tuple(unprotected)
