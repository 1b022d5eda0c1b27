"""The folder of a training run: what lies in it, and whether it is whole."""

import json
import os
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import yaml
from pydantic import ValidationError

from agents.training.set_options import described
from agents.training.settings import CONFIGURATION_FORMAT, RunConfiguration
from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError
from blast_env.scenario import Scenario, ScenarioError, load_scenario, save_scenario

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


@dataclass(frozen=True)
class RunFolder:
    """The files of a run.

    Attributes:
        path: The folder.
    """

    path: Path

    @property
    def last(self) -> Path:
        """Checkpoint after the last rollout: weights, optimiser and counters."""
        return self.path / "last.pt"

    @property
    def best(self) -> Path:
        """Checkpoint of the best evaluation on held-out threats."""
        return self.path / "best.pt"

    @property
    def rollouts(self) -> Path:
        """What each rollout brought, a row each."""
        return self.path / "rollouts.csv"

    @property
    def evaluations(self) -> Path:
        """The evaluations on held-out threats, a row each."""
        return self.path / "evaluations.csv"

    @property
    def learning_curve(self) -> Path:
        """The learning curve as a picture."""
        return self.path / "learning_curve.png"

    @property
    def tensorboard(self) -> Path:
        """The folder for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def _configuration(self) -> Path:
        return self.path / "config.yaml"

    @property
    def _scenario(self) -> Path:
        return self.path / "scenario.toml"

    def create(self, configuration: RunConfiguration, scenario: Scenario, command: str) -> None:
        """Make the folder and write what does not change.

        Args:
            configuration: Of the run.
            scenario: The scenario; of sites, the first one.
            command: What started the run.

        Raises:
            BlastEnvError: If the folder cannot be made, or there is anything in it.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            taken = sorted(os.listdir(self.path))
        except OSError as error:
            raise BlastEnvError(
                f"{self.path}: cannot be a folder: {error.strerror or error}"
            ) from error
        if taken:
            raise BlastEnvError(
                f"{self.path}: has {taken[0]!r} in it, must be empty; --resume goes on with a run"
            )
        save_scenario(scenario, self._scenario)
        _write(self.path / "command.txt", f"{command}\n")
        _write(self.path / "versions.json", json.dumps(_versions(), indent=2) + "\n")
        text = yaml.safe_dump(configuration.document(), sort_keys=False)
        _write(self._configuration, text)  # the last one: with it, the folder is a run's

    def configuration(self) -> RunConfiguration:
        """Return the configuration of the run.

        Raises:
            BlastEnvError: If there is none, or it is damaged.
        """
        try:
            document = yaml.safe_load(self._configuration.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise BlastEnvError(
                f"{self.path}: is no run folder: there is no {self._configuration.name} in it"
            ) from error
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise BlastEnvError(f"{self._configuration}: is damaged: {error}") from error
        found = document.get("format") if isinstance(document, dict) else None
        if found != CONFIGURATION_FORMAT:
            raise BlastEnvError(
                f"{self._configuration}: format is {found!r}, must be {CONFIGURATION_FORMAT}"
            )
        try:
            return RunConfiguration.model_validate(document)
        except ValidationError as error:
            raise BlastEnvError(described(error, f"{self._configuration}: is damaged")) from error

    def scenario(self, configuration: RunConfiguration) -> Scenario:
        """Return the scenario of the run.

        Args:
            configuration: Of the run.

        Raises:
            BlastEnvError: If there is none, it is damaged, or it is another one than that of the
                configuration.
        """
        try:
            scenario = load_scenario(self._scenario)
        except ScenarioError as error:
            raise BlastEnvError(f"{self.path}: the run folder is damaged: {error}") from error
        check_scenario(scenario, configuration, str(self._scenario))
        return scenario


def check_scenario(scenario: Scenario, configuration: RunConfiguration, place: str) -> None:
    """Refuse a scenario that is not the one of a run.

    Args:
        scenario: The scenario.
        configuration: Of the run.
        place: Where the scenario comes from, for the error.

    Raises:
        BlastEnvError: If the hashes differ.
    """
    if scenario.content_hash != configuration.scenario_hash:
        raise BlastEnvError(
            f"{place}: the scenario's hash is {scenario.content_hash[:12]}..., must be "
            f"{configuration.scenario_hash[:12]}..., that of the run: it is another scenario"
        )


def _versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    versions = {"python": platform.python_version(), "platform": platform.platform()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _write(path: Path, text: str) -> None:
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
