"""Hyperparameters: read from YAML, changed by options `key=value`, and checked."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import mul
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StrictFloat,
    StrictInt,
    ValidationError,
    model_validator,
)

from blast_env.documents import DocumentError, described, parse_json
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError, UnknownNameError, shortened


def parse_options(options: Sequence[str], known: Sequence[str]) -> dict[str, Any]:
    """Return the values of options, `"key=value"` each; a value that is no JSON is a text.

    Args:
        options: The options.
        known: The keys that there are.

    Raises:
        UnknownNameError: If there is no such key; the message names the nearest one.
        BlastEnvError: If an option has no `=`.
    """
    values = {}
    for option in options:
        key, separator, text = option.partition("=")
        if not separator:
            raise BlastEnvError(f"--set {shortened(option)!r}: must be key=value")
        if key not in known:
            raise UnknownNameError("setting", key, known)
        try:
            values[key] = parse_json(text)
        except DocumentError:
            values[key] = text
    return values


def with_changes(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with changes in their places; `"group.key"` is for a mapping within."""
    result = dict(values)
    for key, value in changes.items():
        group, _, name = key.rpartition(".")
        if group:
            result[group] = {**result.get(group, {}), name: value}
        else:
            result[name] = value
    return result


def option_names(model: type[BaseModel]) -> list[str]:
    """Return the keys for the fields of a model, `"group.key"` for those of a model within."""
    names = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            names += [f"{name}.{each}" for each in inner.model_fields]
        else:
            names.append(name)
    return names


LINEAR: Final = "lin_"


def _checked(value: float | str) -> float | str:
    number = value
    if isinstance(value, str):
        if not value.startswith(LINEAR):
            raise ValueError("must be a number, or 'lin_' and a number")
        try:
            number = float(value.removeprefix(LINEAR))
        except ValueError:
            raise ValueError("must be a number, or 'lin_' and a number") from None
    if not 0.0 < float(number) <= 1.0:
        raise ValueError("must be above 0 and at most 1")
    return value


Amount = Annotated[float | str, AfterValidator(_checked)]
"""A number from 0 to 1, or `"lin_"` and a number: from that to 0 at the end of training."""


def schedule(amount: float | str) -> float | Callable[[float], float]:
    """Return an amount as stable-baselines3 takes it: a number, or one times what share is left."""
    if isinstance(amount, str):
        return partial(mul, float(amount.removeprefix(LINEAR)))
    return amount


PPO_ALGORITHMS: Final = ("ppo", "maskable_ppo")
"""Those of stable-baselines3 and sb3-contrib."""

SELF_LABELLING: Final = "self_labelling"
"""Begins where the rules end and learns from its own best; see `training.self_labelling`."""

ALGORITHMS: Final = (*PPO_ALGORITHMS, SELF_LABELLING)

ALGORITHM_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {"ppo": "PPO", "maskable_ppo": "MaskablePPO", SELF_LABELLING: "Self-labelling"}
)
"""What people call them."""

DEFAULT_SECTION: Final = "BlastBarrier-v0"
"""The section for scenarios that have none of their own."""

_FOLDER: Final = Path(__file__).parents[1] / "hyperparameters"

PolicyName = Literal[
    "blast_agents.policies.spatial.SpatialPolicy",
    "blast_agents.policies.spatial.SpatialMaskablePolicy",
    "CnnPolicy",
    "MlpPolicy",
]
"""Policies by the names that RL Zoo imports them by."""

WrapperName = Literal[
    "blast_agents.training.environments.RelativeReward",
    "blast_agents.training.environments.ThreatPool",
]
"""Wrappers of the environment by the names that RL Zoo imports them by."""

Share = Annotated[StrictFloat, Field(ge=0.0, le=1.0)]


class PolicyArguments(BaseModel):
    """Arguments of the spatial policies; stable-baselines3's own policies take none.

    Attributes:
        rows: Rows of the build zone; the scenario decides.
        columns: Its columns; the scenario decides.
        item_channels: Names of the planes that its catalogue adds to the observation.
        places: Places that stand for where the charge may be; unless given, 1 for a visible charge
            and 9 for a hidden one.
        width: Number of features of a cell.
        critic_width: Neurons of the critic's hidden layer.
        finish_bias: What the logit of finishing begins with.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    rows: Annotated[StrictInt, Field(ge=1, le=1000)] = 1
    columns: Annotated[StrictInt, Field(ge=1, le=1000)] = 1
    item_channels: Annotated[tuple[str, ...], Field(max_length=1000)] = ()
    places: Annotated[StrictInt, Field(ge=1, le=64)] | None = None
    width: Annotated[StrictInt, Field(ge=1, le=512)] = 24
    critic_width: Annotated[StrictInt, Field(ge=1, le=4096)] = 64
    finish_bias: Annotated[StrictFloat, Field(ge=-50.0, le=50.0)] = -3.0


class CommonHyperparameters(BaseModel):
    """What all algorithms have; see each for what a step is.

    Attributes:
        n_timesteps: Steps of training unless others are asked for.
        n_envs: Parallel environments, or worker processes, unless others are asked for.
        policy: The policy.
        policy_kwargs: Its arguments.
        learning_rate: A number, or `"lin_"` and a number for one that falls to 0 at the end.
        batch_size: Steps in a minibatch.
        vf_coef: Weight of the critic's error.
        max_grad_norm: Largest gradient.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    n_timesteps: Annotated[StrictInt, Field(ge=1, le=10**10)]
    n_envs: Annotated[StrictInt, Field(ge=1, le=256)]
    policy: PolicyName
    policy_kwargs: PolicyArguments = PolicyArguments()
    learning_rate: Amount
    batch_size: Annotated[StrictInt, Field(ge=2, le=10**8)]
    vf_coef: Annotated[StrictFloat, Field(ge=0.0, le=100.0)] = 0.5
    max_grad_norm: Annotated[StrictFloat, Field(gt=0.0, le=1000.0)] = 0.5


