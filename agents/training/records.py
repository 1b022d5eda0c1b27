"""The rows of a run folder's tables."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from blast_env.atomic import write_atomically
from blast_env.errors import BlastEnvError


@dataclass(frozen=True)
class RolloutRow:
    """What a rollout brought.

    Attributes:
        steps: Steps of training at its end.
        episodes: Episodes that ended in it.
        reward: Mean over these episodes.
        reduction: Mean over these episodes.
        modules: Mean number of modules of their layouts.
        blasts: Blasts simulated since training began.
        cache_hits: Loads that needed no blast, likewise.
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
        writer.writerows(asdict(row) for row in rows)


def read_rows(path: Path, kind: type[Row], most_steps: int) -> list[Row]:
    """Read rows up to a number of steps; those after it belong to what was lost.

    Raises:
        BlastEnvError: If there is no such file, or it is damaged.
    """
    types: dict[str, Callable[[str], Any]] = {
        field.name: int if field.type is int else float for field in fields(kind)
    }
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [
                kind(**{name: convert(row[name]) for name, convert in types.items()})
                for row in csv.DictReader(file)
            ]
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError) as error:
        raise BlastEnvError(f"{path}: is missing or damaged: {error}") from error
    return [row for row in rows if row.steps <= most_steps]
