"""A script that starts commands, and interrupts copies of them all along.

    python tests/cli/starts.py OUT ARGUMENTS [-- ARGUMENTS ...]

At some audit events of Python (imports, files opened, code run), always fewer of them, a copy of
the process receives SIGINT or SIGTERM, by turns. OUT gets a line of JSON for each copy: command,
event, signal, exit code, and what it wrote. The first command starts from nothing. The
others start where it has ended, because most of their imports are its own.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from itertools import groupby
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
GROWTH = 1.22
"""Of the count of events from one copy to the next."""
MOST_S = 120


def in_copy(work: Callable[[], None]) -> tuple[int, str] | None:
    """Start some work in a copy of this process.

    Returns:
        `None` in the copy, which goes on; here its exit code, and what it wrote.
    """
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        signal.alarm(MOST_S)
        os.dup2(writing, 1)
        os.dup2(writing, 2)
        work()
        return None
    os.close(writing)
    with os.fdopen(reading, errors="replace") as written:
        text = written.read()
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), text


class Interrupter:
    """An audit hook, which copies and interrupts the process.

    Attributes:
        command: Name of the running command; empty for no copies.
    """

    def __init__(self, out: str) -> None:
        self.command = ""
        self._out = out
        self._events = self._next = self._copies = 0

    def begin(self, command: str) -> None:
        """Copy the process during a command."""
        self.command = command
        self._events = self._copies = 0
        self._next = 1

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.command:
            return
        self._events += 1
        if self._events < self._next:
            return
        self._next = max(self._events + 1, int(GROWTH * self._events))
        self._copies += 1
        command, self.command = self.command, ""
        number = SIGNALS[self._copies % len(SIGNALS)]
        found = in_copy(lambda: os.kill(os.getpid(), number))
        if found is None:
            return
        where = f"{self._events}: {event} {str(arguments)[:80]}"
        with open(self._out, "a") as file:
            print(json.dumps([command, where, number, *found]), file=file)
        self.command = command


def start(command: list[str], interrupter: Interrupter) -> None:
    """Run a command to its end."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.argv = ["blast-env", *command]
    interrupter.begin(command[0])
    try:
        main()
    except SystemExit:
        if not interrupter.command:  # a copy
            raise
    interrupter.command = ""


if __name__ == "__main__":
    from blast_env_command import main

    out, *words = sys.argv[1:]
    commands = [list(group) for is_end, group in groupby(words, "--".__eq__) if not is_end]
    interrupter = Interrupter(out)
    sys.addaudithook(interrupter)
    start(commands[0], interrupter)
    for command in commands[1:]:
        if in_copy(lambda: start(command, interrupter)) is None:  # noqa: B023  # called at once
            sys.exit()
