"""Agents: models, their files, and the layouts that they propose."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.policies import (
    MaskableActorCriticCnnPolicy,
    MaskableActorCriticPolicy,
)
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticCnnPolicy, ActorCriticPolicy
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.vec_env import VecEnv, VecTransposeImage

from blast_agents.packaged import MOST_DRAWS
from blast_agents.policies.spatial import SpatialMaskablePolicy, SpatialPolicy, ZonePolicy
from blast_agents.training.hyperparameters import ALGORITHMS, schedule
from blast_agents.training.run_folder import RunConfiguration, RunFolder, TrainingSettings
from blast_agents.training.weights import load_policy, read_parameters
from blast_env.envs.arguments import check_names
from blast_env.envs.observable import Array, EpisodeObservation, Observable
from blast_env.envs.observations import OBSERVATIONS, SINGLE_ARRAYS
from blast_env.envs.planes import item_channels, vehicle_channels
from blast_env.envs.strategies import check_size
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario
from blast_env.site.sources import source_of
from blast_env.values import checked_seed, whole_number

Model = PPO | MaskablePPO
Policy = ActorCriticPolicy | MaskableActorCriticPolicy
_PLACES: Final = {"visible": 1, "hidden": 9}


def fitted(configuration: RunConfiguration, scenario: Scenario) -> RunConfiguration:
    """Return a configuration with the policy's arguments that scenario and threat determine.

    Raises:
        BlastEnvError: If the policy does not suit the algorithm and the observation.
    """
    zone, settings = scenario.zone, configuration.settings
    given = configuration.hyperparameters
    policies = _policies(settings)
    if given.policy not in policies:
        raise BlastEnvError(
            f"policy is {given.policy}, must be one of {', '.join(policies)} for "
            f"{settings.algorithm} on the observation {settings.observation!r}"
        )
    changes = {
        "rows": zone.rows,
        "columns": zone.columns,
        "item_channels": (
            *item_channels(zone.catalogue),
            *vehicle_channels(bool(scenario.vehicles)),
        ),
        "places": given.policy_kwargs.places or _PLACES[settings.threat],
    }
    arguments = given.policy_kwargs.model_copy(update=changes)
    hyperparameters = given.model_copy(update={"policy_kwargs": arguments})
    return replace(configuration, hyperparameters=hyperparameters)


def channels_of(observation: str) -> tuple[str, ...]:
    """Return the names of an observation's planes, without those of catalogue and vehicles.

    The result is empty for an observation without planes.
    """
    channels: tuple[str, ...] = getattr(OBSERVATIONS[observation], "channels", ())
    return channels


def make_model(configuration: RunConfiguration, environments: VecEnv, seed: int = 0) -> Model:
    """Return a model with random weights, drawn by a seed below 2**32."""
    arguments = configuration.hyperparameters.model_arguments()
    for name in ("learning_rate", "clip_range"):
        arguments[name] = schedule(arguments[name])
    policy_class, policy_arguments = _policy_class(configuration)
    common: dict[str, Any] = {"policy_kwargs": policy_arguments, "seed": seed, "device": "cpu"}
    if configuration.settings.algorithm == "ppo":
        return PPO(policy_class, environments, **arguments, **common)
    return MaskablePPO(policy_class, environments, **arguments, **common)


def policy_for(configuration: RunConfiguration, scenario: Scenario) -> Policy:
    """Return the policy of a run for a scenario of its size, with random weights."""
    policy_class, arguments = _policy_class(configuration)
    seen, actions = policy_spaces(configuration.settings.observation, scenario)
    policy: Policy = policy_class(seen, actions, lambda _: 0.0, **arguments)
    return policy


def policy_spaces(
    observation: str, scenario: Scenario
) -> tuple[spaces.Space[Any], spaces.Discrete]:
    """Return the spaces of observations and actions of a policy for a scenario.

    They are those of the environment, except that stable-baselines3 puts an image's channels first.
    """
    space = OBSERVATIONS[observation].space(scenario)
    if isinstance(space, spaces.Box) and is_image_space(space):
        space = VecTransposeImage.transpose_space(space)
    return space, spaces.Discrete(scenario.zone.catalogue.finish + 1)


def as_tensor(policy: Policy, observations: Array) -> torch.Tensor:
    """Return observations as the input tensor of a policy, with an image's channels first."""
    tensor, _ = policy.obs_to_tensor(observations)
    if not isinstance(tensor, torch.Tensor):
        raise TypeError(f"observations are arrays, not {type(tensor).__name__}")
    return tensor


