"""Protective-layout optimisation: barriers on a site against blast loads on buildings.

Two kinds of model behind one interface: the particle model of the paper, in plan, and gas dynamics,
in three dimensions with real heights. `import blast_env` registers the environments with Gymnasium
and imports nothing heavier; each name below is imported on first access.
"""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from blast_env.bundled import bundled_scenarios
from blast_env.envs import register_environments as _register_environments
from blast_env.provenance import package_version

if TYPE_CHECKING:  # the same names as in `_PLACES`, for editors and type checkers
    from blast_agents.proposal import propose, search

    from blast_env.engines.contract import Engine
    from blast_env.engines.gas import GasBlast, GasResult
    from blast_env.engines.particles import Blast, BlastResult
    from blast_env.engines.simulate import simulate, simulate_many
    from blast_env.evaluation.cases import Case, Threat
    from blast_env.evaluation.report import LayoutEvaluation, evaluate_layout
    from blast_env.physics.scene import Charge
    from blast_env.scenario import (
        Placement,
        Scenario,
        load_layout,
        load_scenario,
        save_scenario,
        write_layout,
    )

_PLACES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Blast": "blast_env.engines.particles",
        "BlastResult": "blast_env.engines.particles",
        "Case": "blast_env.evaluation.cases",
        "Charge": "blast_env.physics.scene",
        "Engine": "blast_env.engines.contract",
        "GasBlast": "blast_env.engines.gas",
        "GasResult": "blast_env.engines.gas",
        "LayoutEvaluation": "blast_env.evaluation.report",
        "Placement": "blast_env.scenario",
        "Scenario": "blast_env.scenario",
        "Threat": "blast_env.evaluation.cases",
        "evaluate_layout": "blast_env.evaluation.report",
        "load_layout": "blast_env.scenario",
        "load_scenario": "blast_env.scenario",
        "propose": "blast_agents.proposal",
        "save_scenario": "blast_env.scenario",
        "search": "blast_agents.proposal",
        "simulate": "blast_env.engines.simulate",
        "simulate_many": "blast_env.engines.simulate",
        "write_layout": "blast_env.scenario",
    }
)

__version__ = package_version()
__all__ = [
    "Blast",
    "BlastResult",
    "Case",
    "Charge",
    "Engine",
    "GasBlast",
    "GasResult",
    "LayoutEvaluation",
    "Placement",
    "Scenario",
    "Threat",
    "bundled_scenarios",
    "evaluate_layout",
    "load_layout",
    "load_scenario",
    "propose",
    "save_scenario",
    "search",
    "simulate",
    "simulate_many",
    "write_layout",
]


def __getattr__(name: str) -> object:
    """Import a public name on first access."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, imported or not."""
    return sorted({*globals(), *__all__})


_register_environments()
