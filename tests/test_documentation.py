"""Every Python block of the README runs, and so do the examples in docstrings."""

import doctest
import re
from pathlib import Path

import pytest

from blast_env.envs import simulator_env

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_code_of_the_readme_runs(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(BLOCKS[number], f"README.md, block {number + 1}", "exec"), {})


def test_the_readme_has_code() -> None:
    assert len(BLOCKS) >= 2


def test_examples_in_the_environment_s_docstring() -> None:
    failures, tried = doctest.testmod(simulator_env)
    assert tried > 5
    assert failures == 0
