"""Random search: what any other method has to beat at equal cost."""

from dataclasses import dataclass

import numpy as np

from agents.random_layouts import random_layout
from agents.search.method import Report
from agents.search.plan import Plan
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession


@dataclass(frozen=True)
class RandomSearch:
    """Tries layouts with every module on a random cell, each independent of the others.

    Attributes:
        initial: Layouts to try first.
        batch: Layouts that are assessed at a time.
    """

    initial: tuple[Layout, ...] = ()
    batch: int = 16
    name: str = "random"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best of as many random layouts as the budget pays for."""
        rng = np.random.default_rng(seed)
        session = SearchSession(problem, budget, Plan.of(problem, budget), report)

        def explore() -> None:
            if self.initial:
                session.assess(self.initial)
            while True:
                session.assess([random_layout(problem.scenario, rng) for _ in range(self.batch)])

        return session.result(self.name, seed, session.run(explore))
