"""Layouts by what has been learnt: a surrogate, an agent or both, with and without blasts."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil
from typing import Final

import numpy as np

from blast_agents.search.moves import Moves
from blast_agents.search.problem import (
    LayoutProblem,
    Progress,
    Report,
    SamplingAgent,
    SearchResult,
)
from blast_agents.search.registry import layouts_by_rule
from blast_agents.search.session import Plan, Search, SearchSession
from blast_agents.surrogate.correction import Correction
from blast_agents.surrogate.network import Surrogate, packaged_surrogate
from blast_agents.surrogate.walls import SurrogateSite, site_of
from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case, Threat
from blast_env.evaluation.cases import one_of_each_charge, practice_hidden, practice_visible
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario
from blast_env.values import generator

_DRAWN_CHARGES: Final = 16
_HIDDEN_CHARGES: Final = 4
"""Where the charge is not known, layouts are guessed against so many different ones of those drawn:
the middle one, and those that are farthest from each other."""

_KEPT: Final = 4
"""How many of the best layouts are changed."""

_BATCH: Final = 8
"""How many changes are guessed at a time."""

_SITE_SHARE: Final = 0.3
"""Of the time for guesses alone, what the rules and the ways around on a site take, about."""


@dataclass(frozen=True, eq=False)
class Guesses:
    """What the surrogate says of the layouts of a case; each is asked once.

    Attributes:
        surrogate: The surrogate.
        case: What layouts meet.
        site: The scenario as the surrogate sees it.
    """

    surrogate: Surrogate
    case: Case
    site: SurrogateSite
    _known: dict[Layout, float] = field(default_factory=dict)

    @classmethod
    def of(cls, surrogate: Surrogate, case: Case) -> "Guesses":
        """Begin with none.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        return cls(surrogate, case, site_of(case.scenario))

    def loads(self, layouts: Sequence[Layout]) -> FloatArray:
        """Return the load that counts behind each layout, as rewards are paid (layouts,)."""
        new = [each for each in dict.fromkeys(layouts) if each not in self._known]
        if new:
            by_threat = [self._weighted(new, threat) for threat in self.case.threats]
            for layout, loads in zip(new, np.transpose(by_threat), strict=True):
                self._known[layout] = self.case.counted(loads, layout)
        return np.array([self._known[each] for each in layouts])

    @property
    def count(self) -> int:
        """How many layouts it was asked about."""
        return len(self._known)

    def ranked(self) -> list[Layout]:
        """Return all layouts that it was asked about, the least load first."""
        return sorted(self._known, key=lambda layout: self._known[layout])

    def _weighted(self, layouts: Sequence[Layout], threat: Threat) -> FloatArray:
        charges = [threat.charge_against(self.case.scenario, each) for each in layouts]
        return self.surrogate.guess(self.site, layouts, charges).loads(self.site, layouts)


def improved(
    guesses: Guesses,
    begin_with: Iterable[Layout],
    most: int,
    rng: np.random.Generator,
    tell: Callable[[float], None] = lambda _: None,
) -> list[Layout]:
    """Return the layouts that a search by guesses alone has met, the best first.

    Begins with given layouts, then changes the best ones so far by one or two moves.

    Args:
        guesses: Is asked, and remembers.
        begin_with: Legal layouts.
        most: Most layouts to ask about, beside those.
        rng: Draws the changes.
        tell: Is told the share that is done.
    """
    guesses.loads([tuple(sorted(each)) for each in begin_with])
    moves, end = Moves(guesses.case.scenario), guesses.count + most
    tries = 0
    while guesses.count < end and tries < 4 * most:
        tell(1.0 - (end - guesses.count) / most)
        best = guesses.ranked()[:_KEPT]
        changed = [moves.near_best(best, rng) for _ in range(min(_BATCH, end - guesses.count))]
        guesses.loads(changed)
        tries += len(changed)
    return guesses.ranked()


