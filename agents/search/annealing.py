"""Simulated annealing: one layout that changes little by little, at first also for the worse."""

from dataclasses import dataclass
from math import exp

import numpy as np

from agents.search.method import Report
from agents.search.moves import Draw, Moves, random_walls
from agents.search.plan import Plan
from agents.search.problem import Layout, LayoutProblem
from agents.search.result import SearchResult
from agents.search.session import SearchSession


@dataclass(frozen=True)
class AnnealingSearch:
    """Accepts every better neighbour, and a worse one the less likely the later and the worse.

    It begins with the best of the layouts that the first few blasts show. The temperature falls
    geometrically over the blasts for exploring, so that it is as cold at the end of a small budget
    as of a large one.

    Attributes:
        initial: Layouts to begin with, beside those that are drawn.
        draw: Draws the layouts to begin with.
        starting_share: Share of the exploration that goes into them.
        hot: Temperature at first, as a share of the impulse that it begins with.
        cold: Temperature at the end, likewise.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.15
    hot: float = 0.02
    cold: float = 0.001
    name: str = "annealing"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met on the way."""
        rng = np.random.default_rng(seed)
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)

        def explore() -> None:
            layouts = int(plan.exploring_layouts * self.starting_share)
            drawn = [self.draw(problem.scenario, rng) for _ in range(max(1, layouts))]
            starts = [*self.initial, *drawn]
            impulses = session.assess(starts)
            best = int(np.argmin(impulses))
            self._anneal(session, starts[best], float(impulses[best]), rng)

        return session.result(self.name, seed, session.run(explore))

    def _anneal(
        self, session: SearchSession, layout: Layout, impulse_pa_s: float, rng: np.random.Generator
    ) -> None:
        """Go from neighbour to neighbour until the session ends it."""
        moves = Moves(session.problem.scenario)
        scale_pa_s, begun = impulse_pa_s, session.exploring_share
        while True:
            share = (session.exploring_share - begun) / max(1.0 - begun, 1e-9)
            temperature_pa_s = scale_pa_s * self.hot * (self.cold / self.hot) ** share
            neighbour = moves.neighbour(layout, rng)
            (neighbour_pa_s,) = session.assess([neighbour]).tolist()
            worse_pa_s = neighbour_pa_s - impulse_pa_s
            if worse_pa_s <= 0.0 or rng.random() < _likelihood(worse_pa_s, temperature_pa_s):
                layout, impulse_pa_s = neighbour, neighbour_pa_s


def _likelihood(worse_pa_s: float, temperature_pa_s: float) -> float:
    """Return how likely a worse layout is accepted (Metropolis); never when all is cold."""
    return exp(-worse_pa_s / temperature_pa_s) if temperature_pa_s > 0.0 else 0.0
