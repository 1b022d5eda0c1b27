"""Layouts by guesses: a search that asks the surrogate first, an agent that asks nothing else."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Final

import numpy as np

from blast_agents.search.by_rule import layouts_by_rule
from blast_agents.search.from_policy import SamplingAgent
from blast_agents.search.moves import Moves
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_agents.surrogate.network import Surrogate
from blast_agents.surrogate.walls import SurrogateSite, site_of
from blast_env.arrays import FloatArray
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
    guesses: Guesses, begin_with: Iterable[Layout], most: int, rng: np.random.Generator
) -> list[Layout]:
    """Return the layouts that a search by guesses alone has met, the best first.

    Begins with given layouts, then changes the best ones so far by one or two moves.

    Args:
        guesses: Is asked, and remembers.
        begin_with: Legal layouts.
        most: Most layouts to ask about, beside those.
        rng: Draws the changes.
    """
    guesses.loads([tuple(sorted(each)) for each in begin_with])
    moves, end = Moves(guesses.case.scenario), guesses.count + most
    tries = 0
    while guesses.count < end and tries < 4 * most:
        best = guesses.ranked()[:_KEPT]
        changed = [moves.near_best(best, rng) for _ in range(min(_BATCH, end - guesses.count))]
        guesses.loads(changed)
        tries += len(changed)
    return guesses.ranked()


_BATCH: Final = 8


@dataclass(frozen=True)
class SurrogateAgent:
    """Proposes what the surrogate likes best of the rules' layouts and changes of them: no blast.

    Attributes:
        surrogate: The surrogate.
        changes: How many changed layouts it looks at, beside the rules'.
    """

    surrogate: Surrogate = field(repr=False)
    changes: int = 300

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None) -> Layout:
        """Return a layout that keeps every condition of the build zone; always the same one.

        Args:
            scenario: The scenario; it has a build zone.
            charge: Where the charge is, if that is known; otherwise the layout is for some of the
                places where the scenario may have one.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        guesses = Guesses.of(self.surrogate, _case_for(scenario, charge))
        ruled = layouts_by_rule(scenario, charge).values()
        return improved(guesses, [(), *ruled], self.changes, generator(0))[0]


