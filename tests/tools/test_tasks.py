"""Splits of tasks: what can be drawn by whom."""

import pytest

from blast_env.benchmark import DEFINITIONS
from blast_env.errors import BlastEnvError
from blast_env.tools import Tasks

SECRET = "correct horse"


def test_test_sites_need_the_secret() -> None:
    own, other = Tasks(SECRET), Tasks("another text")
    assert own.problem("test", 3) == Tasks(SECRET).problem("test", 3)
    assert own.problem("test", 3) != other.problem("test", 3)
    assert own.problem("train", 3) == other.problem("train", 3) == Tasks().problem("train", 3)
    seeds = [int(own.problem("test", index).site.partition("_")[2]) for index in range(20)]
    assert len(set(seeds)) == 20
    assert min(seeds) > 2**61
    with pytest.raises(BlastEnvError, match="start the server with a secret"):
        Tasks().problem("test", 0)
    assert SECRET not in repr(own)


def test_splits_have_ends() -> None:
    tasks = Tasks()
    assert tasks.count("test") == 0
    assert tasks.problem("benchmark", 0).name == next(iter(DEFINITIONS))
    for split, index, message in (
        ("benchmark", len(DEFINITIONS), "index is 12"),
        ("train", -1, "index is -1"),
        ("trial", 0, "no split 'trial'"),
    ):
        with pytest.raises(BlastEnvError, match=message):
            tasks.problem(split, index)
    with pytest.raises(BlastEnvError, match="8"):
        Tasks("short")
    assert tasks.spec("train", 2) == {"id": "train-2", "split": "train", "index": 2}
