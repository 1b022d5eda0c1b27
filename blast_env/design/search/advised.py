"""Advice with its verdict: the best layout of each kind of measures, judged by finer cells.

A layout that the search passes and the judge fails is searched for again, with a margin.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from blast_env.design.search.advice import (
    MARGIN,
    Advice,
    MeasureKind,
    advise_until,
    best_of,
    kinds_for,
)
from blast_env.evaluation import BlastEvaluator, DesignProblem
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.questions.grid_error import GridError
from blast_env.evaluation.questions.probability import Uncertainty, level_probability
from blast_env.evaluation.questions.verdict import Consequences, Verdict, consequences_of
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.response.levels import LevelOfProtection
from blast_env.runner import ProgressCallback, share_of
from blast_env.site import Scenario
from blast_env.site.content import SCHEMA_VERSION

ROUNDS: Final = 3
"""Default number of searches for each kind."""

_PROBABLE_MARGIN: Final = 0.3
"""Margin in damage levels after a layout failed before a judge who wants a probability."""


def site_with_target(
    scenario: Scenario,
    level: LevelOfProtection,
    target_probability: float | None = None,
    budget_cost: float | None = None,
) -> Scenario:
    """Return the scenario with the requested target and budget.

    Args:
        level: The required level.
        target_probability: Least probability of it; `None` for the scenario's.
        budget_cost: The most that may be spent; `None` for the scenario's.
    """
    kept = scenario.objective.model_dump(
        include={"charges", "cvar_level", "measure", "target_probability"}, exclude_none=True
    )
    if target_probability is not None:
        kept["target_probability"] = target_probability
    document = scenario.model_dump() | {
        "schema_version": SCHEMA_VERSION,
        "objective": {**kept, "kind": "response", "target": level.label},
    }
    if budget_cost is not None:
        document["build_zone"] = {**scenario.zone.model_dump(), "budget": budget_cost}
    return Scenario.from_document(document, scenario.name)


class AdviceJudge:
    """The verdicts on layouts by finer cells.

    Args:
        problem: The problem of the search.
        evaluator: Gas dynamics with the finer cells, and its store of blasts.
        mass_error: Uncertainty of the masses; see `Uncertainty`.

    Attributes:
        judged: The consequences with each layout that was judged.
        shares: The probability of the required level with each of them.
    """

    def __init__(
        self, problem: DesignProblem, evaluator: BlastEvaluator, mass_error: float
    ) -> None:
        self.problem, self.evaluator, self._mass_error = problem, evaluator, mass_error
        self.scenario = problem.scenario
        self.judged: dict[Layout, Consequences] = {}
        self.shares: dict[Layout, float] = {}

    @property
    def engine(self) -> Engine:
        """Gas dynamics with the finer cells."""
        return self.evaluator.engine

    @property
    def target(self) -> LevelOfProtection:
        """The required level."""
        target = self.scenario.objective.level
        assert target is not None
        return target

    def verdict(self, layout: Layout) -> Verdict:
        """Return the verdict on a layout; it takes a blast per charge, once."""
        if layout not in self.judged:
            self.judged[layout] = consequences_of(self._campaign(layout).run())
            likely = level_probability(self.judged[layout], Uncertainty(mass=self._mass_error))
            self.shares[layout] = likely.of(self.target)
        found = self.judged[layout].verdict(self.target)
        wanted = self.scenario.objective.target_probability or 0.0
        return found if self.shares[layout] >= wanted else min(found, Verdict.PASSES_BARELY)

    def error(self, layout: Layout) -> GridError | None:
        """Return the grid error for a judged layout, from the charge that governs.

        The search's blasts serve it if their cells are twice as large as the judge's.
        """
        coarser: BlastEvaluator | None = self.problem.evaluator
        if self.engine.coarser != self.problem.evaluator.engine:
            coarser = self.evaluator.coarser()
        campaign = replace(self._campaign((), load_relevant(layout)), coarser=coarser)
        number = self.judged[layout].worst_number
        return GridError.of(campaign.run(worst=lambda _: number))

    def _campaign(self, *layouts: Layout) -> Campaign:
        named = {str(number): layout for number, layout in enumerate(layouts)}
        return Campaign(self.problem.case, named, self.evaluator)


@dataclass(frozen=True, eq=False)
class AdviceResult:
    """The best layouts of all kinds, and the verdicts on them."""

    judge: AdviceJudge
    found: Sequence[Advice]

    @property
    def best(self) -> Advice:
        """The best layout of all."""
        return best_of(self.found, self.judge.verdict)


def advised(
    judge: AdviceJudge,
    budget: int,
    rounds: int = ROUNDS,
    seed: int = 0,
    progress: ProgressCallback | None = None,
) -> AdviceResult:
    """Return the best layout of each kind of measures, with the verdicts on them.

    Args:
        judge: The verdicts, and the problem of the search.
        budget: Most blasts of a search.
        rounds: Most searches for each kind.
        seed: Seed of the draws.
        progress: Called with the finished share of the kinds.
    """
    kinds, found = kinds_for(judge.scenario), list[Advice]()
    margin = MARGIN if judge.scenario.objective.target_probability is None else _PROBABLE_MARGIN
    for number, kind in enumerate(kinds):
        # All measures together begin with what each kind found, so that they are never worse.
        first = tuple(advice.layout for advice in found) if kind is MeasureKind.TOGETHER else ()
        part = share_of(progress, number, len(kinds))
        found.append(
            advise_until(
                judge.verdict,
                judge.problem,
                kind,
                budget,
                seed,
                first,
                part,
                rounds=rounds,
                margin=margin,
            )
        )
    return AdviceResult(judge, found)