@dataclass(frozen=True)
class RankedAgent:
    """Proposes what the surrogate likes best of what another agent proposes and draws: no blast.

    Attributes:
        agent: The other agent.
        surrogate: The surrogate.
        drawn: How many layouts are drawn.
    """

    agent: SamplingAgent = field(repr=False)
    surrogate: Surrogate = field(repr=False)
    drawn: int = 16

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None) -> Layout:
        """Return a layout that keeps every condition of the build zone; always the same one.

        Args:
            scenario: As for `SurrogateAgent`.
            charge: Likewise.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        guesses = Guesses.of(self.surrogate, _case_for(scenario, charge))
        proposed = self.agent.propose(scenario, charge)
        drawn = self.agent.sample(scenario, charge, self.drawn, 0)
        guesses.loads([tuple(sorted(each)) for each in (proposed, *drawn)])
        return guesses.ranked()[0]


def _case_for(scenario: Scenario, charge: AnyCharge | None) -> Case:
    """Return what a proposal is guessed against: the charge, or some of those that may be."""
    if charge is not None:
        return practice_visible(scenario, charge, 1, 0)
    drawn = practice_hidden(scenario, _DRAWN_CHARGES, 1, 0)
    return replace(drawn, threats=one_of_each_charge(drawn.threats)[:_HIDDEN_CHARGES])


@dataclass(frozen=True)
class SurrogateSearch:
    """Spends each blast on what the surrogate likes best of what is left.

    First the rules' layouts and the best that a search by guesses alone has found, in turn; then
    changes of the best by blasts, of which the surrogate picks one out of many.

    Against a hidden charge layouts meet a few places alone. What the surrogate says of all places,
    times by how much it was wrong at those, tells more of a layout than its loads there: it decides
    what is changed, and what meets the other places in the end.

    Attributes:
        surrogate: The surrogate; the digest says which.
        digest: Of its file, and of the agent's weights, so that results of different ones are told
            apart.
        agent: An agent whose proposal and draws the search by guesses begins with, too; the
            proposal is the first to get a blast. `None` begins with the rules alone.
        agent_draws: How many layouts it draws.
        guesses: Layouts that it is asked about before the first blast.
        drawn: Changes that it picks one out of, afterwards.
        guessed_share: Share of the blasts for what was found by guesses alone.
        name: In tables.
    """

    surrogate: Surrogate = field(repr=False)
    digest: str
    agent: SamplingAgent | None = field(default=None, repr=False)
    agent_draws: int = 64
    guesses: int = 600
    drawn: int = 16
    guessed_share: float = 0.4
    name: str = "surrogate"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met.

        Raises:
            BlastEnvError: If nothing is protected.
        """
        rng = generator(seed)
        plan = _plan(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        estimates = _Estimates.of(self.surrogate, problem, session)
        guesses = estimates.everywhere

        def explore() -> None:
            rules = layouts_by_rule(problem.scenario, problem.told).values()
            proposed = self._from_agent(problem, seed)
            session.assess(proposed[:1])
            found = improved(guesses, [(), *rules, *proposed], self.guesses, rng)
            share = max(1, round(self.guessed_share * plan.exploring_layouts))
            ruled = sorted(rules, key=lambda layout: guesses.loads([layout]).item())
            ruled = ruled[: ceil(plan.exploring_layouts / _LAYOUTS_A_RULE)]
            for first, second in zip(found[:share], [*ruled, *found[share:]], strict=False):
                session.assess([first])
                session.assess([second])
            self._go_on(session, estimates, rng)

        def choose() -> None:
            most = len(problem.threats)
            for layout in estimates.ranked():
                session.assess([layout], most)

        return session.result(self.name, seed, session.run(explore, choose))

    def _from_agent(self, problem: LayoutProblem, seed: int) -> list[Layout]:
        """Return what the agent proposes, then what it draws."""
        if self.agent is None:
            return []
        scenario, told = problem.scenario, problem.told
        drawn = self.agent.sample(scenario, told, self.agent_draws, seed)
        return [self.agent.propose(scenario, told), *drawn]

    def _go_on(
        self, session: SearchSession, estimates: "_Estimates", rng: np.random.Generator
    ) -> None:
        """Change the best by blasts, one of many changes at a time, until the blasts are spent."""
        guesses = estimates.everywhere
        moves = Moves(guesses.case.scenario)
        tried: set[Layout] = set(estimates.ranked())
        while True:
            best = estimates.ranked()[:_KEPT]
            changed = [moves.near_best(best, rng) for _ in range(self.drawn)]
            new = [each for each in dict.fromkeys(changed) if each not in tried] or changed
            chosen = new[int(guesses.loads(new).argmin())]
            tried.add(chosen)
            session.assess([chosen])


_LAYOUTS_A_RULE: Final = 8
"""Of so many layouts that get a blast one is a rule's, as long as there are some."""

_LEAST_PLACES: Final = 4
"""Of a hidden charge, that a layout meets before it is said how wrong the surrogate is of it."""

_CHOOSING_SHARE: Final = 0.4
"""Of the blasts, for the places of a hidden charge that the best layouts have not met."""


def _plan(problem: LayoutProblem, budget: int) -> Plan:
    """Return how the blasts are divided; against a hidden charge for few layouts, met well."""
    plan = Plan.of(problem, budget)
    most = len(problem.threats)
    places = min(max(plan.threats, _LEAST_PLACES), most, budget)
    if problem.told is not None or places == most:
        return plan
    return Plan(places, budget - min(round(_CHOOSING_SHARE * budget), budget - places))


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
    def of(
        cls, surrogate: Surrogate, problem: LayoutProblem, session: SearchSession
    ) -> "_Estimates":
        """Begin with none."""

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
        wrong_by = self.session.assess(layouts) / self.met.loads(layouts)
        order = np.argsort(wrong_by * self.everywhere.loads(layouts), kind="stable")
        return [layouts[index] for index in order.tolist()]