class Hyperparameters(CommonHyperparameters):
    """Hyperparameters of PPO and MaskablePPO, named as there and in RL Zoo.

    A step is a step of an environment: a module or piece.

    Attributes:
        env_wrapper: Wrappers of the environment, the innermost first: a name, or a name with
            arguments.
        n_steps: Steps of each environment between two updates.
        n_epochs: Passes over the steps in an update.
        gamma: Discount; 1 for none.
        gae_lambda: Trade-off between bias and variance of the advantages.
        clip_range: How far an update may move a probability; as `learning_rate`.
        ent_coef: Weight of the entropy, which keeps the agent exploring.
        normalize_advantage: Whether advantages are normalised by minibatch.
        target_kl: An update ends where the policy has moved further; `None` for no limit.
    """

    env_wrapper: tuple[WrapperName | dict[WrapperName, dict[str, Any]], ...] = ()
    n_steps: Annotated[StrictInt, Field(ge=2, le=100_000)]
    n_epochs: Annotated[StrictInt, Field(ge=1, le=100)]
    gamma: Share = 1.0
    gae_lambda: Share = 0.95
    clip_range: Amount = 0.2
    ent_coef: Annotated[StrictFloat, Field(ge=0.0, le=10.0)] = 0.0
    normalize_advantage: bool = True
    target_kl: Annotated[StrictFloat, Field(gt=0.0)] | None = None

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


Count = Annotated[StrictInt, Field(ge=0, le=10_000)]


class SelfLabellingHyperparameters(CommonHyperparameters):
    """Hyperparameters of self-labelling; see `training.self_labelling`.

    A step is a layout that meets a threat: a blast, unless it is known already.

    Attributes:
        cases: How many cases there are: charges, or sites, to learn from.
        cases_per_round: How many of them, in turn, get new layouts in a round after the first.
        samples: Layouts that the policy draws for each of these.
        neighbours: Layouts for each of them that are the best one so far, a little changed.
        borrowed: Layouts for each of them that are the best ones of the nearest charges.
        first_updates: Minibatches that the policy learns from after the first round, which has the
            layouts of the rules.
        updates: The same after each further round.
    """

    cases: Annotated[StrictInt, Field(ge=1, le=100_000)]
    cases_per_round: Annotated[StrictInt, Field(ge=1, le=100_000)]
    samples: Count
    neighbours: Count
    borrowed: Count = 0
    first_updates: Count
    updates: Count


AnyHyperparameters = Hyperparameters | SelfLabellingHyperparameters

_MODELS: Final[Mapping[str, type[AnyHyperparameters]]] = MappingProxyType(
    dict.fromkeys(PPO_ALGORITHMS, Hyperparameters) | {SELF_LABELLING: SelfLabellingHyperparameters}
)


def hyperparameter_keys(algorithm: str) -> tuple[str, ...]:
    """Return names that changes can have: `"policy_kwargs.width"` for an argument of the policy.

    Raises:
        UnknownNameError: If there is no such algorithm; the message names the nearest one.
    """
    check_names("algorithm", [algorithm], ALGORITHMS)
    return tuple(option_names(_MODELS[algorithm]))


def hyperparameter_file(algorithm: str) -> Path:
    """Return the YAML file of an algorithm, which comes with the package.

    Raises:
        UnknownNameError: If there is no such algorithm; the message names the nearest one.
    """
    check_names("algorithm", [algorithm], ALGORITHMS)
    return _FOLDER / f"{algorithm}.yml"


def load_hyperparameters(
    algorithm: str,
    env_id: str,
    changes: Mapping[str, Any] = MappingProxyType({}),
    envs: int | None = None,
) -> AnyHyperparameters:
    """Return the hyperparameters of an algorithm for an environment.

    Args:
        algorithm: One of `ALGORITHMS`.
        env_id: Section of the file; one that it does not have gets that of `BlastBarrier-v0`.
        changes: Values in the place of those of the file, by name; see `hyperparameter_keys`.
        envs: Parallel environments, in the place of `n_envs`.

    Raises:
        UnknownNameError: If there is no such algorithm or key; the message names the nearest one.
        BlastEnvError: If a value is of no use; the message names its bound.
    """
    path = hyperparameter_file(algorithm)
    sections = yaml.safe_load(path.read_text(encoding="utf-8"))  # our own file, with aliases
    check_names("hyperparameter", changes, hyperparameter_keys(algorithm))
    values = with_changes(sections.get(env_id, sections[DEFAULT_SECTION]), changes)
    if envs is not None:
        values["n_envs"] = envs
    try:
        return _MODELS[algorithm].model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(f"hyperparameters: {described(error)}") from error
