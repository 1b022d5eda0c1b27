"""Greedy search: module after module on the cell that takes off most."""

from dataclasses import dataclass

import numpy as np

from agents.search.method import Report
from agents.search.plan import Plan
from agents.search.problem import LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession
from blast_env.scenario import Cell, Placement


@dataclass(frozen=True)
class GreedySearch:
    """Places every module on the best of the cells that it tries for it, and never moves one.

    With enough blasts it tries every cell. With fewer it divides what is left evenly among the
    modules that are left to place. Half of the cells that it tries are those that took off most
    when they were tried last: what a cell takes off rarely becomes more when others are taken. The
    others are drawn among those that were never tried.

    A module is placed even if none of the tried cells takes anything off: two may help where one
    does not. What was best on the way is kept all the same.

    Attributes:
        promising_share: Share of the tried cells that were good before.
    """

    promising_share: float = 0.5
    name: str = "greedy"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met on the way."""
        rng = np.random.default_rng(seed)
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)

        def explore() -> None:
            placement = Placement.empty(problem.scenario)
            (impulse_pa_s,) = session.assess([()]).tolist()
            gains_pa_s: dict[Cell, float] = {}
            while not placement.is_full:
                blasts = session.exploring_left // placement.stock_left
                tried = self._cells(placement, gains_pa_s, max(1, blasts // plan.threats), rng)
                impulses = session.assess([(*placement.cells, cell) for cell in tried])
                gains_pa_s.update(zip(tried, (impulse_pa_s - impulses).tolist(), strict=True))
                best = int(np.argmin(impulses))
                placement = placement.place(tried[best])
                impulse_pa_s = float(impulses[best])

        return session.result(self.name, seed, session.run(explore))

    def _cells(
        self,
        placement: Placement,
        gains_pa_s: dict[Cell, float],
        count: int,
        rng: np.random.Generator,
    ) -> list[Cell]:
        """Return cells to try for the next module, at least one and at most `count`."""
        free = [(int(row), int(column)) for row, column in np.argwhere(placement.free)]
        known = sorted((cell for cell in free if cell in gains_pa_s), key=lambda c: -gains_pa_s[c])
        new = [cell for cell in free if cell not in gains_pa_s]
        promising = known[: max(round(count * self.promising_share), count - len(new))]
        fresh = rng.permutation(len(new))[: count - len(promising)]
        return [*promising, *(new[index] for index in fresh)]
