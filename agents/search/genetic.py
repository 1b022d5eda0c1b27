"""Genetic search with pymoo: layouts are crossed and changed, and the best survive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA

from agents.search.evolution import evolve, operators, population_size
from agents.search.method import Report
from agents.search.moves import Draw, Moves, random_walls
from agents.search.plan import Plan
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession


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
