"""Work for the workers of a pool or a cluster: apart from the tests, whose imports take seconds."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib

from blast_env.errors import BlastEnvError


def square(number: int) -> int:
    """Return the square of a number."""
    return number * number


def process(_: int) -> int:
    """Return which process does it."""
    return os.getpid()


def kill(_: int) -> None:
    """End the process that does it, as no error does."""
    os.kill(os.getpid(), signal.SIGKILL)


def workers_within(_: int) -> int:
    """Return how many workers joblib would use here."""
    return int(joblib.effective_n_jobs(None))


def refuse_three(item: int) -> int:
    """Return the item, unless it is 3."""
    if item == 3:
        raise BlastEnvError("item 3 is odd")
    return item


@dataclass(frozen=True)
class Touch:
    """Leaves a file with the number of each item in a folder, and takes a moment for it."""

    folder: Path

    def __call__(self, item: int) -> None:
        """Leave the file."""
        (self.folder / str(item)).touch()
        time.sleep(0.02)


def name_and_seed(blast: Any) -> tuple[str, int]:
    """Return the name of a blast's site, and the seed."""
    return blast.scenario.name, blast.seed
