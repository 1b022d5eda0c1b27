"""What other processes do with environments, apart from what takes them long to import."""

from typing import Any

import gymnasium as gym

from tests.envs.small import ThinEngine, small_scenario


def barrier_arguments() -> dict[str, Any]:
    return {"scenario": small_scenario(), "engine": ThinEngine(), "observation": "features"}


def watch(env: gym.Env, seed: int, **options: object) -> tuple[list, list[float], dict]:
    """Return the observations, the rewards and the last information of an episode of a blast."""
    observation, info = env.reset(seed=seed, options=options)
    observations, rewards, ended = [observation], [], False
    while not ended:
        observation, reward, ended, truncated, info = env.step(0)
        assert not truncated
        observations.append(observation)
        rewards.append(float(reward))
    return observations, rewards, info
