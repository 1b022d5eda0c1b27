"""SIGINT and SIGTERM end every command, at any moment, in one line and with 130 or 143."""

import json
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

LINE = "interrupted: no file was left half-written\n"
STARTS = str(Path(__file__).with_name("starts.py"))
COPIES = str(Path(__file__).with_name("copies.py"))
LEAST_COPIES = 20

Ending = Callable[[str], tuple[int, str, str]]

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


@contextmanager
def copies() -> Iterator[Ending]:
    """Give what runs Python code in a copy of one process, which has all imports of a command."""
    with subprocess.Popen(
        # Python 3.12 warns of copies of processes that have threads.
        [sys.executable, "-W", "ignore", COPIES],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        asked, answers = process.stdin, process.stdout

        def ending(code: str) -> tuple[int, str, str]:
            print(json.dumps(code), file=asked, flush=True)
            exit_code, output, errors = json.loads(answers.readline())
            return exit_code, output, errors

        yield ending
        asked.close()
    assert process.returncode == 0


@pytest.fixture(scope="module")
def ending() -> Iterator[Ending]:
    """Return the exit code of some Python code, its output and its errors."""
    with copies() as found:
        yield found


@pytest.fixture
def of_command(ending: Ending) -> Ending:
    """The same of code that is the work of a command; it finds `signal` and `sys` imported."""

    def found(work: str) -> tuple[int, str, str]:
        return ending(
            "import signal, sys, typer\n"
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

    return found


@pytest.mark.slow
def test_every_command_ends_in_one_line_at_any_moment_of_its_start(tmp_path: Path) -> None:
    started = commands(tmp_path)
    words = [word for command in started for word in ("--", *command)][1:]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", STARTS, str(tmp_path / "outcomes.jsonl"), *words],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
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
def test_no_import_is_broken_off(
    number: signal.Signals, tmp_path: Path, of_command: Ending
) -> None:
    """A compiled module does not survive an exception; the interruption comes after it."""
    (tmp_path / "compiled.py").write_text(
        f"import os\nos.kill(os.getpid(), {number})\nfor k in range(1000): pass\nprint('whole')\n"
    )
    found = of_command(
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "import compiled, time\n"
        "time.sleep(60)\n"  # which the signal that comes again ends
        "print('after it')"
    )
    assert found == (128 + number, "whole\n", LINE)


def test_training_that_loads_what_it_works_with_ends_at_once(
    tmp_path: Path, ending: Ending
) -> None:
    """Torch takes seconds to import, and there is nothing to lose before."""
    package = tmp_path / "blast_agents"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "training.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nprint('on')\n"
    )
    run = tmp_path / "run"
    found = ending(
        "import sys\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        f"sys.argv = ['blast-env', 'train', '--run', {str(run)!r}]\n"
        "from blast_env_command import main\n"
        "main()"
    )
    assert found == (130, "", LINE)
    assert not run.exists()


def test_an_interruption_where_no_exception_can_be_raised_is_raised_again(
    of_command: Ending,
) -> None:
    code, _, errors = of_command(
        "import time\n"
        "class Held:\n"
        "    def __del__(self):\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "Held()\n"
        "time.sleep(60)"
    )
    assert (code, errors) == (130, LINE)


def test_an_error_that_follows_an_interruption_is_its_consequence(of_command: Ending) -> None:
    code, _, errors = of_command(
        "try:\n"
        "    signal.raise_signal(signal.SIGTERM)\n"
        "except KeyboardInterrupt:\n"
        "    raise RuntimeError('a worker is missing')"
    )
    assert (code, errors) == (143, LINE)


def test_a_fault_of_the_program_is_still_shown(of_command: Ending) -> None:
    code, _, errors = of_command("raise RuntimeError('a fault')")
    assert code == 1
    assert "RuntimeError: a fault" in errors


def test_signals_while_a_command_ends_add_no_line(of_command: Ending) -> None:
    last = "import atexit\natexit.register(signal.raise_signal, signal.SIGINT)\nprint('a result')\n"
    assert of_command(last) == (130, "a result\n", LINE)
    code, _, errors = of_command(f"{last}signal.raise_signal(signal.SIGTERM)")
    assert (code, errors) == (130, LINE)


def test_a_signal_that_the_parent_ignores_stays_ignored(ending: Ending) -> None:
    found = ending(
        "import signal\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from blast_env.cli.interruptions import Interruptions\n"
        "Interruptions().install()\n"
        "signal.raise_signal(signal.SIGINT)\n"
        "print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)\n"
    )
    assert found == (0, "True\n", "")
