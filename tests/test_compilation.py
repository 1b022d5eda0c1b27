"""Compiling: once per installation, with a notice, and again when any of the sources changed."""

import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import njit

import blast_env
from blast_env.compilation import compilation_notice
from blast_env.particles.event import engine as event_engine

FIRST_BLAST = """
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
    assert [record.message for record in caplog.records] == [
        "compiling a doubling, once per installation ..."
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "name"), [("gas", "gas dynamics"), ("surrogate", "surrogate")])
def test_the_first_blast_of_an_installation_gives_it(
    engine: str, name: str, tmp_path: Path
) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", FIRST_BLAST, engine],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        logged = process.stderr.readline()
        process.kill()
    assert name in logged
    assert logged.startswith("compiling ")


# --- Compiling: once per installation, with a notice, and again when any of the sources changed.


NOTICE = "compiling the event engine"
SEEDS = range(2)
CODE = f"""
import logging
logging.basicConfig(format="%(name)s: %(message)s")
import blast_env
print(blast_env.__file__)
scenario = blast_env.load_scenario("courtyard")
for seed in {SEEDS}:
    print(blast_env.simulate(scenario, seed=seed, engine="event").digest)
"""


def start_in(folder: Path) -> subprocess.Popen[str]:
    """Begin to run two blasts with the package in `folder`."""
    own = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return subprocess.Popen(
        [sys.executable, "-c", CODE],
        cwd=folder,
        env=own,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_the_first_run_compiles_and_says_so_and_only_the_first(tmp_path: Path) -> None:
    """In a copy of the package and of what was compiled here, of which one file is then changed."""
    scenario = blast_env.load_scenario("courtyard")
    digests = [blast_env.simulate(scenario, seed=seed, engine="event").digest for seed in SEEDS]
    package = Path(blast_env.__file__).parent
    without = shutil.ignore_patterns("__pycache__", "*.png")
    shutil.copytree(package, tmp_path / "blast_env", ignore=without)
    shutil.copytree(package.parent / "scenarios", tmp_path / "scenarios")
    compiled: Any = event_engine._RUN
    shutil.copytree(
        compiled.stats.cache_path, tmp_path / "blast_env" / "particles" / "event" / "__pycache__"
    )

    with start_in(tmp_path) as process:
        printed, logged = process.communicate()
    path, *again = printed.split()
    assert Path(path).is_relative_to(tmp_path)
    assert (again, logged) == (digests, "")

    # Not the file of the function that is kept on disk: a change of that one Numba would notice.
    source = tmp_path / "blast_env" / "particles" / "event" / "contacts.py"
    text = source.read_text(encoding="utf-8")
    changed = text.replace(
        "-(1.0 + restitution) * reduced_mass", "-(1.5 + restitution) * reduced_mass"
    )
    assert changed != text
    source.write_text(changed, encoding="utf-8")
    # Without optimisation compiling takes a third of the time.
    with start_in(tmp_path) as process:
        assert process.stderr is not None
        logged = process.stderr.readline()  # Numba has begun; to wait for its end proves no more
        process.kill()
    assert logged.startswith("blast_env: ")
    assert NOTICE in logged
