"""What a training run is about, as its run folder keeps it."""

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

from blast_agents.surrogate.engine import engine_to_train_on, is_surrogate
from blast_agents.training.hyperparameters import (
    ALGORITHMS,
    SELF_LABELLING,
    AnyHyperparameters,
    Hyperparameters,
    SelfLabellingHyperparameters,
)
from blast_env.documents import (
    DocumentError,
    checked_as,
    described,
    parse_csv,
    parse_json,
    read_text,
)
from blast_env.engines import JUDGE, Engine, find_engine
from blast_env.envs.arguments import check_names
from blast_env.envs.observations import OBSERVATIONS
from blast_env.errors import BlastEnvError, value_text
from blast_env.files import is_temporary, make_folder, sync, write_atomically
from blast_env.provenance import versions
from blast_env.scenario import Scenario, ScenarioError, load_scenario, save_scenario
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
"""Settings that `--set` changes, beside the hyperparameters."""


class TrainingSettings(BaseModel):
    """What is trained on what; how is for the hyperparameters.

    Attributes:
        algorithm: `"ppo"`, `"maskable_ppo"` or `"self_labelling"`.
        scenario: Bundled name, path of a scenario file, or `"sites"` for generated ones.
        steps: Steps to train for; a rollout, or a round, is always finished.
        seed: Decides everything: weights, episodes, actions, minibatches.
        threat: `"visible"`: the agent sees the charge; `"hidden"`: it sees where it may be.
        engine: Engine that runs the blasts; or `"surrogate"`, guesses instead of blasts (that
            of the package; or a surrogate's file).
        cell_m: Side of the cells of gas dynamics; that of the engine unless given.
        cells: How they grow: `"uniform"`, `"coarse"` or `"fine"`; as the engine's unless given.
        observation: Name of what the agent sees of the site; see `BlastBarrier-v0`.
        hidden_threats: Charges in an episode where they are hidden. The mean over episodes is the
            same for any number; with few, more layouts are tried for the same number of blasts.
        evaluation_interval: Rollouts from one evaluation to the next.
        evaluation_cases: Held-out threats that the layouts are evaluated on.
        evaluation_engine: Engine by which the best weights are chosen; that of the training unless
            given, and gas dynamics where the surrogate trains.
        evaluation_first_seed: The seeds of these threats count from here, within those that
            belong to the choice of weights (`SeedRange.SELECTION`).
        torch_threads: Threads for the network.
        start_from: Run folder whose best weights the training began with; `None` for fresh ones.
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
    observation: Literal["grid", "grid_with_load", "image", "features"] = "grid"
    hidden_threats: Annotated[int, Field(ge=1, le=1000)] = 2
    evaluation_interval: Annotated[int, Field(ge=1, le=10**6)] = 5
    evaluation_cases: Annotated[int, Field(ge=2, le=100)] = 16
    evaluation_engine: str | None = None
    evaluation_first_seed: Annotated[int, Field(ge=0, lt=2**30)] = 0
    torch_threads: Annotated[int, Field(ge=1, le=256)] = 1
    start_from: str | None = None

    @model_validator(mode="after")
    def _check_loads(self) -> "TrainingSettings":
        """Refuse to show loads of modules where there is nothing that knows them.

        A surrogate knows only their mean; for self-labelling they would take blasts of their own.
        """
        where = "with a surrogate" if self.guesses else "for self_labelling"
        nobody_knows = self.guesses or self.algorithm == SELF_LABELLING
        if nobody_knows and self.observation == "grid_with_load":
            raise ValueError(
                f"observation is 'grid_with_load', must be 'grid', 'image' or 'features' {where}"
            )
        return self

    @property
    def blast_engine(self) -> Engine:
        """The engine itself.

        Raises:
            UnknownNameError: If there is no engine of that name.
            BlastEnvError: If it has no such cells.
        """
        return engine_to_train_on(self.engine, self.cell_m, self.cells)

    @property
    def guesses(self) -> bool:
        """Whether a surrogate says what blasts would do."""
        return is_surrogate(self.engine)

    @property
    def real_engine(self) -> Engine:
        """The engine that runs the blasts; gas dynamics where a surrogate guesses it.

        A surrogate's file need not be there (any more).

        Raises:
            UnknownNameError: If there is no engine of that name.
            BlastEnvError: If it has no such cells.
        """
        return find_engine(JUDGE) if self.guesses else self.blast_engine

    @property
    def judge(self) -> Engine:
        """The engine by which the best weights are chosen, and the agent is evaluated.

        Raises:
            UnknownNameError: If there is no engine of that name.
            BlastEnvError: If it guesses: weights are chosen by blasts.
        """
        if self.evaluation_engine is not None:
            if is_surrogate(self.evaluation_engine):
                raise BlastEnvError(
                    f"evaluation_engine is {self.evaluation_engine!r}, must be an engine that runs "
                    "blasts: a surrogate guesses them"
                )
            return find_engine(self.evaluation_engine)
        return self.real_engine


class RunConfiguration(BaseModel):
    """All that a run needs to be repeated, with the file of its scenario.

    Attributes:
        format: Version of this form.
        settings: What is trained on what.
        hyperparameters: How.
        scenario_hash: Content hash of the scenario; of sites, that of the first one.
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
        """Return plain data."""
        return self.model_dump(mode="json")


