"""Gymnasium environments, and their ids: importing the package registers them."""

from typing import Final

import gymnasium as gym

from blast_env.bundled import ITEM_SITES, LARGE_SITES, REAL_SIZE, SITES, bundled_scenarios

BARRIER_ENTRY_POINT: Final = "blast_env.envs.barrier_env:BlastBarrierEnv"

WITHOUT_BUILD_ZONE: Final = frozenset({"free_field"})
"""Bundled scenarios without a build zone, listed here because loading all takes time."""

FOR_GAS: Final = frozenset(
    {
        *REAL_SIZE,
        *("clinic_front", "control_room", "guard_post", "hotel_forecourt", "ministry_kerb"),
        *("school_and_clinic", "school_wing", "shopping_street", "visitor_entrance"),
    }
)
"""Bundled scenarios with heights and a catalogue but no calibration: their environments use gas
dynamics."""


def barrier_id(scenario_name: str) -> str:
    """Return the id of the environment of a bundled scenario: `BlastBarrier/PerimeterGate-v0`."""
    words = scenario_name.replace("-", "_").split("_")
    return f"BlastBarrier/{''.join(word[:1].upper() + word[1:] for word in words)}-v0"


def register_environments() -> None:
    """Register all environments without importing their modules."""
    gym.register(
        id="BlastSimulator-v0",
        entry_point="blast_env.envs.simulator_env:BlastSimulatorEnv",
    )
    _register_barrier("BlastBarrier-v0", scenario="courtyard")
    _register_barrier("BlastBarrierIncremental-v0", scenario="courtyard", reward="incremental")
    _register_barrier("BlastBarrierGas-v0", scenario="courtyard", engine="gas")
    _register_barrier("BlastBarrierSites-v0", scenario=SITES)
    _register_barrier("BlastBarrierItemSites-v0", scenario=ITEM_SITES, engine="gas")
    _register_barrier("BlastBarrierLargeSites-v0", scenario=LARGE_SITES, engine="gas")
    for name in bundled_scenarios():
        if name not in WITHOUT_BUILD_ZONE:
            engine = {"engine": "gas"} if name in FOR_GAS else {}
            _register_barrier(barrier_id(name), scenario=name, **engine)


def _register_barrier(environment_id: str, **arguments: str) -> None:
    gym.register(
        id=environment_id,
        entry_point=BARRIER_ENTRY_POINT,
        kwargs=arguments,
    )
