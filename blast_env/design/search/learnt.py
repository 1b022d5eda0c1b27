"""Layouts from trained models: a surrogate, an agent or both, with and without blasts."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil, inf, isnan
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.design.search.batch_moves import BatchMoves
from blast_env.design.search.moves import Moves
from blast_env.design.search.problem import Progress, Report, SamplingAgent, SearchResult
from blast_env.design.search.session import Plan, Search, SearchSession
from blast_env.errors import BlastEnvError
from blast_env.evaluation import DesignProblem, LoadCase, LoadCaseSet
from blast_env.evaluation.cases import check_loaded, one_per_charge, search_set
from blast_env.geometry import Layout
from blast_env.rules import layouts_by_rule
from blast_env.site import AnyCharge, Scenario
from blast_env.surrogate import Surrogate, packaged_surrogate
from blast_env.surrogate.correction import Correction
from blast_env.surrogate.walls import SurrogateSite, site_of
from blast_env.values import generator

_DRAWN_CHARGES: Final = 16
_HIDDEN_CHARGES: Final = 4
"""Number of drawn charges, and of those used for predictions, where the charge is unknown.

The latter are the central one and those farthest apart.
"""

_KEPT: Final = 4
"""Number of best layouts by blasts that the search changes."""

_RESPONSE_HALF_WIDTHS: Final = 2.0
"""How far above their guess loads are by which facades respond, in half-widths of intervals.

