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

MOST_FUNCTIONS, MOST_MODULES = 44, 10


class ConstantEngine(Engine):
    """Has the same loads for everything: none of the way is its own."""

    name, version = "constant", "constant 1"

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return 100 Pa s on everything."""
        loads = [
            StructureLoad(
                *(each.name, each.protected, each.weight, 100.0, None, 1.0, True, (), each.name)
            )
            for each in scenario.structures
        ]
        modules = sum(each.rows * each.columns for each in scenario.structures)
        return BlastLoads(tuple(loads), np.ones(modules))


def test_the_way_to_the_reward_is_short() -> None:
    """Functions that somebody wrote count: no comprehensions, no methods made by dataclasses."""
    env: Any = gym.make("BlastBarrier-v0", engine=ConstantEngine()).unwrapped
    env.reset(seed=0)
    for action in (160, 176):
        env.step(action)
    called: set[tuple[str, str]] = set()
    is_paid = False

    def note(frame: FrameType, event: str, _: object) -> None:
        nonlocal is_paid
        module, name = str(frame.f_globals.get("__name__", "")), frame.f_code.co_qualname
        is_paid |= (event, name) == ("return", "Episode.pay")
        if event == "call" and module.startswith("blast_env") and not is_paid:
            called.add((module, name))

    sys.setprofile(note)
    try:
        env.step(env.action_space.n - 1)
    finally:
        sys.setprofile(None)
    assert is_paid
    functions = {each for each in called if "<" not in each[1].split(".")[-1]}
    functions = {each for each in functions if "__create_fn__" not in each[1]}
    modules = {module for module, _ in functions}
    assert "blast_env.evaluation.engines.contract" in modules
    assert len(functions) <= MOST_FUNCTIONS, sorted(functions)
    assert len(modules) <= MOST_MODULES, sorted(modules)
