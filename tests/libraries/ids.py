"""The registered environments, each with what makes its episodes cheap."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import gymnasium as gym

import blast_env  # noqa: F401  # registers the environments
from blast_env.bundled import REAL_SIZE
from blast_env.envs import FOR_GAS, barrier_id
from blast_env.evaluation.engines.gas import GasEngine
from tests.envs.small import ThinEngine
from tests.gas_sites import hut

IDS: Final = tuple(
    sorted(name for name, spec in gym.registry.items() if "blast_env" in str(spec.entry_point))
)
BARRIER_IDS: Final = tuple(name for name in IDS if name.startswith("BlastBarrier"))
OTHERS: Final = frozenset(barrier_id(name) for name in REAL_SIZE - {"street_front"})
"""Sites of real size beside one: what differs from it is looked at in `tests/envs`."""


def arguments(name: str) -> dict[str, Any]:
    """Return arguments of `gymnasium.make` with which a blast takes little time."""
    return dict(_CHEAP.get(name, {"realisations": 1, "engine": ThinEngine()}))


_SHORT: Final = GasEngine(border_m=0.0, until=0.005)

_CHEAP: Final[Mapping[str, dict[str, Any]]] = MappingProxyType(
    {
        "BlastSimulator-v0": {"scenario": "free_field", "engine": "event"},
        "BlastBarrierGas-v0": {"scenario": hut()},
        "BlastBarrierItemSites-v0": {"engine": "event", "realisations": 1},
        **{barrier_id(name): {"engine": _SHORT} for name in FOR_GAS},
    }
)