These are set for structures: bays err more, and a search finds those that are guessed too low.
"""

_GUESSED: Final = 8
"""The same by guesses alone."""

_BATCH: Final = 24
"""Number of changed layouts per call of the surrogate."""

_SITE_SHARE: Final = 0.3
"""Approximate share of the rules and paths of a site in the time of a search without blasts."""


@dataclass(frozen=True, eq=False)
class Guesses:
    """Cached predictions of a surrogate for the layouts of a case.

    Attributes:
        case: The scenario and its threats.
        site: The scenario as the surrogate represents it.
    """

    surrogate: Surrogate
    case: LoadCaseSet
    site: SurrogateSite
    _known: dict[Layout, float] = field(default_factory=dict)

    @classmethod
    def of(cls, surrogate: Surrogate, case: LoadCaseSet) -> "Guesses":
        """Return an empty cache.

        Raises:
            BlastEnvError: If no structure is protected, or one has no load without a barrier.
        """
        site = site_of(case.scenario)
        check_loaded(case, site.without_load)
        return cls(surrogate, case, site)

    def loads(self, layouts: Sequence[Layout]) -> FloatArray:
        """Return the predicted value of the objective for each layout (layouts,).

        It is infinite of a layout that hides a building, so that this is never the best one.
        """
        new = [layout for layout in dict.fromkeys(layouts) if layout not in self._known]
        if new:
            # One call of the network per threat for all layouts: it is fast in batches.
            by_threat = [self._weighted(new, threat) for threat in self.case.threats]
            for layout, loads in zip(new, np.transpose(by_threat), strict=True):
                value = self.case.objective_value(loads, layout)
                self._known[layout] = inf if isnan(value) else value
        return np.array([self._known[layout] for layout in layouts])

    @property
    def count(self) -> int:
        """Number of layouts with a prediction."""
        return len(self._known)

    def ranked(self) -> list[Layout]:
        """Return all layouts with a prediction, the least load first."""
        return sorted(self._known, key=lambda layout: self._known[layout])

    def _weighted(self, layouts: Sequence[Layout], threat: LoadCase) -> FloatArray:
        charges = [threat.charge_against(self.case.scenario, layout) for layout in layouts]
        guess = self.surrogate.guess(self.site, layouts, charges)
        if self.case.scenario.objective.is_response and self.surrogate.has_intervals:
            # A response comes in steps: a search finds layouts just before one, beyond which a
            # small error is. So they have to pass well above the guess.
            guess = self.surrogate.upper_ends(guess, _RESPONSE_HALF_WIDTHS)
        return guess.loads(self.site, layouts)


def improved(
    guesses: Guesses,
    begin_with: Iterable[Layout],
    most: int,
    rng: np.random.Generator,
    tell: Callable[[float], None] = lambda _: None,
) -> list[Layout]:
    """Return all layouts of a search by predictions alone, the best first.

    The search starts from given layouts, then changes the best so far (`BatchMoves`).

    Args:
        guesses: The predictions, which it extends.
        begin_with: Legal initial layouts.
        most: Largest number of further layouts.
        rng: Draws the changes.
        tell: Called with the share that is done.
    """
    guesses.loads([tuple(sorted(layout)) for layout in begin_with])
    moves, end = BatchMoves(guesses.case.scenario), guesses.count + most
    # Moves may lead back to known layouts, which add none: a bound on the tries ends the search on
    # small sites.
    tries = 0
    while guesses.count < end and tries < 4 * most:
        tell(1.0 - (end - guesses.count) / most)
        best = guesses.ranked()[:_GUESSED]
        changed = moves.near_best(best, min(_BATCH, end - guesses.count), rng)
        guesses.loads(changed)
        tries += len(changed)
    return guesses.ranked()


@dataclass(frozen=True)
class SurrogateSearch(Search):
    """A search guided by a surrogate of gas dynamics, a trained agent, or both.

    Without a blast (a budget of 0) it proposes

    - with a surrogate, the best prediction among the rules' layouts and changes of them;
    - with an agent, the agent's layout;
    - with both, the best prediction among these, the agent's samples and changes.

    With blasts, a surrogate selects the layouts to simulate: first the agent's layout, then in
    turn the rules' layouts and the best of a search by predictions alone, then changes of the best
    simulated layouts, one out of many at a time. Where the response of facades counts, the agent is
    left out. The selection uses predictions corrected by the
    errors on similar layouts (`Correction`). Against a hidden charge, layouts are simulated for a
    few places only. The prediction under all places, times the ratio of simulated to predicted
    load under those few, estimates a layout better than its simulated loads alone: it selects the
    layouts to change, and those to simulate for the other places in the end.

    An agent without a surrogate spends its blasts on its own layout, its samples and the rules,
    and then on changes of the best of these by one or two moves, in favour of the better ones.

    Attributes:
        digest: Digest of both, which identifies results.
        changes: Number of changed layouts to predict in a search without blasts.
        ranked: Number of samples of the agent in a search without blasts, with a surrogate.
        guesses: Number of layouts to predict before the first blast.
        agent_draws: Number of samples of the agent among these.
        drawn: Number of changed layouts from which the surrogate selects one, afterwards.
        guessed_share: Share of the blasts for layouts found by predictions alone.
        drawn_share: Without a surrogate, share of the layouts that the agent samples.
        name: Name in tables.

    Raises:
        BlastEnvError: If there is neither a surrogate nor an agent.
    """

    surrogate: Surrogate | None = field(default=None, repr=False)
    agent: SamplingAgent | None = field(default=None, repr=False)
    digest: str = ""
    changes: int = 1000
    ranked: int = 16
    guesses: int = 1500
    agent_draws: int = 64
    drawn: int = 32
    guessed_share: float = 0.4
    drawn_share: float = 0.3
    name: str = "surrogate"

    def __post_init__(self) -> None:
        if self.surrogate is None and self.agent is None:
            raise BlastEnvError("there is neither a surrogate nor an agent, must be one or both")

    def propose(
        self, problem: DesignProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout by blasts or, with a budget of 0, by predictions.

        Raises:
            BlastEnvError: If no structure is protected.
        """
        if budget:
            return super().propose(problem, budget, seed, report)

        def tell(share: float) -> None:
            if report is not None:
                report(Progress(0, 0, guessed=share))

        layout = self.at_once(problem.scenario, problem.known_charge, tell)
        return SearchResult(layout, self.name, seed=seed)

    def at_once(
        self,
        scenario: Scenario,
        charge: AnyCharge | None = None,
        tell: Callable[[float], None] = lambda _: None,
    ) -> Layout:
        """Return the layout proposed without a blast; it is deterministic.

        Args:
            scenario: The scenario; it has a build zone.
            charge: The charge, if it is known; otherwise the layout is for some of the charges of
                the scenario.
            tell: Called with the share that is done.

        Raises:
            BlastEnvError: As for `propose`.
        """
        if self.surrogate is None:
            return tuple(sorted(_given(self.agent).propose(scenario, charge)))
        guesses = Guesses.of(self.surrogate, case_for(scenario, charge))
        tell(0.5 * _SITE_SHARE)
        begin_with = [(), *layouts_by_rule(scenario, charge).values()]
        agent = self._agent_beside(scenario)
        if agent is not None:
            drawn = agent.sample(scenario, charge, self.ranked, 0)
            begin_with += [agent.propose(scenario, charge), *drawn]

        def go_on(share: float) -> None:
            tell(_SITE_SHARE + (1.0 - _SITE_SHARE) * share)

        return improved(guesses, begin_with, self.changes, generator(0), go_on)[0]

    def plan(self, problem: DesignProblem, budget: int) -> Plan:
        """Divide the blasts; with a surrogate and a hidden charge, favour threats over layouts."""
        # A surrogate ranks layouts, but not the scatter over places: a few places suffice while
        # exploring, and a reserve is kept for the choice under all of them.
        plan = Plan.of(problem, budget)
        most = len(problem.threats)
        places = min(max(plan.threats, _LEAST_PLACES), most, budget)
        if self.surrogate is None or problem.known_charge is not None or places == most:
            return plan
        return Plan(places, budget - min(round(_CHOOSING_SHARE * budget), budget - places))

    def phases(self, session: SearchSession) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return the functions that explore a session and make the final choice."""
        if self.surrogate is None:
            return super().phases(session)
        estimates = _Estimates.of(self.surrogate, session)

        def choose() -> None:
            for layout in estimates.ranked():
                session.assess([layout], len(session.problem.threats))

        return partial(self._explore_by_guesses, session, estimates), choose

    def explore(self, session: SearchSession) -> None:
        """Simulate the rules' layouts and the agent's samples, then changes of the best."""
        scenario, known_charge, plan = (
            session.problem.scenario,
            session.problem.known_charge,
            session.plan,
        )
        agent = _given(self.agent)
        count = max(1, round(self.drawn_share * plan.exploring_layouts))
        session.assess([agent.propose(scenario, known_charge)])
        session.assess([*layouts_by_rule(scenario, known_charge).values()])
        session.assess(agent.sample(scenario, known_charge, count, session.seed))
        moves = Moves(scenario)
        while True:
            best = session.ranked(plan.threats)[:_KEPT]
            session.assess([moves.near_best(best, session.rng)])

    def _agent_beside(self, scenario: Scenario) -> SamplingAgent | None:
        """Return the agent that a search by guesses begins with; none where the response counts.

        The agent learnt to lower impulses. A response comes in steps, and many of its layouts are
        just before the same one: they take the blasts of better ones.
        """
        return None if scenario.objective.is_response else self.agent

    def _explore_by_guesses(self, session: SearchSession, estimates: "_Estimates") -> None:
        """Simulate the layouts with the best predictions, then changes of the best."""
        scenario, known_charge = session.problem.scenario, session.problem.known_charge
        guesses = estimates.everywhere
        rules = layouts_by_rule(scenario, known_charge).values()
        proposed: list[Layout] = []
        agent = self._agent_beside(scenario)
        if agent is not None:
            # 1. The agent's layout and samples, if there is one.
            drawn = agent.sample(scenario, known_charge, self.agent_draws, session.seed)
            proposed = [agent.propose(scenario, known_charge), *drawn]
        session.assess(proposed[:1])
        # 2. A search by predictions alone, from no barrier, the rules' and the agent's layouts.
        found = improved(guesses, [(), *rules, *proposed], self.guesses, session.rng)
        layouts = session.plan.exploring_layouts
        share = max(1, round(self.guessed_share * layouts))
        ruled = sorted(rules, key=lambda layout: guesses.loads([layout]).item())
        ruled = ruled[: ceil(layouts / _LAYOUTS_A_RULE)]
        tried = {*proposed[:1]}

        def try_best(candidates: Sequence[Layout]) -> None:
            # The correction learns from each blast, so the likeliest candidate may change after
            # every one.
            new = [candidate for candidate in dict.fromkeys(candidates) if candidate not in tried]
            chosen = estimates.likeliest(new or candidates)
            tried.add(chosen)
            session.assess([chosen])

        # 3. In turn the best by predictions and the rules' layouts: the rules guard against a
        # surrogate that is wrong on this site.
        for number in range(share):
            try_best(found[:_POOL])
            try_best(ruled[number : number + 1] or found[:_POOL])
        moves = BatchMoves(scenario)
        # 4. Changes of the best by corrected predictions; the session ends it by its budget.
        while True:
            best = estimates.ranked()[:_KEPT]
            try_best(moves.near_best(best, self.drawn, session.rng))


def packaged_search() -> SurrogateSearch:
    """Return the search by the bundled surrogate."""
    return search_by(packaged_surrogate())


def search_by(surrogate: Surrogate) -> SurrogateSearch:
    """Return the search by a surrogate."""
    return SurrogateSearch(surrogate, digest=surrogate.digest)


def _given(agent: SamplingAgent | None) -> SamplingAgent:
    assert agent is not None  # as checked when it was made
    return agent


def case_for(scenario: Scenario, charge: AnyCharge | None) -> LoadCaseSet:
    """Return the case of a proposal without blasts: the charge, or some of the possible ones."""
    drawn = search_set(scenario, charge, charges=_DRAWN_CHARGES)
    if charge is not None:
        return drawn
    return replace(drawn, threats=one_per_charge(drawn.threats)[:_HIDDEN_CHARGES])


_LAYOUTS_A_RULE: Final = 8
"""Exploring layouts per rule's layout: limits the rules that are simulated."""

