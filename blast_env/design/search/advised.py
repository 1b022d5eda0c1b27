"""Advice with its verdict: the best layout of each kind of measures, judged by finer cells.

A layout that the search passes and the judge fails is searched for again, with a margin.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
from blast_env.evaluation.answers import AnswerPart, AnswerTable
from blast_env.evaluation.consequences import Consequences, Verdict
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.grid_error import GridError, grid_error
from blast_env.evaluation.probability import (
    DRAWS,
    Uncertainty,
    level_probability,
    probability_text,
)
from blast_env.evaluation.shared import consequences
from blast_env.geometry import Layout, layout_words
from blast_env.layout import LayoutState
from blast_env.layout.placement import load_relevant
from blast_env.response.buildings import LevelOfProtection
from blast_env.runner import ProgressCallback, share_of
from blast_env.site import Scenario
from blast_env.site.content import SCHEMA_VERSION

ROUNDS: Final = 3
"""Default number of searches for each kind."""

_PROBABLE_MARGIN: Final = 0.3
"""Margin in damage levels after a layout failed before a judge who wants a probability."""

_HEADERS: Final = (
    *("kind", "layout", "cost", "blasts", "level", "passes", "judged", "sharp peaks"),
    "probability",
)


def site_with_target(
    scenario: Scenario,
    level: LevelOfProtection,
    target_probability: float | None = None,
    budget_cost: float | None = None,
) -> Scenario:
    """Return the scenario with the requested target and budget.

    Args:
        scenario: The scenario.
        level: The required level.
        target_probability: Least probability of it; `None` for the scenario's.
        budget_cost: The most that may be spent; `None` for the scenario's.

    Raises:
        ScenarioError: If one of them is out of bounds, or no protected structure has a facade.
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
            charges = [each.charge for each in self.problem.threats]
            self.judged[layout] = consequences(self.evaluator, layout, charges)
            likely = level_probability(self.judged[layout], Uncertainty(mass=self._mass_error))
            self.shares[layout] = likely.of(self.target)
        found = self.judged[layout].verdict(self.target)
        wanted = self.scenario.objective.target_probability or 0.0
        return found if self.shares[layout] >= wanted else min(found, Verdict.PASSES_BARELY)

    def error(self, layout: Layout) -> GridError | None:
        """Return the grid error for a judged layout.

        The search's blasts serve it if their cells are twice as large as the judge's.
        """
        fine, unprotected = self.judged[layout], self.judged[()]
        threat = self.problem.threats[fine.worst_number]
        of_both = fine.loads[fine.worst_number], unprotected.loads[fine.worst_number]
        coarser: BlastEvaluator | None = self.problem.evaluator
        if self.engine.coarser != self.problem.evaluator.engine:
            coarser = self.evaluator.coarser()
        return grid_error(coarser, self.problem.case, load_relevant(layout), threat, of_both)


@dataclass(frozen=True, eq=False)
class AdviceResult:
    """The best layouts of all kinds, and the verdicts on them.

    Attributes:
        judge: The verdicts.
        found: The best layout of each kind.
    """

    judge: AdviceJudge
    found: Sequence[Advice]

    @property
    def best(self) -> Advice:
        """The best layout of all."""
        return best_of(self.found, self.judge.verdict)

    def answer(self) -> Iterator[AnswerPart]:
        """Yield the cost to pass, flags, the grid error, and the table of the kinds."""
        judge, best = self.judge, self.best
        scenario, target = judge.scenario, judge.target
        yield self._first_line(best)
        yield from (f"flag: {note}" for note in judge.judged[best.layout].notes)
        error = judge.error(best.layout)
        if error is not None:
            yield error.impulse_words
            yield error.words
        rows = []
        for each in self.found:
            seen = judge.judged[each.layout]
            rows.append(
                (
                    each.kind,
                    layout_words(each.layout),
                    f"{LayoutState(scenario, each.layout).cost:,.10g}",
                    str(each.blasts),
                    min(seen.level(building) for building in seen.buildings).label,
                    "yes" if each.passes else "no",
                    Verdict.of(seen.passes_on_cells(target)).word(seen.is_flagged).lower(),
                    seen.verdict_word(target).lower(),
                    probability_text(judge.shares[each.layout], DRAWS),
                )
            )
        zone = scenario.zone
        budget = "no limit" if zone.budget is None else zone.priced(zone.budget)
        title = f"{scenario.name}: budget {budget}, required level {target.label!r}"
        yield AnswerTable.of(title, _HEADERS, rows, 2)
        yield (
            f"passes: by the search; judged: {judge.engine.words}; level, sharp peaks: the same "
            "impulses with peaks that cells do not clip as well; probability: of the required "
            "level."
        )

    def _first_line(self, best: Advice) -> str:
        """Return the answer in a line or two: the cost to pass, and whether walls help."""
        judge = self.judge
        scenario, target = judge.scenario, judge.target
        by_kind = {each.kind: each for each in self.found}
        cost = LayoutState(scenario, best.layout).cost
        flagged = " (flagged)" if judge.judged[best.layout].is_flagged else ""
        wanted = scenario.objective.target_probability
        likely = probability_text(judge.shares[best.layout], DRAWS)
        if judge.verdict(best.layout) is not Verdict.PASSES:
            least = (
                ""
                if wanted is None
                else f" with a probability of {wanted:g}; the best has {likely}"
            )
            answer = f"{scenario.name}: nothing that was tried reaches {target.label!r}{least}."
        elif not best.layout:
            answer = (
                f"{scenario.name}: the empty site reaches {target.label!r} with {likely}{flagged}."
            )
        else:
            words = layout_words(best.layout)
            level = f"{target.label!r} with {likely}"
            price = scenario.zone.priced(cost)
            answer = f"{scenario.name}: {level} costs {price}{flagged}: {words}."
        shield, nothing = by_kind.get(MeasureKind.SHIELD), by_kind[MeasureKind.NOTHING]
        if shield is None or judge.judged[shield.layout].passes(target):
            return answer
        barrier = set(load_relevant(best.layout))
        gain = 1.0 - (shield.worth - 1.0) / (nothing.worth - 1.0) if nothing.worth > 1.0 else 0.0
        if best.passes and not barrier:
            return f"Walls are worth nothing here: better components alone are cheaper. {answer}"
        if gain < 0.01:
            return (
                "Walls alone are worth nothing here: they change the shortfall by "
                f"{gain:.1%}. {answer}"
            )
        return answer


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
        first = tuple(each.layout for each in found) if kind is MeasureKind.TOGETHER else ()
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
