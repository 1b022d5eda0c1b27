"""The settings and the run folder of a training."""

import csv
import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from blast_agents.training.hyperparameters import (
    ALGORITHMS,
    SELF_LABELLING,
    AnyHyperparameters,
    Hyperparameters,
    SelfLabellingHyperparameters,
)
from blast_env.design.surrogate.engine import engine_to_train_on, is_surrogate
from blast_env.documents import (
    DocumentError,
    checked_as,
    described,
    parse_csv,
    parse_json,
    read_text,
)
from blast_env.envs.arguments import check_names
from blast_env.envs.observations import SINGLE_ARRAYS
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.files import is_temporary, make_folder, sync, write_atomically, write_text
from blast_env.provenance import versions
from blast_env.site import Scenario, ScenarioError, load_scenario, save_scenario
from blast_env.tables import cell_text

CONFIGURATION_FORMAT: Final = 1
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
        algorithm: `"ppo"`, `"maskable_ppo"` or `"self_labelling"`.
        scenario: Bundled name, path of a scenario file, or `"sites"` for generated ones.
        steps: Steps to train for; the last rollout, or round, is always completed.
        seed: Seed of weights, episodes, actions and minibatches.
        threat: `"visible"`: the agent sees the charge; `"hidden"`: it sees the possible places.
        engine: Engine of the blasts; `"surrogate"` or a surrogate's file for predictions instead
            of blasts.
        cell_m: Side of the cells of gas dynamics; by default the engine's.
        cells: Growth of the cells: `"uniform"`, `"coarse"` or `"fine"`; by default the engine's.
        observation: Name of the observation; see `BlastBarrier-v0`.
        hidden_threats: Charges per episode with a hidden threat. The expected reward does not
            depend on it; with few charges, the same number of blasts covers more layouts.
        evaluation_interval: Rollouts between two evaluations.
        evaluation_cases: Number of held-out threats of an evaluation.
        evaluation_engine: Engine that selects the best weights; by default that of the training,
            or gas dynamics if a surrogate trains.
        evaluation_first_seed: Offset of the seeds of these threats within the range for the
            selection of weights (`SeedRange.VALIDATION`).
        torch_threads: Threads for the network.
        start_from: Run folder whose best weights initialise the training; `None` for random ones.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    algorithm: Literal["ppo", "maskable_ppo", "self_labelling"]
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


