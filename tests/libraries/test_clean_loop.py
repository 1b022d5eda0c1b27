"""A loop in CleanRL's style: vector environment, roll-out, advantages, PPO's clipped update."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn
from torch.distributions import Categorical

from tests.libraries.ids import arguments

pytestmark = pytest.mark.slow
_ENVS, _STEPS, _EPOCHS = 2, 8, 2
_GAMMA, _LAMBDA, _CLIP = 1.0, 0.95, 0.2

# By particles and by gas: `tests/envs/test_barrier_checks.py` has all ids.
KINDS = ("BlastBarrier-v0", "BlastBarrierGas-v0")


class Agent(nn.Module):
    """Actor and critic, a layer each."""

    def __init__(self, features: int, actions: int) -> None:
        super().__init__()
        self.actor = nn.Linear(features, actions)
        self.critic = nn.Linear(features, 1)

    def policy(
        self, observation: torch.Tensor, mask: torch.Tensor
    ) -> Any:  # a Categorical, untyped
        return Categorical(logits=self.actor(observation).masked_fill(~mask, -1e9))


@pytest.mark.parametrize("name", KINDS)
def test_a_loop_in_the_style_of_cleanrl(name: str) -> None:
    torch.manual_seed(0)
    chosen = {**arguments(name), "observation": "features"}
    envs = gym.make_vec(name, num_envs=_ENVS, vectorization_mode="sync", **chosen)
    space = envs.single_action_space
    assert isinstance(space, gym.spaces.Discrete)
    assert envs.single_observation_space.shape is not None
    agent = Agent(envs.single_observation_space.shape[0], int(space.n))
    optimiser = torch.optim.Adam(agent.parameters(), lr=1e-3)
    before = agent.actor.weight.detach().clone()

    seen, info = envs.reset(seed=0)
    columns: dict[str, list[torch.Tensor]] = {
        key: [] for key in ("seen", "mask", "action", "chance", "value", "reward", "ended")
    }
    for _ in range(_STEPS):
        observation = torch.as_tensor(np.asarray(seen))
        mask = torch.as_tensor(info["action_mask"]).bool()
        with torch.no_grad():
            policy = agent.policy(observation, mask)
            action = policy.sample()
            value = agent.critic(observation)[:, 0]
        assert mask.gather(1, action[:, None]).all()
        seen, reward, terminated, truncated, info = envs.step(action.numpy())
        assert not info.get("invalid_actions", np.zeros(_ENVS)).any()
        ended = torch.as_tensor(terminated | truncated)
        chance = policy.log_prob(action)
        row = (observation, mask, action, chance, value, torch.as_tensor(reward).float(), ended)
        for column, entry in zip(columns.values(), row, strict=True):
            column.append(entry)

    rolled = {key: torch.stack(column) for key, column in columns.items()}
    with torch.no_grad():
        following = agent.critic(torch.as_tensor(np.asarray(seen)))[:, 0]
    advantage = torch.zeros(_STEPS, _ENVS)
    carried = torch.zeros(_ENVS)
    for step in reversed(range(_STEPS)):
        goes_on = 1.0 - rolled["ended"][step].float()
        error = rolled["reward"][step] + _GAMMA * following * goes_on - rolled["value"][step]
        carried = error + _GAMMA * _LAMBDA * goes_on * carried
        advantage[step], following = carried, rolled["value"][step]
    target = advantage + rolled["value"]

    for _ in range(_EPOCHS):
        policy = agent.policy(rolled["seen"], rolled["mask"])
        ratio = (policy.log_prob(rolled["action"]) - rolled["chance"]).exp()
        clipped = ratio.clamp(1.0 - _CLIP, 1.0 + _CLIP)
        value_loss = (agent.critic(rolled["seen"])[..., 0] - target).square().mean()
        loss = value_loss - torch.min(ratio * advantage, clipped * advantage).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    assert all(bool(parameter.isfinite().all()) for parameter in agent.parameters())
    assert not torch.equal(agent.actor.weight, before)
    envs.close()
