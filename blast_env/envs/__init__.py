"""Gymnasium environments, and their ids: importing the package registers them."""

from typing import Final

import gymnasium as gym

from blast_env.bundled import ITEM_SITES, LARGE_SITES, SITES

BARRIER_ENTRY_POINT: Final = "blast_env.envs.barrier_env:BlastBarrierEnv"


def register_environments() -> None:
    """Register all environments without importing their modules.

    Without Gymnasium's checker: it knows no vectors as rewards, and in 1.4.0 every step ends in its
    error after a first `reset` that an environment refuses.
    """
    gym.register(
        id="BlastSimulator-v0",
        entry_point="blast_env.envs.simulator_env:BlastSimulatorEnv",
        disable_env_checker=True,
    )
    gym.register(
        id="BlastBarrier-MO-v0",
        entry_point="blast_env.envs.two_objectives:BlastBarrierTwoObjectivesEnv",
        disable_env_checker=True,
        kwargs={"scenario": "courtyard"},
    )
    _register_barrier("BlastBarrier-v0", scenario="courtyard")
    _register_barrier("BlastBarrierGas-v0", scenario="courtyard", engine="gas")
    _register_barrier("BlastBarrierSites-v0", scenario=SITES)
    _register_barrier("BlastBarrierItemSites-v0", scenario=ITEM_SITES)
    _register_barrier("BlastBarrierLargeSites-v0", scenario=LARGE_SITES)


def _register_barrier(environment_id: str, **arguments: str) -> None:
    gym.register(
        id=environment_id,
        entry_point=BARRIER_ENTRY_POINT,
        vector_entry_point="blast_env.envs.vector_env:BlastBarrierVectorEnv",
        disable_env_checker=True,
        kwargs=arguments,
    )
