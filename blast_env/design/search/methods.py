"""Search methods without further libraries."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.design.search.by_rule import rule_layouts
from blast_env.design.search.moves import Draw, Moves, random_walls
from blast_env.design.search.session import Plan, Search, SearchSession
from blast_env.evaluation import DesignProblem
from blast_env.geometry import Layout
from blast_env.rules import random_layout


@dataclass(frozen=True)
class RandomSearch(Search):
    """Assesses independent layouts whose modules lie on random cells.

    Attributes:
        initial: Layouts to assess first.
        batch: Layouts per batch.
    """

    initial: tuple[Layout, ...] = ()
    batch: int = 16
    name: str = "random"

    def explore(self, session: SearchSession) -> None:
        """Assess batches of random layouts."""
        scenario, rng = session.problem.scenario, session.rng
        if self.initial:
            session.assess(self.initial)
        while True:
            session.assess([random_layout(scenario, rng) for _ in range(self.batch)])


class Cooling:
    """The temperature, which falls geometrically over the remaining exploring blasts.

    Args:
        session: Counts the blasts.
        scale: The load to which `hot` and `cold` are relative, in the unit of the objective.
        hot: Initial temperature, relative to `scale`.
        cold: Final temperature, relative to `scale`.
    """

    def __init__(self, session: SearchSession, scale: float, hot: float, cold: float) -> None:
        self._session, self._scale, self._hot, self._cold = session, scale, hot, cold
        self._begun = session.exploring_share

    @property
    def share(self) -> float:
        """Share of the cooling that is done, from 0 (hot) to 1 (cold)."""
        return (self._session.exploring_share - self._begun) / max(1.0 - self._begun, 1e-9)

    @property
    def temperature(self) -> float:
        """The temperature, in the unit of the load."""
        # Geometric: equal shares of the budget lower the temperature by equal factors.
        temperature: float = self._scale * self._hot * (self._cold / self._hot) ** self.share
        return temperature


_LEAST_WALKERS: Final = 3
_MOST_WALKERS: Final = 16
_LEAST_MOVES: Final = 8


@dataclass(frozen=True)
class PopulationAnnealingSearch(Search):
    """Anneals several layouts in parallel; at intervals the worst walkers restart from the best.

    Each walker accepts better neighbours, and worse ones by Metropolis's rule. Single runs of
    annealing end in different minima; the exchange continues the good ones. The number of walkers
    grows with the square root of the layouts that the budget pays for.

    Attributes:
        initial: Initial layouts, in addition to those of the rules and random ones.
        from_rules: Whether the layouts of the rules are among the initial ones.
        draw: Draws the random initial layouts.
        starting_share: Share of the exploration spent on initial layouts.
        exchanged_share: Share of the walkers that restart from the best ones at an exchange.
        hot: Initial temperature, relative to the load of the best initial walker.
        cold: Final temperature, relative to the same load.
        width: Number of blasts that can run at the same time: the number of walkers is rounded up
            to as many as they keep at work, as far as each makes eight moves.
    """

    initial: tuple[Layout, ...] = ()
    from_rules: bool = True
    draw: Draw = random_walls
    starting_share: float = 0.25
    exchanges: int = 8
    exchanged_share: float = 0.34
    hot: float = 0.02
    cold: float = 0.001
    width: int = 1
    name: str = "population_annealing"

    def explore(self, session: SearchSession) -> None:
        """Draw initial layouts, and let walkers start from the best of them."""
        scenario, rng, plan = session.problem.scenario, session.rng, session.plan
        # (1) Initial layouts: given ones, the rules', random ones; (2) the best of them become
        # walkers; (3) walk.
        walkers = round(0.4 * plan.exploring_layouts**0.5)
        walkers = int(np.clip(walkers, _LEAST_WALKERS, _MOST_WALKERS))
        wide = min(-(-self.width // plan.threats), plan.exploring_layouts // _LEAST_MOVES)
        walkers = -(-walkers // max(wide, 1)) * max(wide, 1)
        count = max(walkers, round(self.starting_share * plan.exploring_layouts))
        initial = [*self.initial, *(rule_layouts(session.problem) if self.from_rules else ())]
        count = max(count - len(initial), 0)
        session.assess([*initial, *(self.draw(scenario, rng) for _ in range(count))])
        self._walk(session, session.ranked(plan.threats)[:walkers])

    def _walk(self, session: SearchSession, layouts: list[Layout]) -> None:
        """Let walkers move from neighbour to neighbour until the session ends."""
        moves, rng, exchanged = Moves(session.problem.scenario), session.rng, 0
        loads = session.assess(layouts)
        cooling = Cooling(session, float(loads.min()), self.hot, self.cold)
        while loads.min() > 0.0:
            share, temperature = cooling.share, cooling.temperature
            # 1. One neighbour per walker, blasted in one batch.
            neighbours = [moves.neighbour(layout, rng) for layout in layouts]
            worse = session.assess(neighbours) - loads
            # 2. Metropolis and others 1953: accept with probability min(1, exp(-worse / T)).
            accepted = rng.random(len(layouts)) < np.exp(-np.maximum(worse, 0.0) / temperature)
            for index in np.flatnonzero(accepted).tolist():
                layouts[index] = neighbours[index]
                loads[index] += worse[index]
            # 3. At equal intervals of the budget the worst walkers restart from the best ones, rank
            # by rank.
            if int(share * (self.exchanges + 1)) > exchanged:
                exchanged += 1
                order = np.argsort(loads, kind="stable")
                for rank in range(int(self.exchanged_share * len(layouts))):
                    better, worst = int(order[rank]), int(order[-1 - rank])
                    layouts[worst], loads[worst] = layouts[better], loads[better]


@dataclass(frozen=True)
class BestRuleSearch(Search):
    """Simulates the layouts of all rules and takes the best, as a careful engineer would.

    The budget limits the rules, of which there are at most nine, and then the threats per layout.
    """

    name: str = "best_rule"

    def plan(self, problem: DesignProblem, budget: int) -> Plan:
        """Plan as many threats per layout as the budget pays for, at least one."""
        layouts = len(rule_layouts(problem))
        # Few rules: what is left of the budget buys more threats for each, not more layouts.
        return Plan(max(1, min(len(problem.threats), budget // layouts)), budget)

    def explore(self, session: SearchSession) -> None:
        """Assess the layouts of all rules."""
        session.assess(rule_layouts(session.problem))
