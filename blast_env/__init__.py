"""Protective-layout optimisation: barriers on a site against blast loads on buildings.

Two kinds of model behind one interface: the particle model of the paper, in plan, and gas dynamics,
in three dimensions with real heights. `import blast_env` registers the environments with Gymnasium
and imports nothing heavier; each name below is imported on first access.
"""

from typing import TYPE_CHECKING

from blast_env.bundled import bundled_scenarios
from blast_env.envs import register_environments as _register_environments
from blast_env.lazy import on_first_use
from blast_env.provenance import package_version

if TYPE_CHECKING:
    from blast_env.design.proposal import propose, search
    from blast_env.evaluation.cases import LoadCase, LoadCaseSet
    from blast_env.evaluation.engines.contract import Engine
    from blast_env.evaluation.engines.gas import GasBlast, GasResult
    from blast_env.evaluation.engines.particles import Blast, BlastResult
    from blast_env.evaluation.engines.simulation import simulate
    from blast_env.evaluation.evaluate import evaluate_layout
    from blast_env.evaluation.questions.reduction import Evaluation
    from blast_env.layout import LayoutState, load_layout, write_layout
    from blast_env.site import Scenario, load_scenario, save_scenario
    from blast_env.site.blast_site import Charge
else:
    __getattr__, __dir__ = on_first_use(__name__)

__version__ = package_version()
__all__ = [
    "Blast",
    "BlastResult",
    "Charge",
    "Engine",
    "Evaluation",
    "GasBlast",
    "GasResult",
    "LayoutState",
    "LoadCase",
    "LoadCaseSet",
    "Scenario",
    "bundled_scenarios",
    "evaluate_layout",
    "load_layout",
    "load_scenario",
    "propose",
    "save_scenario",
    "search",
    "simulate",
    "write_layout",
]


_register_environments()
