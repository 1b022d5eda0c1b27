"""The stable-baselines3 model of a run, and its policy alone."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import torch
from gymnasium import spaces
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.policies import (
    MaskableActorCriticCnnPolicy,
    MaskableActorCriticPolicy,
)
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticCnnPolicy, ActorCriticPolicy
from stable_baselines3.common.vec_env import VecEnv

from agents.policies.spatial import SpatialMaskablePolicy, SpatialPolicy
from agents.training.hyperparameters import Hyperparameters
from agents.training.schedule import schedule
from agents.training.settings import RunConfiguration, TrainingSettings
from blast_env.envs.scenario_source import zone_of
from blast_env.errors import BlastEnvError
from blast_env.scenario import Scenario

Model = PPO | MaskablePPO
Policy = ActorCriticPolicy | MaskableActorCriticPolicy

_SPATIAL = {"ppo": SpatialPolicy, "maskable_ppo": SpatialMaskablePolicy}
_FLAT = {"ppo": ActorCriticCnnPolicy, "maskable_ppo": MaskableActorCriticCnnPolicy}


_PLACES: Final = {"visible": 1, "hidden": 9}


def fitted(
    hyperparameters: Hyperparameters, settings: TrainingSettings, scenario: Scenario
) -> Hyperparameters:
    """Return hyperparameters with what follows from the scenario's build zone and the threat.

    Raises:
        BlastEnvError: If the policy is not one for the algorithm.
    """
    zone = zone_of(scenario)
    places = hyperparameters.policy_kwargs.places or _PLACES[settings.threat]
    changes = {"rows": zone.rows, "columns": zone.columns, "places": places}
    spatial = _SPATIAL[settings.algorithm]
    names = (f"{spatial.__module__}.{spatial.__name__}", "CnnPolicy")
    if hyperparameters.policy not in names:
        raise BlastEnvError(
            f"policy is {hyperparameters.policy}, must be one of {', '.join(names)} for "
            f"{settings.algorithm}"
        )
    arguments = hyperparameters.policy_kwargs.model_copy(update=changes)
    return hyperparameters.model_copy(update={"policy_kwargs": arguments})


def make_model(configuration: RunConfiguration, environments: VecEnv) -> Model:
    """Return a model with fresh weights, which the seed decides."""
    hyperparameters = configuration.hyperparameters
    arguments = hyperparameters.model_arguments()
    for name in ("learning_rate", "clip_range"):
        arguments[name] = schedule(arguments[name])
    policy_class, policy_arguments = _policy_class(configuration)
    seed = configuration.settings.seed % 2**32
    common: dict[str, Any] = {"policy_kwargs": policy_arguments, "seed": seed, "device": "cpu"}
    if configuration.settings.algorithm == "ppo":
        return PPO(policy_class, environments, **arguments, **common)
    return MaskablePPO(policy_class, environments, **arguments, **common)


def make_policy(
    configuration: RunConfiguration,
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
) -> Policy:
    """Return the policy of a run without its weights."""
    policy_class, arguments = _policy_class(configuration)
    policy: Policy = policy_class(observation_space, action_space, lambda _: 0.0, **arguments)
    return policy


def logits_of(policy: Policy, observations: torch.Tensor) -> torch.Tensor:
    """Return the logit of each action, legal or not (batch, actions)."""
    distribution = policy.get_distribution(observations).distribution
    if not isinstance(distribution, torch.distributions.Categorical):
        raise TypeError(f"the actions of a placement are discrete, not {distribution}")
    logits: torch.Tensor = distribution.logits
    return logits


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch work with so many threads in this block."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _policy_class(configuration: RunConfiguration) -> tuple[type[Any], dict[str, Any]]:
    """Return the class of the policy, and the arguments beside spaces and schedule."""
    algorithm = configuration.settings.algorithm
    if configuration.hyperparameters.policy == "CnnPolicy":
        return _FLAT[algorithm], {}
    return _SPATIAL[algorithm], configuration.hyperparameters.policy_kwargs.model_dump()
