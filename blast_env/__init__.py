"""Protective-layout optimisation on a two-dimensional discrete-element blast model.

Importing the package registers its environments with Gymnasium.
"""

from blast_env.engines import Blast, BlastResult, simulate, simulate_many
from blast_env.envs.registration import register_environments as _register_environments
from blast_env.evaluation import LayoutEvaluation, evaluate_layout
from blast_env.physics.scene import Charge
from blast_env.provenance import package_version
from blast_env.scenario import (
    Scenario,
    bundled_scenarios,
    load_layout,
    load_scenario,
    save_scenario,
    write_layout,
)

__version__ = package_version()
__all__ = [
    "Blast",
    "BlastResult",
    "Charge",
    "LayoutEvaluation",
    "Scenario",
    "bundled_scenarios",
    "evaluate_layout",
    "load_layout",
    "load_scenario",
    "save_scenario",
    "simulate",
    "simulate_many",
    "write_layout",
]

_register_environments()
