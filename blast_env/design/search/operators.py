"""Operators of pymoo's algorithms for layouts: crossover, mutation, repair, and the main loop.

Needs the extra `search`.
"""

from collections.abc import Callable, Sequence
from math import cos, pi, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray
from blast_env.design.search.moves import Moves, legal_part
from blast_env.design.search.session import SearchSession
from blast_env.errors import LayoutError, import_extra
from blast_env.geometry import Element, Layout
from blast_env.layout import LayoutState
from blast_env.site import Scenario

with import_extra("search", "genetic search"):
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.crossover import Crossover
    from pymoo.core.mutation import Mutation
    from pymoo.core.problem import Problem
    from pymoo.core.repair import Repair
    from pymoo.core.termination import NoTermination

__all__ = ["GA", "NSGA2", "LayoutRepair", "MoveMutation", "SpatialCrossover", "evolve", "operators"]


def individual(scenario: Scenario, layout: Layout) -> BoolArray:
    """Return a layout as an individual (actions,): True for the action of each element."""
    catalogue = scenario.zone.catalogue
    actions = np.zeros(catalogue.finish, dtype=bool)
    actions[[catalogue.action(element) for element in layout]] = True
    return actions


def layout_of(scenario: Scenario, actions: BoolArray) -> Layout:
    """Return an individual (actions,) as a layout, sorted."""
    catalogue = scenario.zone.catalogue
    return tuple(sorted(catalogue.element(int(action)) for action in np.flatnonzero(actions)))


_MIXED_SHARE: Final = 0.3
"""Share of the crossed pairs whose modules are mixed; the others are cut along a line."""


class SpatialCrossover(Crossover):
    """Crossover of layouts along a line: each side of a child comes from another parent.

    Groups of adjacent modules protect, and a cut along a line in a random direction mostly
    preserves them. In some pairs a child draws its modules from those of both parents instead, so
    that two walls in one place can become one. A child has as many modules as one of its parents,
    unless modules of both coincide.

    Args:
        scenario: The scenario.
        prob: Share of the pairs that are crossed.
    """

    def __init__(self, scenario: Scenario, prob: float) -> None:
        super().__init__(2, 2, prob=prob)
        self._scenario = scenario

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        children = np.empty_like(actions)
        for pair in range(actions.shape[1]):
            parents = [layout_of(self._scenario, actions[value, pair]) for value in (0, 1)]
            cross = mixed if rng.random() < _MIXED_SHARE else cut
            for child, (first, second) in enumerate((parents, parents[::-1])):
                layout = cross(first, second, rng)
                children[child, pair] = individual(self._scenario, layout)
        return children


def cut(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return the first elements of one layout and the last of another, in a random direction."""
    # Order the elements of both parents along one random direction; the child takes the first ones
    # of one parent and the rest of the other.
    angle = rng.uniform(0.0, 2.0 * pi)

    def along(cell: Element) -> float:
        return cos(angle) * cell[0] + sin(angle) * cell[1]

    count = int(rng.integers(len(first) + 1))
    last = sorted(second, key=along)[count:] if count < len(second) else []
    return tuple(sorted({*sorted(first, key=along)[:count], *last}))


def mixed(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return as many modules or pieces as the first layout has, drawn from those of both."""
    # Sorted first, so that the draw does not depend on the order of a set.
    both = sorted({*first, *second})
    chosen = rng.choice(len(both), size=min(len(first), len(both)), replace=False)
    return tuple(both[index] for index in sorted(chosen))


class MoveMutation(Mutation):
    """Mutation by one or more moves of the neighbourhood that population annealing uses too.

    Args:
        moves: The neighbourhood.
        more: Probability of each further move after the first.
    """

    def __init__(self, moves: Moves, more: float) -> None:
        super().__init__(prob=1.0)
        self._moves, self._more = moves, more

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        scenario = self._moves.scenario
        return np.array([individual(scenario, self._changed(action, rng)) for action in actions])

    def _changed(self, actions: BoolArray, rng: np.random.Generator) -> Layout:
        scenario = self._moves.scenario
        # Crossover may leave an illegal layout, and moves need a legal one.
        layout = repaired(scenario, layout_of(scenario, actions), rng)
        layout = self._moves.neighbour(layout, rng)
        while rng.random() < self._more:
            layout = self._moves.neighbour(layout, rng)
        return layout


class LayoutRepair(Repair):
    """Removes random modules or pieces of a child until all conditions hold.

    Args:
        scenario: The scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        scenario = self._scenario
        layouts = (repaired(scenario, layout_of(scenario, action), rng) for action in actions)
        return np.array([individual(scenario, layout) for layout in layouts])


def repaired(scenario: Scenario, layout: Layout, rng: np.random.Generator) -> Layout:
    """Return a legal part of a layout; the elements to drop are chosen at random."""
    stock = scenario.zone.stock
    if len(layout) > stock:
        kept = rng.choice(len(layout), size=stock, replace=False)
        layout = tuple(layout[index] for index in sorted(kept))
    try:
        return LayoutState.of(scenario, layout).layout
    except LayoutError:
        # Greedy in random order: no end of the build zone is favoured.
        order = rng.permutation(len(layout))
        return legal_part(scenario, [layout[index] for index in order]).layout


Objectives = Callable[[list[Layout]], NDArray[np.float64]]
"""Returns the values to minimise (layouts, objectives)."""


def operators(
    moves: Moves, first: Sequence[Layout], crossed_share: float, more_moves: float
) -> dict[str, Any]:
    """Return pymoo's arguments for sampling, crossover, mutation and repair of layouts.

    Args:
        moves: The neighbourhood that mutation draws from.
        first: The layouts of the first population; pymoo drops duplicates.
        crossed_share: Share of the pairs of parents that are crossed.
        more_moves: Probability of each further move of a child after the first.
    """
    scenario = moves.scenario
    return {
        "sampling": np.array([individual(scenario, layout) for layout in first]),
        "crossover": SpatialCrossover(scenario, crossed_share),
        "mutation": MoveMutation(moves, more_moves),
        "repair": LayoutRepair(scenario),
        "eliminate_duplicates": True,
    }


def evolve(session: SearchSession, algorithm: Any, objectives: Objectives) -> None:
    """Run an algorithm until the session ends it or it finds no new layouts.

    Args:
        session: Ends the run by `SearchEndedError`; its seed determines all random draws.
        algorithm: One of pymoo's genetic algorithms.
        objectives: Returns the objectives of layouts, by way of the session.
    """
    scenario = session.problem.scenario
    count = objectives([]).shape[1]
    problem = Problem(n_var=scenario.zone.catalogue.finish, n_obj=count, vtype=bool)
    # Ask and tell: the session counts the blasts and ends the run, not pymoo.
    algorithm.setup(problem, termination=NoTermination(), seed=session.seed)
    while True:
        population = algorithm.ask()
        if population is None or not len(population):
            return
        layouts = [layout_of(scenario, individual) for individual in population.get("X")]
        population.set("F", objectives(layouts))
        algorithm.tell(infills=population)
