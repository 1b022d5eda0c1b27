"""Annealing by several walkers of which the winners go on: go with the winners."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_agents.search.moves import Draw, Moves, random_walls
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_env.geometry import Layout
from blast_env.values import generator

_LEAST_WALKERS: Final = 3


_MOST_WALKERS: Final = 16


@dataclass(frozen=True)
class WinnersSearch:
    """Anneals several layouts side by side; from time to time the best take the worst ones' places.

    Each walker accepts every better neighbour, and a worse one the less likely the later and the
    worse. Single runs of annealing end in different places; of several the good ones are gone on
    from. The number of walkers grows with the square root of the layouts that the budget pays for.

    Attributes:
        initial: Layouts to begin with, beside those that are drawn.
        draw: Draws the layouts to begin with.
        starting_share: Share of the exploration that goes into them.
        exchanges: How often walkers are exchanged.
        exchanged_share: Share of the walkers that go on from the best ones' places then.
        hot: Temperature at first, as a share of the load that the best walker begins with.
        cold: Temperature at the end, likewise.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.25
    exchanges: int = 8
    exchanged_share: float = 0.34
    hot: float = 0.02
    cold: float = 0.001
    name: str = "winners"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met on the way."""
        rng = generator(seed)
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        walkers = round(0.4 * plan.exploring_layouts**0.5)
        walkers = int(np.clip(walkers, _LEAST_WALKERS, _MOST_WALKERS))

        def explore() -> None:
            count = max(walkers, round(self.starting_share * plan.exploring_layouts))
            count = max(count - len(self.initial), 0)
            session.assess(
                [*self.initial, *(self.draw(problem.scenario, rng) for _ in range(count))]
            )
            self._walk(session, session.ranked(plan.threats)[:walkers], rng)

        return session.result(self.name, seed, session.run(explore))

    def _walk(
        self, session: SearchSession, layouts: list[Layout], rng: np.random.Generator
    ) -> None:
        """Let walkers go from neighbour to neighbour until the session ends it."""
        moves = Moves(session.problem.scenario)
        loads = session.assess(layouts)
        scale, begun, exchanged = float(loads.min()), session.exploring_share, 0
        while True:
            share = (session.exploring_share - begun) / max(1.0 - begun, 1e-9)
            temperature = scale * self.hot * (self.cold / self.hot) ** share
            neighbours = [moves.neighbour(layout, rng) for layout in layouts]
            worse = session.assess(neighbours) - loads
            accepted = rng.random(len(layouts)) < np.exp(-np.maximum(worse, 0.0) / temperature)
            for index in np.flatnonzero(accepted).tolist():
                layouts[index] = neighbours[index]
                loads[index] += worse[index]
            if int(share * (self.exchanges + 1)) > exchanged:
                exchanged += 1
                order = np.argsort(loads, kind="stable")
                for rank in range(int(self.exchanged_share * len(layouts))):
                    winner, loser = int(order[rank]), int(order[-1 - rank])
                    layouts[loser], loads[loser] = layouts[winner], loads[winner]
