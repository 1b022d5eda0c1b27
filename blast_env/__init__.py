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
    from blast_env.design.proposal import propose, search
    from blast_env.evaluation.cases import LoadCase, LoadCaseSet
    from blast_env.evaluation.engines.contract import Engine
    from blast_env.evaluation.engines.gas import GasBlast, GasResult
    from blast_env.evaluation.engines.particles import Blast, BlastResult
    from blast_env.evaluation.engines.simulate import simulate
    from blast_env.evaluation.evaluate import evaluate_layout
    from blast_env.evaluation.questions.reduction import Evaluation
    from blast_env.layout import LayoutState, load_layout, write_layout
    from blast_env.site import Scenario, load_scenario, save_scenario
    from blast_env.site.blast_site import Charge

_PLACES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Blast": "blast_env.evaluation.engines.particles",
        "BlastResult": "blast_env.evaluation.engines.particles",
        "LoadCaseSet": "blast_env.evaluation.cases",
        "Charge": "blast_env.site.blast_site",
        "Engine": "blast_env.evaluation.engines.contract",
        "GasBlast": "blast_env.evaluation.engines.gas",
        "GasResult": "blast_env.evaluation.engines.gas",
        "Evaluation": "blast_env.evaluation.questions.reduction",
        "LayoutState": "blast_env.layout",
        "Scenario": "blast_env.site",
        "LoadCase": "blast_env.evaluation.cases",
        "evaluate_layout": "blast_env.evaluation.evaluate",
        "load_layout": "blast_env.layout",
        "load_scenario": "blast_env.site",
        "propose": "blast_env.design.proposal",
        "save_scenario": "blast_env.site",
        "search": "blast_env.design.proposal",
        "simulate": "blast_env.evaluation.engines.simulate",
        "write_layout": "blast_env.layout",
    }
)

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
