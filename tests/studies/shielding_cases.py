"""Blocks and made-up loads for tests of the shielding study."""

import numpy as np

from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.studies.shielding.ratios import LoadKind
from blast_env.studies.shielding.report import BlockGeometry, ShieldingReport, ShieldingStudy

NARROW = BlockGeometry(margin_m=10.0)
SMALL = BlockGeometry(side_modules=9, stand_off_m=3.0, margin_m=6.0)
DENSE = with_overrides(
    SimulationParameters(),
    {
        "air": {"spacing_units": 3.0, "radius_units": 1.0, "elasticity": 1.0, "mass": 0.1},
        "explosive": {"elasticity": 1.0},
        "contact": {"module_restitution": 0.9},
    },
)


def made_up(ratio: float, seeds: int = 3) -> ShieldingReport:
    """A report in which every gauge has the same share of a free field that falls as 1 / path."""
    study = ShieldingStudy("ballistic", seeds=tuple(range(seeds)), geometry=NARROW)
    strength = np.arange(1.0, seeds + 1.0)[:, None, None] * np.ones((1, len(LoadKind), 1))
    block = ratio * strength / NARROW.gauge_path_m
    return ShieldingReport(study, block, strength / NARROW.wall_path_m)
