"""What gas dynamics says of the particle model: order, overstatement and regret of its layouts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.stats import spearmanr

from blast_env.arrays import FloatArray
from blast_env.evaluation import BlastEvaluator, SeedRange, Threat
from blast_env.geometry import Layout
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.statistics import Estimate, mean_estimate, reductions

PRESETS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "collisional": "collisional_kb",
        "collisional_fine": "collisional_fine_kb",
        "ballistic": "ballistic_kb_100kg",
    }
)
"""The presets that are judged, each with the calibration that goes with it."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Layouts under charges, by the particle model and by gas dynamics.

    Attributes:
        particle: Reduction by the particle model, mean over its seeds (layouts, charges).
        gas: Reduction by gas dynamics (layouts, charges).
    """

    particle: FloatArray
    gas: FloatArray

    @cached_property
    def rank_correlations(self) -> FloatArray:
        """Rank correlation of the two reductions for each charge (charges,)."""
        pairs = zip(self.particle.T, self.gas.T, strict=True)
        return np.array([spearmanr(*pair).statistic for pair in pairs])

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
        """How many times the mean reduction of gas dynamics the particle model promises."""
        particle, gas = self.means
        return particle / gas

    @property
    def factor(self) -> float:
        """By which the particle model's reductions come nearest to those of gas dynamics."""
        return float((self.particle * self.gas).sum() / (self.particle**2).sum())

    @property
    def errors(self) -> tuple[float, float]:
        """Root mean squares: gas less `factor` times particles, and gas less its own mean.

        The second is what one gets without looking at the layout.
        """
        left = self.gas - self.factor * self.particle
        return float(np.sqrt((left**2).mean())), float(self.gas.std())

    @property
    def regret(self) -> Estimate:
        """Gas reduction lost by taking the layout that the particle model likes best.

        Against the best of these layouts; the mean over the charges, with its 95 % interval.
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
    presets: Mapping[str, str] = PRESETS,
    store: Path | None = None,
) -> dict[str, Judgement]:
    """Return what gas dynamics and each preset of the particle model say of layouts.

    Args:
        scenario: The scenario.
        layouts: At least three.
        charges: At least one.
        seeds: Blasts of the particle model for each layout and charge.
        processes: Worker processes.
        progress: Called with the share of the gas blasts that is done; the particle model's
            follow.
        presets: Presets by name, each with its calibration.
        store: Folder for the gas blasts, from which a study that was broken off goes on.
    """
    drawn = SeedRange.JUDGEMENT.seeds(0, seeds)
    evaluator = BlastEvaluator(scenario, "gas", cache=store)
    gas = _impulses(evaluator, layouts, charges, drawn[:1], processes, progress)
    of_gas = reductions(gas[1:], _bare(gas))
    found = {}
    for preset, calibration in presets.items():
        evaluator = BlastEvaluator(_with_preset(scenario, preset, calibration), "event")
        particle = _impulses(evaluator, layouts, charges, drawn, processes, None)
        found[preset] = Judgement(reductions(particle[1:], _bare(particle)), of_gas)
    return found


def _with_preset(scenario: Scenario, preset: str, calibration: str) -> Scenario:
    document = scenario.model_dump()
    document["calibration"] = calibration
    return Scenario.from_document(document, scenario.name).with_simulation(preset)


def _bare(impulses: FloatArray) -> FloatArray:
    """Return the impulses without a barrier as often as there are layouts."""
    return np.broadcast_to(impulses[0], impulses[1:].shape)


def _impulses(
    evaluator: BlastEvaluator,
    layouts: Sequence[Layout],
    charges: Sequence[Charge],
    seeds: Sequence[int],
    processes: int,
    progress: Callable[[float], None] | None,
) -> FloatArray:
    """Return the impulse without and with each layout, Pa s (1 + layouts, charges)."""
    pairs = [
        (layout, Threat(charge, seed))
        for layout in ((), *layouts)
        for charge in charges
        for seed in seeds
    ]
    loads = evaluator.loads_of_many(pairs, processes, progress)
    values = np.array([each.protected_impulse_pa_s for each in loads])
    means: FloatArray = values.reshape(1 + len(layouts), len(charges), len(seeds)).mean(axis=2)
    return means
