"""Stable-Baselines3 learns a few steps on every environment, masked where there are masks."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from blast_agents.training import BatchVecEnv
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO
from stable_baselines3.common.utils import obs_as_tensor
from stable_baselines3.common.vec_env import DummyVecEnv

from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.site import Scenario
from blast_env.surrogate import SurrogateEngine
from tests.catalogue_sites import ITEMS
from tests.envs.small import same, small_scenario
from tests.libraries.ids import BARRIER_IDS, arguments
from tests.office_park import office_park
from tests.surrogate.cases import by_hand

pytestmark = pytest.mark.slow
_STEPS = 4
_SMALL: dict[str, Any] = {
    "n_steps": _STEPS,
    "batch_size": _STEPS,
    "n_epochs": 1,
    "seed": 0,
    "device": "cpu",
}
_POLICY = {"net_arch": [8]}


def test_ppo_on_the_bare_simulator() -> None:
    env = gym.make("BlastSimulator-v0", **arguments("BlastSimulator-v0"))
    model = PPO("MultiInputPolicy", env, policy_kwargs=_POLICY, **_SMALL).learn(_STEPS)
    assert model.num_timesteps == _STEPS


@pytest.mark.parametrize("name", BARRIER_IDS)
def test_cnn_policy_takes_every_image_and_finds_its_channels(name: str) -> None:
    env = gym.make(name, **arguments(name))
    model = PPO("CnnPolicy", env, policy_kwargs=_POLICY, **_SMALL).learn(_STEPS)
    assert env.observation_space.shape is not None
    height, width, channels = env.observation_space.shape
    assert model.observation_space.shape == (channels, height, width)
    observation, _ = env.reset(seed=0)
    assert model.env is not None
    model.env.seed(0)
    learnt_on = model.env.reset()
    assert isinstance(learnt_on, np.ndarray)
    assert (learnt_on[0] == observation.transpose(2, 0, 1)).all()


def test_a_network_of_ones_own_gets_the_planes_in_their_order() -> None:
    env = gym.make("BlastBarrier-v0", **arguments("BlastBarrier-v0"), observation="grid")
    model = PPO("MlpPolicy", env, policy_kwargs=_POLICY, **_SMALL)
    assert model.observation_space == env.observation_space


@pytest.mark.parametrize("name", ["BlastBarrier-v0", "BlastBarrierItemSites-v0"])
def test_maskable_ppo_gives_illegal_actions_no_probability(name: str) -> None:
    env = gym.make(name, action="place", **arguments(name))
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


def test_maskable_ppo_learns_by_item_and_block_in_a_zone_of_a_hundred_metres() -> None:
    """19,264 places for four variants are 152 actions; illegal ones get no probability."""
    document = office_park().model_dump(exclude_none=True)
    zone = {"corner_m": (36.0, 12.0), "rows": 112, "columns": 43, "items": ITEMS, "budget": 20.0}
    scenario = Scenario.from_document(document | {"build_zone": zone}, "large")
    assert scenario.zone.catalogue.finish == 19_264
    env = gym.make(
        "BlastBarrier-v0",
        scenario=scenario,
        action="item_then_block",
        observation="features",
        engine=SurrogateEngine(by_hand()),
    )
    assert env.action_space == gym.spaces.Discrete(4 + 84 + 64 + 1)
    model = MaskablePPO("MlpPolicy", env, policy_kwargs=_POLICY, **{**_SMALL, "n_steps": 32})
    before = {name: value.clone() for name, value in model.policy.state_dict().items()}
    model.learn(64)
    changed = [
        not (value == before[name]).all() for name, value in model.policy.state_dict().items()
    ]
    assert any(changed)
    observation, info = env.reset(seed=0)
    choices = set()
    for _ in range(6):
        mask = info["action_mask"].astype(bool)
        action, _ = model.predict(observation, action_masks=mask)
        assert mask[action]
        choices.add(int(action) // 88 if action >= 4 else -1)
        observation, _, ended, _, info = env.step(action)
        assert info["invalid_actions"] == 0
        if ended:
            observation, info = env.reset()
    assert len(choices) == 3  # item, block and cell


def test_a_batch_resets_as_other_vectors_do() -> None:
    """With options of each environment, and the information of the episodes that follow."""
    site: dict[str, Any] = {"scenario": small_scenario(), "observation": "features"}
    site |= {"engine": SurrogateEngine(by_hand()), "action": "place"}
    batch = BatchVecEnv(BlastBarrierVectorEnv(2, "Disabled", **site))
    dummy = DummyVecEnv([lambda: gym.make("BlastBarrier-v0", **site)] * 2)
    found: list[list[Any]] = []
    for envs in (batch, dummy):
        envs.seed(3)
        envs.set_options([{"tnt_kg": 20.0}, {"layout": [(0, 0)]}])
        own: list[Any] = [envs.reset(), envs.reset_infos[0]["blast_seeds"]]
        finish = [batch.envs.finish, 1]
        for _ in range(2):
            own += [envs.step(np.array(finish))[0], envs.reset_infos[0]["blast_seeds"]]
        found.append(own)
    assert same(*found)