@dataclass(frozen=True)
class LearntSearch(Search):
    """Proposes by what a surrogate of gas dynamics has learnt, an agent, or both.

    Without a blast (a budget of 0) it proposes

    - what the surrogate likes best of the rules' layouts and changes of them;
    - what the agent proposes;
    - with both, what the surrogate likes best of what the agent proposes and draws.

    With blasts a surrogate says what gets one: first what the agent proposes, then the rules'
    layouts and the best that a search by guesses alone has found, in turn; then changes of the best
    by blasts, of which it picks one out of many. What it picks is by guesses that are corrected by
    how far it was off on layouts that are alike (`Correction`). Against a hidden charge layouts
    meet a few places alone. The guesses under all places, times the ratio of blast and guess under
    those few, tell more of a layout than its loads there: they decide what is changed, and what
    meets the other places in the end.

    An agent without a surrogate gets its blasts for what it proposes and draws and for the rules;
    then for changes of the best of these, the better ones more often, by one or two moves.

    Attributes:
        surrogate: The surrogate.
        agent: The agent.
        digest: Of both, so that results of different ones are told apart.
        changes: Changed layouts that are guessed where there is no blast.
        ranked: Layouts that the agent draws for the surrogate where there is no blast.
        guesses: Layouts that are guessed before the first blast.
        agent_draws: Layouts that the agent draws for that.
        drawn: Changes that the surrogate picks one out of, afterwards.
        guessed_share: Share of the blasts for what was found by guesses alone.
        drawn_share: Without a surrogate, share of the layouts that the agent draws.
        name: In tables.

    Raises:
        BlastEnvError: If there is neither a surrogate nor an agent.
    """

    surrogate: Surrogate | None = field(default=None, repr=False)
    agent: SamplingAgent | None = field(default=None, repr=False)
    digest: str = ""
    changes: int = 300
    ranked: int = 16
    guesses: int = 600
    agent_draws: int = 64
    drawn: int = 16
    guessed_share: float = 0.4
    drawn_share: float = 0.3
    name: str = "surrogate"

    def __post_init__(self) -> None:
        if self.surrogate is None and self.agent is None:
            raise BlastEnvError("there is neither a surrogate nor an agent, must be one or both")

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met; with a budget of 0 the best one by guesses.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        if budget:
            return super().propose(problem, budget, seed, report)

        def tell(share: float) -> None:
            if report is not None:
                report(Progress(0, 0, guessed=share))

        layout = self.at_once(problem.scenario, problem.told, tell)
        return SearchResult(layout, self.name, seed=seed)

    def at_once(
        self,
        scenario: Scenario,
        charge: AnyCharge | None = None,
        tell: Callable[[float], None] = lambda _: None,
    ) -> Layout:
        """Return the layout that is proposed without a blast; always the same one.

        Args:
            scenario: The scenario; it has a build zone.
            charge: Where the charge is, if that is known; otherwise the layout is for some of the
                places where the scenario may have one.
            tell: Is told the share that is done.

        Raises:
            BlastEnvError: As for `propose`.
        """
        if self.surrogate is None:
            return tuple(sorted(_given(self.agent).propose(scenario, charge)))
        guesses = Guesses.of(self.surrogate, case_for(scenario, charge))
        tell(0.5 * _SITE_SHARE)
        if self.agent is None:
            begin_with = [(), *layouts_by_rule(scenario, charge).values()]

            def go_on(share: float) -> None:
                tell(_SITE_SHARE + (1.0 - _SITE_SHARE) * share)

            return improved(guesses, begin_with, self.changes, generator(0), go_on)[0]
        proposed = self.agent.propose(scenario, charge)
        drawn = self.agent.sample(scenario, charge, self.ranked, 0)
        guesses.loads([tuple(sorted(each)) for each in (proposed, *drawn)])
        return guesses.ranked()[0]

    def plan(self, problem: LayoutProblem, budget: int) -> Plan:
        """Divide the blasts; by guesses against a hidden charge for few layouts, met well."""
        plan = Plan.of(problem, budget)
        most = len(problem.threats)
        places = min(max(plan.threats, _LEAST_PLACES), most, budget)
        if self.surrogate is None or problem.told is not None or places == most:
            return plan
        return Plan(places, budget - min(round(_CHOOSING_SHARE * budget), budget - places))

    def phases(self, session: SearchSession) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return how a session is explored, and how the choice is made then."""
        if self.surrogate is None:
            return super().phases(session)
        estimates = _Estimates.of(self.surrogate, session)

        def choose() -> None:
            for layout in estimates.ranked():
                session.assess([layout], len(session.problem.threats))

        return partial(self._explore_by_guesses, session, estimates), choose

    def explore(self, session: SearchSession) -> None:
        """Let blasts decide between rules and draws of the agent, and changes of the best."""
        scenario, told, plan = session.problem.scenario, session.problem.told, session.plan
        agent = _given(self.agent)
        count = max(1, round(self.drawn_share * plan.exploring_layouts))
        session.assess([agent.propose(scenario, told)])
        session.assess([*layouts_by_rule(scenario, told).values()])
        session.assess(agent.sample(scenario, told, count, session.seed))
        moves = Moves(scenario)
        while True:
            best = session.ranked(plan.threats)[:_KEPT]
            session.assess([moves.near_best(best, session.rng)])

    def _explore_by_guesses(self, session: SearchSession, estimates: "_Estimates") -> None:
        """Let blasts decide between what guesses like best, and changes of it."""
        scenario, told = session.problem.scenario, session.problem.told
        guesses = estimates.everywhere
        rules = layouts_by_rule(scenario, told).values()
        proposed: list[Layout] = []
        if self.agent is not None:
            drawn = self.agent.sample(scenario, told, self.agent_draws, session.seed)
            proposed = [self.agent.propose(scenario, told), *drawn]
        session.assess(proposed[:1])
        found = improved(guesses, [(), *rules, *proposed], self.guesses, session.rng)
        layouts = session.plan.exploring_layouts
        share = max(1, round(self.guessed_share * layouts))
        ruled = sorted(rules, key=lambda layout: guesses.loads([layout]).item())
        ruled = ruled[: ceil(layouts / _LAYOUTS_A_RULE)]
        tried = {*proposed[:1]}

        def try_best(candidates: Sequence[Layout]) -> None:
            new = [each for each in dict.fromkeys(candidates) if each not in tried]
            chosen = estimates.likeliest(new or candidates)
            tried.add(chosen)
            session.assess([chosen])

        for number in range(share):
            try_best(found[:_POOL])
            try_best(ruled[number : number + 1] or found[:_POOL])
        moves = Moves(scenario)
        while True:
            best = estimates.ranked()[:_KEPT]
            try_best([moves.near_best(best, session.rng) for _ in range(self.drawn)])


def packaged_search() -> LearntSearch:
    """Return the search by the surrogate that comes with the package."""
    return search_by(packaged_surrogate())


def search_by(surrogate: Surrogate) -> LearntSearch:
    """Return the search by a surrogate."""
    return LearntSearch(surrogate, digest=surrogate.digest)


def _given(agent: SamplingAgent | None) -> SamplingAgent:
    assert agent is not None  # as checked when it was made
    return agent


def case_for(scenario: Scenario, charge: AnyCharge | None) -> Case:
    """Return what a proposal is guessed against: the charge, or some of those that may be."""
    if charge is not None:
        return practice_visible(scenario, charge, 1, 0)
    drawn = practice_hidden(scenario, _DRAWN_CHARGES, 1, 0)
    return replace(drawn, threats=one_of_each_charge(drawn.threats)[:_HIDDEN_CHARGES])


_LAYOUTS_A_RULE: Final = 8
"""Of so many layouts that get a blast one is a rule's, as long as there are some."""

