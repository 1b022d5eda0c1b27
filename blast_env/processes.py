"""Processes that this one starts: not interrupted while they start, and ended with this one."""

import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from multiprocessing import forkserver, get_all_start_methods, get_context, resource_tracker
from threading import Thread
from time import sleep
from typing import Final

FORK_SERVER: Final = "forkserver"
"""Start method of processes that are forks of a server, on systems that support it."""

_WATCHED: Final = "blast_env.watched"
_WATCH_S: Final = 1.0
_BLOCKS_SIGNALS: Final = hasattr(signal, "pthread_sigmask")
"""False on Windows, where a thread cannot block a signal."""


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Block SIGINT in this thread, and in the processes that it starts in the block.

    A terminal sends Ctrl-C to all processes of a command, and one that is importing would print a
    traceback. This process alone is interrupted, after the block, and ends the others. On Windows
    the block does nothing.
    """
    if not _BLOCKS_SIGNALS:
        yield
        return
    resource_tracker.ensure_running()  # in the block, Python 3.11 would lift the mask to start it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_fork_server(modules: Sequence[str]) -> None:
    """Start the server whose forks are the processes of the method `FORK_SERVER`.

    Ctrl-C ends it without a word while it loads, and so does the end of this process. Nothing
    happens where it runs already or where the method does not exist.

    Args:
        modules: Names of the modules that it loads, once for all processes.
    """
    if FORK_SERVER in get_all_start_methods():
        get_context(FORK_SERVER).set_forkserver_preload([_WATCHED, *modules])
        with uninterrupted():
            forkserver.ensure_running()


def end_silently_at_interrupt() -> None:
    """End this process without a word at SIGINT, unless that is ignored, and lift its block."""
    if _BLOCKS_SIGNALS:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


@cache
def end_with(parent: int) -> None:
    """End this process when its parent, a process that may have been killed, has ended."""

    def watch() -> None:
        while os.getppid() == parent:
            sleep(_WATCH_S)
        os._exit(1)

    Thread(target=watch, daemon=True).start()
