"""Hyperparameters in RL Zoo's form: a YAML file an algorithm, a section an environment."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from agents.training.schedule import Amount
from agents.training.set_options import described, option_names, with_changes
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError, UnknownNameError

ALGORITHMS: Final = ("ppo", "maskable_ppo")
DEFAULT_SECTION: Final = "BlastBarrier-v0"
"""The section for scenarios that have none of their own."""

_FOLDER: Final = Path(__file__).parents[1] / "hyperparameters"

PolicyName = Literal[
    "agents.policies.spatial.SpatialPolicy",
    "agents.policies.spatial.SpatialMaskablePolicy",
    "CnnPolicy",
]
"""Policies by the names that RL Zoo imports them by."""

WRAPPERS: Final = ("agents.training.wrappers.RelativeReward", "agents.training.wrappers.ThreatPool")
WrapperName = Literal[
    "agents.training.wrappers.RelativeReward", "agents.training.wrappers.ThreatPool"
]
"""Wrappers of the environment, likewise."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class PolicyArguments(BaseModel):
    """Arguments of the spatial policies; `None` and a `CnnPolicy` leave stable-baselines3's.

    Attributes:
        rows: Rows of the build zone; the scenario decides.
        columns: Its columns; likewise.
        places: Places that stand for where the charge may be; unless given, 1 for a visible charge
            and 9 for a hidden one.
        width: Number of features of a cell.
        critic_width: Neurons of the critic's hidden layer.
        finish_bias: What the logit of finishing begins with.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    rows: Annotated[int, Field(ge=1)] = 1
    columns: Annotated[int, Field(ge=1)] = 1
    places: Annotated[int, Field(ge=1, le=64)] | None = None
    width: Annotated[int, Field(ge=1, le=512)] = 24
    critic_width: Annotated[int, Field(ge=1, le=4096)] = 64
    finish_bias: Annotated[float, Field(ge=-50.0, le=50.0)] = -3.0


class Hyperparameters(BaseModel):
    """Hyperparameters of PPO and MaskablePPO, named as there and in RL Zoo.

    Attributes:
        n_timesteps: Steps of training unless others are asked for.
        n_envs: Parallel environments unless others are asked for.
        policy: The policy.
        policy_kwargs: Its arguments.
        env_wrapper: Wrappers of the environment, the innermost first: a name, or a name with
            arguments.
        learning_rate: A number, or `"lin_"` and a number for one that falls to 0 at the end.
        n_steps: Steps of each environment between two updates.
        batch_size: Steps in a minibatch.
        n_epochs: Passes over the steps in an update.
        gamma: Discount; 1 for none.
        gae_lambda: Trade-off between bias and variance of the advantages.
        clip_range: How far an update may move a probability; as `learning_rate`.
        ent_coef: Weight of the entropy, which keeps the agent exploring.
        vf_coef: Weight of the critic's error.
        max_grad_norm: Largest gradient.
        normalize_advantage: Whether advantages are normalised by minibatch.
        target_kl: An update ends where the policy has moved further; `None` for no limit.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    n_timesteps: Annotated[int, Field(ge=1)]
    n_envs: Annotated[int, Field(ge=1, le=256)]
    policy: PolicyName
    policy_kwargs: PolicyArguments = PolicyArguments()
    env_wrapper: tuple[WrapperName | dict[WrapperName, dict[str, Any]], ...] = ()
    learning_rate: Amount
    n_steps: Annotated[int, Field(ge=2, le=100_000)]
    batch_size: Annotated[int, Field(ge=2)]
    n_epochs: Annotated[int, Field(ge=1, le=100)]
    gamma: Share = 1.0
    gae_lambda: Share = 0.95
    clip_range: Amount = 0.2
    ent_coef: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    vf_coef: Annotated[float, Field(ge=0.0, le=100.0)] = 0.5
    max_grad_norm: Annotated[float, Field(gt=0.0, le=1000.0)] = 0.5
    normalize_advantage: bool = True
    target_kl: Annotated[float, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _check_batches(self) -> "Hyperparameters":
        """Refuse batches that do not divide a rollout: stable-baselines3 would only warn."""
        steps = self.n_steps * self.n_envs
        if steps % self.batch_size:
            raise ValueError(
                f"batch_size is {self.batch_size}, must divide n_steps * n_envs = {steps}"
            )
        return self

    def model_arguments(self) -> dict[str, Any]:
        """Return the arguments of PPO and MaskablePPO but for the policy and its own."""
        others = {"n_timesteps", "n_envs", "policy", "policy_kwargs", "env_wrapper"}
        return self.model_dump(exclude=others)

    def wrappers(self) -> tuple[tuple[str, dict[str, Any]], ...]:
        """Return name and arguments of each wrapper, the innermost first."""
        wrappers: list[tuple[str, dict[str, Any]]] = []
        for each in self.env_wrapper:
            if isinstance(each, str):
                wrappers.append((each, {}))
            else:
                wrappers += [(name, dict(arguments)) for name, arguments in each.items()]
        return tuple(wrappers)


HYPERPARAMETER_KEYS: Final = tuple(option_names(Hyperparameters))
"""Names that changes can have: `"policy_kwargs.width"` for an argument of the policy."""


def hyperparameter_file(algorithm: str) -> Path:
    """Return the YAML file of an algorithm, which comes with the package.

    Raises:
        UnknownNameError: If there is no such algorithm; the message names the nearest one.
    """
    if algorithm not in ALGORITHMS:
        raise UnknownNameError("algorithm", algorithm, ALGORITHMS)
    return _FOLDER / f"{algorithm}.yml"


def load_hyperparameters(
    algorithm: str,
    env_id: str,
    changes: Mapping[str, Any] = MappingProxyType({}),
    envs: int | None = None,
) -> Hyperparameters:
    """Return the hyperparameters of an algorithm for an environment.

    Args:
        algorithm: `"ppo"` or `"maskable_ppo"`.
        env_id: Section of the file; one that it does not have gets that of `BlastBarrier-v0`.
        changes: Values in the place of those of the file, by name; see `HYPERPARAMETER_KEYS`.
        envs: Parallel environments, in the place of `n_envs`.

    Raises:
        UnknownNameError: If there is no such algorithm or key; the message names the nearest one.
        BlastEnvError: If a value is of no use; the message names its bound.
    """
    path = hyperparameter_file(algorithm)
    sections = yaml.safe_load(path.read_text(encoding="utf-8"))
    check_names("hyperparameter", changes, HYPERPARAMETER_KEYS)
    values = with_changes(sections.get(env_id, sections[DEFAULT_SECTION]), changes)
    if envs is not None:
        values["n_envs"] = envs
    return checked(values, "hyperparameters")


def checked(values: Mapping[str, Any], place: str) -> Hyperparameters:
    """Return hyperparameters from plain values.

    Args:
        values: By name.
        place: Where they come from, for the error.

    Raises:
        BlastEnvError: If a value is of no use; the message names its bound.
    """
    try:
        return Hyperparameters.model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(described(error, place)) from error
