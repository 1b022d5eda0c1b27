"""Bundled trained weights: files of weights only, with records of their provenance."""

import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Annotated, Final, Literal

import torch
from pydantic import BaseModel, ConfigDict, Field

from blast_agents.training.agent import TrainedAgent, policy_for
from blast_agents.training.checkpoint import Checkpoint, load_archive, load_weights
from blast_agents.training.run_folder import RunConfiguration, RunFolder, refusing
from blast_env.documents import checked_as, parse_json, read_text
from blast_env.envs.strategies import check_size
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.site import Scenario
from blast_env.sites import FAMILIES, training_sites

WEIGHTS: Final = Path(__file__).parents[1] / "weights"
"""The folder of the bundled weights."""


class LeagueResult(BaseModel):
    """Result of the weights in a league, on cases used neither for training nor for selection.

    Attributes:
        command: Command that played the league.
        engine: The judging engine.
        track: Name of the track.
        cases: Number of cases.
        reduction: Mean reduction of the load.
        low: Lower end of its 95 % interval.
        high: Upper end of its 95 % interval.
        best_rule: Name of the rule with the largest mean reduction.
        best_rule_reduction: Mean reduction by that rule.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    command: str
    engine: str
    track: str
    cases: Annotated[int, Field(ge=1)]
    reduction: float
    low: float
    high: float
    best_rule: str
    best_rule_reduction: float


class Record(BaseModel):
    """Provenance of weights, in a JSON file beside them.

    Attributes:
        format: Version of the file format.
        configuration: Configuration of their run, with the scenario's hash.
        scenario: Name of the scenario, or of the family of generated sites.
        command: Command that trained them.
        versions: Versions of the software, without the platform.
        steps: Steps of training at the evaluation that selected them.
        blasts: Blasts of the training, or predictions of a surrogate.
        seconds: Duration of the training, in s.
        league: Their result in a league.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    configuration: RunConfiguration
    scenario: str
    command: str
    versions: dict[str, str]
    steps: int
    blasts: int
    seconds: float
    league: LeagueResult | None = None


def pack(
    run: str | Path, name: str, league: LeagueResult | None = None, folder: Path = WEIGHTS
) -> list[Path]:
    """Write the best weights of a run and their record.

    Args:
        run: The run folder.
        name: Stem of the files.
        league: Their result in a league.
        folder: Target folder, which exists.

    Returns:
        The files.

    Raises:
        BlastEnvError: If `run` is not a run folder, is damaged or has no evaluation yet, or if a
            file cannot be written.
    """
    source = RunFolder(Path(run))
    configuration, checkpoint = source.configuration(), Checkpoint.load(source.checkpoint)
    checkpoint.check_configuration(configuration, source.path)
    if not checkpoint.best_policy:
        raise BlastEnvError(f"{source.path}: has no weights yet, before its first evaluation")
    counters = checkpoint.counters
    family = configuration.settings.scenario
    record = Record(
        configuration=configuration,
        scenario=family if family in FAMILIES else source.scenario(configuration).name,
        command=source.command,
        versions={name: each for name, each in source.versions.items() if name != "platform"},
        steps=counters.best_steps,
        blasts=counters.blasts,
        seconds=round(counters.seconds, 1),
        league=league,
    )
    buffer = BytesIO()
    torch.save(dict(checkpoint.best_policy), buffer)
    paths = [folder / f"{name}.pt", folder / f"{name}.json"]
    with write_atomically(paths[0]) as temporary:
        temporary.write_bytes(buffer.getbuffer())
    with write_atomically(paths[1]) as temporary:
        text = json.dumps(record.model_dump(mode="json"), indent=2)
        temporary.write_text(f"{text}\n", encoding="utf-8")
    return paths


def records(folder: Path | None = None) -> Iterator[tuple[Path, Record]]:
    """Yield each file of weights with its record, by name.

    Args:
        folder: Folder of the files; `WEIGHTS` by default.

    Raises:
        BlastEnvError: If a record is damaged.
    """
    for path in sorted((folder or WEIGHTS).glob("*.json")):
        with refusing(path):
            record = checked_as(Record, parse_json(read_text(path)))
        yield path.with_suffix(".pt"), record


def packaged_agent(
    scenario: Scenario, threat: Literal["visible", "hidden"], folder: Path | None = None
) -> tuple[TrainedAgent, Record] | None:
    """Return the bundled agent for a scenario, or `None` if there is none.

    An agent trained for this scenario precedes one for its family of generated sites. Only weights
    are read: no file can contain code.

    Args:
        scenario: The scenario, identified by its content and not by its name.
        threat: Whether the agent sees the charge.
        folder: Folder of the weights; `WEIGHTS` by default.

    Raises:
        BlastEnvError: If a file is damaged.
    """
    found = [each for each in records(folder) if each[1].configuration.settings.threat == threat]
    for path, record in found:
        if record.configuration.scenario_hash == scenario.content_hash:
            return _agent(path, record.configuration, scenario), record
    for path, record in found:
        representative = _of_family(record.configuration, scenario)
        if representative is not None:
            return _agent(path, record.configuration, representative), record
    return None


def _of_family(configuration: RunConfiguration, scenario: Scenario) -> Scenario | None:
    """Return the representative site of the family of weights if a scenario is compatible."""
    family, size = configuration.settings.scenario, configuration.hyperparameters.policy_kwargs
    if family not in FAMILIES or (size.rows, size.columns) != scenario.zone.shape:
        return None
    representative = training_sites(family).representative
    try:
        check_size(scenario, representative)
    except BlastEnvError:
        return None
    learnt = (configuration.scenario_hash, scenario.objective.quantity)
    is_as_then = learnt == (representative.content_hash, representative.objective.quantity)
    return representative if is_as_then else None


def _agent(path: Path, configuration: RunConfiguration, scenario: Scenario) -> TrainedAgent:
    policy = policy_for(configuration, scenario)
    load_weights(policy, load_archive(path, "no weights"), path)
    policy.set_training_mode(False)
    settings = configuration.settings
    return TrainedAgent(policy, scenario, settings.observation, settings.real_engine)
