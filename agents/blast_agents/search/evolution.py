"""Genetic search and NSGA-II on pymoo, which is imported when one of them runs."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_agents.search.moves import Draw, Moves, random_part, random_walls
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_env.geometry import Layout
from blast_env.values import generator

_LEAST_POPULATION: Final = 6


_MOST_POPULATION: Final = 60


def population_size(layouts: int) -> int:
    """Return the size of a population for a search that can try so many layouts.

    It grows with the square root: twice the layouts, 1.4 times the population and the generations.
    """
    return int(np.clip(round(0.7 * layouts**0.5), _LEAST_POPULATION, _MOST_POPULATION))


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
        """Return the best layout that was found.

        Raises:
            MissingExtraError: If the extra `search` is not installed.
        """
        # Here, because the other methods need no extra.
        from blast_agents.search.operators import GA, evolve, operators

        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        size = population_size(plan.exploring_layouts)
        rng = generator(seed)

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

    Those are the impulse and the number of modules or, with a catalogue, the cost. The result
    carries the front: what each further module, or all further spending, is worth. Its best
    layout is the end of the front with the least impulse.

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
        """Return the front, and the layout with the least impulse.

        Raises:
            MissingExtraError: If the extra `search` is not installed.
        """
        # Here, because the other methods need no extra.
        from blast_agents.search.operators import NSGA2, evolve, operators

        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        size = 2 * population_size(plan.exploring_layouts)
        rng = generator(seed)

        def objectives(layouts: list[Layout]) -> NDArray[np.float64]:
            prices = [problem.price(each) for each in layouts]
            return np.column_stack([session.assess(layouts), prices])

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
