"""Processes end with the one that started them, and without a word, even while they load."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

PROGRAM = """
import os, sys, time
from blast_env.runner import run_all

def work(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(600)

if __name__ == "__main__":
    run_all(work, [sys.argv[1]] * 2, 2)
"""
COMMAND = """
import multiprocessing, signal, typer
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
from blast_env.cli.command import ShellCommand
from blast_env.processes import FORK_SERVER, start_fork_server
from blast_env.runner import run_all

def work() -> None:
    {work}

app = typer.Typer()
app.command(cls=ShellCommand)(work)
app()
"""
WORK = {
    "workers": "run_all(abs, [1, 2], 2)",
    "fork server": (
        "start_fork_server(['slow'])"
        "; multiprocessing.get_context(FORK_SERVER).Process(target=int).start()"
    ),
}
SLOW = """
import os, time
open(os.path.join(os.environ["STARTED"], str(os.getpid())), "w").close()
time.sleep(600)
"""
START = """
import sys
if any("loky" in word and "popen" in word for word in sys.orig_argv):
    import slow
"""
PATIENCE_S = 120.0


def is_there(process: int) -> bool:
    """Return whether a process runs; one that has ended and waits to be reaped does not."""
    try:
        status = Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] not in "ZX"


def eventually(condition: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.1)


def group_of(leader: int) -> list[int]:
    """Return the running processes of a group."""
    numbers = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [number for number in numbers if is_there(number) and os.getpgid(number) == leader]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
def test_workers_and_their_trackers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    started = tmp_path / "started"
    started.mkdir()
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "program.py"), str(started)], start_new_session=True
    )
    try:
        eventually(lambda: len(list(started.iterdir())) == 2)
        group = group_of(process.pid)
        assert {int(path.name) for path in started.iterdir()} < {*group}
        process.kill()
        process.wait()
        eventually(lambda: not any(map(is_there, group)))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


@contextmanager
def loading(starting: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Yield a command all of whose processes are at their first import."""
    (folder / "sitecustomize.py").write_text(START)
    (folder / "slow.py").write_text(SLOW)
    started = folder / "started"
    started.mkdir()
    paths = os.pathsep.join([str(folder), *sys.path])
    count = 2 if starting == "workers" else 1
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND.format(work=WORK[starting])],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": paths, "STARTED": str(started)},
    ) as process:
        try:
            eventually(lambda: len(list(started.iterdir())) == count)
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
@pytest.mark.parametrize(
    ("starting", "number"),
    [
        ("workers", signal.SIGINT),
        ("workers", signal.SIGTERM),
        ("fork server", signal.SIGINT),
    ],
)
def test_a_command_whose_processes_are_starting_ends_in_one_line(
    starting: str, number: signal.Signals, tmp_path: Path
) -> None:
    """Ctrl-C goes to all processes of a terminal."""
    with loading(starting, tmp_path) as process:
        os.killpg(process.pid, number)
        _, text = process.communicate(timeout=PATIENCE_S)
        assert text == "interrupted: no file was left half-written\n"
        assert process.returncode == 128 + number
        eventually(lambda: not group_of(process.pid))


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
def test_a_loading_fork_server_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    with loading("fork server", tmp_path) as process:
        process.kill()
        process.wait()
        eventually(lambda: not group_of(process.pid))
