"""An engine for tests of searches: what stands in the way of rays takes them off, at no cost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blast_env.evaluation.engines import BlastLoads, StructureLoad
from blast_env.geometry import Element
from blast_env.layout import charge_against
from blast_env.site import AnyCharge, Scenario
from blast_env.units import MODULE_SIDE_M
from tests.evaluation.engines.shade import ShadeEngine

COUNT = 40
NOISE = 0.1


@dataclass(frozen=True)
class RaysEngine(ShadeEngine):
    """Rays go from the charge to points across a structure; a module leaves a share of each.

    The seed shifts the points, and makes the whole blast up to a tenth stronger or weaker.
    """

    share: float = 0.1
    name: str = "rays"
    version: str = "rays 1"

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return loads of up to 1,000 Pa s."""
        start = np.array(charge_against(scenario, layout, charge).position_m)
        shift, strength = np.random.default_rng(seed).random(2)
        x_m, y_m = scenario.zone.centres_m
        places = np.array([(x_m[cell[:2]], y_m[cell[:2]]) for cell in layout]).reshape(-1, 2)
        ahead = places - start
        loads = []
        for structure in scenario.structures:
            left, bottom, right, top = structure.rectangle_m
            to_centre = np.array([0.5 * (left + right), 0.5 * (bottom + top)]) - start
            across = np.array([-to_centre[1], to_centre[0]]) / np.hypot(*to_centre)
            along = (np.arange(COUNT) + shift) / COUNT - 0.5
            rays = to_centre + min(right - left, top - bottom) * along[:, np.newaxis] * across
            unit = rays / np.hypot(*rays.T)[:, np.newaxis]
            beside_m = np.abs(np.outer(unit[:, 0], ahead[:, 1]) - np.outer(unit[:, 1], ahead[:, 0]))
            half_m = 0.5 * MODULE_SIDE_M * np.abs(unit).sum(axis=1, keepdims=True)
            passed = (self.share ** (beside_m < half_m).sum(axis=1)).mean()
            pa_s = 1000.0 * float(passed) * (1.0 + NOISE * (2.0 * strength - 1.0))
            loads.append(StructureLoad.on(structure, pa_s, notes=("a formula, not a blast",)))
        modules = [structure.rows * structure.columns for structure in scenario.structures]
        return BlastLoads(tuple(loads), np.repeat([load.impulse_pa_s for load in loads], modules))
