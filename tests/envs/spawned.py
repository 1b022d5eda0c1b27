"""What other processes do with environments, apart from what takes them long to import."""

import multiprocessing
from typing import Any

import gymnasium as gym

from tests.envs.small import ThinEngine, play, small_scenario
from tests.scenarios import BALLISTIC_COURTYARD


def barrier_arguments() -> dict[str, Any]:
    return {"scenario": small_scenario(), "engine": ThinEngine(), "observation": "features"}


def play_in_process(queue: "multiprocessing.Queue[list]") -> None:
    queue.put(play(gym.make("blast_env:BlastBarrier-v0", **barrier_arguments()), 3))


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


def digest_in_process(queue: "multiprocessing.Queue[str]") -> None:
    env = gym.make("blast_env:BlastSimulator-v0", scenario=BALLISTIC_COURTYARD, step_s=0.1)
    queue.put(watch(env, 3)[2]["digest"])
