"""Checkpoints: the complete state of a training run in one file."""

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
from blast_env.errors import BlastEnvError, shortened, value_text
from blast_env.files import write_atomically
from blast_env.geometry import Layout

CHECKPOINT_FORMAT: Final = 2
Weights = Mapping[str, torch.Tensor]


@dataclass(frozen=True)
class Counters:
    """Counters of a training run.

    Attributes:
        steps: Steps of all environments.
        rollouts: Rollouts with their updates.
        updates: Passes over rollouts.
        episodes: Finished episodes.
        blasts: Blasts simulated.
        cache_hits: Loads that needed no blast.
        seconds: Duration of the training so far, in s.
        best_reduction: Reduction of the best evaluation; minus infinity before the first.
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
    """The best layout of a case found by self-labelling so far.

    Attributes:
        layout: The layout, sorted; empty if no layout is better than no barrier.
        load: Load with it, one per threat of the case, in the unit of the scenario's objective.
        unprotected: Load without a barrier, one per threat of the case, in the same unit.
    """

    layout: Layout
    load: tuple[float, ...]
    unprotected: tuple[float, ...]


_LABELS: Final = TypeAdapter(list[CaseLabel])


class Checkpoint(BaseModel):
    """The state of a training run between two rollouts.

    It is a single file, so that a run is always in the state before or after a rollout. It holds no
    state of random generators, because each rollout has separate seeds.

    Attributes:
        format: Version of the file format.
        configuration: Configuration of the run of the weights.
        counters: Counters of the run.
        policy: Weights of the policy, by name; empty before the first rollout unless the run
            started from other weights.
        optimizer: State of the optimiser.
        best_policy: Weights of the best evaluation; empty before the first one.
        rollouts: Results of the rollouts.
        evaluations: The evaluations on held-out threats.
        labels: Labels of self-labelling, one per case.
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
        """Return the checkpoint of a run before its first rollout.

        Args:
            configuration: Configuration of the run.
            weights: Initial weights; random ones by default.
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
        """Whether the run has no rollout yet."""
        return self.counters.rollouts == 0

    def save(self, path: Path, policy: BasePolicy | None = None) -> None:
        """Write the checkpoint atomically, with the present state of a policy if given.

        Raises:
            BlastEnvError: If the file cannot be written.
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
        # torch raises errors of another type if the device is full.
        buffer = BytesIO()
        torch.save(content, buffer)
        with write_atomically(path) as temporary:
            temporary.write_bytes(buffer.getbuffer())

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Read a checkpoint; only tensors and plain data are accepted.

        Raises:
            BlastEnvError: If the file does not exist or is damaged.
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
        """Write the tables for readers.

        Raises:
            BlastEnvError: If they cannot be written.
        """
        write_rows(folder.rollouts, RolloutRow, self.rollouts)
        write_rows(folder.evaluations, EvaluationRow, self.evaluations)

    def check_configuration(self, configuration: RunConfiguration, place: Path) -> None:
        """Refuse the configuration of another run, which would change the meaning of the weights.

        Only `steps`, the length of the training, may differ.

        Args:
            configuration: The configuration in the run folder.
            place: The folder, for the error.

        Raises:
            BlastEnvError: If any other value differs.
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
        """Load the weights into a policy.

        Args:
            policy: The policy.
            place: Source of the weights, for the error.
            weights: Weights of the best evaluation, or the last ones.

        Raises:
            BlastEnvError: If there are none yet, or they do not fit the policy.
        """
        values = self.best_policy if weights == "best" else self.policy
        if not values:
            what = "evaluation" if self.policy else "rollout"
            raise BlastEnvError(
                f"{place}: has no weights yet, before its first {what}; "
                f"blast-env train --resume {place} continues the run"
            )
        load_weights(policy, values, place)

    def load_into(self, policy: BasePolicy, place: Path) -> None:
        """Load the last weights and the optimiser's state, if any, into a policy.

        Args:
            policy: The policy.
            place: Source of the weights, for the error.

        Raises:
            BlastEnvError: If they do not fit the policy.
        """
        if self.policy:
            self.load_policy(policy, place)
        if self.is_start:
            return
        try:
            _check_optimizer(policy.optimizer, self.optimizer)
            policy.optimizer.load_state_dict(self.optimizer)
        # torch reports a mismatch by exceptions of many types.
        except Exception as error:
            reason = shortened(str(error), 300)
            raise BlastEnvError(f"{place}: the optimiser's state does not fit: {reason}") from error


def _check_optimizer(optimizer: torch.optim.Optimizer, given: Mapping[str, Any]) -> None:
    """Refuse settings and tensors of another optimiser, which torch loads and fails with later.

    Raises:
        Exception: If anything does not fit, of many types.
    """
    own, rates = optimizer.state_dict(), ("lr", "initial_lr")
    for group, known in zip(given["param_groups"], own["param_groups"], strict=True):
        for key in {*group, *known} - {*rates}:
            same = type(group[key]) is type(known[key]) and group[key] == known[key]
            if not same:
                raise ValueError(f"{key} differs")
        if not (isinstance(group["lr"], float | int) and 0.0 <= group["lr"] <= 1.0):
            raise ValueError("lr must be a number from 0 to 1")
    parameters = [each for group in optimizer.param_groups for each in group["params"]]
    for number, tensors in given["state"].items():
        shape = dict(enumerate(parameters))[number].shape
        if tensors.keys() != {"step", "exp_avg", "exp_avg_sq"}:
            raise ValueError(f"parameter {number} has other values than those of Adam")
        for name, tensor in tensors.items():
            what = f"{name} of parameter {number}"
            if not (isinstance(tensor, torch.Tensor) and tensor.dtype is torch.float32):
                raise ValueError(f"{what} is no tensor of numbers")
            if tensor.shape != (() if name == "step" else shape):
                raise ValueError(f"{what} has the shape {tuple(tensor.shape)}")
            if not torch.isfinite(tensor).all() or (name != "exp_avg" and (tensor < 0.0).any()):
                raise ValueError(f"{what} is negative, or not finite")


def load_weights(policy: nn.Module, values: Weights, place: Path) -> None:
    """Load weights into a policy.

    Args:
        policy: The policy.
        values: The weights, by name.
        place: Source of the weights, for the error.

    Raises:
        BlastEnvError: If they do not fit the policy or are not finite.
    """
    try:
        policy.load_state_dict(values)
    # torch reports a mismatch by exceptions of many types.
    except Exception as error:
        problem = " ".join(str(error).split())
        raise BlastEnvError(f"{place}: weights and configuration differ: {problem}") from error
    for name, value in policy.state_dict().items():
        if not torch.isfinite(value).all():
            raise BlastEnvError(f"{place}: the weights {name} are not finite")


def load_archive(path: Path, otherwise: str) -> Any:
    """Return the content of a file saved by torch; only tensors and plain data are accepted.

    Args:
        path: The file.
        otherwise: Alternative to a damaged file, for the error, such as `"no checkpoint"`.

    Raises:
        BlastEnvError: If the file is damaged or contains anything else.
    """
    try:
        _check_archive(path)
        content = torch.load(path, map_location="cpu", weights_only=True)
        _check_tensors(content)
    # torch reports a faulty file by exceptions of many types.
    except Exception as error:
        first_line = str(error).partition("\n")[0]
        raise BlastEnvError(f"{path}: is damaged, or {otherwise}: {first_line}") from error
    return content


def _check_archive(path: Path) -> None:
    """Refuse a compressed file, or one with wrong checksums, which torch does not verify."""
    with ZipFile(path) as archive:
        for member in archive.infolist():
            if member.compress_type != ZIP_STORED:  # may expand to any size
                raise BadZipFile(f"{member.filename} is compressed")
        wrong = archive.testzip()
    if wrong is not None:
        raise BadZipFile(f"{wrong} has a wrong checksum")


def _check_tensors(content: Any) -> None:
    """Refuse tensors larger than their data in the file."""
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
    """Yield the dotted names and values of nested tables."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value
