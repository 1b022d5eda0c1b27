"""Worker processes for all designs: started in advance, given work, stopped."""

import asyncio
import os
import secrets
import subprocess
import sys
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Final

from blast_env.app.work import Status, Task, read_status, write_status, write_task
from blast_env.files import make_folder

_GRACE_S: Final = 5.0
"""Time allowed for work to stop with the server before its process is killed."""

_MOST_READINGS: Final = 2
_COMMAND: Final = (sys.executable, "-m", "blast_env.app.worker")


@dataclass
class _Process:
    """A worker process and its task."""

    popen: "subprocess.Popen[str]"
    folder: Path | None = None
    stop_by_s: float | None = None

    @classmethod
    def started(cls) -> "_Process":
        log = None if os.environ.get("BLAST_ENV_WORKER_LOG") else subprocess.DEVNULL
        return cls(
            subprocess.Popen(
                _COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
                text=True,
                start_new_session=True,  # Ctrl-C is for the server, which stops the workers
            )
        )

    @property
    def is_alive(self) -> bool:
        return self.popen.poll() is None

    def send(self, line: str) -> bool:
        """Send a line; return whether the process accepted it."""
        assert self.popen.stdin is not None
        try:
            self.popen.stdin.write(f"{line}\n")
            self.popen.stdin.flush()
        except OSError:
            return False
        return True

    def end(self) -> None:
        """End the process at once."""
        self.popen.kill()
        self.popen.wait()
        self.hang_up()

    def hang_up(self) -> None:
        """Close the process's standard input, which ends it."""
        if self.popen.stdin is not None:
            with suppress(OSError):
                self.popen.stdin.close()


@dataclass
class Workers:
    """The worker processes, and the queue of work.

    Call `tick` regularly to hand out work. Work is identified by its folder.

    Attributes:
        most: Most worker processes at the same time.
        readings: Limits the processes that read uploaded files: each holds it while it runs.
    """

    most: int = field(default_factory=lambda: min(max(os.cpu_count() or 1, 1), 4))
    readings: asyncio.Semaphore = field(
        default_factory=partial(asyncio.Semaphore, _MOST_READINGS), init=False
    )
    _processes: list[_Process] = field(default_factory=list, init=False)
    _waiting: deque[Path] = field(default_factory=deque, init=False)

    def prepare(self) -> None:
        """Start one idle process, so that the first blast need not wait for it."""
        if not self._processes:
            self._processes.append(_Process.started())

    def begin(self, task: Task, jobs: Path, title: str) -> Path:
        """Queue work.

        Args:
            task: The work.
            jobs: Parent of its folder.
            title: Its title on the page.

        Returns:
            The folder of the work.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        folder = jobs / f"{len(list(jobs.iterdir())):04}-{secrets.token_hex(4)}"
        make_folder(folder)
        write_task(task, folder, title)
        self._waiting.append(folder)
        self.tick()
        return folder

    def stop(self, folder: Path) -> None:
        """Stop work; a search keeps the best layout so far."""
        if folder in self._waiting:
            self._waiting.remove(folder)
            _put(folder, "stopped", "stopped before it began")
            return
        for process in self._processes:
            if process.folder == folder and process.stop_by_s is None:
                process.stop_by_s = monotonic() + read_status(folder).grace_s
                process.send("stop")

    def is_known(self, folder: Path) -> bool:
        """Return whether work is queued or running here."""
        return folder in self._waiting or any(each.folder == folder for each in self._processes)

    def tick(self) -> None:
        """Check the processes for finished work and deaths, and hand out queued work."""
        for process in [*self._processes]:
            self._look_at(process)
        while self._waiting:
            idle = next((each for each in self._processes if each.folder is None), None)
            if idle is None:
                if len(self._processes) >= self.most:
                    return
                idle = _Process.started()
                self._processes.append(idle)
            folder = self._waiting.popleft()
            idle.folder = folder
            if not idle.send(f"run {folder}"):
                self._waiting.appendleft(folder)
                idle.end()
                self._processes.remove(idle)

    def close(self) -> None:
        """Stop all work, let searches keep their best layouts, and end the processes."""
        for folder in [*self._waiting]:
            self.stop(folder)
        for process in self._processes:
            process.hang_up()
        until_s = monotonic() + _GRACE_S
        for process in self._processes:
            try:
                process.popen.wait(max(until_s - monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.end()
            if process.folder is not None and not read_status(process.folder).is_over:
                _put(process.folder, "stopped", "stopped with the server")
        self._processes.clear()

    def _look_at(self, process: _Process) -> None:
        if not process.is_alive:
            process.hang_up()
            self._processes.remove(process)
            if process.folder is not None and not read_status(process.folder).is_over:
                code = process.popen.returncode
                _put(process.folder, "failed", f"its process ended unexpectedly (code {code})")
            return
        if process.folder is None:
            return
        if read_status(process.folder).is_over:
            process.folder, process.stop_by_s = None, None
        elif process.stop_by_s is not None and monotonic() > process.stop_by_s:
            process.end()
            self._processes.remove(process)
            _put(process.folder, "stopped", "stopped")


def jobs_of(folder: Path, most: int | None = None) -> list[tuple[Path, Status]]:
    """Return the requested work, the latest first, at most `most` of it."""
    folders = sorted((each for each in folder.iterdir() if each.is_dir()), reverse=True)
    return [(each, read_status(each)) for each in folders[:most]]


def _put(folder: Path, state: str, text: str) -> None:
    status = read_status(folder)
    write_status(status.model_copy(update={"state": state, "text": text}), folder)


def settle(jobs: Path, workers: Workers) -> None:
    """Mark as stopped the unfinished work without a process, as after a killed server."""
    for folder, status in jobs_of(jobs):
        if not status.is_over and not workers.is_known(folder):
            _put(folder, "stopped", "the server stopped meanwhile")
