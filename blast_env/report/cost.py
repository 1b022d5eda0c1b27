"""The cost of a report, estimated before it starts."""

from dataclasses import dataclass

from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas.cost import CostGuess, cost_words
from blast_env.geometry import Layout
from blast_env.report.study import StudyOptions, blasts_of, threats_of
from blast_env.site import Scenario


@dataclass(frozen=True)
class ReportCost:
    """The cost of a report, part by part.

    Attributes:
        parts: The label by which `run_study` reports each part, and the costs of its blasts.
        drawn: Number of blasts with pictures.
    """

    parts: tuple[tuple[str, tuple[CostGuess, ...]], ...]
    drawn: int

    @classmethod
    def of(cls, scenario: Scenario, layout: Layout, options: StudyOptions) -> "ReportCost":
        """Return the estimated cost of a report; nothing is run for it.

        Raises:
            BlastEnvError: If there are too many threats.
        """
        threats = threats_of(scenario, options)
        parts = blasts_of(scenario, layout, options, threats)
        asked = {(each.cells, charge) for each in parts for charge in each.charges}
        one = {pair: GasEngine.with_cells(pair[0]).cost(scenario, pair[1]) for pair in asked}
        costs = [tuple(one[each.cells, charge] for charge in each.charges) for each in parts]
        labelled = zip((each.label for each in parts), costs, strict=True)
        return cls(tuple(labelled), sum(len(each.charges) for each in parts if each.is_drawn))

    @property
    def words(self) -> str:
        """The cost in words."""
        return cost_words(self.blasts, self.drawn)

    @property
    def blasts(self) -> tuple[CostGuess, ...]:
        """The cost of every blast."""
        return tuple(each for _, costs in self.parts for each in costs)

    def share(self, label: str, share: float) -> float | None:
        """Return the completed share of the whole at a share of a part; `None` of no part."""
        costs_s = {name: sum(each.seconds for each in costs) for name, costs in self.parts}
        if label not in costs_s:
            return None
        names = list(costs_s)
        before_s = sum(costs_s[name] for name in names[: names.index(label)])
        return min((before_s + share * costs_s[label]) / sum(costs_s.values()), 1.0)
