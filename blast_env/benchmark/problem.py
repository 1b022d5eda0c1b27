"""The interface of a problem for optimisers: layouts as vectors or lists, blasts counted."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from blast_env.benchmark.definitions import (
    BUDGETS,
    DEFINITIONS,
    SEEDS,
    Definition,
    find_definition,
)
from blast_env.benchmark.references import ScoreReference, stored_references
from blast_env.benchmark.space import LayoutSpace
from blast_env.design.search import Candidate, DesignProblem
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastStore, BudgetError, LoadCase, LoadCaseSet
from blast_env.evaluation.cases import check_loaded
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.geometry import Element, Layout
from blast_env.layout import check_layout
from blast_env.layout.placement import load_relevant
from blast_env.values import whole_number

_MOST_REPEATS: Final = 200
"""Successive evaluations without a new blast after which a problem ends a method."""


@dataclass(frozen=True)
class LayoutValue:
    """An evaluated layout.

    Attributes:
        layout: Its cells or pieces, sorted.
        share: Share of the load without a barrier that remains; less is better.
        threats: Number of threats, counted from the first.
        blasts: Blasts spent up to and including this evaluation.
    """

    layout: Layout
    share: float
    threats: int
    blasts: int


@dataclass(eq=False, kw_only=True)
class BenchmarkProblem(DesignProblem):
    """A problem of the benchmark with a budget of gas blasts; see `make`.

    A cached blast takes no time, but counts all the same. Methods may use the whole `case`, with
    its charges.

    Attributes:
        definition: Definition of the problem.
        history: Every evaluated layout, in order.
    """

    definition: Definition
    history: list[LayoutValue] = field(default_factory=list, init=False)
    _repeats: int = field(default=0, init=False, repr=False)

    @property
    def most_blasts(self) -> int:
        """The budget, which a problem of the benchmark always has."""
        return self.budget or 0

    @property
    def name(self) -> str:
        """Name with family and version."""
        return self.definition.name

    @property
    def family(self) -> str:
        """The family: `known_charge`, `hidden`, `vehicle`, `unseen` or `response`."""
        return self.definition.family

    @property
    def budgets(self) -> tuple[int, ...]:
        """The budgets that count for the score."""
        return BUDGETS

    @property
    def seeds(self) -> range:
        """The seeds of the runs of a stochastic method."""
        return range(SEEDS)

    @property
    def reference(self) -> ScoreReference | None:
        """The best rule and the best known layout; `None` for a site of `secret_sites`."""
        return stored_references().get(self.name)

    @cached_property
    def space(self) -> LayoutSpace:
        """The layouts as vectors."""
        return LayoutSpace(self.scenario)

    @property
    def blasts_left(self) -> int:
        """Blasts that remain in the budget."""
        return self.most_blasts - self.blasts

    @property
    def best(self) -> LayoutValue | None:
        """The best of the layouts evaluated with most threats; `None` before the first."""
        return min(self.history, key=lambda step: (-step.threats, step.share), default=None)

    @property
    def curve(self) -> tuple[tuple[int, float], ...]:
        """Blasts spent and share of the best layout so far, each time it changed."""
        found: list[tuple[int, float]] = []
        best = (0, 0.0)
        for step in self.history:
            rank = (-step.threats, step.share)
            if rank < best:
                best = rank
                found.append((step.blasts, round(step.share, 5)))
        return tuple(found)

    def enter(self, found: Candidate) -> None:
        """Enter a layout of a search that counted its blasts in the history."""
        met = replace(self.case, threats=self.case.threats[: found.threats])
        unprotected = met.objective_value(self.unprotected[: found.threats], ())
        share = found.load / unprotected
        self.history.append(LayoutValue(found.layout, share, found.threats, found.blasts))

    def check(self, layout: Sequence[Element]) -> tuple[str, ...]:
        """Return the reasons why a layout is illegal, one sentence each; none if it is legal.

        Raises:
            LayoutError: If it is not a list of cells or pieces.
        """
        return self.space.reasons_against(layout)

    def evaluate(self, layout: Sequence[Element], threats: int | None = None) -> float:
        """Return the share of the load without a barrier that remains with a layout.

        It spends one blast per threat, except for pairs of layout and threat that were evaluated
        before. Blasts without a barrier are free. Where the response of facades counts, the share
        is that of the response; measures that harden a facade take no further blast.

        Args:
            layout: (row, column) of each module, or pieces (row, column, item, turned).
            threats: Number of the problem's threats, from the first; they are ordered far from
                each other, so that a few represent all. All of them unless given.

        Returns:
            The objective, to be minimised; 1 without a barrier.

        Raises:
            BudgetError: If the blasts exceed the budget, or after many evaluations in a row without
                a new blast. A method may let it end its search (`play`).
            LayoutError: If the layout is not legal; no blast is counted then.
            BlastEnvError: If `threats` is not 1 to the number of threats.
        """
        most = len(self.case.threats)
        count = most if threats is None else threats
        if not 1 <= count <= most:
            raise BlastEnvError(f"threats is {count}, must be 1 to {most}")
        # 1. What it costs: a layout that changes no load is known.
        checked = tuple(sorted(check_layout(self.scenario, layout)))
        pairs: list[tuple[Layout, LoadCase]] = [
            (checked, threat) for threat in self.case.threats[:count] if load_relevant(checked)
        ]
        before = self.blasts
        try:
            self.spend(pairs)
        except BudgetError:
            raise BudgetError(
                f"{self.name}: {count} blasts asked for, {self.blasts_left} of the budget of "
                f"{self.budget} are left"
            ) from None
        # 2. A method that asks for known layouts only would never end.
        self._repeats = self._repeats + 1 if self.blasts == before else 0
        if self._repeats > _MOST_REPEATS:
            raise BudgetError(f"{self.name}: {_MOST_REPEATS} evaluations without a new blast")
        # 3. The share under the first threats, for methods that look closer at the best.
        met = replace(self.case, threats=self.case.threats[:count])
        (share,) = shares_of(met, [checked], self.evaluator)
        self.history.append(LayoutValue(checked, share, count, self.blasts))
        return share

    def judged(self, layout: Sequence[Element], processes: int = 1) -> float:
        """Return the share of the load that remains under the threats of the judge.

        For reports only: methods must not call it, and its blasts are not counted.

        Raises:
            LayoutError: If the layout is not legal.
        """
        checked = tuple(sorted(check_layout(self.scenario, layout)))
        (share,) = shares_of(self.definition.case, [checked], self.evaluator, processes)
        return share


def shares_of(
    case: LoadCaseSet, layouts: Sequence[Layout], evaluator: BlastEvaluator, processes: int = 1
) -> list[float]:
    """Return the objective of each layout relative to that without a barrier.

    It is 1, that of nothing, for a layout that hides a protected building, whose load is no number.

    Args:
        case: The case, with its threats.
        evaluator: Runs the blasts.
        processes: Number of worker processes.
    """
    pairs = [(layout, threat) for layout in ((), *layouts) for threat in case.threats]
    found = evaluator.loads_of_many(pairs, processes)
    loads = [load.load(case.scenario.objective) for load in found]
    of_layout = [
        case.objective_value(own, layout)
        for layout, own in zip(
            ((), *layouts), np.reshape(loads, (-1, len(case.threats))), strict=True
        )
    ]
    if not of_layout[0] > 0.0:  # or not a number
        check_loaded(case, found[0].without_load)
        raise BlastEnvError(f"{case.label}: nothing arrives without a barrier")
    return [1.0 if np.isnan(load) else load / of_layout[0] for load in of_layout[1:]]


def make(
    problem: str | Definition,
    budget: int = BUDGETS[1],
    cell_m: float | None = None,
    engine: str | Engine = JUDGE,
    cache: str | Path | BlastStore | None = None,
) -> BenchmarkProblem:
    """Return a problem of the benchmark.

    Args:
        problem: Its name, such as `control_room-known-v2`, or its definition.
        budget: Most gas blasts.
        cell_m: Side of the cells, m; 0.5 unless given.
        engine: Another engine than gas dynamics, for tests.
        cache: Folder or store in which blasts are kept.

    Raises:
        UnknownNameError: If there is no such problem; the message names the nearest one.
        BlastEnvError: If the digest of the definition differs from the stored one, or an argument
            is out of bounds.
    """
    definition = find_definition(problem) if isinstance(problem, str) else problem
    known = stored_references().get(definition.name)
    if known is not None and known.digest != definition.digest:
        if definition.site != DEFINITIONS[definition.name].site:
            raise BlastEnvError(
                f"{definition.site}: {definition.name} is the name of a problem of the benchmark,"
                " on another site: give the file another name"
            )
        raise BlastEnvError(
            f"{definition.name}: the site or its charges have changed (digest {definition.digest}, "
            f"must be {known.digest}): a version never changes its content"
        )
    search_set = definition.case.search_set
    assert search_set is not None
    whole_number("budget", budget, 0, BUDGETS[-1])
    most = budget + len(search_set.threats)
    found = find_engine(engine, cell_m)
    evaluator = BlastEvaluator(definition.scenario, found, cache_size=most, cache=cache)
    return BenchmarkProblem(evaluator, search_set, budget=budget, definition=definition)
