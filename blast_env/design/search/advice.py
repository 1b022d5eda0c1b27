"""Best use of a budget by kind of measure: keep the charge away, shield, harden, or all of them.

The loads depend only on the structures on the ground. Each barrier is therefore combined with its
best choice of the other measures, and the choices are compared without further blasts.
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import combinations
from math import inf, isnan
from typing import Final

import numpy as np

from blast_env.design.search.moves import Moves, legal_part
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BudgetError, DesignProblem
from blast_env.evaluation.questions.verdict import Verdict
from blast_env.geometry import Layout, Measure
from blast_env.layout import LayoutState
from blast_env.layout.placement import load_relevant
from blast_env.response.levels import MOST_DAMAGE, worst
from blast_env.rules import layouts_by_rule
from blast_env.runner import share_of
from blast_env.site import AnyCharge, Scenario
from blast_env.values import generator

_LOW_M: Final = 1.5
"""Items that stop vehicles and are lower than this keep them away; others shield."""

_MOST_LOOKED_AT: Final = 10
"""Largest number of measures with all choices compared; of more, only each alone and all."""

_KEPT: Final = 3
"""Number of best barriers that the search changes."""

MARGIN: Final = 0.1
"""Default margin to the damage of a layout that failed before a judge, in damage levels."""

_TOO_LITTLE: Final = 1e-9
"""Least excess over 1 of the worth of a layout that fails."""

_FEWER_SHARE: Final = 0.4
"""Share of the changes that remove a piece, because the cheapest layout that passes is sought."""


class MeasureKind(StrEnum):
    """Kinds of measures."""

    NOTHING = "nothing"
    KEEP_AWAY = "keep the charge away"
    SHIELD = "shield"
    HARDEN = "harden"
    TOGETHER = "together"


@dataclass(frozen=True, order=True)
class LayoutTrial:
    """A layout that was assessed: a simulated barrier with some of the measures.

    Attributes:
        worth: Value of the objective with its target: at most 1 if it passes; see
            `ObjectiveSection.objective_value`.
        cost: Its cost, in the unit of the zone's budget.
        damage: The worst damage of all components under all charges, from 0 to 5; see
            `blast_env.response.damage`.
    """

    worth: float
    cost: float
    damage: float
    layout: Layout


@dataclass(frozen=True)
class Advice:
    """The best layout of a kind of measures.

    Attributes:
        best: The cheapest layout that passes, or else the one with the least shortfall.
        blasts: Blasts requested.
        tried: All assessed layouts.
    """

    kind: MeasureKind
    best: LayoutTrial
    blasts: int
    tried: tuple[LayoutTrial, ...] = ()

    @property
    def layout(self) -> Layout:
        """The layout."""
        return self.best.layout

    @property
    def worth(self) -> float:
        """Value of the objective for the layout; at most 1 if it passes."""
        return self.best.worth

    @property
    def passes(self) -> bool:
        """Whether the layout reaches the target under the blasts of the search."""
        return self.worth <= 1.0


def kinds_for(scenario: Scenario) -> tuple[MeasureKind, ...]:
    """Return the kinds of measures available in a scenario, `NOTHING` first."""
    kinds = [MeasureKind.NOTHING]
    kinds += [
        kind for kind in (MeasureKind.KEEP_AWAY, MeasureKind.SHIELD) if _items_of(scenario, kind)
    ]
    kinds += [MeasureKind.HARDEN] if scenario.zone.hardening else []
    return (*kinds, MeasureKind.TOGETHER) if len(kinds) > 2 else tuple(kinds)


def most_blasts(
    scenario: Scenario, kinds: Iterable[MeasureKind], rounds: int, budget: int, threats: int
) -> tuple[int, int]:
    """Return the most blasts of a search, and the most barriers for a judge, of kinds of measures.

    All kinds begin without a barrier, and those that place none have no other.

    Args:
        rounds: Largest number of searches for each.
        budget: Largest number of blasts of a search.
    """
    searches = rounds * sum(bool(_items_of(scenario, kind)) for kind in kinds)
    return threats + searches * (budget - threats), 1 + searches


def only(scenario: Scenario, kind: MeasureKind) -> Scenario:
    """Return the scenario restricted to one kind of measures."""
    zone = scenario.zone
    names = _items_of(scenario, kind)
    items = tuple(
        item if item.name in names else item.model_copy(update={"stock": 0}) for item in zone.items
    )
    hardening = zone.hardening if kind in (MeasureKind.HARDEN, MeasureKind.TOGETHER) else ()
    removable = zone.removable if kind in (MeasureKind.SHIELD, MeasureKind.TOGETHER) else ()
    update = {"items": items, "hardening": hardening, "removable": removable}
    changed = zone.model_copy(update=update)
    return scenario.model_copy(update={"build_zone": changed})


def _items_of(scenario: Scenario, kind: MeasureKind) -> set[str]:
    low = {
        item.name
        for item in scenario.zone.items
        if item.stops_vehicles and item.height_m < _LOW_M and scenario.vehicles
    }
    every = {item.name for item in scenario.zone.items if item.stock > 0}
    return {
        MeasureKind.NOTHING: set[str](),
        MeasureKind.KEEP_AWAY: every & low,
        MeasureKind.SHIELD: every - low,
        MeasureKind.HARDEN: set[str](),
        MeasureKind.TOGETHER: every,
    }[kind]


def advise(
    problem: DesignProblem,
    kind: MeasureKind,
    budget: int,
    seed: int = 0,
    begin_with: tuple[Layout, ...] = (),
    progress: Callable[[float], None] | None = None,
    *,
    damage_below: float = inf,
) -> Advice:
    """Return the best layout of a kind of measures.

    The search starts with the rules' layouts, those against each charge alone, and parts of them.
    It then changes the best by moving or removing pieces.

    Args:
        problem: Problem of a scenario whose objective has a target.
        budget: Largest number of blasts.
        seed: Seed of all random draws.
        begin_with: Initial layouts, for example of other kinds.
        progress: Called with the share of the blasts that is spent.
        damage_below: Exclusive bound on the worst damage, for a margin to the target.

    Raises:
        BlastEnvError: If the budget does not pay for one layout under all threats.
    """
    if budget < len(problem.threats):
        raise BlastEnvError(
            f"budget is {budget} blasts, must be at least {len(problem.threats)}: one per threat"
        )
    scenario, rng = only(problem.scenario, kind), generator(seed)
    metered = replace(problem, budget=budget)
    best: dict[Layout, LayoutTrial] = {}
    tried: list[LayoutTrial] = []
    moves = Moves(scenario)

    # A local search with restarts among the best: (1) nothing, what other kinds found, and the
    # rules' layouts, whole and by half; (2) for ever, a neighbour of one of the best so far. Each
    # barrier costs its blasts once; hardening it in all ways costs none.
    def drawn() -> Iterator[Layout]:
        yield ()
        for layout in begin_with:
            yield load_relevant(layout)
        if _items_of(scenario, kind):
            unprotected = scenario.zone.model_copy(update={"hardening": ()})
            unhardened = scenario.model_copy(update={"build_zone": unprotected})
            ruled = layouts_by_rule(unhardened, problem.known_charge)
            yield from ruled.values()
            yield from against_several(unhardened, problem.case.charges)
            for layout in ruled.values():
                yield layout[: len(layout) // 2]
            while True:
                ranked = sorted(best, key=lambda item: best[item])[:_KEPT]
                chosen = ranked[int(rng.integers(len(ranked)))]
                yield load_relevant(_changed(moves, chosen, rng))

    tries = 0
    try:
        for barrier in drawn():
            tries += 1
            key = tuple(sorted(legal_part(scenario, barrier).layout))
            if tries > 20 * budget:  # small sites have fewer layouts than the budget pays for
                break
            if key in best:
                continue
            choices = _hardened(metered, scenario, key, damage_below)
            tried += choices
            best[key] = min(choices)
            if progress is not None:
                progress(metered.blasts / budget)
    except BudgetError:
        pass
    return Advice(kind, min(best.values()), metered.blasts, tuple(tried))


def advise_until(
    judge: Callable[[Layout], Verdict],
    problem: DesignProblem,
    kind: MeasureKind,
    budget: int,
    seed: int = 0,
    begin_with: tuple[Layout, ...] = (),
    progress: Callable[[float], None] | None = None,
    *,
    rounds: int = 1,
    margin: float = MARGIN,
) -> Advice:
    """Search until a judge passes the best layout, and return the best of all searches.

    Each search after the first requires a margin to the damage of the layout that the judge failed.

    Args:
        problem: As for `advise`.
        budget: Largest number of blasts per search.
        seed: Seed of all random draws.
        begin_with: Initial layouts.
        progress: Called with the share of the searches that is done.
        rounds: Largest number of searches.
        margin: The margin, in damage levels.
    """
    every: list[Advice] = []
    below = inf
    for _ in range(rounds):
        part = share_of(progress, len(every), rounds)
        found = advise(problem, kind, budget, seed, begin_with, part, damage_below=below)
        if every and not found.passes:
            break
        every.append(found)
        if not found.passes or judge(found.layout) is Verdict.PASSES:
            break
        # What passed on these cells failed with finer ones: ask for less damage than it had.
        below = found.best.damage - margin
        begin_with = (*begin_with, found.layout)
    return replace(
        best_of(every, judge),
        blasts=sum(thing.blasts for thing in every),
        tried=tuple(tried for thing in every for tried in thing.tried),
    )


def best_of(found: Iterable[Advice], judge: Callable[[Layout], Verdict]) -> Advice:
    """Return the result with the best verdict; among equals the cheapest or nearest to passing."""
    return min(found, key=lambda advice: (-judge(advice.layout), advice.best))


def against_several(scenario: Scenario, charges: Collection[AnyCharge]) -> Iterator[Layout]:
    """Yield for each rule the union of its layouts against several charges.

    Each charge gets an equal share of the budget. Nothing is yielded for a single charge or a
    zone without a budget.
    """
    distinct, zone = tuple(dict.fromkeys(charges)), scenario.zone
    if len(distinct) < 2 or zone.budget is None:
        return
    share = zone.model_copy(update={"budget": zone.budget / len(distinct)})
    poorer = scenario.model_copy(update={"build_zone": share})
    ruled = [layouts_by_rule(poorer, charge) for charge in distinct]
    for name in ruled[0]:
        yield tuple(element for layout in ruled for element in layout.get(name, ()))


def _changed(moves: Moves, layout: Layout, rng: np.random.Generator) -> Layout:
    if len(layout) > 1 and rng.random() < _FEWER_SHARE:
        index = int(rng.integers(len(layout)))
        return layout[:index] + layout[index + 1 :]
    return moves.neighbour(layout, rng)


def _hardened(
    problem: DesignProblem, scenario: Scenario, barrier: Layout, damage_below: float
) -> list[LayoutTrial]:
    """Return a barrier with each choice of measures that the rest of the zone's budget pays for.

    Only the barrier alone needs blasts.

    Raises:
        BudgetError: If the blasts exceed the budget of the problem.
    """
    names = [measure.name for measure in scenario.zone.hardening]
    counts = range(len(names) + 1) if len(names) <= _MOST_LOOKED_AT else (0, 1, len(names))
    placement = LayoutState(scenario, barrier)
    left = placement.budget_left
    prices = {measure.name: measure.cost for measure in scenario.zone.hardening}
    found: list[LayoutTrial] = []
    for count in counts:
        for taken in combinations(names, count):
            cost = sum(prices[name] for name in taken)
            if left is None or cost <= left:
                layout = (*barrier, *map(Measure.named, taken))
                worth = problem.load(layout)
                if isnan(worth):  # pieces hide a building: such a layout is never the best
                    found.append(LayoutTrial(inf, placement.cost + cost, MOST_DAMAGE, layout))
                    continue
                damage = _worst_damage(problem, layout)
                # It reaches the target, but without the margin: worse than any that has it.
                if worth <= 1.0 and damage >= damage_below:
                    worth = 1.0 + damage - damage_below + _TOO_LITTLE
                found.append(LayoutTrial(worth, placement.cost + cost, damage, layout))
    return found


def _worst_damage(problem: DesignProblem, layout: Layout) -> float:
    """Return the worst damage over all threats, from the blasts that were run before."""
    loads = problem.evaluator.loads_of_many((layout, threat) for threat in problem.threats)
    return worst(structure.worst_damage or 0.0 for load in loads for structure in load.protected)
