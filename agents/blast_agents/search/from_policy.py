"""Search from a policy: what an agent would draw, then small changes of the best of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from blast_agents.search.by_rule import layouts_by_rule
from blast_agents.search.moves import Moves
from blast_agents.search.problem import LayoutProblem, Plan, Report, SearchResult
from blast_agents.search.session import SearchSession
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario
from blast_env.values import generator


class SamplingAgent(Protocol):
    """Proposes a layout, and draws others."""

    def propose(self, scenario: Scenario, charge: AnyCharge | None = None, /) -> Layout:
        """Return the layout that it thinks best."""

    def sample(
        self, scenario: Scenario, charge: AnyCharge | None = None, count: int = 8, seed: int = 0, /
    ) -> Sequence[Layout]:
        """Return layouts that it draws; some may be equal."""


@dataclass(frozen=True)
class PolicySearch:
    """Spends blasts on what an agent draws and on the rules, then on changes of the best of these.

    The best layouts so far are changed in turn, the better ones more often, by one or two moves;
    as they get better, what is changed gets better.

    Attributes:
        agent: The agent; the digest says which.
        digest: Of its weights, so that results of different agents are told apart.
        drawn_share: Share of the layouts that the agent draws.
        kept: How many of the best layouts are changed.
        name: In tables.
    """

    agent: SamplingAgent = field(repr=False)
    digest: str
    drawn_share: float = 0.3
    kept: int = 4
    name: str = "policy"

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was met."""
        rng = generator(seed)
        plan = Plan.of(problem, budget)
        session = SearchSession(problem, budget, plan, report)
        told = problem.told

        def explore() -> None:
            scenario = problem.scenario
            count = max(1, round(self.drawn_share * plan.exploring_layouts))
            session.assess([self.agent.propose(scenario, told)])
            session.assess([*layouts_by_rule(scenario, told).values()])
            session.assess(self.agent.sample(scenario, told, count, seed))
            moves = Moves(scenario)
            while True:
                best = session.ranked(plan.threats)[: self.kept]
                session.assess([moves.near_best(best, rng)])

        return session.result(self.name, seed, session.run(explore))