def logits_of(policy: Policy, observations: torch.Tensor) -> torch.Tensor:
    """Return the logit of each action, legal or not (batch, actions)."""
    distribution = policy.get_distribution(observations).distribution
    if not isinstance(distribution, torch.distributions.Categorical):
        raise TypeError(f"the actions of a placement are discrete, not {distribution}")
    logits: torch.Tensor = distribution.logits
    return logits


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Set the number of torch's threads in this block."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _policies(settings: TrainingSettings) -> dict[str, type[Policy]]:
    """Return the policies for algorithm and observation, by their names for import in RL Zoo."""
    of_ppo = settings.algorithm == "ppo"
    plain: dict[str, type[Policy]] = {
        "MlpPolicy": ActorCriticPolicy if of_ppo else MaskableActorCriticPolicy
    }
    if settings.observation == "image":
        return {
            "CnnPolicy": ActorCriticCnnPolicy if of_ppo else MaskableActorCriticCnnPolicy
        } | plain
    if channels_of(settings.observation):
        spatial = SpatialPolicy if of_ppo else SpatialMaskablePolicy
        return {f"{spatial.__module__}.{spatial.__name__}": spatial} | plain
    return plain


def _policy_class(configuration: RunConfiguration) -> tuple[type[Any], dict[str, Any]]:
    """Return the class of the policy, and its arguments without spaces and schedule."""
    settings, hyperparameters = configuration.settings, configuration.hyperparameters
    policy_class = _policies(settings)[hyperparameters.policy]
    if not issubclass(policy_class, ZonePolicy):
        return policy_class, {}
    arguments = hyperparameters.policy_kwargs.model_dump()
    channels = (*channels_of(settings.observation), *arguments.pop("item_channels"))
    return policy_class, arguments | {"channels": channels}


_ARCHIVE: Final = ".zip"
_ARCHIVES_HOLD_CODE: Final = "such archives may hold pickled code, which runs when they are read"

_SCHEDULES: Final = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf")
"""Entries of an archive that only training needs; RL Zoo's may not be importable here."""


@dataclass(frozen=True, eq=False)
class PolicyAgent:
    """Places modules one after the other by a policy; a `LayoutAgent`.

    Attributes:
        policy: The policy, of PPO or MaskablePPO.
        representative: A scenario of the size that the policy is for.
        observation: Name of the observation that the policy is for.

    Raises:
        UnknownNameError: If the observation is unknown.
    """

    policy: Policy
    representative: Scenario
    observation: str = "grid"

    def __post_init__(self) -> None:
        check_names("observation", [self.observation], SINGLE_ARRAYS)

    @cached_property
    def digest(self) -> str:
        """16 hexadecimal digits of a hash of the weights."""
        digest = sha256()
        for name, values in self.policy.state_dict().items():
            digest.update(name.encode() + values.numpy().tobytes())
        return digest.hexdigest()[:16]

    def propose(self, scenario: AnyScenario, charge: AnyCharge | None = None) -> Layout:
        """Return the layout of the most likely legal actions.

        Args:
            scenario: A scenario of the same size as that of the training, or its bundled name or
                path.
            charge: One of the scenario's charges; `None` if it is hidden.

        Raises:
            BlastEnvError: If the scenario has another size, or no build zone.
        """
        return self._layouts(find_scenario(scenario), charge, None, 1)[0]

    def sample(
        self,
        scenario: AnyScenario,
        charge: AnyCharge | None = None,
        count: int = 8,
        seed: int = 0,
    ) -> tuple[Layout, ...]:
        """Return layouts of actions sampled from the policy, as in training.

        Args:
            scenario: As for `propose`.
            charge: As for `propose`.
            count: Number of layouts; some may be equal.
            seed: Seed of the samples.

        Raises:
            BlastEnvError: As for `propose`, or if `count` is not a whole number from 1 to 10,000,
                or the seed none from 0 on.
        """
        checked = whole_number("count", count, 1, MOST_DRAWS)
        generator = torch.Generator().manual_seed(checked_seed(seed))
        return self._layouts(find_scenario(scenario), charge, generator, checked)

    def _layouts(
        self, scenario: Scenario, charge: AnyCharge | None, draw: torch.Generator | None, count: int
    ) -> tuple[Layout, ...]:
        check_size(scenario, self.representative)
        episode = self._episode(scenario, charge)
        catalogue = scenario.zone.catalogue
        placements = [LayoutState.empty(scenario)] * count
        open_ones = [index for index in range(count) if not placements[index].is_full]
        while open_ones:
            # Many layouts have the same beginning: the policy evaluates it once.
            different = {placements[index].layout: placements[index] for index in open_ones}
            number_of = {layout: number for number, layout in enumerate(different)}
            observations = np.stack([episode.observe(item) for item in different.values()])
            legal = np.stack([item.legal.ravel() for item in different.values()])
            numbers = [number_of[placements[index].layout] for index in open_ones]
            with torch_threads(1):  # further threads only wait for these small products
                actions = self._actions(observations, legal, numbers, draw)
            going_on = []
            for index, action in zip(open_ones, actions, strict=True):
                if action == catalogue.finish:
                    continue
                placements[index] = placements[index].place(catalogue.element(action))
                if not placements[index].is_full:
                    going_on.append(index)
            open_ones = going_on
        return tuple(placement.layout for placement in placements)

    def _episode(self, scenario: Scenario, charge: AnyCharge | None) -> EpisodeObservation:
        sources = scenario.charge
        if charge is not None:
            scenario.check_charge(charge)
            sources = (source_of(charge),)
        among_vehicles = bool(self.representative.vehicles)
        observable = Observable(scenario, sources, among_vehicles)
        return OBSERVATIONS[self.observation].episode(observable)

    def _actions(
        self,
        observations: Array,
        placeable: NDArray[np.bool_],
        numbers: Sequence[int],
        draw: torch.Generator | None,
    ) -> list[int]:
        """Return an action for each of the numbered observations; finishing is always legal."""
        legal = torch.as_tensor(np.pad(placeable, ((0, 0), (0, 1)), constant_values=True))
        with torch.no_grad():
            logits = logits_of(self.policy, as_tensor(self.policy, observations))
            logits = logits.masked_fill(~legal, -torch.inf)[numbers]
            if draw is None:
                chosen = logits.argmax(dim=1)
            else:
                chosen = torch.multinomial(logits.softmax(dim=1), 1, generator=draw)[:, 0]
        actions: list[int] = chosen.tolist()
        return actions


