"""Hyperparameters, read from YAML, changed by options `key=value` and validated."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import mul
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, NotRequired

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
from typing_extensions import TypedDict

from blast_env.documents import DocumentError, described, parse_json
from blast_env.envs.arguments import check_names
from blast_env.errors import BlastEnvError, UnknownNameError, shortened
from blast_env.values import MOST_SEED


def parse_options(options: Sequence[str], known: Sequence[str]) -> dict[str, Any]:
    """Return the values of options, `"key=value"` each; a value that is not JSON is a text.

    Args:
        options: The options.
        known: The valid keys.

    Raises:
        UnknownNameError: If a key is unknown; the message names the nearest one.
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
    """Return values with changes; `"group.key"` changes a nested mapping."""
    result = dict(values)
    for key, value in changes.items():
        group, _, name = key.rpartition(".")
        if group:
            result[group] = {**result.get(group, {}), name: value}
        else:
            result[name] = value
    return result


def option_names(model: type[BaseModel]) -> list[str]:
    """Return the keys of a model's fields, `"group.key"` for those of nested models."""
    names = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            names += [f"{name}.{model_field}" for model_field in inner.model_fields]
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
"""A number above 0 up to 1, or `"lin_"` and such a number for a linear decay to 0."""


def schedule(amount: float | str) -> float | Callable[[float], float]:
    """Return an amount for stable-baselines3: a number, or a function of the remaining share."""
    if isinstance(amount, str):
        return partial(mul, float(amount.removeprefix(LINEAR)))
    return amount


ALGORITHM_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {"ppo": "PPO", "maskable_ppo": "MaskablePPO"}
)
"""Names for readers of the algorithms, those of stable-baselines3 and sb3-contrib."""

ALGORITHMS: Final = tuple(ALGORITHM_NAMES)

DEFAULT_SECTION: Final = "BlastBarrier-v0"
"""The section, and environment id, for scenarios without a separate one."""

SITES_SECTION: Final = "BlastBarrierSites-v0"
"""The section, and environment id, for generated sites."""

_FOLDER: Final = Path(__file__).parents[1] / "hyperparameters"

PolicyName = Literal[
    "blast_agents.policies.spatial.SpatialPolicy",
    "blast_agents.policies.spatial.SpatialMaskablePolicy",
    "CnnPolicy",
    "MlpPolicy",
]
"""Policies, by their names for import in RL Zoo."""

WrapperName = Literal["blast_agents.training.environments.ThreatPool"]
"""The wrapper of the environment, by its name for import in RL Zoo."""

Share = Annotated[StrictFloat, Field(ge=0.0, le=1.0)]


class PoolArguments(TypedDict):
    """Arguments of the wrapper; see `ThreatPool`."""

    __pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[misc]

    size: Annotated[StrictInt, Field(ge=1, le=100_000)]
    seed: NotRequired[Annotated[StrictInt, Field(ge=0, le=MOST_SEED)]]


