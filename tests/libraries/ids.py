"""The registered environments with one reward, each with what makes its episodes cheap."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import gymnasium as gym

import blast_env  # noqa: F401  # registers the environments
from blast_env.sites import FAMILIES, ITEM_SITES, LARGE_SITES, SITES, SiteSource
from tests.agents.training_runs import small_scenario as sparse_site
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
    """Return arguments of `gymnasium.make` with which a site and a blast take little time."""
    return dict(_CHEAP.get(name, {"realisations": 1, "engine": ThinEngine()}))


def few(family: str) -> SiteSource:
    """Return two sites of a family, which one process generates once."""
    return SiteSource.training(2, FAMILIES[family])


_CHEAP: Final[Mapping[str, dict[str, Any]]] = MappingProxyType(
    {
        "BlastSimulator-v0": {"scenario": sparse_site(), "engine": "event"},
        "BlastBarrierGas-v0": {"scenario": hut()},
        "BlastBarrierSites-v0": {"scenario": few(SITES), "realisations": 1, "engine": ThinEngine()},
        "BlastBarrierItemSites-v0": {
            "scenario": few(ITEM_SITES),
            "engine": "event",
            "realisations": 1,
        },
        "BlastBarrierLargeSites-v0": {
            "scenario": few(LARGE_SITES),
            "realisations": 1,
            "engine": ThinEngine(),
        },
    }
)
