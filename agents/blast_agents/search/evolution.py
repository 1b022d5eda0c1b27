"""Genetic search and NSGA-II on pymoo."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.problem import Problem
from pymoo.core.repair import Repair
from pymoo.core.termination import NoTermination

from blast_agents.search.moves import Draw, Moves, legal_part, random_part, random_walls
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_env.arrays import BoolArray
from blast_env.errors import LayoutError
from blast_env.geometry import Cell, Layout
from blast_env.scenario import Placement, Scenario


def individual(scenario: Scenario, layout: Layout) -> BoolArray:
    """Return a layout as an individual (cells,)."""
    cells = np.zeros(Placement.empty(scenario).usable.shape, dtype=bool)
    if layout:
        cells[tuple(zip(*layout, strict=True))] = True
    return cells.ravel()


def layout_of(scenario: Scenario, cells: BoolArray) -> Layout:
    """Return an individual (cells,) as a layout, its cells sorted."""
    columns = Placement.empty(scenario).usable.shape[1]
    return tuple(divmod(int(index), columns) for index in np.flatnonzero(cells))


class SpatialCrossover(Crossover):
    """Children with the modules of one parent on one side and the other's on the other side.

    What works in a layout is a group of modules near each other, which a cut along a line in a
    random direction mostly leaves whole. In some of the pairs a child draws its modules from those
    of both parents instead, so that two walls in one place can become one. A child has as many
    modules as one of its parents, unless two fall on one cell.

    Args:
        scenario: The scenario.
        prob: Share of the pairs that are crossed at all.
        mixed_share: Share of the crossed pairs that are mixed and not cut.
    """

    def __init__(self, scenario: Scenario, prob: float, mixed_share: float = 0.3) -> None:
        super().__init__(2, 2, prob=prob)
        self._scenario, self._mixed_share = scenario, mixed_share

    def _do(
        self,
        _problem: Any,
        cells: BoolArray,
        *_: Any,
        random_state: np.random.Generator,
        **_options: Any,
    ) -> BoolArray:
        children = np.empty_like(cells)
        for pair in range(cells.shape[1]):
            parents = [layout_of(self._scenario, cells[each, pair]) for each in (0, 1)]
            cross = mixed if random_state.random() < self._mixed_share else cut
            for child, (first, second) in enumerate((parents, parents[::-1])):
                layout = cross(first, second, random_state)
                children[child, pair] = individual(self._scenario, layout)
        return children


def cut(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return the first modules of one layout and the last ones of another in some direction."""
    angle = rng.uniform(0.0, 2.0 * pi)

    def along(cell: Cell) -> float:
        return cos(angle) * cell[0] + sin(angle) * cell[1]

    count = int(rng.integers(len(first) + 1))
    last = sorted(second, key=along)[count:] if count < len(second) else []
    return tuple(sorted({*sorted(first, key=along)[:count], *last}))


def mixed(first: Layout, second: Layout, rng: np.random.Generator) -> Layout:
    """Return as many modules as the first layout has, drawn from those of both."""
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

    def _do(
        self,
        _problem: Any,
        cells: BoolArray,
        *_: Any,
        random_state: np.random.Generator,
        **_options: Any,
    ) -> BoolArray:
        scenario = self._moves.scenario
        return np.array([individual(scenario, self._changed(each, random_state)) for each in cells])

    def _changed(self, cells: BoolArray, rng: np.random.Generator) -> Layout:
        scenario = self._moves.scenario
        layout = repaired(scenario, layout_of(scenario, cells), rng)
        layout = self._moves.neighbour(layout, rng)
        while rng.random() < self._more:
            layout = self._moves.neighbour(layout, rng)
        return layout


