"""Exhaustive search: every layout there is, for instances small enough to know the optimum."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice
from math import comb

import numpy as np

from agents.search.method import Report
from agents.search.plan import Plan
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.scenario import Cell, Placement


@dataclass(frozen=True)
class ExhaustiveSearch:
    """Tries every layout under every threat, the empty one among them; nothing is drawn.

    Attributes:
        batch: Layouts that are assessed at a time.
    """

    batch: int = 64
    name: str = "exhaustive"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the optimum.

        Raises:
            BlastEnvError: If the budget does not pay for all layouts; none is tried then.
        """
        self._check(problem, budget)
        session = SearchSession(problem, budget, Plan.thorough(problem, budget), report)

        def explore() -> None:
            layouts = every_layout(problem)
            while batch := list(islice(layouts, self.batch)):
                session.assess(batch)

        return session.result(self.name, seed, session.run(explore))

    def _check(self, problem: LayoutProblem, budget: int) -> None:
        cells = len(_usable(problem))
        layouts = sum(comb(cells, modules) for modules in range(min(problem.stock, cells) + 1))
        blasts = layouts * len(problem.threats)
        if blasts > budget:
            raise BlastEnvError(
                f"{problem.scenario.name} has up to {_count_text(layouts)} layouts ({cells} usable "
                f"cells, stock {problem.stock}), which take {_count_text(blasts)} blasts; the "
                f"budget is {budget}: exhaustive search is for small instances"
            )


def every_layout(problem: LayoutProblem) -> Iterator[Layout]:
    """Yield every legal layout, those with few modules first."""
    cells = _usable(problem)
    for modules in range(min(problem.stock, len(cells)) + 1):
        for layout in combinations(cells, modules):
            if _is_legal(problem, layout):
                yield layout


def _is_legal(problem: LayoutProblem, layout: Layout) -> bool:
    try:
        Placement.of(problem.scenario, layout)
    except LayoutError:
        return False
    return True


def _usable(problem: LayoutProblem) -> list[Cell]:
    cells = np.argwhere(Placement.empty(problem.scenario).usable)
    return [(int(row), int(column)) for row, column in cells]


def _count_text(count: int) -> str:
    """Return a count, of which a few digits are enough when it is large."""
    return f"{count:,}" if count < 1_000_000 else f"{count:.3g}"