def weights_of(run: str | Path, weights: Literal["best", "last"] = "best") -> Path:
    """Return the archive of the best or the last weights of a run folder.

    Raises:
        UnknownNameError: If `weights` is neither `"best"` nor `"last"`.
        BlastEnvError: If it is not a run folder, or has no such weights yet.
    """
    check_names("weights", [weights], ("best", "last"))
    folder = RunFolder(Path(run))
    folder.configuration()
    checkpoints = [*folder.checkpoints.values()]
    if not checkpoints:
        raise BlastEnvError(
            f"{run}: has no weights yet, before its first evaluation; "
            f"blast-env train --resume {run} continues the run"
        )
    return folder.best_model if weights == "best" else checkpoints[-1]


def load_agent(run: str | Path, weights: Literal["best", "last"] = "best") -> PolicyAgent:
    """Return the agent of a run folder.

    The policy is rebuilt from the run's configuration, and only weights are read: no file of a run
    folder can contain code.

    Args:
        run: A run folder.
        weights: Weights of the best evaluation, or the last ones.

    Raises:
        BlastEnvError: If it is not a run folder, is damaged, or has no such weights yet; also for
            an archive of stable-baselines3, which `load_archive` reads.
    """
    if Path(run).suffix == _ARCHIVE:
        raise BlastEnvError(
            f"{run}: is an archive of stable-baselines3 and no run folder; {_ARCHIVES_HOLD_CODE}: "
            "load_archive(..., trust_archive=True) reads it, if you trust its maker"
        )
    folder = RunFolder(Path(run))
    configuration = folder.configuration()
    scenario = folder.scenario(configuration)
    configuration = fitted(configuration, scenario)
    place = weights_of(run, weights)
    policy = policy_for(configuration, scenario)
    load_policy(policy, read_parameters(place), place)
    policy.set_training_mode(False)
    return PolicyAgent(policy, scenario, configuration.settings.observation)


def load_archive(
    path: str | Path,
    algorithm: Literal["ppo", "maskable_ppo"],
    scenario: AnyScenario,
    *,
    trust_archive: bool = False,
    observation: str = "grid",
) -> PolicyAgent:
    """Return the agent of an archive written by stable-baselines3 or RL Zoo.

    Such archives may contain pickled objects, which can execute arbitrary code when read, so
    reading them requires a flag. RL Zoo need not be installed.

    Args:
        path: The archive, a `.zip` file.
        algorithm: Algorithm of the archive.
        scenario: A scenario of the size that the policy is for, or its bundled name or path.
        trust_archive: Whether the archive may run code; only for a trusted source.
        observation: Name of the observation that the policy is for.

    Raises:
        UnknownNameError: If the algorithm is unknown; the message has the nearest one.
        BlastEnvError: If the archive is not trusted, cannot be read, or is for observations or
            actions other than those of the scenario.
    """
    check_names("algorithm", [algorithm], ALGORITHMS)
    if not trust_archive:
        raise BlastEnvError(f"{path}: {_ARCHIVES_HOLD_CODE}; trust_archive is False, must be True")
    model = PPO if algorithm == "ppo" else MaskablePPO
    unread = dict.fromkeys(_SCHEDULES, 1.0)
    try:
        with Path(path).open("rb") as archive:  # by its name it would look for .zip.zip, too
            policy = model.load(archive, device="cpu", custom_objects=unread).policy
    except (OSError, ImportError, ValueError, KeyError, RuntimeError, AttributeError) as error:
        raise BlastEnvError(f"{path}: cannot be read: {error}") from error
    policy.set_training_mode(False)
    agent = PolicyAgent(policy, find_scenario(scenario), observation)
    seen, actions = policy_spaces(observation, agent.representative)
    for name, found, wanted in (
        ("observation_space", policy.observation_space, seen),
        ("action_space", policy.action_space, actions),
    ):
        if found != wanted:
            raise BlastEnvError(
                f"{path}: {name} is {found}, must be {wanted}, as the observation "
                f"{observation!r} and the scenario {agent.representative.name!r} say"
            )
    return agent
