"""Worker processes end with the process that started them."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
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
        group = [int(each.name) for each in Path("/proc").iterdir() if each.name.isdigit()]
        group = [each for each in group if is_there(each) and os.getpgid(each) == process.pid]
        assert {int(each.name) for each in started.iterdir()} < {*group}
        process.kill()
        process.wait()
        eventually(lambda: not any(map(is_there, group)))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
