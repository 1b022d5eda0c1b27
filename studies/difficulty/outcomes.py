"""What ways to place a barrier leave of the impulse, with the uncertainty."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.geometry import Layout
from blast_env.statistics import (
    CVAR_LEVEL,
    Estimate,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
)


@dataclass(frozen=True, eq=False)
class WayOutcome:
    """What one way to place a barrier leaves of the impulse.

    Impulses are those of `BlastLoads.protected_impulse_pa_s`. In the visible task a threat is a
    charge, with the mean over its realisations.

    Attributes:
        name: The way, in words.
        layouts: What was built: one layout for all threats, one for each, or random ones.
        impulse_pa_s: Impulse of layouts that each meet all threats (layouts, threats); a single row
            where every threat has a layout of its own.
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
        """Return by how much more than another one this reduces, on the same threats."""
        gained = other.impulse_pa_s.mean(axis=0) - self.impulse_pa_s.mean(axis=0)
        return reduction_estimate(self.unprotected_pa_s - gained, self.unprotected_pa_s)


@dataclass(frozen=True, eq=False)
class TaskResult:
    """All outcomes of one task.

    Attributes:
        bare: Without a barrier.
        random: Random layouts, as they come.
        rules: Layouts by hand; without a catalogue the wall at `STAND_OFFS`.
        searched: The best that was searched.
    """

    bare: WayOutcome
    random: WayOutcome
    rules: tuple[WayOutcome, ...]
    searched: WayOutcome

    @property
    def rows(self) -> tuple[WayOutcome, ...]:
        """All of them in the order of the table."""
        return (self.bare, self.random, *self.rules, self.searched)

    @property
    def best_rule(self) -> WayOutcome:
        """The best of the layouts by hand."""
        return max(self.rules, key=lambda outcome: outcome.reduction.value)

    @property
    def best(self) -> WayOutcome:
        """What reduces most."""
        return max(self.best_rule, self.searched, key=lambda outcome: outcome.reduction.value)
