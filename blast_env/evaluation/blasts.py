"""The records of a campaign: layouts under threats, compared with no barrier."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.record import BlastLoads, BlastRecord
from blast_env.geometry import Layout
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.blast_site import Charge

NO_BARRIER = "no barrier"
"""Name of the empty layout."""

NumberOf: TypeAlias = Callable[[BlastRecord], float]
"""Selects a number from the record of a blast: the load of a building, or the objective."""


@dataclass(frozen=True, order=True)
class Severity:
    """The severity of a blast, with attributes in the order of comparison; the largest governs.

    Where facades count, the lower level of protection governs, then the larger damage of all
    components. Ties, and sites without facades, are decided by the load.

    Attributes:
        lost_levels: Levels of protection below "high" of buildings with a facade.
        damage: Total damage of all components, or the response in the objective.
        load: The load, in the same unit for all compared blasts.
    """

    lost_levels: int = 0
    damage: float = 0.0
    load: float = 0.0

    @classmethod
    def of_loads(cls, loads: BlastLoads, objective: ObjectiveSection) -> "Severity":
        """Return the severity of a blast by the objective of a site."""
        counted = loads.load(objective)
        if not objective.is_response:
            return cls(load=counted)
        return cls(4 - loads.level, counted, loads.protected_impulse_pa_s)


@dataclass(frozen=True, eq=False)
class Blasts:
    """The records of the blasts of some layouts under the threats of a case.

    Attributes:
        case: The site and the threats.
        layouts: The layouts by name, no barrier first, the one in question last.
        records: Their records, one per threat.
        coarse: The same layouts on coarser cells, under some of the threats; `None` without.
    """

    case: LoadCaseSet
    layouts: Mapping[str, Layout]
    records: Mapping[str, tuple[BlastRecord, ...]]
    engine: Engine
    coarse: "Blasts | None" = None

    @property
    def scenario(self) -> Scenario:
        """The site."""
        return self.case.scenario

    @property
    def threats(self) -> tuple[LoadCase, ...]:
        """The threats."""
        return self.case.threats

    @property
    def unprotected(self) -> str:
        """The name of the first layout: no barrier."""
        return next(iter(self.layouts))

    @property
    def judged(self) -> str:
        """The name of the layout in question: the last one."""
        return list(self.layouts)[-1]

    def charge(self, name: str, number: int) -> Charge:
        """Return the charge of a threat at its place with a layout."""
        return self.threats[number].charge_against(self.scenario, self.layouts[name])

    def objective_of(self, record: BlastRecord) -> float:
        """Return the load of a blast in the unit of the site's objective."""
        return record.loads.load(self.scenario.objective)

    def values(self, name: str, number_of: NumberOf) -> FloatArray:
        """Return a number of the blasts with a layout (threats,)."""
        return np.array([number_of(record) for record in self.records[name]])

    def loads(self, name: str) -> FloatArray:
        """Return the loads with a layout in the unit of the objective (threats,)."""
        return self.values(name, self.objective_of)

    def pairs(self, name: str) -> list[tuple[BlastRecord, BlastRecord]]:
        """Return the records with a layout and without a barrier, one pair per threat."""
        return list(zip(self.records[name], self.records[self.unprotected], strict=True))

    def worst(self, name: str | None = None) -> int:
        """Return the number of the threat that governs by the site's objective, with a layout.

        It is the first of equal ones; the layout is the one in question unless it is named.
        """
        objective = self.scenario.objective
        records = self.records[name or self.judged]
        own = [Severity.of_loads(record.loads, objective) for record in records]
        return own.index(max(own))

    def under(self, numbers: Iterable[int]) -> "Blasts":
        """Return the blasts under some of the threats, by their numbers."""
        chosen = tuple(numbers)
        return replace(
            self,
            case=LoadCaseSet(self.scenario, tuple(self.threats[k] for k in chosen)),
            records={name: tuple(own[k] for k in chosen) for name, own in self.records.items()},
        )
