"""The comparison of `make demo`: a league of what spends no blast on a case, and its verdict."""

from dataclasses import dataclass, replace
from math import isnan
from typing import Final

import numpy as np
from blast_agents.league import RandomLayout, Result, Standings

from blast_env.cli.evaluation_report import interval, percent

HEADERS: Final = (
    "layouts",
    "Pa s",
    "reduction",
    "95 % interval",
    "agent ahead by",
    "95 % interval",
    "ms",
)
"""Columns of the printed table."""


@dataclass(frozen=True, eq=False)
class AgentComparison:
    """The trained agent against the other entries.

    Attributes:
        standings: Of a league with one agent.
    """

    standings: Standings

    @property
    def agent(self) -> Result:
        """The trained agent."""
        return next(each for each in self.standings.results if each.training is not None)

    @property
    def random(self) -> Result:
        """The random layouts."""
        return next(each for each in self.standings.results if each.name == RandomLayout.name)

    @property
    def best_rule(self) -> Result:
        """The rule that takes off most on the mean."""
        return max(self.standings.rules, key=lambda rule: self.standings.reduction(rule).value)

    @property
    def best_rule_each(self) -> Result:
        """The best rule for each case, which only blasts with all of them can tell."""
        rules = self.standings.rules
        means = np.array([rule.loads.mean(axis=1) for rule in rules])
        chosen = [rules[number] for number in means.argmin(axis=0).tolist()]
        return replace(
            self.best_rule,
            name="best rule for each case",
            proposals=tuple(rule.proposals[case] for case, rule in enumerate(chosen)),
            loads=np.array([rule.loads[case] for case, rule in enumerate(chosen)]),
        )

    @property
    def has_learnt(self) -> bool:
        """Whether the agent beats random layouts by more than both confidence intervals."""
        agent, random = map(self.standings.reduction, (self.agent, self.random))
        return bool(agent.low > random.high)

    @property
    def verdict(self) -> str:
        """Whether the agent has learnt anything, and what it is beside the best rule."""
        gain = self.standings.difference(self.agent, self.random)
        if isnan(gain.low):
            return "No verdict: one threat says nothing about the others."
        value, low, high = gain.scaled(100.0)
        outcome = (
            "The agent has learnt: its layouts beat random ones by more than the 95 % intervals, "
            "which do not overlap"
            if self.has_learnt
            else "Not shown that the agent has learnt: its 95 % interval reaches that of random "
            "layouts"
        )
        ahead = self.standings.difference(self.agent, self.best_rule).scaled(100.0)
        return (
            f"{outcome}. It takes off {value:.1f} percentage points more than random layouts do "
            f"(95 % interval of the paired difference {low:.1f} to {high:.1f}), and "
            f"{ahead.value:+.1f} points beside the best rule, {self.best_rule.name!r} "
            f"({ahead.low:+.1f} to {ahead.high:+.1f})."
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the printed table, a row an entry; see `HEADERS`."""
        others = [each for each in self.standings.results if each is not self.agent]
        return [self._row(result) for result in (*others, self.best_rule_each, self.agent)]

    def _row(self, result: Result) -> tuple[str, ...]:
        reduction = self.standings.reduction(result)
        ahead = self.standings.difference(self.agent, result)
        return (
            result.name,
            f"{result.loads.mean():,.0f}",
            percent(reduction.value),
            interval(reduction),
            *(("-", "-") if result is self.agent else (percent(ahead.value), interval(ahead))),
            f"{result.proposal_ms:.1f}",
        )
