"""SIGINT and SIGTERM end every command, at any moment, in one line and with 130 or 143."""

import json
import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

LINE = "interrupted: no file was left half-written\n"
STARTS = Path(__file__).with_name("starts.py")
LEAST_COPIES = 20

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="copies processes")


def commands(folder: Path) -> list[list[str]]:
    """Return a start of each command that ends soon: with an error, after all imports."""
    return [
        ["simulate", "nosuch"],
        ["draw", "nosuch"],
        ["calibrate", "--name", "a", "--scenario", "nosuch"],
        ["evaluate", "--scenario", "nosuch", "--layout", "nosuch.json"],
        ["assess", "nosuch"],
        ["advise", "nosuch"],
        ["search", "--scenario", "nosuch", "--out", str(folder / "search")],
        ["train", "--scenario", "nosuch", "--run", str(folder / "run")],
        ["judge", "nosuch"],
        ["report", "--scenario", "nosuch", "--layout", "nosuch.json"],
        ["import", "nosuch.osm", "--out", str(folder / "a.toml")],
        ["app", "--nosuch"],
    ]


def python(*arguments: str | Path, **options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        # Python 3.12 warns of copies of processes that have threads.
        [sys.executable, "-W", "ignore", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        **options,  # type: ignore[call-overload]
    )


def in_command(work: str) -> subprocess.CompletedProcess[str]:
    """Run Python code as the work of a command; `signal` and `os` are imported."""
    code = (
        "import os, signal, sys, typer\n"
        "from blast_env_command import SIGNALS, end_at_once\n"
        "for number in SIGNALS:\n"
        "    signal.signal(number, end_at_once)\n"
        "from blast_env.cli.command import ShellCommand\n"
        "def work() -> None:\n"
        + "".join(f"    {line}\n" for line in work.splitlines())
        + "app = typer.Typer()\n"
        "app.command(cls=ShellCommand)(work)\n"
        "app()\n"
    )
    return python("-c", code)


@pytest.mark.slow
def test_every_command_ends_in_one_line_at_any_moment_of_its_start(tmp_path: Path) -> None:
    started = commands(tmp_path)
    words = [word for command in started for word in ("--", *command)][1:]
    done = python(STARTS, tmp_path / "outcomes.jsonl", *words)
    assert done.returncode == 0, done.stderr[-2000:]
    copies, wrong = Counter[str](), []
    for line in (tmp_path / "outcomes.jsonl").read_text().splitlines():
        name, where, number, code, text = json.loads(line)
        copies[name] += 1
        if (code, text) != (128 + number, LINE):
            wrong.append((name, where, number, code, text[-1000:]))
    assert not wrong
    assert {name for name, *_ in started} == {*copies}
    assert min(copies.values()) >= LEAST_COPIES
    assert [path.name for path in tmp_path.iterdir()] == ["outcomes.jsonl"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_no_import_is_broken_off(number: signal.Signals, tmp_path: Path) -> None:
    """A compiled module does not survive an exception; the interruption comes after it."""
    (tmp_path / "compiled.py").write_text(
        f"import os\nos.kill(os.getpid(), {number})\nfor k in range(1000): pass\nprint('whole')\n"
    )
    done = in_command(
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "import compiled, time\n"
        "time.sleep(60)\n"  # which the signal that comes again ends
        "print('after it')"
    )
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "whole\n", LINE)


def test_an_interruption_where_no_exception_can_be_raised_is_raised_again() -> None:
    done = in_command(
        "import time\n"
        "class Held:\n"
        "    def __del__(self):\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "Held()\n"
        "time.sleep(60)"
    )
    assert (done.returncode, done.stderr) == (130, LINE)


def test_an_error_that_follows_an_interruption_is_its_consequence() -> None:
    done = in_command(
        "try:\n"
        "    signal.raise_signal(signal.SIGTERM)\n"
        "except KeyboardInterrupt:\n"
        "    raise RuntimeError('a worker is missing')"
    )
    assert (done.returncode, done.stderr) == (143, LINE)


def test_a_fault_of_the_program_is_still_shown() -> None:
    done = in_command("raise RuntimeError('a fault')")
    assert done.returncode == 1
    assert "RuntimeError: a fault" in done.stderr


def test_signals_while_a_command_ends_add_no_line() -> None:
    ending = (
        "import atexit\natexit.register(signal.raise_signal, signal.SIGINT)\nprint('a result')\n"
    )
    done = in_command(ending)
    assert (done.returncode, done.stdout, done.stderr) == (130, "a result\n", LINE)
    done = in_command(f"{ending}signal.raise_signal(signal.SIGTERM)")
    assert (done.returncode, done.stderr) == (130, LINE)


def test_a_signal_that_the_parent_ignores_stays_ignored() -> None:
    code = (
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from blast_env.cli.interruptions import Interruptions\n"
        "Interruptions().install()\n"
        "signal.raise_signal(signal.SIGINT)\n"
        "print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)\n"
    )
    assert python("-c", code).stdout == "True\n"
