"""Gymnasium's usual wrappers, around every environment."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers

from tests.libraries.ids import IDS, arguments

pytestmark = pytest.mark.slow
_STEPS = 2


@pytest.mark.parametrize("name", IDS)
def test_the_usual_wrappers(name: str) -> None:
    """One around the other, as training code has them; a limit of steps ends the episode."""
    env: gym.Env[Any, Any] = gym.make(name, max_episode_steps=_STEPS, **arguments(name))
    env = wrappers.RecordEpisodeStatistics(env)
    env = wrappers.TransformReward(env, lambda reward: 2.0 * float(reward))
    env = wrappers.NormalizeReward(wrappers.FlattenObservation(env))
    env.reset(seed=0)
    env.action_space.seed(0)
    ended, steps = False, 0
    while not ended:
        action = env.action_space.sample()
        if isinstance(env.action_space, gym.spaces.MultiDiscrete):
            action = np.zeros_like(action)  # places a barrier, and does not finish
        observation, reward, terminated, truncated, info = env.step(action)
        ended, steps = terminated or truncated, steps + 1
    assert truncated
    assert steps == _STEPS == info["episode"]["l"]
    assert observation in env.observation_space
    assert np.isfinite(float(reward))
    env.close()
