"""The problem of finding a layout: a case, the evaluator of its blasts, and their budget."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, check_distinct
from blast_env.evaluation.comparison import check_something_arrives
from blast_env.evaluation.engines import BlastLoads
from blast_env.evaluation.evaluator import BlastEvaluator, BudgetError
from blast_env.geometry import Element, Layout
from blast_env.layout import LayoutState
from blast_env.layout.placement import load_relevant
from blast_env.response.buildings import LevelOfProtection
from blast_env.runner import check_workers
from blast_env.site import AnyCharge, Scenario
from blast_env.statistics import reductions
from blast_env.units import PA_PER_PSI


@dataclass(frozen=True)
class Assessment:
    """The loads on the protected structures with one layout.

    Each load is the mean over the realisations of a charge, combined over the charges by the risk
    measure.

    Attributes:
        impulse_pa_s: Weighted sum of the impulses per area of the protected buildings, Pa*s.
        impulse_sim: Weighted sum of the impulses of the protected structures, simulation units;
            `None` of an engine without particles.
        peak_pa: The largest overpressure on the walls of these structures, Pa; NaN for particles.
        load: The objective value: Pa s for impulses, Pa for peaks, dimensionless for both, for a
            response and with a target.
        in_range: Whether all the blasts are in the range of the calibration.
        level: The lowest level of protection under any threat; `None` unless the objective is a
            response.
    """

    impulse_pa_s: float
    impulse_sim: float | None
    peak_pa: float
    load: float
    in_range: bool
    level: LevelOfProtection | None = None

    @classmethod
    def of(cls, case: LoadCaseSet, layout: Sequence[Element], loads: Sequence[BlastLoads]) -> Self:
        """Return the assessment of a layout from its loads, one per threat of the case."""
        combined, counts = case.combined, case.scenario.objective
        sums = [s for each in loads if (s := each.protected_impulse_sim) is not None]
        return cls(
            impulse_pa_s=combined([each.protected_impulse_pa_s for each in loads]),
            impulse_sim=combined(sums) if len(sums) == len(loads) else None,
            peak_pa=combined([each.protected_peak_pa for each in loads]),
            load=case.objective_value([each.load(counts) for each in loads], layout),
            level=min(each.level for each in loads) if counts.kind == "response" else None,
            in_range=all(each.in_range for each in loads),
        )

    @property
    def impulse_psi_s(self) -> float:
        """The impulse in the paper's unit, psi*s."""
        return self.impulse_pa_s / PA_PER_PSI

    def reduction_from(self, unprotected: "Assessment") -> float:
        """Return the relative reduction of `load` from no barrier; NaN if that load is 0."""
        return reductions(self.load, unprotected.load).item()


@dataclass(eq=False)
class DesignProblem:
    """A case to find a layout for, the evaluator that runs its blasts, and their budget.

    It serves searches, rewards and the benchmark.

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
        loads = self.evaluator.loads_of_many(pairs, self.processes)
        return [each.load(self.scenario.objective) for each in loads]

    def loads_with(self, layout: Sequence[Element]) -> list[BlastLoads]:
        """Return the loads with a layout, one per threat; errors as for `loads`."""
        cells = layout if isinstance(layout, tuple) else tuple(layout)  # may be a CheckedLayout
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

    def reward_value(self, layout: Sequence[Element]) -> float:
        """Return the objective value in the unit of rewards: psi s, psi, or dimensionless."""
        return self.scenario.objective.reward_value(self.assess(layout).load)

    def load(self, layout: Sequence[Element]) -> float:
        """Return the load of a layout over all threats, in the unit of the objective."""
        pairs = [(tuple(layout), threat) for threat in self.threats]
        return self.case.objective_value(self.loads(pairs), layout)

    @cached_property
    def unprotected(self) -> tuple[float, ...]:
        """The load without a barrier, one per threat, in the unit of the objective.

        These blasts are not charged to any budget.

        Raises:
            BlastEnvError: If nothing arrives: there is nothing to reduce.
        """
        unprotected = self._free([((), threat) for threat in self.threats])
        check_something_arrives([self.case], np.array(unprotected))
        return tuple(unprotected)
