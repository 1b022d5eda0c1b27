"""NSGA-II with pymoo: the front of impulse against number of modules."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.nsga2 import NSGA2

from agents.search.evolution import evolve, operators, population_size
from agents.search.method import Report
from agents.search.moves import Draw, Moves, random_part
from agents.search.plan import Plan
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession


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
