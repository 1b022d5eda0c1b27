"""One of pymoo's evolutionary algorithms at work on layouts."""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination

from agents.search.moves import Moves
from agents.search.problem import Layout
from agents.search.pymoo_operators import (
    LayoutRepair,
    MoveMutation,
    SpatialCrossover,
    individual,
    layout_of,
)
from agents.search.session import SearchSession
from blast_env.scenario import Placement

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
