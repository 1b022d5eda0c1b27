"""The registered environments with one reward, each with what makes its episodes cheap."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import gymnasium as gym

import blast_env  # noqa: F401  # registers the environments
from tests.envs.small import ThinEngine
from tests.gas_sites import hut

IDS: Final = tuple(
    sorted(
        name
        for name, spec in gym.registry.items()
        if "blast_env" in str(spec.entry_point) and "-MO-" not in name
    )
)
BARRIER_IDS: Final = tuple(name for name in IDS if name.startswith("BlastBarrier"))


def arguments(name: str) -> dict[str, Any]:
    """Return arguments of `gymnasium.make` with which a blast takes little time."""
    return dict(_CHEAP.get(name, {"realisations": 1, "engine": ThinEngine()}))


_CHEAP: Final[Mapping[str, dict[str, Any]]] = MappingProxyType(
    {
        "BlastSimulator-v0": {"scenario": "free_field", "engine": "event"},
        "BlastBarrierGas-v0": {"scenario": hut()},
        "BlastBarrierItemSites-v0": {"engine": "event", "realisations": 1},
    }
)
