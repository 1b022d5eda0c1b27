"""kill -9 at a moment, then the same command again: the result is the one it would have been.

Every step on the disk of every job takes minutes (`tests/attack/kills.py`); here is one of them.
"""

from pathlib import Path

import pytest

from tests.attack.kills import outcome_after_kill, steps_and_outcome


@pytest.mark.slow
def test_training_goes_on_from_a_step_on_the_disk(tmp_path: Path) -> None:
    steps, whole = steps_and_outcome("train", tmp_path / "whole")
    assert outcome_after_kill("train", tmp_path / "killed", steps // 2) == whole
