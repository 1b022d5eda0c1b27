"""Search methods that need no further library, and others that begin with the rules of thumb."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, islice
from math import comb, exp
from typing import Final

import numpy as np

from blast_agents.rules import random_layout
from blast_agents.search.evolution import GeneticSearch
from blast_agents.search.moves import Draw, Moves, random_walls
from blast_agents.search.problem import LayoutProblem, Report, SearchResult
from blast_agents.search.registry import layouts_by_rule
from blast_agents.search.session import Plan, Search, SearchSession
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Element, Layout, Measure, Piece
from blast_env.scenario import Placement


@dataclass(frozen=True)
class RandomSearch(Search):
    """Tries layouts with every module on a random cell, each independent of the others.

    Attributes:
        initial: Layouts to try first.
        batch: Layouts that are assessed at a time.
    """

    initial: tuple[Layout, ...] = ()
    batch: int = 16
    name: str = "random"

    def explore(self, session: SearchSession) -> None:
        """Try one batch after the other."""
        scenario, rng = session.problem.scenario, session.rng
        if self.initial:
            session.assess(self.initial)
        while True:
            session.assess([random_layout(scenario, rng) for _ in range(self.batch)])


@dataclass(frozen=True)
class GreedySearch(Search):
    """Places every module on the best of the cells that it tries for it, and never moves one.

    With a catalogue it tries pieces in places, and takes the one that takes off most for its cost.

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

    def explore(self, session: SearchSession) -> None:
        """Place one after the other until nothing more may be placed."""
        placement = Placement.empty(session.problem.scenario)
        (load,) = session.assess([()]).tolist()
        gains: dict[Element, float] = {}
        while not placement.is_full:
            blasts = session.exploring_left // _still_to_place(placement)
            count = max(1, blasts // session.plan.threats)
            tried = self._elements(placement, gains, count, session.rng)
            impulses = session.assess([(*placement.layout, each) for each in tried])
            gains.update(zip(tried, (load - impulses).tolist(), strict=True))
            best = int(np.argmin(impulses))
            if placement.catalogue.has_items:
                worths = [self._worth(placement, each, gains) for each in tried]
                best = int(np.argmax(worths))
            placement = placement.place(tried[best])
            load = float(impulses[best])

    @staticmethod
    def _worth(placement: Placement, element: Element, gains: dict[Element, float]) -> float:
        """Return what something took off when it was tried last; with a catalogue, for its cost."""
        if not isinstance(element, Piece):
            return gains[element]
        number = placement.catalogue.variant_number(element)
        return gains[element] / float(placement.costs[number, element.row, element.column])

    def _elements(
        self,
        placement: Placement,
        gains: dict[Element, float],
        count: int,
        rng: np.random.Generator,
    ) -> list[Element]:
        """Return what to try next: so many pieces or modules, and all measures not tried yet.

        A measure takes no blast of its own.
        """
        catalogue = placement.catalogue
        free = [catalogue.element(int(action)) for action in np.flatnonzero(placement.legal)]
        known = sorted(
            (each for each in free if each in gains),
            key=lambda each: -self._worth(placement, each, gains),
        )
        unknown = [each for each in free if each not in gains]
        measures = [each for each in unknown if isinstance(each, Measure)]
        new = [each for each in unknown if not isinstance(each, Measure)]
        promising = known[: max(round(count * self.promising_share), count - len(new))]
        fresh = rng.permutation(len(new))[: count - len(promising)]
        return [*promising, *(new[index] for index in fresh), *measures]


def _still_to_place(placement: Placement) -> int:
    """Return how many modules or pieces may follow, as far as stock and budget tell; one at least.

    Of a catalogue those count that the budget pays for if every item has as large a share of it.
    """
    left, budget = placement.stock_left, placement.budget_left
    if placement.catalogue.has_items and budget is not None:
        both = zip(placement.costs, placement.legal, strict=True)
        costs = [float(own[legal].mean()) for own, legal in both if legal.any()]
        left = min(left, max(1, round(budget / float(np.mean(costs)))))
    return left


@dataclass(frozen=True)
class AnnealingSearch(Search):
    """Accepts every better neighbour, and a worse one the less likely the later and the worse.

    It begins with the best of the layouts that the first few blasts show. The temperature falls
    geometrically over the blasts for exploring, so that it is as cold at the end of a small budget
    as of a large one.

    Attributes:
        initial: Layouts to begin with, beside those that are drawn.
        draw: Draws the layouts to begin with.
        starting_share: Share of the exploration that goes into them.
        hot: Temperature at first, as a share of the impulse that it begins with.
        cold: Temperature at the end, as the same share.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.15
    hot: float = 0.02
    cold: float = 0.001
    name: str = "annealing"

    def explore(self, session: SearchSession) -> None:
        """Draw some layouts, and go from the best of them from neighbour to neighbour."""
        scenario, rng = session.problem.scenario, session.rng
        count = int(session.plan.exploring_layouts * self.starting_share)
        starts = [*self.initial, *(self.draw(scenario, rng) for _ in range(max(1, count)))]
        loads = session.assess(starts)
        best = int(np.argmin(loads))
        layout, load = starts[best], float(loads[best])
        moves, cooling = Moves(scenario), Cooling(session, load, self.hot, self.cold)
        while load > 0.0:
            temperature = cooling.temperature
            neighbour = moves.neighbour(layout, rng)
            (neighbour_load,) = session.assess([neighbour]).tolist()
            worse = neighbour_load - load
            # Metropolis
            if worse <= 0.0 or rng.random() < exp(-worse / temperature):
                layout, load = neighbour, neighbour_load


class Cooling:
    """The temperature, which falls geometrically over the blasts for exploring that are left.

    Args:
        session: Knows how many are spent.
        scale: The load that `hot` and `cold` are shares of.
        hot: Temperature now.
        cold: Temperature at the end.
    """

    def __init__(self, session: SearchSession, scale: float, hot: float, cold: float) -> None:
        self._session, self._scale, self._hot, self._cold = session, scale, hot, cold
        self._begun = session.exploring_share

    @property
    def share(self) -> float:
        """Share of the way from hot to cold."""
        return (self._session.exploring_share - self._begun) / max(1.0 - self._begun, 1e-9)

    @property
    def temperature(self) -> float:
        """The temperature, in the unit of the load."""
        temperature: float = self._scale * self._hot * (self._cold / self._hot) ** self.share
        return temperature


_LEAST_WALKERS: Final = 3
_MOST_WALKERS: Final = 16


@dataclass(frozen=True)
class WinnersSearch(Search):
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
        cold: Temperature at the end, as the same share.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.25
    exchanges: int = 8
    exchanged_share: float = 0.34
    hot: float = 0.02
    cold: float = 0.001
    name: str = "winners"

    def explore(self, session: SearchSession) -> None:
        """Draw some layouts, and let walkers go from the best of them."""
        scenario, rng, plan = session.problem.scenario, session.rng, session.plan
        walkers = round(0.4 * plan.exploring_layouts**0.5)
        walkers = int(np.clip(walkers, _LEAST_WALKERS, _MOST_WALKERS))
        count = max(walkers, round(self.starting_share * plan.exploring_layouts))
        count = max(count - len(self.initial), 0)
        session.assess([*self.initial, *(self.draw(scenario, rng) for _ in range(count))])
        self._walk(session, session.ranked(plan.threats)[:walkers])

    def _walk(self, session: SearchSession, layouts: list[Layout]) -> None:
        """Let walkers go from neighbour to neighbour until the session ends it."""
        moves, rng, exchanged = Moves(session.problem.scenario), session.rng, 0
        loads = session.assess(layouts)
        cooling = Cooling(session, float(loads.min()), self.hot, self.cold)
        while loads.min() > 0.0:
            share, temperature = cooling.share, cooling.temperature
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


@dataclass(frozen=True)
class ExhaustiveSearch(Search):
    """Tries every layout under every threat, the empty one among them; nothing is drawn.

    Attributes:
        batch: Layouts that are assessed at a time.
    """

    batch: int = 64
    name: str = "exhaustive"

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Let every layout meet every threat.

        Raises:
            BlastEnvError: If the budget does not pay for all layouts.
        """
        places = len(_placeable(problem))
        counts = range(min(problem.stock, places) + 1)
        layouts = sum(comb(places, count) for count in counts)
        blasts = layouts * len(problem.threats)
        if blasts > budget:
            what = "places of pieces" if problem.scenario.zone.items else "usable cells"
            raise BlastEnvError(
                f"{problem.scenario.name} has up to {_count_text(layouts)} layouts ({places} "
                f"{what}, stock {problem.stock}), which take {_count_text(blasts)} blasts; the "
                f"budget is {budget}: exhaustive search is for small instances"
            )
        return Plan.thorough(problem, budget)

    def explore(self, session: SearchSession) -> None:
        """Try one batch after the other."""
        layouts = every_layout(session.problem)
        while batch := list(islice(layouts, self.batch)):
            session.assess(batch)


def every_layout(problem: LayoutProblem) -> Iterator[Layout]:
    """Yield every legal layout, those with few modules or pieces first."""
    places = _placeable(problem)
    for count in range(min(problem.stock, len(places)) + 1):
        for layout in combinations(places, count):
            with suppress(LayoutError):
                Placement.of(problem.scenario, layout)
                yield layout


def _placeable(problem: LayoutProblem) -> list[Element]:
    """Return everything that there is room for in the empty zone."""
    empty = Placement.empty(problem.scenario)
    actions = np.flatnonzero(empty.places(empty.usable))
    return [empty.catalogue.element(int(action)) for action in actions]


def _count_text(count: int) -> str:
    """Return a count, of which a few digits are enough when it is large."""
    return f"{count:,}" if count < 1_000_000 else f"{count:.3g}"


@dataclass(frozen=True)
class BestRuleSearch(Search):
    """Lets the layouts of all rules meet the threats, and takes the best: a careful engineer.

    Of as many rules as the budget pays for; there are at most nine. Against a hidden charge each
    meets all threats if the budget lasts.
    """

    name: str = "best_rule"

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Let each layout meet as many threats as the budget pays for."""
        layouts = len(_layouts(problem))
        return Plan(max(1, min(len(problem.threats), budget // layouts)), budget)

    def explore(self, session: SearchSession) -> None:
        """Try all of them."""
        session.assess(_layouts(session.problem))


@dataclass(frozen=True)
class FromRulesSearch:
    """Lets another search begin with the layouts of all rules.

    Attributes:
        method: The other search.
    """

    method: AnnealingSearch | GeneticSearch | WinnersSearch

    @property
    def name(self) -> str:
        """Name of the other one, and that it begins with the rules."""
        return f"{self.method.name}_from_rules"

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return what the other search finds."""
        method = replace(self.method, initial=_layouts(problem))
        return replace(method.propose(problem, budget, seed, report), method=self.name)


ANNEALING_FROM_RULES: Final = FromRulesSearch(AnnealingSearch())
WINNERS_FROM_RULES: Final = FromRulesSearch(WinnersSearch())
GENETIC_FROM_RULES: Final = FromRulesSearch(GeneticSearch())


def _layouts(problem: LayoutProblem) -> tuple[Layout, ...]:
    """Return the rules' layouts, each once."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.told).values()))
