"""The driver of all searches: the plan for a budget, and the account of blasts and layouts."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan
from typing import ClassVar, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.design.search.problem import Candidate, Progress, Report, SearchResult
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.values import generator

LAYOUTS_PER_REALISATION: Final = 500
"""Layouts that the budget pays for, per realisation (fan and air) of a known charge."""

CHARGES_PER_ROOT_BLAST: Final = 0.3
"""Threats per layout with a hidden charge, over the square root of the budget in blasts."""

CONFIRMED_LAYOUTS: Final = 32
"""Number of layouts whose blasts under all threats bound the reserve."""

MOST_CONFIRMING_SHARE: Final = 0.2
"""Largest share of the budget held in reserve to assess the best layouts under more threats."""


@dataclass(frozen=True)
class Plan:
    """Division of the blasts of a search.

    Attributes:
        threats: Number of threats per layout during exploration.
    """

    threats: int
    exploring_blasts: int

    @property
    def exploring_layouts(self) -> int:
        """Number of layouts that exploration can assess, at least one."""
        return max(1, self.exploring_blasts // self.threats)

    @classmethod
    def of(cls, problem: DesignProblem, budget: int) -> "Plan":
        """Return the plan for a budget.

        The load of a layout varies less between realisations of fan and air than between layouts.
        Against a known charge, exploration therefore assesses many layouts under few threats, and
        the reserve identifies the lucky ones among the best. The load varies strongly with the
        place of the charge. Against a hidden charge, each layout is therefore assessed for several
        places from the start.
        """
        most = len(problem.threats)
        if len({threat.charge for threat in problem.threats}) == 1:
            # One charge: realisations average noise only, so the budget goes to layouts first.
            wanted = budget // LAYOUTS_PER_REALISATION
        else:
            # Many charges: layouts and threats per layout both grow with the square root of the
            # budget.
            wanted = round(CHARGES_PER_ROOT_BLAST * budget**0.5)
        threats = max(1, min(wanted, most, budget))
        if threats == most:
            return cls.thorough(problem, budget)
        held_back = min(CONFIRMED_LAYOUTS * most, int(MOST_CONFIRMING_SHARE * budget))
        return cls(threats, budget - held_back)

    @classmethod
    def thorough(cls, problem: DesignProblem, budget: int) -> "Plan":
        """Return the plan that assesses every layout under all threats at once."""
        return cls(len(problem.threats), budget)


_MOST_REPEATS: Final = 300
"""Successive assessments without a new blast after which the search ends."""


class SearchEndedError(Exception):
    """The blasts of a search are spent, or it finds no new layouts to spend them on."""


class SearchSession:
    """Assesses layouts for a method within a budget of blasts.

    A layout is assessed under the threats in their order: first some of them, later perhaps more,
    each once. A layout assessed under more threats is known better and ranks first; with equal
    numbers of threats, the one with the lower load does.

    Args:
        problem: The problem to minimise.
        budget: Largest number of blasts.
        plan: Number of threats per layout at first, and the reserve for the others.
        report: Called with the progress after every batch.
        seed: Seed of all random draws.

    Attributes:
        rng: The random generator.
        blasts: Blasts spent: distinct pairs of layout and threat that were requested.

    Raises:
        BlastEnvError: If the budget is below 1.
    """

    def __init__(
        self,
        problem: DesignProblem,
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
        self._hiding: set[Layout] = set()
        self._largest = 0.0
        self._repeats = 0

    @property
    def best(self) -> Candidate | None:
        """The best layout so far."""
        return self._history[-1] if self._history else None

    @property
    def exploring_share(self) -> float:
        """Share of the exploring blasts that is spent."""
        return self.blasts / self._limit

    def run(self, explore: Callable[[], None], choose: Callable[[], None]) -> bool:
        """Explore until the exploring blasts are spent, then spend the reserve on the best layouts.

        Args:
            explore: Calls `assess` until it is done or `SearchEndedError` is raised.
            choose: Does the same with the reserve.

        Returns:
            Whether Ctrl-C interrupted the search.
        """
        try:
            self._until_ended(explore)
            self._limit = self._budget
            self._until_ended(choose)
        except KeyboardInterrupt:
            return True
        return False

    def assess(self, layouts: Sequence[Layout], threats: int | None = None) -> FloatArray:
        """Return the load of layouts under the first threats, in the objective's unit (layouts,).

        Args:
            layouts: Legal layouts.
            threats: Number of threats; the plan's number for exploration by default.

        Raises:
            SearchEndedError: If too few blasts are left for all of them, after the affordable ones
                were assessed, or if too many assessments in a row needed no new blast.
        """
        # (1) Equal layouts once; (2) as many as the blasts pay for; (3) their new blasts alone.
        count = self.plan.threats if threats is None else threats
        # Sorted: layouts that differ in the order of pieces are one and the same.
        keys = [tuple(sorted(layout)) for layout in layouts]
        distinct = list(dict.fromkeys(keys))
        affordable = self._affordable(distinct, count)
        self._simulate(affordable, count)
        if len(affordable) < len(distinct) or self._repeats > _MOST_REPEATS:
            raise SearchEndedError
        return np.array([self._load(key, count) for key in keys])

    def confirm_best(self) -> None:
        """Assess fewer and fewer of the best layouts under more threats (successive halving).

        This identifies layouts that were lucky under the first threats.
        """
        # Successive halving (Jamieson and Talwalkar 2016): each round doubles the threats for the
        # layouts that the blasts pay for, in equal shares of the reserve per round, and drops the
        # rest.
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
        """Assess the front under more threats and, as far as blasts last, the next fronts.

        All threats are used if the remaining blasts suffice, otherwise as many as they pay for.
        """
        # (1) The front with the threats met so far; (2) as many more threats as the reserve pays
        # for it; (3) further fronts, peeled off one by one, while it lasts.
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
        """Return the layouts assessed under at least so many threats, least load first."""
        met = [key for key, values in self._known.items() if len(values) >= threats]
        met = [key for key in met if key not in self._hiding]
        return sorted(met, key=lambda key: self._load(key, threats))

    def front(self) -> tuple[Candidate, ...]:
        """Return the Pareto front of load and price, in ascending order of price.

        It contains only layouts assessed under the largest number of threats. The price is the
        number of modules or, with a catalogue, the cost.
        """
        most = max(map(len, self._known.values()), default=0)
        return tuple(self._candidate(key, most) for key in self._front_of(self.ranked(most), most))

    def result(self, method: str, interrupted: bool, has_front: bool = False) -> SearchResult:
        """Return the result of the search, with the front if `has_front`."""
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
        """Return the front of layouts ranked by load, in ascending order of price."""
        front: list[Layout] = []
        # Stable: among equal prices, the least load first.
        # By rising price, a layout is on the front if its load is below all cheaper ones.
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
        """Return the first layouts, as many as the remaining blasts pay for under `threats`."""
        # Blasts that several layouts share, such as those that differ in glass alone, count once.
        asked, affordable = set[tuple[Layout, int]](), list[Layout]()
        for key in layouts:
            asked |= self._new_blasts([key], threats)
            if len(asked) > self._limit - self.blasts:
                break
            affordable.append(key)
        return affordable

    def _new_blasts(self, layouts: Sequence[Layout], threats: int) -> set[tuple[Layout, int]]:
        """Return the new blasts of layouts, as pairs of structures and the threat's number.

        Measures that harden facades need no blasts.
        """
        return {
            (load_relevant(key), number)
            for key in layouts
            for number in range(len(self._known.get(key, ())), threats)
        } - self._met

    def _simulate(self, layouts: Sequence[Layout], threats: int) -> None:
        """Simulate layouts under those of the first threats that are new to them."""
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
            counted = load
            if isnan(load):  # pieces hide a building: such a layout is never the best
                self._hiding.add(key)
                counted = 1.0 + 2.0 * self._largest
            self._largest = max(self._largest, load)
            self._known[key] = (*self._known.get(key, ()), counted)
        self._met |= new
        self.blasts += len(new)
        for key in layouts:
            self._consider(key)
        if self._report is not None:
            self._report(Progress(self.blasts, self._budget, self.best))

    def _consider(self, key: Layout) -> None:
        """Record a layout as the best one if it ranks before the present best."""
        if key in self._hiding:
            return
        # More threats rank first: a load under few of them may be luck.
        threats = len(self._known[key])
        candidate = self._candidate(key, threats)
        best = self.best
        if best is None or (-threats, candidate.load) < (-best.threats, best.load):
            if best is not None and best.blasts == self.blasts:
                self._history.pop()  # one entry per batch
            self._history.append(candidate)

    def _candidate(self, key: Layout, threats: int) -> Candidate:
        """Return a layout with its present load and number of threats."""
        load = self._load(key, threats)
        return Candidate(self.blasts, key, load, threats, self.problem.cost(key))

    def _load(self, key: Layout, threats: int) -> float:
        return self.problem.case.objective_value(self._known[key][:threats], key)


@dataclass(frozen=True)
class Search(ABC):
    """A search: it selects the layouts to simulate, and `SearchSession` keeps the account.

    Derive a dataclass with a name and `explore`, and list it in `blast_env.design.search.registry`.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in tables and on the command line."""

    @abstractmethod
    def explore(self, session: SearchSession) -> None:
        """Call `session.assess` until the search is done.

        The session raises `SearchEndedError` when the exploring blasts are spent. All random draws
        use `session.rng`.
        """

    def choose(self, session: SearchSession) -> None:
        """Spend the reserve: assess the best layouts under more threats."""
        session.confirm_best()

    def phases(self, session: SearchSession) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return the functions that explore a session and make the final choice."""
        return partial(self.explore, session), partial(self.choose, session)

    def plan(self, problem: DesignProblem, budget: int) -> Plan:
        """Return the division of the blasts."""
        return Plan.of(problem, budget)

    has_front: ClassVar[bool] = False
    """Whether the result includes the front of load and price."""

    def propose(
        self, problem: DesignProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout found; see `Proposer`."""
        session = SearchSession(problem, budget, self.plan(problem, budget), report, seed)
        interrupted = session.run(*self.phases(session))
        return session.result(self.name, interrupted, self.has_front)
