"""In training a policy gets the planes of the site as they are, however a site is shaped.

Stable-Baselines3 guesses from the sizes which axis of an image has its channels. Where rows or
columns were fewer than planes it turned them round in training, and only there.
"""

from itertools import islice
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from blast_agents.policies.spatial import SpatialMaskablePolicy, SpatialPolicy
from blast_agents.training import TrainingSettings, load_hyperparameters
from blast_agents.training.agent import as_tensor, fitted, logits_of, make_model, policy_for
from blast_agents.training.run_folder import RunConfiguration
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv

from blast_env import load_scenario
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observations import OBSERVATIONS
from blast_env.envs.planes import GridObservation
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState
from blast_env.site import Scenario
from blast_env.sites import FAMILIES, generate_site
from tests.catalogue_sites import yard_document


def shaped_yard(width_m: float, height_m: float) -> Scenario:
    """Return the yard with its catalogue (22 planes) on a site of another size."""
    document = yard_document()
    document["site"] |= {"width_m": width_m, "height_m": height_m}
    return Scenario.from_document(document, "yard")


def configuration(scenario: Scenario, observation: str, policy: str | None) -> RunConfiguration:
    settings = TrainingSettings.model_validate(
        {"algorithm": "maskable_ppo", "scenario": "a", "steps": 8, "observation": observation}
    )
    changes: dict[str, Any] = {"n_envs": 1, "n_steps": 2, "batch_size": 2}
    changes |= {"policy_kwargs.width": 4} if policy is None else {"policy": policy}
    hyperparameters = load_hyperparameters("maskable_ppo", "BlastBarrier-v0", changes)
    return fitted(RunConfiguration(settings, hyperparameters, scenario.content_hash), scenario)


def environment(scenario: Scenario, observation: str = "grid") -> BlastBarrierEnv:
    """Return an environment; nothing runs a blast here, so any engine will do."""
    env = gym.make(
        "BlastBarrierGas-v0", scenario=scenario, observation=observation, action="place"
    ).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    return env


def check(scenario: Scenario, observation: str = "grid", policy: str | None = None) -> None:
    """A model of training and an agent's policy give one site's planes the same logits."""
    env = environment(scenario, observation)
    run = configuration(scenario, observation, policy)
    model = make_model(run, DummyVecEnv([lambda: env]))
    assert model.env is not None
    model.env.seed(3)
    in_training = model.env.reset()
    assert isinstance(in_training, np.ndarray)
    episode = OBSERVATIONS[observation].episode(env.observable)
    planes = episode.observe(LayoutState.empty(scenario))[None]
    agent = policy_for(run, scenario)
    agent.load_state_dict(model.policy.state_dict())
    agent.set_training_mode(False)
    model.policy.set_training_mode(False)
    trained: Any = model.policy
    with torch.no_grad():
        expected = logits_of(trained, as_tensor(trained, in_training))
        found = logits_of(agent, as_tensor(agent, planes))
    if observation == "grid":
        assert in_training.shape[1:] == GridObservation().space(scenario).shape
        assert np.array_equal(in_training, planes)
    assert torch.equal(found, expected)


@pytest.mark.parametrize("name", ["courtyard", "visitor_entrance", "guard_post"])
def test_bundled_sites_as_images(name: str) -> None:
    check(load_scenario(name), "image", "CnnPolicy")


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_generated_sites(family: str) -> None:
    check(generate_site(0, FAMILIES[family]))


def test_sites_of_many_shapes() -> None:
    """Also those where columns are fewest, of which stable-baselines3 does not even warn."""
    rng = np.random.default_rng(0)
    sizes = {tuple(rng.integers(24, 70, size=2).tolist()) for _ in range(20)}
    shapes = set()
    for rows, columns in islice(sorted(sizes), 8):
        scenario = shaped_yard(columns / 2.0, rows / 2.0)
        shapes.add(GridObservation().space(scenario).shape)
        check(scenario)
    assert len(shapes) == 8


def test_a_policy_refuses_turned_planes() -> None:
    scenario = load_scenario("hotel_forecourt")
    env = environment(scenario)
    channels = GridObservation().channels_of(scenario)
    arguments = {"rows": scenario.zone.rows, "columns": scenario.zone.columns, "width": 4}
    policy = SpatialPolicy(
        env.observation_space, env.action_space, lambda _: 0.0, channels=channels, **arguments
    )
    planes, _ = env.reset(seed=0)
    turned = torch.as_tensor(planes.transpose(2, 0, 1).copy())[None]
    with pytest.raises(BlastEnvError, match=r"shape \(34, 33, 28\), must have .* \(33, 28, 34\)"):
        logits_of(policy, turned)
    space = spaces.Box(0.0, 1.0, turned.shape[1:], np.float32)
    with pytest.raises(
        BlastEnvError, match=r"\(34, 33, 28\), must have .*33 channels, at least 16"
    ):
        SpatialMaskablePolicy(
            space, env.action_space, lambda _: 0.0, channels=channels, **arguments
        )
