"""Weights in files that hold no code."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile, ZipFile

import torch
from torch import nn

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError

CHECKPOINT_FORMAT: Final = 1


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


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What training goes on from.

    There is no state of random numbers: each rollout has seeds of its own.

    Attributes:
        policy: Weights of the policy, by name.
        optimizer: State of the optimiser.
        counters: How far the run is.
    """

    policy: dict[str, Any]
    optimizer: dict[str, Any]
    counters: Counters

    def save(self, path: Path) -> None:
        """Write the checkpoint; the file is complete or as it was.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        content = {
            "format": CHECKPOINT_FORMAT,
            "policy": self.policy,
            "optimizer": self.optimizer,
            "counters": asdict(self.counters),
        }
        with write_atomically(path) as temporary:
            torch.save(content, temporary)

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Read a checkpoint; nothing but tensors and plain data is accepted.

        Raises:
            BlastEnvError: If there is none, or it is damaged.
        """
        if not path.is_file():
            raise BlastEnvError(f"{path}: there is no such checkpoint")
        try:
            _check_sums(path)
            content = torch.load(path, map_location="cpu", weights_only=True)
            if content["format"] != CHECKPOINT_FORMAT:
                raise BlastEnvError(
                    f"{path}: is of format {content['format']}, must be {CHECKPOINT_FORMAT}"
                )
            return cls(content["policy"], content["optimizer"], Counters(**content["counters"]))
        except BlastEnvError:
            raise
        # torch says what is wrong with a file in errors of many kinds.
        except Exception as error:
            first_line = str(error).partition("\n")[0]
            raise BlastEnvError(f"{path}: is damaged, or no checkpoint: {first_line}") from error

    def load_policy(self, policy: nn.Module, place: Path) -> None:
        """Give a policy the weights.

        Args:
            policy: The policy.
            place: Where they come from, for the error.

        Raises:
            BlastEnvError: If they are those of another policy.
        """
        try:
            policy.load_state_dict(self.policy)
        except RuntimeError as error:
            problem = " ".join(str(error).split())
            raise BlastEnvError(f"{place}: weights and configuration differ: {problem}") from error


def _check_sums(path: Path) -> None:
    """Refuse a file with wrong checksums, which torch itself does not look at."""
    with ZipFile(path) as archive:
        wrong = archive.testzip()
    if wrong is not None:
        raise BadZipFile(f"{wrong} has a wrong checksum")
