"""The contract of proposers (rules, searches and trained agents): problem, progress and result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from blast_env.evaluation import DesignProblem
from blast_env.geometry import Layout, layout_text
from blast_env.site import AnyCharge, Scenario
from blast_env.statistics import reductions

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


@dataclass(frozen=True)
class Candidate:
    """A layout with its load and cost, at one point of a search.

    Attributes:
        blasts: Blasts spent by the search up to this point.
        layout: Its cells or pieces, sorted.
        load: Value of the scenario's objective under the first `threats` threats, in its unit.
        threats: Number of threats under which the layout was assessed, counted from the first.
        cost: Cost of its modules or pieces, in the unit of the zone's budget.
    """

    blasts: int
    layout: Layout
    load: float
    threats: int
    cost: float

    def reduction(self, problem: DesignProblem) -> float:
        """Return the relative reduction of the load, under the threats of the candidate."""
        unprotected = problem.case.objective_value(problem.unprotected[: self.threats])
        return reductions(self.load, unprotected).item()


@dataclass(frozen=True)
class Progress:
    """The progress of a proposer.

    Attributes:
        blasts: Blasts spent.
        budget: Largest number of blasts; 0 for a proposer that spends none.
        best: The best simulated layout so far; `None` before the first.
        guessed: Estimated share of the work that is done, for a proposer that spends no blasts.
    """

    blasts: int
    budget: int
    best: Candidate | None = None
    guessed: float = 0.0

    @property
    def share(self) -> float:
        """Approximate share of the work that is done."""
        return self.blasts / self.budget if self.budget else self.guessed


Report = Callable[[Progress], None]
"""Called with the progress of a proposer after every batch of blasts."""


@dataclass(frozen=True)
class SearchResult:
    """A proposed layout, with an account of the search that found it.

    Attributes:
        layout: The layout, its cells sorted; empty if a search ended before it had one.
        by: Description of the source of the layout, for a proposer that consults others.
        gain: Relative reduction of the load that the proposer predicts; `None` without a
            prediction.
        load: Its load under the first `threats` threats, in the unit of the scenario's objective;
            `None` without a blast. A search selected the layout on these blasts, so that its load
            on other blasts is somewhat larger.
        threats: Number of threats under which the layout was assessed.
        blasts: Blasts spent: distinct pairs of layout and threat that were requested, whether
            cached or not.
        budget: Largest number of blasts.
        seed: Seed of all random draws.
        history: The best layout each time it changed.
        interrupted: Whether Ctrl-C ended the search early.
        front: The Pareto front of load and number of modules (or, with a catalogue, cost), in
            ascending order of the latter; only of methods that search for it.
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
        """The predicted gain as text; empty without a prediction."""
        return "" if self.gain is None else f"expected reduction {100.0 * self.gain:.1f} %"

    def history_table(self) -> "pd.DataFrame":
        """Return one row per change of the best layout."""
        return _table(self.history)

    def front_table(self) -> "pd.DataFrame":
        """Return one row per layout of the front."""
        return _table(self.front)


def _table(candidates: tuple[Candidate, ...]) -> "pd.DataFrame":
    # Imported here because the import takes a third of a second.
    import pandas as pd

    rows = [
        (
            *(
                candidate.blasts,
                candidate.load,
                candidate.threats,
                len(candidate.layout),
                candidate.cost,
            ),
            layout_text(candidate.layout),
        )
        for candidate in candidates
    ]
    columns = ["blasts", "load", "threats", "modules", "cost", "layout"]
    return pd.DataFrame(rows, columns=columns)


class Proposer(Protocol):
    """Proposes a layout for a case: a rule, a search or a trained agent."""

    @property
    def name(self) -> str:
        """Name in tables and on the command line."""

    def propose(
        self, problem: DesignProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return a layout, for instance as `SearchResult(layout)`.

        The same arguments give the same layout. Ctrl-C ends a search, which returns its best
        layout so far.

        Args:
            problem: The problem to minimise. `problem.load` and `problem.loads` run blasts.
            budget: Largest number of blasts; see `SearchResult.blasts`.
            seed: Seed of all random draws.

        Raises:
            BlastEnvError: If the proposer is not applicable to the budget or the site.
        """


class LayoutAgent(Protocol):
    """Proposes a layout for a site without simulating a blast."""

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None, /) -> Layout:
        """Return a layout that satisfies all conditions of the build zone; it is deterministic.

        Args:
            charge: The charge, if it is known; otherwise the layout is for all charges of the
                scenario.
        """


class SamplingAgent(LayoutAgent, Protocol):
    """Proposes a layout, and samples others."""

    def sample(
        self, scenario: Scenario, charge: AnyCharge | None = None, count: int = 8, seed: int = 0, /
    ) -> Sequence[Layout]:
        """Return `count` random layouts; some may be equal."""
