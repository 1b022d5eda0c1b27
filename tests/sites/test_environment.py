"""`BlastBarrierSites-v0`: another site at every reset."""

from typing import Any

import gymnasium as gym

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.sites import HELD_OUT_SITES, SiteSource
from tests.envs.small import ThinEngine

ID = "BlastBarrierSites-v0"
ROWS = 28


def make(**arguments: Any) -> BlastBarrierEnv:
    defaults: dict[str, Any] = {"engine": ThinEngine(), "realisations": 1}
    env = gym.make(ID, **(defaults | arguments)).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    return env


def test_every_reset_gives_another_site_to_train_on() -> None:
    env = make()
    env.reset(seed=0)
    names = []
    for _ in range(10):
        observation, info = env.reset()
        assert env.observation_space.contains(observation)
        assert info["action_mask"].shape == (1 + ROWS + 1 + ROWS,)
        names.append(env.observable.scenario.name)
    assert len(set(names)) == 10
    assert all(int(name.removeprefix("site_")) >= HELD_OUT_SITES for name in names)


def test_it_can_be_given_the_sites_held_out() -> None:
    env = make(scenario=SiteSource.held_out(1))
    env.reset(seed=4)
    assert env.observable.scenario.name == "site_0"
