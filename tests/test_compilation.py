"""Compiling: once per installation, with a notice, and again when any of the sources changed."""

import importlib
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from blast_env.compilation import compilation_notice

FIRST_BLASTS = """
import logging, sys
from blast_env import evaluate_layout

class Told(BaseException):
    pass

class Telling(logging.StreamHandler):
    def emit(self, record):
        super().emit(record)
        raise Told

logging.lastResort = Telling()
for engine in sys.argv[1:]:
    try:
        evaluate_layout("courtyard", [(0, 0)], seeds=range(1), engine=engine)
    except Told:
        pass
"""
"""Blasts, each of which ends when a notice is given, where nobody has said where notices go."""


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
def test_the_first_blast_of_an_installation_gives_it(tmp_path: Path) -> None:
    """Of each kind, before it compiles for a minute."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_BLASTS, "gas", "surrogate"],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    told = [line for line in done.stderr.splitlines() if line.startswith("compiling ")]
    assert len(told) == 2, done.stderr
    assert "gas dynamics" in told[0]
    assert "surrogate" in told[1]


COMPILED_AGAIN = """
import sys
from numba.core import event
from blast_env import evaluate_layout

class Telling(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__qualname__)
    def on_end(self, event):
        pass

event.register("numba:compile", Telling())
for engine in sys.argv[1:]:
    evaluate_layout("courtyard", [(0, 0)], seeds=range(1), engine=engine)
"""


def test_a_later_process_compiles_nothing() -> None:
    for _ in range(3):  # tests beside this one may keep theirs at the same time
        arguments = [sys.executable, "-c", COMPILED_AGAIN, "event", "surrogate"]
        told = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
        if not told:
            return
    pytest.fail(f"compiled in each process: {told}")


# --- Compiled code is kept until one of its sources changes, in whichever file that is.


SOURCES = {
    "numbers.py": "FACTOR = 3.0\n",
    "steps.py": """
from numba import njit

@njit
def halved(value):
    return value / 2.0
""",
    "pairs.py": """
from typing import NamedTuple

class Pair(NamedTuple):
    left: float
    right: float

def pair():
    return Pair(1.0, 2.0)
""",
    "kernel.py": """
from blast_env.compilation import compiled
from PACKAGE.numbers import FACTOR
from PACKAGE.steps import halved

@compiled(error_model="numpy")
def kernel(value):
    return FACTOR * halved(value)
""",
}


def kernel_of(folder: Path) -> Any:
    """Import the kernel of a package as a new process does."""
    for name in [name for name in sys.modules if name.partition(".")[0] == folder.name]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return importlib.import_module(f"{folder.name}.kernel").kernel


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a package with a kernel whose code is on disk."""
    folder = tmp_path / f"kernels_{tmp_path.name.replace('-', '_')}"
    folder.mkdir()
    for name, text in SOURCES.items():
        (folder / name).write_text(text.replace("PACKAGE", folder.name), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert kernel_of(folder)(8.0) == 12.0
    return folder


def test_code_on_disk_serves_while_no_source_changes(package: Path) -> None:
    again = kernel_of(package)
    assert again(8.0) == 12.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_a_change_of_any_source_compiles_again(package: Path) -> None:
    """A constant, a function that the kernel calls, and an option, one after the other."""
    for name, old, new, expected in (
        ("numbers.py", "3.0", "5.0", 20.0),
        ("steps.py", "2.0", "4.0", 10.0),
        ("kernel.py", '"numpy"', '"numpy", fastmath=True', 10.0),
    ):
        path = package / name
        path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        changed = kernel_of(package)
        assert changed(8.0) == expected, name
        assert sum(changed.stats.cache_hits.values()) == 0, name


def test_code_for_a_type_that_has_gone_is_compiled_again(package: Path) -> None:
    """Numba's index of a function names the types of its arguments."""
    path = package / "kernel.py"
    kernel = path.read_text(encoding="utf-8")
    path.write_text(kernel.replace("halved(value)", "value.right"), encoding="utf-8")
    pairs = package / "pairs.py"
    for name in ("Pair", "Couple"):
        pairs.write_text(pairs.read_text(encoding="utf-8").replace("Pair", name), encoding="utf-8")
        own = kernel_of(package)
        assert own(importlib.import_module(f"{package.name}.pairs").pair()) == 6.0


def test_a_damaged_index_is_written_anew(package: Path) -> None:
    for index in package.rglob("*.nbi"):
        index.write_bytes(index.read_bytes()[:40])
    assert kernel_of(package)(8.0) == 12.0
    again = kernel_of(package)
    assert again(8.0) == 12.0
    assert sum(again.stats.cache_hits.values()) == 1