_LEAST_PLACES: Final = 4
"""Least number of threats per exploring layout against a hidden charge."""

_POOL: Final = 64
"""Number of best predicted layouts that are candidates for a blast."""

_LEARNT_FROM: Final = 64
"""Number of best layouts that the correction is fitted to: its cost grows with the cube."""

_LEAST_SHARE: Final = 1e-3
"""Least ratio of simulated to predicted load; without it, a load of zero has no logarithm."""

_HOPE: Final = 0.5
"""Standard deviations below the mean at which the lower confidence bound lies."""

_CHOOSING_SHARE: Final = 0.4
"""Share of the blasts held in reserve for the remaining places of a hidden charge."""


@dataclass(frozen=True, eq=False)
class _Estimates:
    """Estimated loads under all threats for layouts simulated under the first threats.

    Attributes:
        session: Holds the simulated loads under the first threats.
        everywhere: Predictions under all threats.
        met: Predictions under the first threats, those of exploration.
    """

    session: SearchSession
    everywhere: Guesses
    met: Guesses

    @classmethod
    def of(cls, surrogate: Surrogate, session: SearchSession) -> "_Estimates":
        """Return estimates without predictions."""
        problem = session.problem

        def under(threats: Sequence[LoadCase]) -> Guesses:
            case = LoadCaseSet(problem.scenario, tuple(threats), risk=problem.case.risk)
            return Guesses.of(surrogate, case)

        first = problem.threats[: session.plan.threats]
        return cls(session, under(problem.threats), under(first))

    def ranked(self) -> list[Layout]:
        """Return the layouts simulated under the first threats, the least estimate first."""
        layouts = self.session.ranked(self.session.plan.threats)
        if not layouts:
            return []
        wrong_by = np.exp(self._errors(layouts))
        order = np.argsort(wrong_by * _floored(self.everywhere, layouts), kind="stable")
        return [layouts[index] for index in order.tolist()]

    def likeliest(self, layouts: Sequence[Layout]) -> Layout:
        """Return the layout with the least lower confidence bound of the corrected prediction."""
        scores = np.log(_floored(self.everywhere, layouts))
        met = self.session.ranked(self.session.plan.threats)[:_LEARNT_FROM]
        if met:
            barrier = self.everywhere.site.barrier
            correction = Correction.of([barrier(item) for item in met], self._errors(met))
            mean, spread = correction.expected([barrier(layout) for layout in layouts])
            scores += mean - _HOPE * spread
        return layouts[int(scores.argmin())]

    def _errors(self, layouts: Sequence[Layout]) -> FloatArray:
        """Return the logarithms of simulated over predicted loads, first threats (layouts,)."""
        shares = self.session.assess(layouts) / _floored(self.met, layouts)
        errors: FloatArray = np.log(np.maximum(shares, _LEAST_SHARE))
        return errors


def _floored(guesses: Guesses, layouts: Sequence[Layout]) -> FloatArray:
    """Return predictions above 0: a response may be predicted to be none, which has no logarithm.

    The floor is a share of the prediction without a barrier.
    """
    least = max(_LEAST_SHARE * guesses.loads([()]).item(), _LEAST_SHARE**2)
    return np.maximum(guesses.loads(layouts), least)
