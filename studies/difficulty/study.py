"""Reduction of the impulse in a scenario by rule, random and searched layouts.

There are two tasks. With a *hidden* charge, one layout serves for every threat drawn from the
scenario. With a *visible* charge, every charge has its layout. Layouts are chosen on training seeds
and compared on held-out seeds, all on the same threats.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.design.rules import expected_charge, random_layout
from blast_env.design.search import ProposerKind, proposers
from blast_env.design.search.registry import Rule
from blast_env.evaluation import BlastEvaluator, Case, SeedRange, Threat, draw_threats
from blast_env.evaluation.comparison import check_something_arrives
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, Scenario
from blast_env.statistics import (
    CVAR_LEVEL,
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)


@dataclass(frozen=True, eq=False)
class WayOutcome:
    """Impulse with the layouts of one way to place a barrier.

    Impulses are those of `BlastLoads.protected_impulse_pa_s`. In the visible task a threat is a
    charge, with the mean over its realisations.

    Attributes:
        name: The way, in words.
        layouts: The layouts: one for all threats, one for each, or random ones.
        impulse_pa_s: Impulse of each layout for all threats (layouts, threats); a single row if
            every threat has its layout (1, threats).
        unprotected_pa_s: Impulse without a barrier (threats,).
    """

    name: str
    layouts: tuple[Layout, ...]
    impulse_pa_s: FloatArray
    unprotected_pa_s: FloatArray

    @property
    def modules(self) -> float:
        """Mean number of modules."""
        return float(np.mean([len(layout) for layout in self.layouts]))

    @cached_property
    def mean_pa_s(self) -> Estimate:
        """Mean impulse over the threats (and the layouts), with its interval."""
        return mean_estimate(self.impulse_pa_s.mean(axis=0))

    @cached_property
    def reduction(self) -> Estimate:
        """1 - mean impulse / mean impulse without a barrier, with its interval."""
        return reduction_estimate(self.impulse_pa_s.mean(axis=0), self.unprotected_pa_s)

    @property
    def spread(self) -> float:
        """Standard deviation of the reduction between layouts; 0 for a single one."""
        if len(self.impulse_pa_s) < 2:
            return 0.0
        return float(self.layout_reductions.std(ddof=1))

    @property
    def layout_reductions(self) -> FloatArray:
        """1 - mean impulse / mean impulse without a barrier, by layout (layouts,)."""
        means = self.impulse_pa_s.mean(axis=1)
        return np.asarray(1.0 - means / self.unprotected_pa_s.mean())

    @property
    def worst_pa_s(self) -> float:
        """Largest impulse of a threat, mean over the layouts."""
        return float(self.impulse_pa_s.max(axis=1).mean())

    @property
    def cvar_pa_s(self) -> float:
        """Mean impulse of the worst 20 % of the threats, mean over the layouts."""
        tails = [conditional_value_at_risk(row, CVAR_LEVEL) for row in self.impulse_pa_s]
        return float(np.mean(tails))

    def better_by(self, other: "WayOutcome") -> Estimate:
        """Return the difference of the reductions, this one less the other, on the same threats."""
        gained = other.impulse_pa_s.mean(axis=0) - self.impulse_pa_s.mean(axis=0)
        return reduction_estimate(self.unprotected_pa_s - gained, self.unprotected_pa_s)


@dataclass(frozen=True, eq=False)
class TaskResult:
    """All outcomes of one task.

    Attributes:
        bare: Without a barrier.
        random: Random layouts, unselected.
        rules: Layouts by rules; without a catalogue, `RULES`.
        searched: The best layouts of the search.
    """

    bare: WayOutcome
    random: WayOutcome
    rules: tuple[WayOutcome, ...]
    searched: WayOutcome

    @property
    def rows(self) -> tuple[WayOutcome, ...]:
        """All outcomes in the order of the table."""
        return (self.bare, self.random, *self.rules, self.searched)

    @property
    def best_rule(self) -> WayOutcome:
        """The rule with the largest reduction."""
        return max(self.rules, key=lambda outcome: outcome.reduction.value)

    @property
    def best(self) -> WayOutcome:
        """The outcome with the largest reduction, of the rules and the search."""
        return max(self.best_rule, self.searched, key=lambda outcome: outcome.reduction.value)


RULES: Final[Mapping[str, Rule]] = MappingProxyType(
    {
        row.title: load_plugin(row.place)
        for row in proposers(ProposerKind.RULE).values()
        if not row.needs
    }
)
"""The rules of the registry for single modules, by title."""

_BARE: Final = "no barrier"
_RANDOM: Final = "random layouts (mean)"


@dataclass(frozen=True)
class Effort:
    """Settings that determine the number of blasts of a study.

    Attributes:
        layouts: Random layouts among which the search selects.
        seeds: Held-out threats of the hidden task.
        charges: Charges of the visible task, used in the first round of both searches.
        realisations: Held-out seeds of fan and air for each charge of the visible task.
        finalists: Layouts in the second round of a search.
        hidden_round: Training threats of that round in the hidden task.
        visible_round: Training seeds per charge of that round in the visible task.
        random_hidden: Unselected random layouts compared in the hidden task.
        random_visible: Unselected random layouts compared in the visible task.
    """

    layouts: int = 500
    seeds: int = 32
    charges: int = 6
    realisations: int = 5
    finalists: int = 20
    hidden_round: int = 16
    visible_round: int = 6
    random_hidden: int = 30
    random_visible: int = 10

    @property
    def blasts(self) -> int:
        """Number of blasts of a study; fewer if some ways give the same layout."""
        others = 2 + len(RULES)  # no barrier, the rules, the best
        return (
            self.charges * self.layouts
            + self.finalists * (self.hidden_round + self.charges * self.visible_round)
            + self.seeds * (self.random_hidden + others)
            + self.charges * self.realisations * (self.random_visible + others)
        )


class DifficultyStudy:
    """Runs the blasts of both tasks in a scenario.

    Args:
        scenario: The scenario, with a build zone and a calibration.
        effort: Settings that determine the number of blasts.
        engine: Name of an engine.
        processes: Worker processes.
        progress: Called with the finished share of the blasts.

    Attributes:
        evaluator: Runs the blasts and caches them.
        held_out: Threats for the comparison of layouts in the hidden task.
    """

    def __init__(
        self,
        scenario: Scenario,
        effort: Effort,
        engine: str = "event",
        processes: int = 2,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.evaluator = BlastEvaluator(scenario, engine, cache_size=effort.blasts)
        self._scenario = scenario
        self._effort = effort
        self._processes = processes
        self._progress = progress
        self.held_out = draw_threats(scenario, SeedRange.JUDGEMENT.seeds(0, effort.seeds))
        rng = np.random.default_rng(0)
        self._pool = [random_layout(scenario, rng) for _ in range(effort.layouts)]
        self._tried = draw_threats(scenario, SeedRange.SEARCH.seeds(0, effort.charges))

    def hidden(self) -> TaskResult:
        """Return the outcomes with one layout for all threats."""
        effort, scenario = self._effort, self._scenario
        more = draw_threats(scenario, SeedRange.SEARCH.seeds(effort.charges, effort.hidden_round))
        searched = self._best_of_pool(self._first_round, more)
        bare = self._impulses([()], self.held_out)
        check_something_arrives([Case(scenario, self.held_out)], bare)

        def outcome(name: str, layouts: Sequence[Layout]) -> WayOutcome:
            return WayOutcome(name, tuple(layouts), self._impulses(layouts, self.held_out), bare[0])

        middle = expected_charge(scenario.charge)
        return TaskResult(
            bare=WayOutcome(_BARE, ((),), bare, bare[0]),
            random=outcome(_RANDOM, self._pool[: effort.random_hidden]),
            rules=tuple(outcome(name, [rule(scenario, middle)]) for name, rule in RULES.items()),
            searched=outcome(f"best of {effort.layouts} random ones", [searched]),
        )

    def visible(self) -> TaskResult:
        """Return the outcomes with one layout per charge."""
        effort, scenario = self._effort, self._scenario
        charges = [threat.charge for threat in self._tried]
        bare = np.stack([self._on_charge([()], charge)[0] for charge in charges])

        def outcome(name: str, layouts: Sequence[Layout]) -> WayOutcome:
            pairs = zip(layouts, charges, strict=True)
            impulse = np.array([self._on_charge([layout], charge) for layout, charge in pairs])
            return WayOutcome(name, tuple(layouts), impulse.reshape(1, -1), bare)

        random = self._pool[: effort.random_visible]
        on_charges = np.stack([self._on_charge(random, charge) for charge in charges], axis=1)
        searched = [
            self._best_of_pool(self._first_round[:, [number]], self._again(charge))
            for number, charge in enumerate(charges)
        ]
        return TaskResult(
            bare=WayOutcome(_BARE, ((),), bare[np.newaxis], bare),
            random=WayOutcome(_RANDOM, tuple(random), on_charges, bare),
            rules=tuple(
                outcome(name, [rule(scenario, charge) for charge in charges])
                for name, rule in RULES.items()
            ),
            searched=outcome(f"best of {effort.layouts} random ones", searched),
        )

    @cached_property
    def _first_round(self) -> FloatArray:
        """Impulses of all random layouts on the first training threats (layouts, charges)."""
        return self._impulses(self._pool, self._tried)

    def _again(self, charge: AnyCharge) -> tuple[Threat, ...]:
        """Return a charge with further training seeds."""
        first = self._effort.charges
        seeds = SeedRange.SEARCH.seeds(first, self._effort.visible_round)
        return tuple(Threat(charge, seed) for seed in seeds)

    def _best_of_pool(self, first: FloatArray, more: Sequence[Threat]) -> Layout:
        """Return the random layout with the least impulse in two rounds on training threats.

        Args:
            first: Impulses of the first round (layouts, threats).
            more: Threats of the second round, for the finalists only.
        """
        order = np.argsort(first.mean(axis=1), kind="stable")[: self._effort.finalists]
        second = self._impulses([self._pool[index] for index in order], more)
        both = np.concatenate((first[order], second), axis=1).mean(axis=1)
        return self._pool[int(order[np.argmin(both)])]

    def _on_charge(self, layouts: Sequence[Layout], charge: AnyCharge) -> FloatArray:
        """Return the impulses of layouts, means over the held-out realisations (layouts,)."""
        seeds = SeedRange.JUDGEMENT.seeds(0, self._effort.realisations)
        means: FloatArray = self._impulses(layouts, [Threat(charge, seed) for seed in seeds]).mean(
            axis=1
        )
        return means

    def _impulses(self, layouts: Sequence[Layout], threats: Sequence[Threat]) -> FloatArray:
        """Return the impulse on the protected structures, Pa*s (layouts, threats)."""
        pairs = product(layouts, threats)
        loads = self.evaluator.loads_of_many(pairs, self._processes, self._report)
        impulses = np.array([each.protected_impulse_pa_s for each in loads])
        return impulses.reshape(len(layouts), len(threats))

    def _report(self, _: float) -> None:
        """Report the finished share of all blasts, regardless of the share of a batch."""
        if self._progress is not None:
            self._progress(self.evaluator.blasts / self._effort.blasts)
