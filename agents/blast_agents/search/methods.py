"""Search methods that need no further library."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice
from math import comb, exp

import numpy as np

from blast_agents.rules import random_layout
from blast_agents.search.moves import Draw, Moves, random_walls
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Element, Layout, Piece
from blast_env.scenario import Placement
from blast_env.values import generator


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
        rng = generator(seed)
        session = SearchSession(problem, budget, Plan.of(problem, budget), report)

        def explore() -> None:
            if self.initial:
                session.assess(self.initial)
            while True:
                session.assess([random_layout(problem.scenario, rng) for _ in range(self.batch)])

        return session.result(self.name, seed, session.run(explore))


@dataclass(frozen=True)
class GreedySearch:
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

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met on the way."""
        rng = generator(seed)
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)

        def explore() -> None:
            placement = Placement.empty(problem.scenario)
            (load,) = session.assess([()]).tolist()
            gains: dict[Element, float] = {}
            while not placement.is_full:
                blasts = session.exploring_left // _still_to_place(placement)
                tried = self._elements(placement, gains, max(1, blasts // plan.threats), rng)
                impulses = session.assess([(*placement.layout, each) for each in tried])
                gains.update(zip(tried, (load - impulses).tolist(), strict=True))
                best = int(np.argmin(impulses))
                if placement.catalogue.has_items:
                    worths = [self._worth(placement, each, gains) for each in tried]
                    best = int(np.argmax(worths))
                placement = placement.place(tried[best])
                load = float(impulses[best])

        return session.result(self.name, seed, session.run(explore))

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
        """Return what to try next, at least one and at most `count`."""
        catalogue = placement.catalogue
        free = [catalogue.element(int(action)) for action in np.flatnonzero(placement.legal)]
        known = sorted(
            (each for each in free if each in gains),
            key=lambda each: -self._worth(placement, each, gains),
        )
        new = [each for each in free if each not in gains]
        promising = known[: max(round(count * self.promising_share), count - len(new))]
        fresh = rng.permutation(len(new))[: count - len(promising)]
        return [*promising, *(new[index] for index in fresh)]


def _still_to_place(placement: Placement) -> int:
    """Return how many modules or pieces may follow, as far as stock and budget tell; one at least.

    Of a catalogue those count that the budget pays for if every item has as large a share of it.
    """
    left, budget = placement.stock_left, placement.budget_left
    if placement.catalogue.has_items and budget is not None:
        costs = [float(own[mask].mean()) for own, mask in _legal_costs(placement)]
        left = min(left, max(1, round(budget / float(np.mean(costs)))))
    return left


def _legal_costs(placement: Placement) -> Iterator[tuple[FloatArray, BoolArray]]:
    """Yield the costs of each variant that may be placed, and where it may."""
    for costs, legal in zip(placement.costs, placement.legal, strict=True):
        if legal.any():
            yield costs, legal


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
        rng = generator(seed)
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
        self, session: SearchSession, layout: Layout, load: float, rng: np.random.Generator
    ) -> None:
        """Go from neighbour to neighbour until the session ends it."""
        moves = Moves(session.problem.scenario)
        scale, begun = load, session.exploring_share
        while True:
            share = (session.exploring_share - begun) / max(1.0 - begun, 1e-9)
            temperature = scale * self.hot * (self.cold / self.hot) ** share
            neighbour = moves.neighbour(layout, rng)
            (neighbour_load,) = session.assess([neighbour]).tolist()
            worse = neighbour_load - load
            if worse <= 0.0 or rng.random() < _likelihood(worse, temperature):
                layout, load = neighbour, neighbour_load


def _likelihood(worse: float, temperature: float) -> float:
    """Return how likely a worse layout is accepted (Metropolis); never when all is cold."""
    return exp(-worse / temperature) if temperature > 0.0 else 0.0


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


def every_layout(problem: LayoutProblem) -> Iterator[Layout]:
    """Yield every legal layout, those with few modules or pieces first."""
    places = _placeable(problem)
    for count in range(min(problem.stock, len(places)) + 1):
        for layout in combinations(places, count):
            if _is_legal(problem, layout):
                yield layout


def _is_legal(problem: LayoutProblem, layout: Layout) -> bool:
    try:
        Placement.of(problem.scenario, layout)
    except LayoutError:
        return False
    return True


def _placeable(problem: LayoutProblem) -> list[Element]:
    """Return everything that there is room for in the empty zone."""
    empty = Placement.empty(problem.scenario)
    actions = np.flatnonzero(empty.places(empty.usable))
    return [empty.catalogue.element(int(action)) for action in actions]


def _count_text(count: int) -> str:
    """Return a count, of which a few digits are enough when it is large."""
    return f"{count:,}" if count < 1_000_000 else f"{count:.3g}"
