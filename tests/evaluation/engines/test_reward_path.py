"""From the last step to the reward: how much a reader has to follow, without the blast."""

import sys
from collections.abc import Sequence
from types import FrameType
from typing import Any

import gymnasium as gym
import numpy as np

from blast_env.evaluation.engines import BlastLoads, Engine, StructureLoad
from blast_env.geometry import Element
from blast_env.site import AnyCharge, Scenario

MOST_FUNCTIONS, MOST_MODULES = 70, 15
"""What the last step may call of ours; it was 131 functions of 25 modules once."""


class ConstantEngine(Engine):
    """Tells the same loads of everything: nothing of the way is its own."""

    name, version = "constant", "constant 1"

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return 100 Pa s on everything."""
        loads = [
            StructureLoad(
                *(each.name, each.protected, each.weight, 0.0, 0.0, 100.0, None, 1.0, True),
                *((), each.name),
            )
            for each in scenario.structures
        ]
        return BlastLoads(
            tuple(loads), np.ones(sum(each.rows * each.columns for each in scenario.structures))
        )


def written_by_hand(qualified_name: str) -> bool:
    """Whether somebody wrote the function: no comprehension, no method that a dataclass made."""
    return "<" not in qualified_name.split(".")[-1] and "__create_fn__" not in qualified_name


def test_the_way_to_the_reward_is_short() -> None:
    env: Any = gym.make("BlastBarrier-v0", engine=ConstantEngine()).unwrapped
    env.reset(seed=0)
    for action in (160, 176):
        env.step(action)
    called: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        module = str(frame.f_globals.get("__name__", ""))
        if event == "call" and module.split(".")[0] in ("blast_env", "blast_agents"):
            called.add((module, frame.f_code.co_qualname))

    sys.setprofile(note)
    try:
        _, _, ended, _, _ = env.step(env.action_space.n - 1)
    finally:
        sys.setprofile(None)
    assert ended
    functions = {each for each in called if written_by_hand(each[1])}
    modules = {module for module, _ in functions}
    assert "blast_env.evaluation.engines.contract" in modules
    assert len(functions) <= MOST_FUNCTIONS, sorted(functions)
    assert len(modules) <= MOST_MODULES, sorted(modules)
