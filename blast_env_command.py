"""The script `blast-env`, which signals end in one line from its first instruction on.

It is no part of `blast_env`, because importing that takes half a second, and imports hardly
anything that Python has not imported already. During a command `blast_env.cli.interruptions` takes
over.
"""

import os
import signal
import sys
from types import FrameType
from typing import Final

NOTHING_HALF_WRITTEN: Final = "no file was left half-written"

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)

EXIT_OF_SIGNALS: Final = 128
"""Exit code of shells for a signal, less its number."""


def end_at_once(number: int, _frame: FrameType | None) -> None:
    """End this process for a signal, with a line."""
    try:
        os.write(2, f"interrupted: {NOTHING_HALF_WRITTEN}\n".encode())
    finally:
        end_silently(number)


def end_silently(number: int) -> None:
    """End this process for a signal; what it has printed is not lost."""
    for stream in (sys.stdout, sys.stderr):
        try:  # noqa: SIM105  # contextlib takes time to import
            stream.flush()
        except (OSError, RuntimeError, ValueError, AttributeError):
            pass  # closed, or the signal came while it was written
    os._exit(EXIT_OF_SIGNALS + number)


def main() -> None:
    """Run the command line."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, end_at_once)
    from blast_env.cli import app  # here, because signals come first

    app(prog_name="blast-env")
