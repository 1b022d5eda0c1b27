"""Search methods without further libraries, and searches that start from the rules of thumb."""

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


@dataclass(frozen=True)
class GreedySearch(Search):
    """Places one module after the other on the best candidate cell, and never moves one.

    With a catalogue, the candidates are pieces in their places, and the one with the largest
    reduction of the load per cost is placed.

    With enough blasts every cell is a candidate. With fewer, the remaining blasts are divided
    evenly among the remaining modules. Half of the candidates are the cells with the largest
    reduction in their last trial, because the reduction by a cell rarely grows as others are
    occupied. The others are drawn among untried cells.

    A module is placed even if no candidate reduces the load: two may help where one does not. The
    best layout on the way is kept in any case.

    Attributes:
        promising_share: Share of the candidates chosen by their last trial.
    """

    promising_share: float = 0.5
    name: str = "greedy"

    def explore(self, session: SearchSession) -> None:
        """Place one element after the other until no more may be placed."""
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
        """Return the last reduction by an element; for a piece, the reduction per cost."""
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
        """Return `count` candidate pieces or modules, and all untried measures.

        A measure needs no blast.
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
    """Return the number of modules or pieces that stock and budget still allow, at least one.

    With a catalogue, the budget is divided by the mean cost of its items.
    """
    left, budget = placement.stock_left, placement.budget_left
    if placement.catalogue.has_items and budget is not None:
        both = zip(placement.costs, placement.legal, strict=True)
        costs = [float(own[legal].mean()) for own, legal in both if legal.any()]
        left = min(left, max(1, round(budget / float(np.mean(costs)))))
    return left


@dataclass(frozen=True)
class AnnealingSearch(Search):
    """Simulated annealing: accepts better neighbours, and worse ones by Metropolis's rule.

    It starts from the best of some initial layouts. The temperature falls geometrically over the
    exploring blasts, so that the final temperature does not depend on the budget.

    Attributes:
        initial: Initial layouts, in addition to random ones.
        draw: Draws the random initial layouts.
        starting_share: Share of the exploration spent on random initial layouts.
        hot: Initial temperature, relative to the load of the initial layout.
        cold: Final temperature, relative to the same load.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_walls
    starting_share: float = 0.15
    hot: float = 0.02
    cold: float = 0.001
    name: str = "annealing"

    def explore(self, session: SearchSession) -> None:
        """Draw initial layouts, and anneal from the best of them."""
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
        temperature: float = self._scale * self._hot * (self._cold / self._hot) ** self.share
        return temperature


_LEAST_WALKERS: Final = 3
_MOST_WALKERS: Final = 16


@dataclass(frozen=True)
class WinnersSearch(Search):
    """Anneals several layouts in parallel; at intervals the worst walkers restart from the best.

    Each walker accepts better neighbours, and worse ones by Metropolis's rule. Single runs of
    annealing end in different minima; the exchange continues the good ones. The number of walkers
    grows with the square root of the layouts that the budget pays for.

    Attributes:
        initial: Initial layouts, in addition to random ones.
        draw: Draws the random initial layouts.
        starting_share: Share of the exploration spent on initial layouts.
        exchanges: Number of exchanges.
        exchanged_share: Share of the walkers that restart from the best ones at an exchange.
        hot: Initial temperature, relative to the load of the best initial walker.
        cold: Final temperature, relative to the same load.
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
        """Draw initial layouts, and let walkers start from the best of them."""
        scenario, rng, plan = session.problem.scenario, session.rng, session.plan
        walkers = round(0.4 * plan.exploring_layouts**0.5)
        walkers = int(np.clip(walkers, _LEAST_WALKERS, _MOST_WALKERS))
        count = max(walkers, round(self.starting_share * plan.exploring_layouts))
        count = max(count - len(self.initial), 0)
        session.assess([*self.initial, *(self.draw(scenario, rng) for _ in range(count))])
        self._walk(session, session.ranked(plan.threats)[:walkers])

    def _walk(self, session: SearchSession, layouts: list[Layout]) -> None:
        """Let walkers move from neighbour to neighbour until the session ends."""
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
    """Assesses every layout, the empty one included, under every threat; it is deterministic.

    Attributes:
        batch: Layouts per batch.
    """

    batch: int = 64
    name: str = "exhaustive"

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Plan every threat for every layout.

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
        """Assess all layouts in batches."""
        layouts = every_layout(session.problem)
        while batch := list(islice(layouts, self.batch)):
            session.assess(batch)


def every_layout(problem: LayoutProblem) -> Iterator[Layout]:
    """Yield every legal layout, in ascending number of modules or pieces."""
    places = _placeable(problem)
    for count in range(min(problem.stock, len(places)) + 1):
        for layout in combinations(places, count):
            with suppress(LayoutError):
                Placement.of(problem.scenario, layout)
                yield layout


def _placeable(problem: LayoutProblem) -> list[Element]:
    """Return all elements that fit into the empty zone."""
    empty = Placement.empty(problem.scenario)
    actions = np.flatnonzero(empty.places(empty.usable))
    return [empty.catalogue.element(int(action)) for action in actions]


def _count_text(count: int) -> str:
    """Return a count as text, with three digits from a million on."""
    return f"{count:,}" if count < 1_000_000 else f"{count:.3g}"


@dataclass(frozen=True)
class BestRuleSearch(Search):
    """Simulates the layouts of all rules and takes the best, as a careful engineer would.

    The budget limits the rules, of which there are at most nine, and then the threats per layout.
    """

    name: str = "best_rule"

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Plan as many threats per layout as the budget pays for, at least one."""
        layouts = len(_layouts(problem))
        return Plan(max(1, min(len(problem.threats), budget // layouts)), budget)

    def explore(self, session: SearchSession) -> None:
        """Assess the layouts of all rules."""
        session.assess(_layouts(session.problem))


@dataclass(frozen=True)
class FromRulesSearch:
    """Starts a search from the layouts of all rules.

    Attributes:
        method: The search.
    """

    method: AnnealingSearch | GeneticSearch | WinnersSearch

    @property
    def name(self) -> str:
        """Name of the search with the suffix `_from_rules`."""
        return f"{self.method.name}_from_rules"

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the result of the search."""
        method = replace(self.method, initial=_layouts(problem))
        return replace(method.propose(problem, budget, seed, report), method=self.name)


ANNEALING_FROM_RULES: Final = FromRulesSearch(AnnealingSearch())
WINNERS_FROM_RULES: Final = FromRulesSearch(WinnersSearch())
GENETIC_FROM_RULES: Final = FromRulesSearch(GeneticSearch())


def _layouts(problem: LayoutProblem) -> tuple[Layout, ...]:
    """Return the distinct layouts of the rules."""
    return tuple(dict.fromkeys(layouts_by_rule(problem.scenario, problem.told).values()))