_LEAST_PLACES: Final = 4
"""Of a hidden charge, that a layout meets before it is said how wrong the surrogate is of it."""

_POOL: Final = 64
"""Of what is liked best by guesses alone, so many may get a blast."""

_LEARNT_FROM: Final = 64
"""The correction is learnt from so many of the best layouts: its cost grows with the cube."""

_LEAST_SHARE: Final = 1e-3
"""Of a guess; particles may all miss, and then there is no load at all."""

_HOPE: Final = 0.5
"""How many standard deviations less than expected is hoped for of a layout that gets a blast."""

_CHOOSING_SHARE: Final = 0.4
"""Of the blasts, for the places of a hidden charge that the best layouts have not met."""


@dataclass(frozen=True, eq=False)
class _Estimates:
    """What layouts that have met some threats would let through under all of them.

    Attributes:
        session: Knows the loads under the first threats.
        everywhere: Guesses under all threats.
        met: Guesses under those that layouts meet while the search explores.
    """

    session: SearchSession
    everywhere: Guesses
    met: Guesses

    @classmethod
    def of(cls, surrogate: Surrogate, session: SearchSession) -> "_Estimates":
        """Begin with none."""
        problem = session.problem

        def under(threats: Sequence[Threat]) -> Guesses:
            case = Case(problem.scenario, tuple(threats), risk=problem.case.risk)
            return Guesses.of(surrogate, case)

        first = problem.threats[: session.plan.threats]
        return cls(session, under(problem.threats), under(first))

    def ranked(self) -> list[Layout]:
        """Return the layouts that have met the first threats, the least estimate first."""
        layouts = self.session.ranked(self.session.plan.threats)
        if not layouts:
            return []
        wrong_by = np.exp(self._errors(layouts))
        order = np.argsort(wrong_by * self.everywhere.loads(layouts), kind="stable")
        return [layouts[index] for index in order.tolist()]

    def likeliest(self, layouts: Sequence[Layout]) -> Layout:
        """Return the layout that most likely lets the least through, by guesses and all blasts."""
        scores = np.log(self.everywhere.loads(layouts))
        met = self.session.ranked(self.session.plan.threats)[:_LEARNT_FROM]
        if met:
            barrier = self.everywhere.site.barrier
            correction = Correction.of([barrier(each) for each in met], self._errors(met))
            mean, spread = correction.expected([barrier(each) for each in layouts])
            scores += mean - _HOPE * spread
        return layouts[int(scores.argmin())]

    def _errors(self, layouts: Sequence[Layout]) -> FloatArray:
        """Return logarithms of loads under the first threats over those guessed (layouts,)."""
        shares = self.session.assess(layouts) / self.met.loads(layouts)
        errors: FloatArray = np.log(np.maximum(shares, _LEAST_SHARE))
        return errors
