"""The comparison of `make demo`: an agent, random layouts and rules on the same unseen threats."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan
from statistics import median
from typing import Final

import numpy as np

from agents.evaluation import CasesEvaluation, evaluate_layouts
from agents.proposal import Layout, LayoutAgent
from agents.random_layouts import random_layout
from agents.rules import RULES
from agents.training.held_out import Case
from agents.unseen_cases import Proposal, propose, told_charge
from blast_env.evaluation import Estimate
from blast_env.scenario import Cell, Charge, Scenario
from blast_env.units import MS_PER_S

AGENT: Final = "MaskablePPO"
RANDOM: Final = "random layouts"


@dataclass(frozen=True, eq=False)
class Entry:
    """What one method did.

    Attributes:
        name: Of the method.
        evaluation: Of its layouts, one a case.
        proposal_ms: Time from a case to its layout, median.
    """

    name: str
    evaluation: CasesEvaluation
    proposal_ms: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """All methods on the same cases.

    Attributes:
        entries: The agent first.
    """

    entries: tuple[Entry, ...]

    @property
    def agent(self) -> Entry:
        """The trained agent."""
        return self.entries[0]

    @property
    def random(self) -> Entry:
        """The random layouts."""
        return next(entry for entry in self.entries if entry.name == RANDOM)

    def gain_over(self, entry: Entry) -> Estimate:
        """Return how much more the agent takes off than another method, paired."""
        return self.agent.evaluation.gain_over(entry.evaluation)

    @property
    def has_learnt(self) -> bool:
        """Whether the agent beats random layouts by more than both confidence intervals."""
        agent, random = self.agent.evaluation.reduction, self.random.evaluation.reduction
        return bool(agent.low > random.high)

    @property
    def verdict(self) -> str:
        """Whether the agent has learnt anything, in a sentence."""
        gain = self.gain_over(self.random)
        if isnan(gain.low):
            return "No verdict: one threat says nothing about the others."
        value, low, high = (100.0 * each for each in gain)
        outcome = (
            "The agent has learnt: its layouts beat random ones by more than the 95 % intervals, "
            "which do not overlap"
            if self.has_learnt
            else "Not shown that the agent has learnt: its 95 % interval reaches that of random "
            "layouts"
        )
        return (
            f"{outcome}. It takes off {value:.1f} percentage points more than random layouts do "
            f"(95 % interval of the paired difference {low:.1f} to {high:.1f})."
        )


class _RandomAgent:
    """Proposes layouts at random, another one every time."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def propose(self, scenario: Scenario, charge: Charge | None = None) -> Layout:  # noqa: ARG002
        """Return a random layout."""
        return random_layout(scenario, self._rng)


@dataclass(frozen=True)
class _RuleAgent:
    """Follows a rule of thumb."""

    rule: Callable[[Scenario, Charge], tuple[Cell, ...]]

    def propose(self, scenario: Scenario, charge: Charge | None = None) -> Layout:
        """Return the layout of the rule for a charge that is known."""
        assert charge is not None
        return self.rule(scenario, charge)


def compare(
    agent: LayoutAgent,
    cases: Sequence[Case],
    seed: int = 0,
    processes: int = 1,
    progress: Callable[[float], None] = lambda _: None,
) -> Comparison:
    """Let the agent, chance and the rules meet the same threats.

    Args:
        agent: The trained agent.
        cases: At least two, with visible charges.
        seed: Of the random layouts.
        processes: Worker processes.
        progress: Called with the share that is done.
    """
    methods: dict[str, LayoutAgent] = {AGENT: agent, RANDOM: _RandomAgent(seed)}
    methods |= {name: _RuleAgent(rule) for name, rule in RULES.items()}
    entries = []
    for number, (name, method) in enumerate(methods.items()):
        proposals = [propose(method, each.evaluator.scenario, told_charge(each)) for each in cases]
        tell = partial(_tell, progress, number, len(methods))
        layouts = [each.layout for each in proposals]
        evaluation = evaluate_layouts(cases, layouts, processes, progress=tell)
        entries.append(Entry(name, evaluation, _milliseconds(proposals)))
    return Comparison(tuple(entries))


def _tell(progress: Callable[[float], None], number: int, count: int, share: float) -> None:
    progress((number + share) / count)


def _milliseconds(proposals: Sequence[Proposal]) -> float:
    return median(MS_PER_S * each.seconds for each in proposals)
