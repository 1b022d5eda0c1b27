"""Work in processes: queued, started, stopped.

Each task has its own process, which takes no time to start: it is forked from one that has loaded
all modules and compiled code in advance.
"""

import _thread
import asyncio
import multiprocessing
import os
import secrets
import signal
import traceback
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Final

from blast_env.app.work import Status, StatusWriter, Task, end, read_status, write_status
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder
from blast_env.processes import FORK_SERVER, start_fork_server

_GRACE_S: Final = 5.0
"""Time allowed for work to stop with the server before its process is killed."""

_MOST_READINGS: Final = 2
_WARM: Final = "blast_env.app.warm"
_CONTEXT: Final = (
    multiprocessing.get_context(FORK_SERVER)
    if FORK_SERVER in multiprocessing.get_all_start_methods()
    else multiprocessing.get_context("spawn")
)


def do(folder: Path, task: Task) -> None:
    """Do the task of a folder and write the outcome into its status; raise no error."""
    try:
        task(StatusWriter(folder))
    except KeyboardInterrupt:
        end(folder, "stopped", "stopped")
    except BlastEnvError as error:
        end(folder, "failed", str(error))
    except MemoryError:
        title = read_status(folder).title
        end(folder, "failed", f"{title}: the memory of this computer does not suffice")
    except Exception as error:  # a fault in the program must not leave the task "running"
        traceback.print_exc()
        end(folder, "failed", f"{type(error).__name__}: {error}")


def _work(folder: Path, task: Task, stop: Connection) -> None:
    """Do a task in this process, until a message or the end of the server stops it."""
    # A shell script's background server ignores SIGINT; inherited, that would disable the stop.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(os, "setsid"):
        os.setsid()  # Ctrl-C is for the server, which stops the tasks

    def wait() -> None:
        with suppress(EOFError, OSError):
            stop.recv()
        _thread.interrupt_main()

    Thread(target=wait, daemon=True).start()
    with suppress(KeyboardInterrupt):  # one that came after the end
        do(folder, task)


def _load() -> None:
    """Start the server of the processes, and wait until it has loaded everything."""
    with suppress(OSError, EOFError):  # it has ended; each task says so
        start_fork_server([_WARM])
        _CONTEXT.Process(target=int, daemon=True).start()


@dataclass
class TaskRun:
    """A task at work.

    Attributes:
        line: A message on it stops the task.
        stop_by_s: Time at which the process is killed, once it is to stop.
    """

    folder: Path
    process: BaseProcess
    line: Connection
    stop_by_s: float | None = None

    @classmethod
    def started(cls, folder: Path, task: Task) -> "TaskRun":
        """Start a task."""
        stop, line = _CONTEXT.Pipe(duplex=False)
        process = _CONTEXT.Process(target=_work, args=(folder, task, stop), daemon=True)
        process.start()
        stop.close()
        return cls(folder, process, line)

    def stop(self) -> None:
        """Ask the task to stop; a search keeps the best layout so far."""
        if self.stop_by_s is None:
            self.stop_by_s = monotonic() + read_status(self.folder).grace_s
            with suppress(OSError):
                self.line.send("stop")

    def end(self) -> None:
        """End the process, and write what it could not."""
        if self.process.is_alive():
            self.process.kill()
        self.process.join()
        self.line.close()
        if self.stop_by_s is not None:
            end(self.folder, "stopped", "stopped")
        code = self.process.exitcode
        end(self.folder, "failed", f"its process ended unexpectedly (code {code})")


@dataclass
class Workers:
    """The tasks at work, and the queue of others.

    Call `tick` regularly to start queued work. Work is identified by its folder.

    Attributes:
        most: Most tasks at work at the same time.
        readings: Limits the processes that read uploaded files: each holds it while it runs.
    """

    most: int = field(default_factory=lambda: min(max(os.cpu_count() or 1, 1), 4))
    readings: asyncio.Semaphore = field(
        default_factory=partial(asyncio.Semaphore, _MOST_READINGS), init=False
    )
    _running: list[TaskRun] = field(default_factory=list, init=False)
    _waiting: deque[tuple[Path, Task]] = field(default_factory=deque, init=False)
    _loading: Thread | None = field(default=None, init=False)

    def prepare(self) -> None:
        """Begin to load modules and compiled code, so that tasks need not; they wait until then."""
        self._loading = Thread(target=_load, daemon=True)  # it takes seconds
        self._loading.start()

    def begin(self, task: Task, jobs: Path, title: str) -> Path:
        """Queue work.

        Args:
            jobs: Parent of its folder.
            title: Its title on the page.

        Returns:
            The folder of the work.
        """
        folder = jobs / f"{len(list(jobs.iterdir())):04}-{secrets.token_hex(4)}"
        make_folder(folder)
        write_status(Status(title=title), folder)
        self._waiting.append((folder, task))
        self.tick()
        return folder

    def stop(self, folder: Path) -> None:
        """Stop work; a search keeps the best layout so far."""
        waiting = [waiting for waiting in self._waiting if waiting[0] == folder]
        for own in waiting:
            self._waiting.remove(own)
            end(folder, "stopped", "stopped before it began")
        for running in self._running:
            if running.folder == folder:
                running.stop()

    def is_known(self, folder: Path) -> bool:
        """Return whether work is queued or running here."""
        return folder in (*(own for own, _ in self._waiting), *(x.folder for x in self._running))

    def tick(self) -> None:
        """Check the processes for their end, and start queued work."""
        for own in [*self._running]:
            is_late = own.stop_by_s is not None and monotonic() > own.stop_by_s
            if is_late or not own.process.is_alive():
                own.end()
                self._running.remove(own)
        if self._loading is not None and self._loading.is_alive():
            return
        while self._waiting and len(self._running) < self.most:
            folder, task = self._waiting.popleft()
            try:
                self._running.append(TaskRun.started(folder, task))
            except (OSError, EOFError) as error:
                end(folder, "failed", f"its process cannot be started: {error}")

    def close(self) -> None:
        """Stop all work, let searches keep their best layouts, and end the processes."""
        for folder, _ in [*self._waiting]:
            self.stop(folder)
        for own in self._running:
            own.stop()
        until_s = monotonic() + _GRACE_S
        for part in self._running:
            part.process.join(max(until_s - monotonic(), 0.0))
            part.end()
        self._running.clear()


def jobs_of(folder: Path, most: int | None = None) -> list[tuple[Path, Status]]:
    """Return the requested work, the latest first, at most `most` of it."""
    folders = sorted((path for path in folder.iterdir() if path.is_dir()), reverse=True)
    return [(path, read_status(path)) for path in folders[:most]]


def settle(jobs: Path, workers: Workers) -> None:
    """Mark as stopped the unfinished work without a process, as after a killed server."""
    for folder, status in jobs_of(jobs):
        if not status.is_over and not workers.is_known(folder):
            end(folder, "stopped", "the server stopped meanwhile")
