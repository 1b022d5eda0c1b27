"""The settings and the folder of a training, laid out as by RL Zoo.

No file of a run folder can run code when it is read here: settings are plain YAML, and of the
archives of stable-baselines3 only the tensors are read (`training.weights`).
"""

import json
import os
import platform
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from blast_agents.training.hyperparameters import (
    ALGORITHMS,
    DEFAULT_SECTION,
    SITES_SECTION,
    Hyperparameters,
)
from blast_env.documents import DocumentError, checked_as, described, read_text
from blast_env.envs.arguments import check_names
from blast_env.envs.observations import SINGLE_ARRAYS
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.files import is_temporary, make_folder, write_text
from blast_env.provenance import versions
from blast_env.site import Scenario, ScenarioError, load_scenario, save_scenario
from blast_env.sites import FAMILIES
from blast_env.surrogate.engine import engine_to_train_on, is_surrogate

THREATS: Final = ("visible", "hidden")

SETTING_KEYS: Final = (
    "hidden_threats",
    "evaluation_interval",
    "evaluation_cases",
    "evaluation_engine",
    "evaluation_first_seed",
    "torch_threads",
)
"""Settings that `--set` changes, in addition to the hyperparameters."""


class TrainingSettings(BaseModel):
    """Algorithm, scenario, engine and evaluation of a training, without the hyperparameters.

    Attributes:
        algorithm: `"ppo"` or `"maskable_ppo"`.
        scenario: Bundled name, path of a scenario file, or `"sites"` for generated ones.
        steps: Steps to train for; the last rollout is always completed.
        seed: Seed of weights, episodes, actions and minibatches.
        threat: `"visible"`: the agent sees the charge; `"hidden"`: it sees the possible places.
        engine: Engine of the blasts; `"surrogate"` or a surrogate's file for predictions instead
            of blasts.
        cell_m: Side of the cells of gas dynamics; by default the engine's.
        cells: Growth of the cells: `"uniform"`, `"coarse"` or `"fine"`; by default the engine's.
        observation: Name of the observation; see `BlastBarrier-v0`.
        hidden_threats: Charges per episode with a hidden threat. The expected reward does not
            depend on it; with few charges, the same number of blasts covers more layouts.
        evaluation_interval: Rollouts between two evaluations, with a checkpoint each.
        evaluation_cases: Number of held-out threats of an evaluation; of a site with fewer fixed
            charges, all of these.
        evaluation_engine: Engine that selects the best weights; by default that of the training,
            or gas dynamics if a surrogate trains.
        evaluation_first_seed: Offset of the seeds of these threats within the range for the
            selection of weights (`SeedRange.VALIDATION`).
        torch_threads: Threads for the network.
        start_from: Run folder whose best weights initialise the training; `None` for random ones.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    algorithm: Literal["ppo", "maskable_ppo"]
    scenario: str
    steps: Annotated[int, Field(ge=1, le=10**10)]
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    threat: Literal["visible", "hidden"] = "visible"
    engine: str = "event"
    cell_m: Annotated[float, Field(gt=0.0)] | None = None
    cells: str | None = None
    observation: Literal["grid", "image", "features"] = "grid"
    hidden_threats: Annotated[int, Field(ge=1, le=1000)] = 2
    evaluation_interval: Annotated[int, Field(ge=1, le=10**6)] = 5
    evaluation_cases: Annotated[int, Field(ge=2, le=100)] = 16
    evaluation_engine: str | None = None
    evaluation_first_seed: Annotated[int, Field(ge=0, lt=2**30)] = 0
    torch_threads: Annotated[int, Field(ge=1, le=256)] = 1
    start_from: str | None = None

    @property
    def blast_engine(self) -> Engine:
        """The engine of the training, which may be a surrogate.

        Raises:
            UnknownNameError: If no engine has that name.
            BlastEnvError: If the engine does not support the cells.
        """
        return engine_to_train_on(self.engine, self.cell_m, self.cells)

    @property
    def guesses(self) -> bool:
        """Whether a surrogate predicts the loads."""
        return is_surrogate(self.engine)

    @property
    def judge(self) -> Engine:
        """The engine that selects the best weights and evaluates the agent.

        It is gas dynamics if a surrogate trains, whose file need not exist (any more).

        Raises:
            UnknownNameError: If no engine has that name.
            BlastEnvError: If it is a surrogate: weights are selected by blasts.
        """
        if self.evaluation_engine is not None:
            if is_surrogate(self.evaluation_engine):
                raise BlastEnvError(
                    f"evaluation_engine is {self.evaluation_engine!r}, must be an engine that runs "
                    "blasts: a surrogate guesses them"
                )
            return find_engine(self.evaluation_engine)
        return find_engine(JUDGE) if self.guesses else self.blast_engine

    @property
    def judging(self) -> dict[str, Any]:
        """The settings that evaluations of one run have in common, so that one is the best."""
        is_own = not (self.guesses or self.evaluation_engine)
        return {
            "evaluation_engine": self.judge.name,
            "evaluation_cases": self.evaluation_cases,
            "evaluation_first_seed": self.evaluation_first_seed,
            "threat": self.threat,
            "cell_m": self.cell_m if is_own else None,
            "cells": self.cells if is_own else None,
        }


class _Arguments(TrainingSettings):
    """The content of `args.yml`."""

    scenario_hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


@dataclass(frozen=True)
class RunConfiguration:
    """The complete configuration of a run, which is reproducible from it and the scenario's file.

    Attributes:
        settings: The settings.
        hyperparameters: The hyperparameters.
        scenario_hash: Content hash of the scenario; for generated sites, that of the first one.
    """

    settings: TrainingSettings
    hyperparameters: Hyperparameters
    scenario_hash: str


def settings_from(values: Mapping[str, Any]) -> TrainingSettings:
    """Return settings from plain values.

    Raises:
        UnknownNameError: If the algorithm, threat or observation is unknown; the message names the
            nearest one.
        BlastEnvError: If a value is invalid; the message names its bound.
    """
    check_names("algorithm", [values.get("algorithm", ALGORITHMS[0])], ALGORITHMS)
    check_names("threat", [values.get("threat", THREATS[0])], THREATS)
    check_names("observation", [values.get("observation", "grid")], SINGLE_ARRAYS)
    try:
        return TrainingSettings.model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(f"training: {described(error)}") from error


_PACKAGES: Final = (
    "blast-env",
    "gymnasium",
    "numba",
    "numpy",
    "pymunk",
    "sb3-contrib",
    "stable-baselines3",
    "torch",
)

_CHECKPOINT: Final = re.compile(r"rl_model_([0-9]{1,12})_steps\.zip")

_MONITOR: Final = re.compile(r"([0-9]{1,12})\.monitor\.csv")

_MOST_YAML_BYTES: Final = 200_000


@contextmanager
def refusing(path: Path) -> Iterator[None]:
    """Report document errors in this block as a damaged file.

    Raises:
        BlastEnvError: If the block raises a `DocumentError`.
    """
    try:
        yield
    except DocumentError as error:
        raise BlastEnvError(f"{path}: is missing or damaged: {error}") from error


def parse_yaml(text: str) -> Any:
    """Return the plain values of a YAML text; no tag makes an object, and none repeats by an alias.

    Raises:
        DocumentError: If it is anything else.
    """
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):  # a few bytes that become any number of values
                raise DocumentError("", f"has the alias *{event.anchor}, must have none")
        content = yaml.safe_load(text)
        json.dumps(content, default=str)  # refuses keys that are no text, and numbers of any length
    except DocumentError:
        raise
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        raise DocumentError("", f"is no YAML: {' '.join(str(error).split())}") from error
    return content


@dataclass(frozen=True)
class RunFolder:
    """The files of a run, named as by RL Zoo and the callbacks of stable-baselines3.

    Attributes:
        path: The folder.
    """

    path: Path

    @property
    def best_model(self) -> Path:
        """The weights of the best evaluation."""
        return self.path / "best_model.zip"

    @property
    def last_model(self) -> Path:
        """The weights at the end of the training."""
        return self.path / f"{self._parameters.name}.zip"

    @property
    def checkpoints(self) -> dict[int, Path]:
        """The checkpoints, weights and optimiser, by the number of steps, in this order."""
        return self._numbered(_CHECKPOINT)

    def checkpoint(self, steps: int) -> Path:
        """Return the checkpoint after a number of steps."""
        return self.path / f"rl_model_{steps}_steps.zip"

    @property
    def evaluations(self) -> Path:
        """The evaluations on held-out threats."""
        return self.path / "evaluations.npz"

    def monitor(self, steps: int) -> Path:
        """Return the table of the episodes of a training that begins after a number of steps."""
        return self.path / f"{steps}.monitor.csv"

    @property
    def monitors(self) -> dict[int, Path]:
        """The tables of episodes by the number of steps before them, in this order."""
        return self._numbered(_MONITOR)

    @property
    def learning_curve(self) -> Path:
        """The figure of the learning curve."""
        return self.path / "learning_curve.png"

    @property
    def tensorboard(self) -> Path:
        """The folder for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def blasts(self) -> Path:
        """The stored blasts of a training, for its continuation and for others."""
        return self.path / "blasts"

    @property
    def is_run(self) -> bool:
        """Whether the folder contains a run."""
        return self._configuration.exists()

    @property
    def _names(self) -> list[str]:
        return os.listdir(self.path) if self.path.is_dir() else []

    def _numbered(self, pattern: re.Pattern[str]) -> dict[int, Path]:
        found = [match for match in map(pattern.fullmatch, self._names) if match]
        return {
            int(match[1]): self.path / match[0] for match in sorted(found, key=lambda m: int(m[1]))
        }

    @property
    def _parameters(self) -> Path:
        """The folder of the settings, named by the environment's id."""
        sites = self.path / SITES_SECTION
        return sites if sites.is_dir() else self.path / DEFAULT_SECTION

    @property
    def _configuration(self) -> Path:
        """The hyperparameters, whose file is written last and makes the folder a run."""
        return self._parameters / "config.yml"

    @property
    def _arguments(self) -> Path:
        return self._parameters / "args.yml"

    @property
    def _scenario(self) -> Path:
        return self.path / "scenario.toml"

    def make(self, configuration: RunConfiguration, scenario: Scenario, command: str) -> None:
        """Create the folder and write its constant files.

        An interrupted creation starts again in the same folder.

        Args:
            configuration: Configuration of the run.
            scenario: The scenario; for generated sites, the first one.
            command: Command that started the run.

        Raises:
            BlastEnvError: If the folder cannot be created or contains other files.
        """
        make_folder(self.path)
        self._check_empty()
        settings = configuration.settings
        parameters = self.path / environment_id(settings.scenario)
        make_folder(parameters)
        self.clear_temporaries()
        save_scenario(scenario, self._scenario)
        known = {"platform": platform.platform()} | versions(packages=_PACKAGES)
        write_text(self.path / "versions.json", json.dumps(known, indent=2) + "\n")
        write_text(parameters / "command.txt", f"{command}\n")
        arguments = settings.model_dump(mode="json")
        arguments["scenario_hash"] = configuration.scenario_hash
        write_text(self._arguments, yaml.safe_dump(arguments))
        hyperparameters = configuration.hyperparameters.model_dump(mode="json")
        write_text(self._configuration, yaml.safe_dump(hyperparameters))

    def clear_temporaries(self) -> None:
        """Remove temporary files of killed writers."""
        for folder in (self.path, self._parameters):
            for path in folder.iterdir():
                if is_temporary(path.name):
                    path.unlink(missing_ok=True)

    def _check_empty(self) -> None:
        """Refuse a folder with a run, or with files other than those of an interrupted creation."""
        if self.is_run:
            raise BlastEnvError(f"{self.path}: has a run in it already; --resume continues it")
        own = {"scenario.toml", "versions.json", self._parameters.name}
        names = {name for name in self._names if not is_temporary(name)}
        taken = sorted(names - (own if self._parameters.name in names else set()))
        if taken:
            raise BlastEnvError(f"{self.path}: has {taken[0]!r} in it, must be empty")

    def configuration(self) -> RunConfiguration:
        """Return the configuration of the run.

        Raises:
            BlastEnvError: If it does not exist or is damaged.
        """
        path = self._configuration
        if not path.exists():
            begun = self._parameters.is_dir()
            raise BlastEnvError(
                f"{self.path}: is no run folder: there is no {path.parent.name}/{path.name} in it"
                + ("; its making was interrupted: train begins anew" * begun)
            )
        with refusing(path):
            content = parse_yaml(read_text(path, _MOST_YAML_BYTES))
            hyperparameters = checked_as(Hyperparameters, content)
        with refusing(self._arguments):
            content = parse_yaml(read_text(self._arguments, _MOST_YAML_BYTES))
            arguments = checked_as(_Arguments, content)
        settings = TrainingSettings.model_validate(arguments.model_dump(exclude={"scenario_hash"}))
        return RunConfiguration(settings, hyperparameters, arguments.scenario_hash)

    def scenario(self, configuration: RunConfiguration) -> Scenario:
        """Return the scenario of the run.

        Args:
            configuration: Configuration of the run.

        Raises:
            BlastEnvError: If it does not exist, is damaged, or is not that of the configuration.
        """
        try:
            scenario = load_scenario(self._scenario)
        except ScenarioError as error:
            raise BlastEnvError(f"{self.path}: the run folder is damaged: {error}") from error
        check_scenario(scenario, configuration, str(self._scenario))
        return scenario


def environment_id(scenario: str) -> str:
    """Return the environment id, and section of the hyperparameters, for a scenario's name."""
    return SITES_SECTION if scenario in FAMILIES else DEFAULT_SECTION


def check_scenario(scenario: Scenario, configuration: RunConfiguration, place: str) -> None:
    """Refuse a scenario other than that of a run.

    Args:
        scenario: The scenario.
        configuration: Configuration of the run.
        place: Source of the scenario, for the error.

    Raises:
        BlastEnvError: If the hashes differ.
    """
    if scenario.content_hash != configuration.scenario_hash:
        raise BlastEnvError(
            f"{place}: the scenario's hash is {scenario.content_hash[:12]}..., must be "
            f"{configuration.scenario_hash[:12]}..., that of the run: it is another scenario"
        )
