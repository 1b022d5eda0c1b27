"""The environments that importing the package registers with Gymnasium."""

from typing import Final

import gymnasium as gym

from blast_env.scenario import bundled_scenarios
from blast_env.sites import SiteSource

BARRIER_ENTRY_POINT: Final = "blast_env.envs.barrier_env:BlastBarrierEnv"

WITHOUT_BUILD_ZONE: Final = frozenset({"free_field"})
"""Bundled scenarios in which nothing can be placed; named here, since loading all takes time."""


def barrier_id(scenario_name: str) -> str:
    """Return the id of the environment of a bundled scenario: `BlastBarrier/PerimeterGate-v0`."""
    words = scenario_name.replace("-", "_").split("_")
    return f"BlastBarrier/{''.join(word[:1].upper() + word[1:] for word in words)}-v0"


def register_environments() -> None:
    """Register all environments; nothing of them is loaded yet."""
    gym.register(
        id="BlastSimulator-v0",
        entry_point="blast_env.envs.simulator_env:BlastSimulatorEnv",
    )
    gym.register(
        id="BlastBarrier-v0", entry_point=BARRIER_ENTRY_POINT, kwargs={"scenario": "courtyard"}
    )
    gym.register(
        id="BlastBarrierIncremental-v0",
        entry_point=BARRIER_ENTRY_POINT,
        kwargs={"scenario": "courtyard", "reward": "incremental"},
    )
    gym.register(
        id="BlastBarrierGas-v0",
        entry_point=BARRIER_ENTRY_POINT,
        kwargs={"scenario": "courtyard", "engine": "gas"},
    )
    gym.register(
        id="BlastBarrierSites-v0",
        entry_point=BARRIER_ENTRY_POINT,
        kwargs={"scenario": SiteSource.training()},
    )
    for name in bundled_scenarios():
        if name not in WITHOUT_BUILD_ZONE:
            gym.register(
                id=barrier_id(name), entry_point=BARRIER_ENTRY_POINT, kwargs={"scenario": name}
            )