class RunConfiguration(BaseModel):
    """The complete configuration of a run, which is reproducible from it and the scenario's file.

    Attributes:
        format: Version of the file format.
        settings: The settings.
        hyperparameters: The hyperparameters.
        scenario_hash: Content hash of the scenario; for generated sites, that of the first one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = CONFIGURATION_FORMAT
    settings: TrainingSettings
    hyperparameters: AnyHyperparameters
    scenario_hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]

    @model_validator(mode="after")
    def _check_algorithm(self) -> "RunConfiguration":
        """Refuse hyperparameters of another algorithm."""
        if isinstance(self.hyperparameters, Hyperparameters) == (
            self.settings.algorithm == SELF_LABELLING
        ):
            raise ValueError(f"hyperparameters are none of {self.settings.algorithm}")
        return self

    @property
    def ppo(self) -> Hyperparameters:
        """The hyperparameters of a run of PPO or MaskablePPO."""
        if not isinstance(self.hyperparameters, Hyperparameters):
            raise TypeError(f"{self.settings.algorithm} is not trained in environments")
        return self.hyperparameters

    @property
    def self_labelling(self) -> SelfLabellingHyperparameters:
        """The hyperparameters of a run of self-labelling."""
        if not isinstance(self.hyperparameters, SelfLabellingHyperparameters):
            raise TypeError(f"{self.settings.algorithm} has no labels")
        return self.hyperparameters

    def document(self) -> dict[str, Any]:
        """Return the configuration as plain data."""
        return self.model_dump(mode="json")


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


@dataclass(frozen=True)
class RolloutRow:
    """Results of a rollout or, in self-labelling, of a round.

    Attributes:
        steps: Steps of training at its end.
        episodes: Episodes that ended in the rollout; layouts tried in the round.
        reward: Mean reward of these episodes; mean reduction of the best layouts of all cases.
        reduction: Mean reduction of these episodes or layouts.
        modules: Mean number of modules or pieces of the layouts.
        blasts: Blasts simulated since the start of training.
        cache_hits: Cached loads used since the start of training.
        seconds: Time since the start of training, in s.
    """

    steps: int
    episodes: int
    reward: float
    reduction: float
    modules: float
    blasts: int
    cache_hits: int
    seconds: float


@dataclass(frozen=True)
class EvaluationRow:
    """An evaluation on held-out threats.

    Attributes:
        steps: Steps of training.
        episodes: Episodes of training.
        reduction: Reduction on the held-out threats.
        low: Lower end of its 95 % interval.
        high: Upper end of its 95 % interval.
        blasts: Blasts of training, without those of the evaluations.
        seconds: Time since the start of training, in s.
    """

    steps: int
    episodes: int
    reduction: float
    low: float
    high: float
    blasts: int
    seconds: float


Row = TypeVar("Row", RolloutRow, EvaluationRow)


def write_rows(path: Path, kind: type[Row], rows: Sequence[Row]) -> None:
    """Write rows as CSV, atomically.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    with (
        write_atomically(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, [field.name for field in fields(kind)])
        writer.writeheader()
        for row in rows:
            writer.writerow({name: cell_text(value) for name, value in asdict(row).items()})


def read_rows(path: Path, kind: type[Row]) -> list[Row]:
    """Read rows from CSV.

    Raises:
        BlastEnvError: If the file does not exist or is damaged.
    """
    with refusing(path, "missing or damaged"):
        return list(parse_csv(read_text(path), kind))


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


def check_format(path: Path, content: Any, wanted: int) -> None:
    """Refuse a file of another format version.

    Args:
        path: The file, for the error.
        content: Its content.
        wanted: The required version.

    Raises:
        BlastEnvError: If its `format` differs.
    """
    found = content.get("format") if isinstance(content, dict) else None
    if found != wanted:
        raise BlastEnvError(f"{path}: format is {value_text(found)}, must be {wanted}")


@contextmanager
def refusing(path: Path, what: str = "damaged") -> Iterator[None]:
    """Report document errors in this block as a damaged file.

    Args:
        path: The file.
        what: Condition of the file, for the error.

    Raises:
        BlastEnvError: If the block raises a `DocumentError`.
    """
    try:
        yield
    except DocumentError as error:
        raise BlastEnvError(f"{path}: is {what}: {error}") from error


@dataclass(frozen=True)
class RunFolder:
    """The files of a run.

    Attributes:
        path: The folder.
    """

    path: Path

    @property
    def checkpoint(self) -> Path:
        """The state of the run: weights, best weights, optimiser, counters and tables."""
        return self.path / "checkpoint.pt"

    @property
    def rollouts(self) -> Path:
        """The results of the rollouts for readers, one per row; a copy of the checkpoint's."""
        return self.path / "rollouts.csv"

    @property
    def evaluations(self) -> Path:
        """The evaluations on held-out threats, one per row; a copy of the checkpoint's."""
        return self.path / "evaluations.csv"

    @property
    def learning_curve(self) -> Path:
        """The figure of the learning curve."""
        return self.path / "learning_curve.png"

    @property
    def tensorboard(self) -> Path:
        """The folder for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def is_run(self) -> bool:
        """Whether the folder contains a run."""
        return self._configuration.exists()

    @property
    def command(self) -> str:
        """The command that started the run.

        Raises:
            BlastEnvError: If the file is missing or damaged.
        """
        return self._said("command.txt").strip()

    @property
    def versions(self) -> dict[str, str]:
        """The versions of the software at the start of the run.

        Raises:
            BlastEnvError: If the file is missing or damaged.
        """
        with refusing(self.path / "versions.json"):
            return checked_as(dict[str, str], parse_json(self._said("versions.json")))

    def _said(self, name: str) -> str:
        with refusing(self.path / name, "missing or damaged"):
            return read_text(self.path / name)

    @property
    def blasts(self) -> Path:
        """The stored blasts of a training, for its continuation and for others."""
        return self.path / "blasts"

    @property
    def _configuration(self) -> Path:
        return self.path / "config.json"

    @property
    def _scenario(self) -> Path:
        return self.path / "scenario.toml"

    @property
    def _unfinished(self) -> Path:
        """The configuration during the creation of the folder; its renaming completes the run."""
        return self.path / ".config.json"

    @contextmanager
    def making(
        self, configuration: RunConfiguration, scenario: Scenario, command: str
    ) -> Iterator[None]:
        """Create the folder and write its constant files; the block writes the variable ones.

        One rename makes the folder a run folder after the block has succeeded. An interrupted
        creation starts again in the same folder.

        Args:
            configuration: Configuration of the run.
            scenario: The scenario; for generated sites, the first one.
            command: Command that started the run.

        Raises:
            BlastEnvError: If the folder cannot be created or contains other files.
        """
        make_folder(self.path)
        self._check_empty()
        write_text(self._unfinished, json.dumps(configuration.document(), indent=2) + "\n")
        self.clear_temporaries()
        save_scenario(scenario, self._scenario)
        write_text(self.path / "command.txt", f"{command}\n")
        known = {"platform": platform.platform()} | versions(packages=_PACKAGES)
        write_text(self.path / "versions.json", json.dumps(known, indent=2) + "\n")
        yield
        try:
            os.replace(self._unfinished, self._configuration)
            sync(self.path)
        except OSError as error:
            raise BlastEnvError(
                f"{self._configuration}: cannot be written: {error.strerror or error}"
            ) from error

    def clear_temporaries(self) -> None:
        """Remove temporary files of killed writers."""
        for path in self.path.iterdir():
            if is_temporary(path.name):
                path.unlink(missing_ok=True)

    def _check_empty(self) -> None:
        """Refuse a folder with a run, or with files other than those of an interrupted creation."""
        if self.is_run:
            raise BlastEnvError(f"{self.path}: has a run in it already; --resume continues it")
        if self._unfinished.exists():
            return
        taken = sorted(name for name in os.listdir(self.path) if not is_temporary(name))
        if taken:
            raise BlastEnvError(f"{self.path}: has {taken[0]!r} in it, must be empty")

    def configuration(self) -> RunConfiguration:
        """Return the configuration of the run.

        Raises:
            BlastEnvError: If it does not exist or is damaged.
        """
        path = self._configuration
        if not path.exists():
            raise BlastEnvError(
                f"{self.path}: is no run folder: there is no {path.name} in it"
                + ("; its making was interrupted: train begins anew" * self._unfinished.exists())
            )
        with refusing(path):
            document = parse_json(read_text(path))
        check_format(path, document, CONFIGURATION_FORMAT)
        with refusing(path):
            return checked_as(RunConfiguration, document)

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
