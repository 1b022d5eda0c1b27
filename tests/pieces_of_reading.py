"""Work of reading processes: apart from the tests, whose imports take half a second."""

import os
import signal

from blast_env.errors import BlastEnvError


def double(value: int) -> int:
    """Return twice a value, and print."""
    print("what a library prints is no answer")
    return 2 * value


def refuse(text: str) -> None:
    """Refuse a file."""
    raise BlastEnvError(text)


def fault() -> None:
    """Fail, as no reader should."""
    raise KeyError("ours")


def spin() -> None:
    """Go on for ever."""
    while True:
        pass


def fill(count: int) -> int:
    """Take memory, 10 MB each."""
    return len([bytearray(10_000_000) for _ in range(count)])


def die() -> None:
    """End this process, as no error does."""
    os.kill(os.getpid(), signal.SIGKILL)
