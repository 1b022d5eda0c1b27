"""Every Python block of the README runs, and so do the examples in docstrings."""

import doctest
import re
from pathlib import Path

import pytest

from blast_env.envs import simulator_env
from blast_env.evaluation import LayoutEvaluation

pytestmark = pytest.mark.slow

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def test_the_code_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From top to bottom, as a reader would try it."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, block in enumerate(BLOCKS, start=1):
        exec(compile(block, f"README.md, block {number}", "exec"), names)
    evaluation = names["evaluation"]
    assert isinstance(evaluation, LayoutEvaluation)
    assert 0.0 < evaluation.mean_reduction < 1.0


def test_the_readme_has_code() -> None:
    assert len(BLOCKS) >= 4


def test_examples_in_the_environment_s_docstring() -> None:
    failures, tried = doctest.testmod(simulator_env)
    assert tried > 5
    assert failures == 0
