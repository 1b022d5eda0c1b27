"""Scenario, layouts and threats that the tests of evaluations share."""

from collections.abc import Sequence

import numpy as np

from blast_env import Charge
from blast_env.evaluation import (
    BlastEvaluator,
    BlastLoads,
    Evaluation,
    LoadCase,
    LoadCaseSet,
    StructureLoad,
    compare,
    draw_threats,
)
from blast_env.geometry import Element
from blast_env.site import Scenario
from tests.scenarios import BALLISTIC_COURTYARD

COURTYARD = BALLISTIC_COURTYARD
SEEDS = (0, 1, 2, 3)
THREATS = draw_threats(COURTYARD, SEEDS)

WALL = tuple((row, 0) for row in range(9, 18)) + tuple((row, 0) for row in range(22, 29))
"""All 16 modules, on both sides of the path."""

FEW = ((4, 0), (5, 0), (6, 1))

SHADOW = tuple((row, 0) for row in range(22, 32))
"""All of the building as seen from `BEHIND_SHADOW`: y = 16.4 m to 20 m at x = 13 m."""

BEHIND_SHADOW = tuple(LoadCase(Charge((5.0, 20.0), 100.0), seed) for seed in (0, 1, 2))


def loads_of(scenario: Scenario, impulse_pa_s: float, *, in_range: bool = True) -> BlastLoads:
    """Return loads by hand, the same on every structure."""
    loads = (
        StructureLoad.on(structure, impulse_pa_s, 0.0, in_range)
        for structure in scenario.structures
    )
    return BlastLoads(tuple(loads), np.zeros(0))


def evaluate_against(
    evaluator: BlastEvaluator, layout: Sequence[Element], threats: Sequence[LoadCase]
) -> Evaluation:
    """Compare one layout with no barrier on some threats."""
    return compare(evaluator, [LoadCaseSet(evaluator.scenario, tuple(threats))], [layout])
