"""Judgement of the particle model by gas dynamics: order, overstatement and regret of layouts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.stats import spearmanr

from blast_env.arrays import FloatArray
from blast_env.evaluation import BlastEvaluator, LoadCase, SeedRange
from blast_env.geometry import Layout
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.statistics import Estimate, mean_estimate, reductions

PRESETS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "collisional": "collisional_kb",
        "collisional_fine": "collisional_fine_kb",
        "ballistic": "ballistic_kb_100kg",
    }
)
"""The judged presets, each with its calibration."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Layouts under charges, by the particle model and by gas dynamics.

    Attributes:
        particle: Reduction by the particle model, mean over its seeds (layouts, charges).
        gas: Reduction by gas dynamics (layouts, charges).
    """

    particle: FloatArray
    gas: FloatArray

    @property
    def all_pairs(self) -> float:
        """Rank correlation over all layouts and charges together."""
        return float(spearmanr(self.particle.ravel(), self.gas.ravel()).statistic)

    @property
    def means(self) -> tuple[float, float]:
        """Mean reduction by the particle model and by gas dynamics."""
        return float(self.particle.mean()), float(self.gas.mean())

    @property
    def overstatement(self) -> float:
        """Ratio of the mean reductions by the particle model and by gas dynamics."""
        particle, gas = self.means
        return particle / gas

    @property
    def regret(self) -> Estimate:
        """Loss of gas reduction by the particle model's choice, against the best of the layouts.

        It is the mean over the charges, with its 95 % interval.
        """
        liked = self.particle.argmax(axis=0)
        taken = self.gas[liked, np.arange(self.gas.shape[1])]
        return mean_estimate(self.gas.max(axis=0) - taken)


def judge(
    scenario: Scenario,
    layouts: Sequence[Layout],
    charges: Sequence[Charge],
    seeds: int = 4,
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Judgement]:
    """Return the reductions by gas dynamics and by each preset of the particle model.

    Args:
        scenario: The scenario.
        layouts: At least three.
        charges: At least one.
        seeds: Number of blasts of the particle model for each layout and charge.
        processes: Number of worker processes.
        progress: Called with the finished share of the gas blasts; those of the particle model
            follow.
    """
    drawn = SeedRange.TEST.seeds(0, seeds)
    evaluator = BlastEvaluator(scenario, "gas")
    gas = _impulses(evaluator, layouts, charges, drawn[:1], processes, progress)
    of_gas = reductions(gas[1:], _bare(gas))
    found = {}
    for preset, calibration in PRESETS.items():
        evaluator = BlastEvaluator(_with_preset(scenario, preset, calibration), "event")
        particle = _impulses(evaluator, layouts, charges, drawn, processes, None)
        found[preset] = Judgement(reductions(particle[1:], _bare(particle)), of_gas)
    return found


def _with_preset(scenario: Scenario, preset: str, calibration: str) -> Scenario:
    document = scenario.model_dump()
    document["calibration"] = calibration
    return Scenario.from_document(document, scenario.name).with_simulation(preset)


def _bare(impulses: FloatArray) -> FloatArray:
    """Return the impulses without a barrier, repeated for each layout (layouts, charges)."""
    return np.broadcast_to(impulses[0], impulses[1:].shape)


def _impulses(
    evaluator: BlastEvaluator,
    layouts: Sequence[Layout],
    charges: Sequence[Charge],
    seeds: Sequence[int],
    processes: int,
    progress: Callable[[float], None] | None,
) -> FloatArray:
    """Return the impulses without a barrier and with each layout, Pa s (1 + layouts, charges)."""
    pairs = [
        (layout, LoadCase(charge, seed))
        for layout in ((), *layouts)
        for charge in charges
        for seed in seeds
    ]
    loads = evaluator.loads_of_many(pairs, processes, progress)
    values = np.array([load.protected_impulse_pa_s for load in loads])
    means: FloatArray = values.reshape(1 + len(layouts), len(charges), len(seeds)).mean(axis=2)
    return means
