"""What training goes on from: all of a run that changes, in one file."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal
from zipfile import ZIP_STORED, BadZipFile, ZipFile

import torch
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from stable_baselines3.common.policies import BasePolicy
from torch import nn

from blast_agents.training.run_folder import (
    EvaluationRow,
    RolloutRow,
    RunConfiguration,
    RunFolder,
    check_format,
    write_rows,
)
from blast_env.documents import described
from blast_env.errors import BlastEnvError, value_text
from blast_env.files import write_atomically
from blast_env.geometry import Layout

CHECKPOINT_FORMAT: Final = 2
Weights = Mapping[str, torch.Tensor]


@dataclass(frozen=True)
class Counters:
    """How far a training run is.

    Attributes:
        steps: Steps of all environments.
        rollouts: Rollouts with their updates.
        updates: Passes over rollouts.
        episodes: Episodes that ended.
        blasts: Blasts simulated.
        cache_hits: Loads that needed no blast.
        seconds: Time that the training has taken.
        best_reduction: Of the best evaluation; minus infinity before the first.
        best_steps: Steps at that evaluation.
    """

    steps: int = 0
    rollouts: int = 0
    updates: int = 0
    episodes: int = 0
    blasts: int = 0
    cache_hits: int = 0
    seconds: float = 0.0
    best_reduction: float = float("-inf")
    best_steps: int = 0


@dataclass(frozen=True)
class CaseLabel:
    """The best layout of a case that self-labelling knows so far.

    Attributes:
        layout: The layout, sorted; empty where nothing is better than nothing.
        load: With it, in the unit of the scenario's objective, one a threat of the case.
        unprotected: Without a barrier, one a threat of the case.
    """

    layout: Layout
    load: tuple[float, ...]
    unprotected: tuple[float, ...]


_LABELS: Final = TypeAdapter(list[CaseLabel])


class Checkpoint(BaseModel):
    """What training goes on from, and what it has come to.

    It is one file, so that every moment of a run is before one rollout or after it. There is no
    state of random numbers: each rollout has seeds of its own.

    Attributes:
        format: Version of this form.
        configuration: Of the run, which the weights belong to.
        counters: How far the run is.
        policy: Weights of the policy, by name; none before the first rollout.
        optimizer: State of the optimiser.
        best_policy: Weights of the best evaluation; none before the first one.
        rollouts: What each rollout brought.
        evaluations: The evaluations on held-out threats.
        labels: What self-labelling has found, a label a case.
    """

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)

    format: Literal[2] = CHECKPOINT_FORMAT
    configuration: RunConfiguration
    counters: Counters
    policy: dict[str, torch.Tensor]
    optimizer: dict[str, Any]
    best_policy: dict[str, torch.Tensor]
    rollouts: list[RolloutRow] = []
    evaluations: list[EvaluationRow] = []
    labels: list[CaseLabel] = []

    @classmethod
    def of_start(
        cls, configuration: RunConfiguration, weights: Weights = MappingProxyType({})
    ) -> "Checkpoint":
        """Return the checkpoint of a run that has not done anything.

        Args:
            configuration: Of the run.
            weights: Those that it begins with; fresh ones unless given.
        """
        return cls(
            configuration=configuration,
            counters=Counters(),
            policy=dict(weights),
            optimizer={},
            best_policy={},
        )

    @property
    def is_start(self) -> bool:
        """Whether there has not been a rollout."""
        return self.counters.rollouts == 0

    def save(self, path: Path, policy: BasePolicy | None = None) -> None:
        """Write the checkpoint, as a policy is now; the file is complete or as it was.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        if policy is not None:
            self.policy, self.optimizer = policy.state_dict(), policy.optimizer.state_dict()
        content = {
            "format": self.format,
            "configuration": self.configuration.document(),
            "counters": asdict(self.counters),
            "policy": self.policy,
            "optimizer": self.optimizer,
            "best_policy": self.best_policy,
            "rollouts": [asdict(row) for row in self.rollouts],
            "evaluations": [asdict(row) for row in self.evaluations],
            "labels": _LABELS.dump_python(self.labels, mode="json"),
        }
        # torch would say in an error of its own that the device is full.
        buffer = BytesIO()
        torch.save(content, buffer)
        with write_atomically(path) as temporary:
            temporary.write_bytes(buffer.getbuffer())

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Read a checkpoint; nothing but tensors and plain data is accepted.

        Raises:
            BlastEnvError: If there is none, or it is damaged.
        """
        if not path.is_file():
            raise BlastEnvError(f"{path}: there is no such checkpoint")
        content = load_archive(path, "no checkpoint")
        check_format(path, content, CHECKPOINT_FORMAT)
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise BlastEnvError(
                f"{path}: is damaged, or no checkpoint: {described(error)}"
            ) from error

    def write_tables(self, folder: RunFolder) -> None:
        """Write the tables for people.

        Raises:
            BlastEnvError: If they cannot be written.
        """
        write_rows(folder.rollouts, RolloutRow, self.rollouts)
        write_rows(folder.evaluations, EvaluationRow, self.evaluations)

    def check_configuration(self, configuration: RunConfiguration, place: Path) -> None:
        """Refuse the configuration of another run: with it the weights would say other things.

        Only `steps` may differ, the steps to train for: a run may be made longer or shorter.

        Args:
            configuration: As the run folder has it.
            place: The folder, for the error.

        Raises:
            BlastEnvError: If anything else differs.
        """
        own, given = dict(_flat(self.configuration.document())), _flat(configuration.document())
        for name, value in given:
            if name != "settings.steps" and value != own.get(name):
                raise BlastEnvError(
                    f"{place}: {name} is {value_text(value)} in the configuration, must be "
                    f"{value_text(own.get(name))}, as the checkpoint was trained with"
                )

    def load_policy(
        self, policy: nn.Module, place: Path, weights: Literal["best", "last"] = "last"
    ) -> None:
        """Give a policy the weights.

        Args:
            policy: The policy.
            place: Where they come from, for the error.
            weights: Those of the best evaluation, or the last ones.

        Raises:
            BlastEnvError: If there are none yet, or they are those of another policy.
        """
        values = self.best_policy if weights == "best" else self.policy
        if not values:
            what = "evaluation" if self.policy else "rollout"
            raise BlastEnvError(
                f"{place}: has no weights yet, before its first {what}; "
                f"blast-env train --resume {place} goes on"
            )
        load_weights(policy, values, place)

    def load_into(self, policy: BasePolicy, place: Path) -> None:
        """Give a policy the last weights, and its optimiser its state, as far as there are some.

        Args:
            policy: The policy.
            place: Where they come from, for the error.

        Raises:
            BlastEnvError: If they are those of another policy.
        """
        if self.policy:
            self.load_policy(policy, place)
        if self.is_start:
            return
        try:
            policy.optimizer.load_state_dict(self.optimizer)
        # torch says in errors of many kinds what does not fit.
        except Exception as error:
            raise BlastEnvError(f"{place}: the optimiser's state does not fit: {error}") from error


def load_weights(policy: nn.Module, values: Weights, place: Path) -> None:
    """Give a policy weights.

    Args:
        policy: The policy.
        values: The weights, by name.
        place: Where they come from, for the error.

    Raises:
        BlastEnvError: If they are those of another policy, or not finite.
    """
    try:
        policy.load_state_dict(values)
    # torch says in errors of many kinds what does not fit.
    except Exception as error:
        problem = " ".join(str(error).split())
        raise BlastEnvError(f"{place}: weights and configuration differ: {problem}") from error
    for name, value in policy.state_dict().items():
        if not torch.isfinite(value).all():
            raise BlastEnvError(f"{place}: the weights {name} are not finite")


def load_archive(path: Path, otherwise: str) -> Any:
    """Return what torch has saved; nothing but tensors and plain data is accepted.

    Args:
        path: The file.
        otherwise: What it is if it is not damaged, for the error.

    Raises:
        BlastEnvError: If it is anything else.
    """
    try:
        _check_archive(path)
        content = torch.load(path, map_location="cpu", weights_only=True)
        _check_tensors(content)
    # torch says what is wrong with a file in errors of many kinds.
    except Exception as error:
        first_line = str(error).partition("\n")[0]
        raise BlastEnvError(f"{path}: is damaged, or {otherwise}: {first_line}") from error
    return content


def _check_archive(path: Path) -> None:
    """Refuse a file with wrong checksums, which torch itself does not look at, or compressed."""
    with ZipFile(path) as archive:
        for member in archive.infolist():
            if member.compress_type != ZIP_STORED:  # may take up any memory
                raise BadZipFile(f"{member.filename} is compressed")
        wrong = archive.testzip()
    if wrong is not None:
        raise BadZipFile(f"{wrong} has a wrong checksum")


def _check_tensors(content: Any) -> None:
    """Refuse tensors that are larger than what the file holds of them."""
    if isinstance(content, torch.Tensor):
        if content.numel() * content.element_size() > content.untyped_storage().nbytes():
            raise ValueError(f"a tensor of {tuple(content.shape)} is not in the file")
    elif isinstance(content, dict):
        for value in content.values():
            _check_tensors(value)
    elif isinstance(content, list | tuple):
        for value in content:
            _check_tensors(value)


def _flat(document: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of what is in nested tables."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value