class PolicyArguments(BaseModel):
    """Arguments of the spatial policies; the policies of stable-baselines3 take none.

    Attributes:
        rows: Rows of the build zone, from the scenario.
        columns: Columns of the build zone, from the scenario.
        item_channels: Names of the planes that the catalogue adds to the observation.
        places: Number of places that represent the charge; by default 1 for a visible and 9 for a
            hidden one.
        width: Number of features per cell.
        critic_width: Neurons of the critic's hidden layer.
        finish_bias: Initial bias of the logit of finishing.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    rows: Annotated[StrictInt, Field(ge=1, le=1000)] = 1
    columns: Annotated[StrictInt, Field(ge=1, le=1000)] = 1
    item_channels: Annotated[tuple[str, ...], Field(max_length=1000)] = ()
    places: Annotated[StrictInt, Field(ge=1, le=64)] | None = None
    width: Annotated[StrictInt, Field(ge=1, le=512)] = 24
    critic_width: Annotated[StrictInt, Field(ge=1, le=4096)] = 64
    finish_bias: Annotated[StrictFloat, Field(ge=-50.0, le=50.0)] = -3.0


_OF_SCENARIO: Final = tuple(
    f"policy_kwargs.{name}" for name in ("rows", "columns", "item_channels")
)
"""Arguments that the scenario decides, so that changes of them would have no effect."""

_SPATIAL: Final = "blast_agents.policies.spatial."

_NO_MODEL_ARGUMENTS: Final = (
    *("n_timesteps", "n_envs", "env_wrapper", "policy", "policy_kwargs"),
    *("imitation_updates", "imitation_cases"),
)


class Hyperparameters(BaseModel):
    """Hyperparameters of PPO and MaskablePPO, named as there and in RL Zoo.

    Attributes:
        n_timesteps: Default number of steps of training: modules or pieces.
        n_envs: Default number of parallel environments.
        env_wrapper: Wrappers of the environment, the innermost first: names with arguments.
        policy: The policy.
        policy_kwargs: Its arguments.
        learning_rate: A number, or `"lin_"` and a number for a linear decay to 0.
        n_steps: Steps of each environment between two updates.
        batch_size: Steps in a minibatch.
        n_epochs: Passes over the steps in an update.
        gamma: Discount; 1 for none.
        gae_lambda: Trade-off between bias and variance of the advantages.
        clip_range: Bound on the change of a probability ratio in an update; as `learning_rate`.
        ent_coef: Weight of the entropy bonus, which sustains exploration.
        vf_coef: Weight of the critic's error.
        max_grad_norm: Bound on the norm of the gradient.
        normalize_advantage: Whether advantages are normalised per minibatch.
        target_kl: Divergence of the policy that ends an update; `None` for no limit.
        imitation_updates: Minibatches of the warm start, which imitates the best layout by rule of
            each case before the first step; 0 for none.
        imitation_cases: Charges, or generated sites, of the warm start.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    n_timesteps: Annotated[StrictInt, Field(ge=1, le=10**10)]
    n_envs: Annotated[StrictInt, Field(ge=1, le=256)]
    env_wrapper: Annotated[tuple[dict[WrapperName, PoolArguments], ...], Field(max_length=4)] = ()
    policy: PolicyName
    policy_kwargs: PolicyArguments = PolicyArguments()
    learning_rate: Amount
    n_steps: Annotated[StrictInt, Field(ge=2, le=100_000)]
    batch_size: Annotated[StrictInt, Field(ge=2, le=10**8)]
    n_epochs: Annotated[StrictInt, Field(ge=1, le=100)]
    gamma: Share = 1.0
    gae_lambda: Share = 0.95
    clip_range: Amount = 0.2
    ent_coef: Annotated[StrictFloat, Field(ge=0.0, le=10.0)] = 0.0
    vf_coef: Annotated[StrictFloat, Field(ge=0.0, le=100.0)] = 0.5
    max_grad_norm: Annotated[StrictFloat, Field(gt=0.0, le=1000.0)] = 0.5
    normalize_advantage: bool = True
    target_kl: Annotated[StrictFloat, Field(gt=0.0)] | None = None
    imitation_updates: Annotated[StrictInt, Field(ge=0, le=10_000)] = 0
    imitation_cases: Annotated[StrictInt, Field(ge=1, le=100_000)] = 96

    @model_validator(mode="after")
    def _check_batches(self) -> "Hyperparameters":
        """Refuse a batch size that does not divide a rollout: stable-baselines3 only warns."""
        steps = self.n_steps * self.n_envs
        if steps % self.batch_size:
            raise ValueError(
                f"batch_size is {self.batch_size}, must divide n_steps * n_envs = {steps}"
            )
        return self

    def model_arguments(self) -> dict[str, Any]:
        """Return the arguments of PPO and MaskablePPO except the policy and its arguments."""
        return self.model_dump(exclude={*_NO_MODEL_ARGUMENTS})

    def wrappers(self) -> tuple[tuple[str, dict[str, Any]], ...]:
        """Return name and arguments of each wrapper, the innermost first."""
        return tuple(
            (name, dict(arguments))
            for wrapper in self.env_wrapper
            for name, arguments in wrapper.items()
        )


def hyperparameter_keys() -> tuple[str, ...]:
    """Return the valid keys of changes, such as `"policy_kwargs.width"`."""
    return tuple(name for name in option_names(Hyperparameters) if name not in _OF_SCENARIO)


def hyperparameter_file(algorithm: str) -> Path:
    """Return the bundled YAML file of an algorithm.

    Raises:
        UnknownNameError: If the algorithm is unknown; the message names the nearest one.
    """
    check_names("algorithm", [algorithm], ALGORITHMS)
    return _FOLDER / f"{algorithm}.yml"


def load_hyperparameters(
    algorithm: str,
    env_id: str,
    changes: Mapping[str, Any] = MappingProxyType({}),
    envs: int | None = None,
) -> Hyperparameters:
    """Return the hyperparameters of an algorithm for an environment.

    Args:
        algorithm: One of `ALGORITHMS`.
        env_id: Section of the file; that of `BlastBarrier-v0` if the file has no such section.
        changes: Values that override those of the file, by name; see `hyperparameter_keys`.
        envs: Number of parallel environments, which overrides `n_envs`.

    Raises:
        UnknownNameError: If the algorithm or a key is unknown; the message names the nearest one.
        BlastEnvError: If a value is invalid; the message names its bound. Or if the policy takes no
            such argument.
    """
    path = hyperparameter_file(algorithm)
    sections = yaml.safe_load(path.read_text(encoding="utf-8"))  # our own file, with aliases
    check_names("hyperparameter", changes, hyperparameter_keys())
    values = with_changes(sections.get(env_id, sections[DEFAULT_SECTION]), changes)
    if envs is not None:
        values["n_envs"] = envs
    try:
        found = Hyperparameters.model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(f"hyperparameters: {described(error)}") from error
    of_policy = [name for name in changes if name.startswith("policy_kwargs.")]
    if of_policy and not found.policy.startswith(_SPATIAL):
        raise BlastEnvError(
            f"hyperparameters: {of_policy[0]} has no effect on {found.policy}, whose network is"
            f" that of stable-baselines3; it is for the policies of {_SPATIAL[:-1]}"
        )
    return found