def settings_from(values: Mapping[str, Any]) -> TrainingSettings:
    """Return settings from plain values.

    Raises:
        UnknownNameError: If there is no such algorithm, threat or observation; the message names
            the nearest.
        BlastEnvError: If a value is of no use; the message names its bound.
    """
    check_names("algorithm", [values.get("algorithm", ALGORITHMS[0])], ALGORITHMS)
    check_names("threat", [values.get("threat", THREATS[0])], THREATS)
    check_names("observation", [values.get("observation", "grid")], OBSERVATIONS)
    try:
        return TrainingSettings.model_validate(values)
    except ValidationError as error:
        raise BlastEnvError(f"training: {described(error)}") from error


@dataclass(frozen=True)
class RolloutRow:
    """What a rollout brought; of self-labelling, what a round did.

    Attributes:
        steps: Steps of training at its end.
        episodes: Episodes that ended in it; or layouts that were tried.
        reward: Mean over these episodes; or over the cases, the reduction by the best layout.
        reduction: Mean over these episodes; or over these layouts.
        modules: Mean number of modules or pieces of the layouts.
        blasts: Blasts simulated since training began.
        cache_hits: Loads that needed no blast since training began.
        seconds: Time since training began.
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
        reduction: On the held-out threats.
        low: Lower end of its 95 % interval.
        high: Upper end.
        blasts: Blasts of training, without those of the evaluations.
        seconds: Time since training began.
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
    """Write rows as CSV; the file is complete or as it was.

    Raises:
        BlastEnvError: If it cannot be written.
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
    """Read rows.

    Raises:
        BlastEnvError: If there is no such file, or it is damaged.
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
    """Refuse a file of another version.

    Args:
        path: The file, for the error.
        content: What is in it.
        wanted: The version.

    Raises:
        BlastEnvError: If its `format` is another one.
    """
    found = content.get("format") if isinstance(content, dict) else None
    if found != wanted:
        raise BlastEnvError(f"{path}: format is {value_text(found)}, must be {wanted}")


@contextmanager
def refusing(path: Path, what: str = "damaged") -> Iterator[None]:
    """Say of a file in which this block finds something wrong that it is damaged.

    Args:
        path: The file.
        what: What it is then.

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
        """All that changes in a run: weights, the best ones too, optimiser, counters, tables."""
        return self.path / "checkpoint.pt"

    @property
    def rollouts(self) -> Path:
        """What each rollout brought, a row each, for people: the checkpoint has it too."""
        return self.path / "rollouts.csv"

    @property
    def evaluations(self) -> Path:
        """The evaluations on held-out threats, a row each; the checkpoint has them too."""
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
    def is_run(self) -> bool:
        """Whether a run has begun in the folder."""
        return self._configuration.exists()

    @property
    def command(self) -> str:
        """What started the run.

        Raises:
            BlastEnvError: If the file is missing or damaged.
        """
        return self._said("command.txt").strip()

    @property
    def versions(self) -> dict[str, str]:
        """With which versions it was started.

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
        """The blasts of a training that keeps them, for it to go on and for others."""
        return self.path / "blasts"

    @property
    def _configuration(self) -> Path:
        return self.path / "config.json"

    @property
    def _scenario(self) -> Path:
        return self.path / "scenario.toml"

    @property
    def _unfinished(self) -> Path:
        """The configuration while the folder is made; renamed, it makes the folder a run's."""
        return self.path / ".config.json"

    @contextmanager
    def making(
        self, configuration: RunConfiguration, scenario: Scenario, command: str
    ) -> Iterator[None]:
        """Make the folder and write what does not change; the block writes what does.

        The folder is a run's when the block has ended well, by one rename. If this was interrupted
        before, it begins anew in what is there.

        Args:
            configuration: Of the run.
            scenario: The scenario; of sites, the first one.
            command: What started the run.

        Raises:
            BlastEnvError: If the folder cannot be made, or anything else is in it.
        """
        make_folder(self.path)
        self._check_empty()
        _write(self._unfinished, json.dumps(configuration.document(), indent=2) + "\n")
        self.clear_temporaries()
        save_scenario(scenario, self._scenario)
        _write(self.path / "command.txt", f"{command}\n")
        known = {"platform": platform.platform()} | versions(packages=_PACKAGES)
        _write(self.path / "versions.json", json.dumps(known, indent=2) + "\n")
        yield
        try:
            os.replace(self._unfinished, self._configuration)
            sync(self.path)
        except OSError as error:
            raise BlastEnvError(
                f"{self._configuration}: cannot be written: {error.strerror or error}"
            ) from error

    def clear_temporaries(self) -> None:
        """Remove what writers that were killed have left."""
        for path in self.path.iterdir():
            if is_temporary(path.name):
                path.unlink(missing_ok=True)

    def _check_empty(self) -> None:
        """Refuse a folder with a run, or with anything but what an interrupted making leaves."""
        if self.is_run:
            raise BlastEnvError(f"{self.path}: has a run in it already; --resume goes on with it")
        if self._unfinished.exists():
            return
        taken = sorted(name for name in os.listdir(self.path) if not is_temporary(name))
        if taken:
            raise BlastEnvError(f"{self.path}: has {taken[0]!r} in it, must be empty")

    def configuration(self) -> RunConfiguration:
        """Return the configuration of the run.

        Raises:
            BlastEnvError: If there is none, or it is damaged.
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


def _write(path: Path, text: str) -> None:
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