class LayoutRepair(Repair):
    """Leaves out modules of a child, chosen at random, until all conditions hold.

    Args:
        scenario: The scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario

    def _do(
        self,
        _problem: Any,
        cells: BoolArray,
        *_: Any,
        random_state: np.random.Generator,
        **_options: Any,
    ) -> BoolArray:
        layouts = (
            repaired(self._scenario, layout_of(self._scenario, each), random_state)
            for each in cells
        )
        return np.array([individual(self._scenario, layout) for layout in layouts])


def repaired(scenario: Scenario, layout: Layout, rng: np.random.Generator) -> Layout:
    """Return as much of a layout as may stand: what is left out is chosen at random."""
    stock = scenario.zone.stock
    if len(layout) > stock:
        kept = rng.choice(len(layout), size=stock, replace=False)
        layout = tuple(layout[index] for index in sorted(kept))
    try:
        return Placement.of(scenario, layout).cells
    except LayoutError:
        order = rng.permutation(len(layout))
        return legal_part(scenario, [layout[index] for index in order]).cells


Objectives = Callable[[list[Layout]], NDArray[np.float64]]
"""Returns what is minimised for each of the layouts (layouts, objectives)."""


_LEAST_POPULATION: Final = 6


_MOST_POPULATION: Final = 60


def population_size(layouts: int) -> int:
    """Return the size of a population for a search that can try so many layouts.

    It grows with the square root: twice the layouts, 1.4 times the population and the generations.
    """
    return int(np.clip(round(0.7 * layouts**0.5), _LEAST_POPULATION, _MOST_POPULATION))


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


def evolve(session: SearchSession, algorithm: Any, objectives: Objectives, seed: int) -> None:
    """Let an algorithm go on until the session ends it or it finds no new layouts.

    Args:
        session: Ends it by `SearchEndedError`.
        algorithm: One of pymoo's genetic algorithms.
        objectives: Asks the session.
        seed: Decides everything that is drawn.
    """
    scenario = session.problem.scenario
    cells = Placement.empty(scenario).usable.size
    count = objectives([]).shape[1]
    problem = Problem(n_var=cells, n_obj=count, vtype=bool)
    algorithm.setup(problem, termination=NoTermination(), seed=seed)
    while True:
        population = algorithm.ask()
        if population is None or not len(population):
            return
        layouts = [layout_of(scenario, each) for each in population.get("X")]
        population.set("F", objectives(layouts))
        algorithm.tell(infills=population)


@dataclass(frozen=True)
class GeneticSearch:
    """pymoo's `GA` with sampling, crossover, mutation and repair made for layouts.

    The best of the layouts that the first blasts show are the first population; from then on the
    best of parents and children survive. The population grows with the square root of the layouts
    that the budget pays for, and half as many children are made at a time.

    Attributes:
        initial: Layouts that are tried first, beside those that are drawn. None by default, so
            that what is found is the search's own and not a rule's.
        draw: Draws the layouts to begin with.
        starting_share: Share of the exploration that goes into them.
        crossed_share: Share of the pairs of parents that are crossed; all children are changed.
        more_moves: How likely a child is changed by each further move after the first.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.25
    crossed_share: float = 0.5
    more_moves: float = 0.5
    name: str = "genetic"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was found."""
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        size = population_size(plan.exploring_layouts)
        rng = np.random.default_rng(seed)

        def objectives(layouts: list[Layout]) -> NDArray[np.float64]:
            return session.assess(layouts)[:, np.newaxis]

        def explore() -> None:
            count = max(size, round(self.starting_share * plan.exploring_layouts))
            drawn = (self.draw(problem.scenario, rng) for _ in range(count))
            session.assess([*self.initial, *drawn])
            algorithm = GA(
                pop_size=size,
                n_offsprings=max(2, size // 2),
                **operators(
                    Moves(problem.scenario),
                    session.ranked(plan.threats)[:size],
                    self.crossed_share,
                    self.more_moves,
                ),
            )
            evolve(session, algorithm, objectives, seed)

        return session.result(self.name, seed, session.run(explore))


@dataclass(frozen=True)
class Nsga2Search:
    """pymoo's `NSGA2` with the operators of the genetic search, and two things to minimise.

    The result carries the front: what each further module is worth. Its best layout is the end of
    the front with the least impulse.

    What is held back of the budget lets the front meet the other threats, and then, as far as it
    goes, the layouts that were just behind it.

    Attributes:
        initial: Layouts that are in the first population.
        draw: Draws the other layouts of the first population.
        crossed_share: Share of the pairs of parents that are crossed; all children are changed.
        more_moves: How likely a child is changed by each further move after the first.
        count_share: Share of the moves that add a module or take one away.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_part
    crossed_share: float = 0.5
    more_moves: float = 0.5
    count_share: float = 0.4
    name: str = "nsga2"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the front, and the layout with the least impulse."""
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        size = 2 * population_size(plan.exploring_layouts)
        rng = np.random.default_rng(seed)

        def objectives(layouts: list[Layout]) -> NDArray[np.float64]:
            return np.column_stack([session.assess(layouts), [len(each) for each in layouts]])

        def explore() -> None:
            drawn = [self.draw(problem.scenario, rng) for _ in range(size)]
            algorithm = NSGA2(
                pop_size=size,
                n_offsprings=max(2, size // 2),
                **operators(
                    Moves(problem.scenario, count_share=self.count_share),
                    [*self.initial, *drawn],
                    self.crossed_share,
                    self.more_moves,
                ),
            )
            evolve(session, algorithm, objectives, seed)

        interrupted = session.run(explore, session.confirm_front)
        return replace(session.result(self.name, seed, interrupted), front=session.front())
