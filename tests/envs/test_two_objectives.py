"""The environment with two objectives, by the convention of MO-Gymnasium."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from mo_gymnasium.utils import make as mo_gymnasium_make
from mo_gymnasium.wrappers.vector.wrappers import MOSyncVectorEnv
from mo_gymnasium.wrappers.wrappers import LinearReward

from blast_env.errors import BlastEnvError
from tests.evaluation.engines.shade import ShadeEngine

ID = "BlastBarrier-MO-v0"


def make(scenario: str) -> gym.Env[Any, Any]:
    env: gym.Env[Any, Any] = mo_gymnasium_make(
        ID, scenario=scenario, engine=ShadeEngine(), observation="features", action="place"
    )
    return env


@pytest.mark.parametrize("scenario", ["courtyard", "hotel_forecourt"])
def test_rewards_add_up_to_what_is_taken_off_and_what_it_costs(scenario: str) -> None:
    env = make(scenario)
    base: Any = env.unwrapped
    _, info = env.reset(seed=1)
    total, ended = np.zeros(2), False
    rng = np.random.default_rng(0)
    while not ended:
        action = rng.choice(np.flatnonzero(info["action_mask"]))
        _, rewards, ended, _, info = env.step(action)
        assert base.reward_space.contains(rewards)
        total += np.asarray(rewards)
    zone = base.placement.scenario.zone
    spent = base.placement.cost / zone.budget if zone.budget else info["placed"] / zone.stock
    assert info["placed"] > 0
    assert total == pytest.approx([info["reduction"], -spent], abs=1e-6)


def test_weights_make_one_score_of_both() -> None:
    env = LinearReward(make("courtyard"), weight=np.array([1.0, 0.5]))
    env.reset(seed=1)
    _, first, *_ = env.step(160)  # a module of 16
    _, last, *_, info = env.step(640)
    assert float(first) + float(last) == pytest.approx(info["reduction"] - 0.5 / 16, abs=1e-6)


def test_vectors_of_mo_gymnasium_have_both_rewards_of_each() -> None:
    envs = MOSyncVectorEnv(iter([lambda: make("courtyard")] * 2))
    envs.reset(seed=1)
    _, rewards, *_ = envs.step(np.array([160, 640]))
    assert np.asarray(rewards) == pytest.approx(np.array([[0.0, -1.0 / 16], [0.0, 0.0]]))


def test_a_reward_of_ones_own_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="reward is 'terminal', must be left out"):
        gym.make(ID, reward="terminal")
