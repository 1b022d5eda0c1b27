"""The notice of the first compilation, without which the first blast is a long silence."""

import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from blast_env.compilation import compilation_notice

CODE = """
import sys
import blast_env
blast_env.evaluate_layout("courtyard", [(0, 0)], seeds=range(1), engine=sys.argv[1])
"""


def test_the_notice_comes_once_and_only_if_something_is_compiled(
    caplog: pytest.LogCaptureFixture,
) -> None:
    twice: Any = njit(lambda number: 2.0 * number)

    with caplog.at_level(logging.WARNING, "blast_env"):
        with compilation_notice("nothing"):
            pass
        for number in (2.0, 2.0, 2):  # an integer compiles again
            with compilation_notice("a doubling"):
                assert twice(number) == 4
        twice(1j)  # outside
    assert [each.message for each in caplog.records] == [
        "compiling a doubling, once per installation ..."
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "name"), [("gas", "gas dynamics"), ("surrogate", "surrogate")])
def test_the_first_blast_of_an_installation_gives_it(
    engine: str, name: str, tmp_path: Path
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CODE, engine],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        logged = process.stderr.readline()
        process.kill()
    assert name in logged
    assert logged.startswith("compiling ")
