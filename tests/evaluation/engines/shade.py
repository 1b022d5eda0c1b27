"""A fourth engine, as a user writes one: a formula instead of a blast."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import ClassVar

import numpy as np

from blast_env.evaluation import BlastLoads, StructureLoad
from blast_env.evaluation.engines import Engine
from blast_env.geometry import Element
from blast_env.layout import charge_against
from blast_env.site import AnyCharge, Scenario


@dataclass(frozen=True)
class ShadeEngine(Engine):
    """Each structure takes less, the farther it is and the more modules stand.

    Attributes:
        share: What is left of an impulse behind one module.
    """

    share: float = 0.9
    name: str = "shade"
    version: str = "shade 1"

    title: ClassVar[str] = "Shade"
    validated_range: ClassVar[str] = "the validated range of a shade"

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return a load of 1,000 Pa s at 1 m, which falls with the distance of the centre."""
        x_m, y_m = charge_against(scenario, layout, charge).position_m
        loads = []
        for structure in scenario.structures:
            left, bottom, right, top = structure.rectangle_m
            distance_m = hypot(0.5 * (left + right) - x_m, 0.5 * (bottom + top) - y_m)
            loads.append(
                StructureLoad.on(
                    structure,
                    1000.0 / distance_m * self.share ** len(layout),
                    notes=("a formula, not a blast",),
                )
            )
        modules = [structure.rows * structure.columns for structure in scenario.structures]
        return BlastLoads(tuple(loads), np.repeat([load.impulse_pa_s for load in loads], modules))
