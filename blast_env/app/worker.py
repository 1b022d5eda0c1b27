"""A worker process, which reads the folders of tasks from its standard input.

`run FOLDER` starts a task; `stop` ends the running one and keeps its results so far. When the
standard input ends, with the server, the process stops its task in the same way and exits.
"""

import _thread
import signal
import sys
import threading
import traceback
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from blast_env.app.tasks import run_task, warm_up
from blast_env.app.work import read_status, write_status
from blast_env.errors import BlastEnvError


class _Inbox:
    """The commands of the server; a thread reads them, so that `stop` interrupts a task."""

    def __init__(self, lines: IO[str]) -> None:
        self._lines = lines
        self._folders: SimpleQueue[Path | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._busy = False
        threading.Thread(target=self._read, daemon=True).start()

    def next(self) -> Path | None:
        """Return the folder of the next task; `None` when there will be no more."""
        return self._folders.get()

    def set_busy(self, busy: bool) -> None:
        """Set whether `stop` has a task to interrupt."""
        with self._lock:
            self._busy = busy

    def _read(self) -> None:
        for line in self._lines:
            word, _, rest = line.strip().partition(" ")
            if word == "run":
                self._folders.put(Path(rest))
            elif word == "stop":
                self._interrupt()
        self._folders.put(None)
        self._interrupt()

    def _interrupt(self) -> None:
        with self._lock:
            if self._busy:
                _thread.interrupt_main()


def do(folder: Path, inbox: _Inbox | None = None) -> None:
    """Run the task of a folder and write the outcome into its status; raise no error."""
    title = read_status(folder).title
    try:
        if inbox is not None:
            inbox.set_busy(True)
        run_task(folder)
        if inbox is not None:
            inbox.set_busy(False)
    except KeyboardInterrupt:
        _end(folder, "stopped", "stopped")
    except BlastEnvError as error:
        _end(folder, "failed", str(error))
    except MemoryError:
        _end(folder, "failed", f"{title}: the memory of this computer does not suffice")
    except Exception as error:  # a fault in the program must not leave the task "running"
        traceback.print_exc()
        _end(folder, "failed", f"{type(error).__name__}: {error}")
    finally:
        if inbox is not None:
            inbox.set_busy(False)


def _end(folder: Path, state: str, text: str) -> None:
    status = read_status(folder)
    changes = {"state": state, "text": text}
    write_status(status.model_copy(update=changes), folder)


def main() -> None:
    """Work until the standard input ends."""
    # A shell script's background server ignores SIGINT; inherited, that would disable `stop`.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    inbox = _Inbox(sys.stdin)
    with suppress(KeyboardInterrupt):
        warm_up()
    while True:
        try:
            folder = inbox.next()
            if folder is None:
                return
            do(folder, inbox)
        except KeyboardInterrupt:  # it came after the task was done
            continue


if __name__ == "__main__":
    main()
