"""What pymoo's algorithms need to work on layouts: crossover, mutation, repair, and the loop.

Needs the extra `search`.
"""

from collections.abc import Callable, Sequence
from math import cos, pi, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_agents.search.moves import Moves, legal_part
from blast_agents.search.session import SearchSession
from blast_env.arrays import BoolArray
from blast_env.errors import LayoutError, import_extra
from blast_env.geometry import Element, Layout
from blast_env.scenario import Placement, Scenario

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
    """Return a layout as an individual: what is placed, by the number of its action (actions,)."""
    catalogue = scenario.zone.catalogue
    actions = np.zeros(catalogue.finish, dtype=bool)
    actions[[catalogue.action(element) for element in layout]] = True
    return actions


def layout_of(scenario: Scenario, actions: BoolArray) -> Layout:
    """Return an individual (actions,) as a layout, sorted."""
    catalogue = scenario.zone.catalogue
    return tuple(sorted(catalogue.element(int(action)) for action in np.flatnonzero(actions)))


_MIXED_SHARE: Final = 0.3
"""Share of the crossed pairs that are mixed and not cut."""


class SpatialCrossover(Crossover):
    """Children with the modules of one parent on one side and the other's on the other side.

    What works in a layout is a group of modules near each other, which a cut along a line in a
    random direction mostly leaves whole. In some of the pairs a child draws its modules from those
    of both parents instead, so that two walls in one place can become one. A child has as many
    modules as one of its parents, unless two fall on one cell.

    Args:
        scenario: The scenario.
        prob: Share of the pairs that are crossed at all.
    """

    def __init__(self, scenario: Scenario, prob: float) -> None:
        super().__init__(2, 2, prob=prob)
        self._scenario = scenario

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        children = np.empty_like(actions)
        for pair in range(actions.shape[1]):
            parents = [layout_of(self._scenario, actions[each, pair]) for each in (0, 1)]
            cross = mixed if rng.random() < _MIXED_SHARE else cut
            for child, (first, second) in enumerate((parents, parents[::-1])):
                layout = cross(first, second, rng)
                children[child, pair] = individual(self._scenario, layout)
        return children


def cut(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return what comes first in one layout and last in another in some direction."""
    angle = rng.uniform(0.0, 2.0 * pi)

    def along(cell: Element) -> float:
        return cos(angle) * cell[0] + sin(angle) * cell[1]

    count = int(rng.integers(len(first) + 1))
    last = sorted(second, key=along)[count:] if count < len(second) else []
    return tuple(sorted({*sorted(first, key=along)[:count], *last}))


def mixed(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return as many modules or pieces as the first layout has, drawn from those of both."""
    both = sorted({*first, *second})
    chosen = rng.choice(len(both), size=min(len(first), len(both)), replace=False)
    return tuple(both[index] for index in sorted(chosen))


class MoveMutation(Mutation):
    """A few moves of the neighbourhood that annealing uses too.

    Args:
        moves: The neighbourhood.
        more: How likely each further move is after the first.
    """

    def __init__(self, moves: Moves, more: float) -> None:
        super().__init__(prob=1.0)
        self._moves, self._more = moves, more

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        scenario = self._moves.scenario
        return np.array([individual(scenario, self._changed(each, rng)) for each in actions])

    def _changed(self, actions: BoolArray, rng: np.random.Generator) -> Layout:
        scenario = self._moves.scenario
        layout = repaired(scenario, layout_of(scenario, actions), rng)
        layout = self._moves.neighbour(layout, rng)
        while rng.random() < self._more:
            layout = self._moves.neighbour(layout, rng)
        return layout


class LayoutRepair(Repair):
    """Leaves out modules or pieces of a child, at random, until all conditions hold.

    Args:
        scenario: The scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario

    def _do(self, _problem: Any, actions: BoolArray, *_: Any, **options: Any) -> BoolArray:
        rng: np.random.Generator = options["random_state"]
        scenario = self._scenario
        layouts = (repaired(scenario, layout_of(scenario, each), rng) for each in actions)
        return np.array([individual(scenario, layout) for layout in layouts])


def repaired(scenario: Scenario, layout: Layout, rng: np.random.Generator) -> Layout:
    """Return as much of a layout as may stand: what is left out is chosen at random."""
    stock = scenario.zone.stock
    if len(layout) > stock:
        kept = rng.choice(len(layout), size=stock, replace=False)
        layout = tuple(layout[index] for index in sorted(kept))
    try:
        return Placement.of(scenario, layout).layout
    except LayoutError:
        order = rng.permutation(len(layout))
        return legal_part(scenario, [layout[index] for index in order]).layout


Objectives = Callable[[list[Layout]], NDArray[np.float64]]
"""Returns what is minimised for each of the layouts (layouts, objectives)."""


def operators(
    moves: Moves, first: Sequence[Layout], crossed_share: float, more_moves: float
) -> dict[str, Any]:
    """Return pymoo's arguments for how layouts are crossed, changed and repaired.

    Args:
        moves: The neighbourhood that mutation draws from.
        first: The layouts of the first population; what is there twice is left out.
        crossed_share: Share of the pairs of parents that are crossed.
        more_moves: How likely a child is changed by each further move after the first.
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
    """Let an algorithm go on until the session ends it or it finds no new layouts.

    Args:
        session: Ends it by `SearchEndedError`; its seed decides everything that is drawn.
        algorithm: One of pymoo's genetic algorithms.
        objectives: Asks the session.
    """
    scenario = session.problem.scenario
    count = objectives([]).shape[1]
    problem = Problem(n_var=scenario.zone.catalogue.finish, n_obj=count, vtype=bool)
    algorithm.setup(problem, termination=NoTermination(), seed=session.seed)
    while True:
        population = algorithm.ask()
        if population is None or not len(population):
            return
        layouts = [layout_of(scenario, each) for each in population.get("X")]
        population.set("F", objectives(layouts))
        algorithm.tell(infills=population)
