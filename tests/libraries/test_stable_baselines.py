"""Stable-Baselines3 learns a few steps on every environment, masked where there are masks."""

from typing import Any

import gymnasium as gym
import pytest
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO
from stable_baselines3.common.utils import obs_as_tensor

from tests.libraries.ids import BARRIER_IDS, IDS, arguments

pytestmark = [
    pytest.mark.slow,
    # Of sites with fewer rows than planes; a policy that flattens them does not care.
    pytest.mark.filterwarnings("ignore:Treating image space as channels-last"),
]
_STEPS = 4
_SMALL: dict[str, Any] = {
    "n_steps": _STEPS,
    "batch_size": _STEPS,
    "n_epochs": 1,
    "seed": 0,
    "device": "cpu",
}
_POLICY = {"net_arch": [8]}


@pytest.mark.parametrize("name", IDS)
def test_ppo(name: str) -> None:
    env = gym.make(name, **arguments(name))
    planes = isinstance(env.observation_space, gym.spaces.Dict)
    model = PPO(
        "MultiInputPolicy" if planes else "MlpPolicy", env, policy_kwargs=_POLICY, **_SMALL
    ).learn(_STEPS)
    assert model.num_timesteps == _STEPS


@pytest.mark.parametrize("name", BARRIER_IDS)
def test_maskable_ppo_gives_illegal_actions_no_probability(name: str) -> None:
    env = gym.make(name, **arguments(name))
    model = MaskablePPO("MlpPolicy", env, policy_kwargs=_POLICY, **_SMALL).learn(_STEPS)
    _, info = env.reset(seed=0)
    placed = int(info["action_mask"].argmax())
    observation, _, _, _, _ = env.step(placed)
    mask = env.unwrapped.action_masks()  # type: ignore[attr-defined]
    tensor = obs_as_tensor(observation[None], model.device)
    policy: Any = model.policy
    probability = policy.get_distribution(tensor, mask[None]).distribution.probs[0]
    assert not mask[placed]
    assert float(probability.detach()[~mask].sum()) == 0.0
