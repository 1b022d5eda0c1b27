"""kill -9 at a moment, then the same command again: the result is the one it would have been.

Every step on the disk of every job takes minutes (`tests/attack/kills.py`); here is one of them.
"""

from pathlib import Path
from types import MappingProxyType

import pytest

from blast_env.errors import BlastEnvError
from tests.attack import kills
from tests.attack.kills import JOBS, Job, in_process, outcome_after_kill, steps_and_outcome


def _two_files(folder: Path) -> None:
    """Write files that belong together, and take one for both."""
    if not (folder / "first").exists():
        (folder / "first").write_text("a")
        (folder / "second").write_text("b")


def _refused(folder: Path) -> None:
    raise BlastEnvError(f"{folder.name} is of no use")


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_training_goes_on_and_what_does_not_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One test, because the processes begin with seconds of imports."""
    steps, whole = steps_and_outcome("train", tmp_path / "whole")
    assert outcome_after_kill("train", tmp_path / "killed", steps // 2) == whole

    wrong = {"two": Job(_two_files, _names), "refused": Job(_refused, _names)}
    monkeypatch.setattr(kills, "JOBS", MappingProxyType({**JOBS, **wrong}))
    assert steps_and_outcome("two", tmp_path / "both") == (2, ["first", "second"])
    assert outcome_after_kill("two", tmp_path / "one", 1) == ["first"]
    assert in_process(_refused, tmp_path / "no").said == "no is of no use"
    with pytest.raises(RuntimeError, match="ended with 3 before it was killed: no is of no use"):
        outcome_after_kill("refused", tmp_path / "no", 0)
    with pytest.raises(RuntimeError, match="refused: no is of no use"):
        steps_and_outcome("refused", tmp_path / "no")
