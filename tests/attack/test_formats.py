"""Wrong files of every format that is read: refused as documented, quickly, or what they say.

Ten thousand of each: `make attack`; here a few.
"""

from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from tests.attack.formats import FORMATS, Format
from tests.attack.run import Limits, attack

FILES = 20


@pytest.mark.parametrize("name", FORMATS)
def test_wrong_files_are_refused_or_read(name: str, tmp_path: Path) -> None:
    outcome = attack(FORMATS[name](tmp_path), FILES)
    assert list(outcome.failures) == []
    assert outcome.refused > 0


@pytest.mark.parametrize("name", FORMATS)
def test_samples_are_the_same_in_every_run(name: str, tmp_path: Path) -> None:
    """So that a file that failed can be made again."""
    folders = (tmp_path / "first", tmp_path / "second")
    for folder in folders:
        folder.mkdir()
    first, second = (FORMATS[name](folder).samples for folder in folders)
    assert first == second


def _endless(content: bytes) -> None:
    if content != _SAMPLE:
        while process_time() < 1e9:
            pass


def _greedy(content: bytes) -> None:
    np.ones(60 << 20, dtype=np.uint8)


def _careless(content: bytes) -> None:
    if content != _SAMPLE:
        raise KeyError(content)


def _vague(content: bytes) -> None:
    if content != _SAMPLE:
        raise BlastEnvError


def _invented(content: bytes) -> bytes:
    return content


_SAMPLE = b"a = 1"


@pytest.mark.parametrize(
    ("read", "limits", "problem"),
    [
        (_endless, Limits(stop_s=0.02), "Overtime in test_formats.py"),
        (_greedy, Limits(most_bytes=50 << 20), "took more than 50 MiB"),
        (_careless, Limits(), "KeyError in test_formats.py"),
        (_vague, Limits(), "an error without a message"),
        (_invented, Limits(), "another result than what was written"),
    ],
)
def test_what_no_reader_may_do_is_noticed(
    read: Callable[[bytes], None], limits: Limits, problem: str
) -> None:
    np.ones(200 << 20, dtype=np.uint8)  # memory that was given back hides nothing
    outcome = attack(Format((_SAMPLE,), read, has_checksum=True), 3, limits=limits)
    assert outcome.failed == 3
    assert all(found.startswith(problem) for found in outcome.failures)
