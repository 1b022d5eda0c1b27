"""The two rules of thumb as search methods that spend nothing."""

from collections.abc import Callable
from dataclasses import dataclass

from agents.rules import wall_near_building, wall_near_charge
from agents.search.method import Report
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from blast_env.scenario import Charge, Scenario


@dataclass(frozen=True)
class RuleSearch:
    """Proposes the layout of a rule; no blast is simulated.

    For a hidden charge the rule stands in the way of the middle of where one may be.

    Attributes:
        rule: Gives the layout for a charge.
        name: Name in tables and on the command line.
    """

    rule: Callable[[Scenario, Charge], Layout]
    name: str

    def search(
        self,
        problem: LayoutProblem,
        budget: int,
        seed: int,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the rule's layout; budget and seed change nothing.

        Raises:
            BlastEnvError: If there is no line of sight; see `line_of_sight_wall`.
        """
        return SearchResult(
            method=self.name,
            layout=tuple(sorted(self.rule(problem.scenario, problem.charge))),
            impulse_pa_s=None,
            threats=0,
            blasts=0,
            budget=budget,
            seed=seed,
            history=(),
            interrupted=False,
        )


WALL_NEAR_CHARGE = RuleSearch(wall_near_charge, "wall_near_charge")
WALL_NEAR_BUILDING = RuleSearch(wall_near_building, "wall_near_building")
