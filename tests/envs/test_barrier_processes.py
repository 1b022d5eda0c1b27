"""The barrier environment in vectors, other processes, and pickles."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from tests.envs.small import make, same
from tests.envs.spawned import barrier_arguments

pytestmark = pytest.mark.slow

FINISH = 40


@pytest.mark.parametrize(("mode", "vector_kwargs"), [("sync", {}), ("async", {"context": "spawn"})])
def test_vectors_of_environments_stack_the_information(mode: str, vector_kwargs: dict) -> None:
    envs = gym.make_vec(
        "BlastBarrier-v0",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs=vector_kwargs,
        invalid_action="penalty",
        **barrier_arguments(),
    )
    _, info = envs.reset(seed=3)
    assert info["action_mask"].shape == (2, FINISH + 1)
    _, _, _, _, info = envs.step(np.array([0, 4 * 5]))
    assert info["invalid_actions"].tolist() == [0, 1]
    _, rewards, ended, _, info = envs.step(np.array([1, FINISH]))
    assert ended.tolist() == [False, True]
    assert info["_reduction"].tolist() == [False, True]
    assert info["layout"][1] == ()
    assert info["reward_terms"]["impulse"][1] == -info["impulse_psi_s"][1]
    assert sum(terms[1] for name, terms in info["reward_terms"].items() if name[0] != "_") == (
        pytest.approx(rewards[1])
    )
    envs.close()


def test_monitor_logs_the_final_information() -> None:
    env = Monitor(make(), info_keywords=("reduction", "impulse_pa_s", "blasts"))
    vector = DummyVecEnv([lambda: env])
    vector.seed(3)
    vector.reset()
    _, _, ended, infos = vector.step(np.array([FINISH]))
    assert ended[0]
    assert infos[0]["episode"]["reduction"] == 0.0
    assert infos[0]["episode"]["blasts"] == 1


@pytest.mark.parametrize("again", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
@pytest.mark.parametrize("observation", ["grid", "features"])
def test_a_copy_in_mid_episode_goes_on_identically(again: Any, observation: str) -> None:
    env = make(reward="incremental", observation=observation, render_mode="rgb_array")
    env.reset(seed=2)
    env.step(11)
    env.render()  # so that there is something that does not pickle
    twin = again(env)
    assert same(env.render(), twin.render())
    for action in (12, 13):
        assert same(env.step(action), twin.step(action))
    assert same(env.reset(), twin.reset())
    assert same(env.step(FINISH), twin.step(FINISH))
