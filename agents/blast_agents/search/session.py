"""The driver of all searches: the plan for a budget, and the account of what blasts have shown."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Final

import numpy as np

from blast_agents.search.problem import Candidate, LayoutProblem, Progress, Report, SearchResult
from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.scenario.placement import met_by_blasts
from blast_env.values import generator

LAYOUTS_PER_REALISATION: Final = 500
"""A known charge is met with one fan and air more for so many layouts that the budget pays for."""

CHARGES_PER_ROOT_BLAST: Final = 0.3
"""Of a hidden charge's places a layout meets so many times the square root of the budget."""

CONFIRMED_LAYOUTS: Final = 32
"""Layouts of which the blasts that are held back can pay for all threats."""

MOST_CONFIRMING_SHARE: Final = 0.2
"""Largest share of the budget that is held back to let the best layouts meet more threats."""


@dataclass(frozen=True)
class Plan:
    """How a search divides its blasts.

    Attributes:
        threats: How many threats a layout meets while the search explores.
        exploring_blasts: How many blasts it spends on exploring.
    """

    threats: int
    exploring_blasts: int

    @property
    def exploring_layouts(self) -> int:
        """How many layouts it can try, at least one."""
        return max(1, self.exploring_blasts // self.threats)

    @classmethod
    def of(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan for a budget.

        A layout's impulse differs little from one fan and air to the next, less than layouts do
        from each other: against a known charge it pays to try many layouts under one threat each,
        and to find out the lucky ones among the best at the end. It differs much from one place of
        the charge to the next: what stands well against one may do nothing against the others, so
        that against a hidden charge layouts meet several places from the start.
        """
        most = len(problem.threats)
        if len({threat.charge for threat in problem.threats}) == 1:
            wanted = budget // LAYOUTS_PER_REALISATION
        else:
            wanted = round(CHARGES_PER_ROOT_BLAST * budget**0.5)
        threats = max(1, min(wanted, most, budget))
        if threats == most:
            return cls.thorough(problem, budget)
        held_back = min(CONFIRMED_LAYOUTS * most, int(MOST_CONFIRMING_SHARE * budget))
        return cls(threats, budget - held_back)

    @classmethod
    def thorough(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan by which every layout meets every threat at once."""
        return cls(len(problem.threats), budget)


_MOST_REPEATS: Final = 300
"""Questions in a row without a new blast after which there is nothing new to be found."""


class SearchEndedError(Exception):
    """The blasts that a search may spend are spent, or it finds nothing new to spend them on."""


class SearchSession:
    """Lets a method ask what layouts are worth, within its budget.

    A layout meets the threats in their order: first some of them, later perhaps more, never one
    twice. Of two layouts the one that has met more threats counts as the better known one and
    goes before; with as many threats, the one with less load.

    Args:
        problem: What is minimised.
        budget: Most blasts that may be spent.
        plan: How many threats a layout meets at first, and what is held back for the others.
        report: Is told after every batch how far the search has come.
        seed: Decides everything that is drawn.

    Attributes:
        rng: Draws it.
        blasts: Blasts spent: distinct pairs of layout and threat that were asked for.

    Raises:
        BlastEnvError: If the budget is below 1.
    """

    def __init__(
        self,
        problem: LayoutProblem,
        budget: int,
        plan: Plan,
        report: Report | None = None,
        seed: int = 0,
    ) -> None:
        if budget < 1:
            raise BlastEnvError(f"budget is {budget} blasts, must be at least 1")
        self.problem = problem
        self.plan = plan
        self.seed = seed
        self.rng = generator(seed)
        self.blasts = 0
        self._budget = budget
        self._limit = min(plan.exploring_blasts, budget)
        self._report = report
        self._known: dict[Layout, tuple[float, ...]] = {}
        self._met: set[tuple[Layout, int]] = set()
        self._history: list[Candidate] = []
        self._repeats = 0

    @property
    def best(self) -> Candidate | None:
        """The best layout so far."""
        return self._history[-1] if self._history else None

    @property
    def exploring_left(self) -> int:
        """How many of the blasts for exploring are left."""
        return max(0, self._limit - self.blasts)

    @property
    def exploring_share(self) -> float:
        """Share of the blasts for exploring that is spent."""
        return self.blasts / self._limit

    def run(self, explore: Callable[[], None], choose: Callable[[], None]) -> bool:
        """Explore until the blasts for it are spent, then let the best meet more threats.

        Args:
            explore: Asks `assess` until it is through or `SearchEndedError` comes.
            choose: Does the same with what was held back.

        Returns:
            Whether it was interrupted.
        """
        try:
            self._until_ended(explore)
            self._limit = self._budget
            self._until_ended(choose)
        except KeyboardInterrupt:
            return True
        return False

    def assess(self, layouts: Sequence[Layout], threats: int | None = None) -> FloatArray:
        """Return the load with layouts under the first threats, in the objective's unit (layouts,).

        Args:
            layouts: Legal layouts.
            threats: How many threats; what the plan says for exploring unless given.

        Raises:
            SearchEndedError: If there are not enough blasts left for all of them; the first ones,
                as many as can be paid for, are assessed all the same.
        """
        count = self.plan.threats if threats is None else threats
        keys = [tuple(sorted(layout)) for layout in layouts]
        distinct = list(dict.fromkeys(keys))
        affordable = self._affordable(distinct, count)
        self._simulate(affordable, count)
        if len(affordable) < len(distinct) or self._repeats > _MOST_REPEATS:
            raise SearchEndedError
        return np.array([self._load(key, count) for key in keys])

    def confirm_best(self) -> None:
        """Let the best layouts meet more threats, fewer and fewer of them (successive halving).

        A layout that was lucky under the first threats is found out before it is chosen.
        """
        count, most = self.plan.threats, len(self.problem.threats)
        candidates = self.ranked(count)
        while count < most:
            rounds = int(np.ceil(np.log2(most / count)))
            more = min(2 * count, most)
            affordable = (self._budget - self.blasts) // (rounds * (more - count))
            candidates = candidates[: max(affordable, 1)]
            impulses = self.assess(candidates, more)
            candidates = [candidates[index] for index in np.argsort(impulses, kind="stable")]
            count = more

    def confirm_front(self) -> None:
        """Let the front meet more threats, and with it, as far as they go, the fronts behind it.

        All threats, if what is left pays for it; else as many as it does.
        """
        met, most = self.plan.threats, len(self.problem.threats)
        left, rest = self._budget - self.blasts, self.ranked(met)
        front = self._front_of(rest, met)
        more = min(met + left // max(len(front), 1), most)
        confirmed: list[Layout] = []
        while front and more > met and (len(confirmed) + len(front)) * (more - met) <= left:
            confirmed += front
            taken = set(front)
            rest = [key for key in rest if key not in taken]
            front = self._front_of(rest, met)
        self.assess(confirmed, more)

    def ranked(self, threats: int) -> list[Layout]:
        """Return the layouts that have met so many threats, least load first."""
        met = [key for key, values in self._known.items() if len(values) >= threats]
        return sorted(met, key=lambda key: self._load(key, threats))

    def front(self) -> tuple[Candidate, ...]:
        """Return the layouts of which none has both less load and a lower price.

        Among those that have met as many threats as any has, by price: the number of modules or,
        with a catalogue, the cost.
        """
        most = max(map(len, self._known.values()), default=0)
        return tuple(self._candidate(key, most) for key in self._front_of(self.ranked(most), most))

    def result(self, method: str, interrupted: bool, has_front: bool = False) -> SearchResult:
        """Return what was found, with the front if there is to be one."""
        best = self.best
        return SearchResult(
            layout=() if best is None else best.layout,
            method=method,
            load=None if best is None else best.load,
            threats=0 if best is None else best.threats,
            blasts=self.blasts,
            budget=self._budget,
            seed=self.seed,
            history=tuple(self._history),
            interrupted=interrupted,
            front=self.front() if has_front else (),
        )

    def _front_of(self, ranked: Sequence[Layout], threats: int) -> list[Layout]:
        """Return the front of layouts that come with the least load first, by price."""
        front: list[Layout] = []
        # Stable: of the same price, the least load first.
        for key in sorted(ranked, key=self.problem.price):
            load = self._load(key, threats)
            if not front or load < self._load(front[-1], threats):
                front.append(key)
        return front

    def _until_ended(self, phase: Callable[[], None]) -> None:
        try:
            phase()
        except SearchEndedError:
            self._repeats = 0

    def _affordable(self, layouts: Sequence[Layout], threats: int) -> list[Layout]:
        """Return the first layouts, as many as can meet so many threats with what is left."""
        asked, affordable = set[tuple[Layout, int]](), list[Layout]()
        for key in layouts:
            asked |= self._new_blasts([key], threats)
            if len(asked) > self._limit - self.blasts:
                break
            affordable.append(key)
        return affordable

    def _new_blasts(self, layouts: Sequence[Layout], threats: int) -> set[tuple[Layout, int]]:
        """Return the blasts that layouts have not met yet: what stands, and the threat's number.

        Measures that harden facades need none of their own.
        """
        return {
            (met_by_blasts(key), number)
            for key in layouts
            for number in range(len(self._known.get(key, ())), threats)
        } - self._met

    def _simulate(self, layouts: Sequence[Layout], threats: int) -> None:
        """Let layouts meet the threats up to a count that they have not met yet."""
        pairs = [
            (key, threat)
            for key in layouts
            for threat in self.problem.threats[len(self._known.get(key, ())) : threats]
        ]
        new = self._new_blasts(layouts, threats)
        self._repeats = 0 if new else self._repeats + 1
        if not pairs:
            return
        for (key, _), load in zip(pairs, self.problem.loads(pairs), strict=True):
            self._known[key] = (*self._known.get(key, ()), load)
        self._met |= new
        self.blasts += len(new)
        for key in layouts:
            self._consider(key)
        if self._report is not None:
            self._report(Progress(self.blasts, self._budget, self.best))

    def _consider(self, key: Layout) -> None:
        """Make a layout the best one if it is."""
        threats = len(self._known[key])
        candidate = self._candidate(key, threats)
        best = self.best
        if best is None or (-threats, candidate.load) < (-best.threats, best.load):
            if best is not None and best.blasts == self.blasts:
                self._history.pop()  # one entry a batch
            self._history.append(candidate)

    def _candidate(self, key: Layout, threats: int) -> Candidate:
        """Return what is known of a layout now."""
        load = self._load(key, threats)
        return Candidate(self.blasts, key, load, threats, self.problem.cost(key))

    def _load(self, key: Layout, threats: int) -> float:
        return self.problem.case.counted(self._known[key][:threats], key)


@dataclass(frozen=True)
class Search(ABC):
    """A search: it says what gets a blast next, and `SearchSession` keeps the account.

    Derive a dataclass that has a name and explores; `blast_agents.search.registry` lists it.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in tables and on the command line."""

    @abstractmethod
    def explore(self, session: SearchSession) -> None:
        """Let `session.assess` layouts until the search is through.

        The session ends it by `SearchEndedError` when the blasts for exploring are spent. What is
        drawn, `session.rng` draws.
        """

    def choose(self, session: SearchSession) -> None:
        """Spend what was held back: the best layouts meet more threats."""
        session.confirm_best()

    def phases(self, session: SearchSession) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return how a session is explored, and how the choice is made then."""
        return partial(self.explore, session), partial(self.choose, session)

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Return how the blasts are divided."""
        return Plan.of(problem, budget)

    has_front: ClassVar[bool] = False
    """Whether the result has the front of load and price."""

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was found; see `Proposer`."""
        session = SearchSession(problem, budget, self.plan(problem, budget), report, seed)
        interrupted = session.run(*self.phases(session))
        return session.result(self.name, interrupted, self.has_front)
