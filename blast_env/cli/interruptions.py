"""What SIGINT and SIGTERM do during a command."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, get_ident, main_thread
from types import FrameType
from typing import Any, Final

from blast_env_command import EXIT_OF_SIGNALS, SIGNALS, end_at_once, end_silently

_IMPORTING: Final = "<frozen importlib._bootstrap>"
_AGAIN_S: Final = 0.05


class Interruptions:
    """What SIGINT (Ctrl-C) and SIGTERM (`timeout`, a batch system, a shutdown) do to a command.

    During its work they raise `KeyboardInterrupt`, so that the command keeps what it has and leaves
    nothing half-written; not while a module is imported, because compiled ones do not survive that:
    then after the import. After its work they end the process at once.

    Attributes:
        received: The signals received so far.
    """

    def __init__(self) -> None:
        self.received: list[int] = []
        self._act: Callable[[int, FrameType | None], None] = self._end
        self._is_told = False

    @classmethod
    def current(cls) -> "Interruptions":
        """Return the object whose handlers are installed, or a new one."""
        for number in SIGNALS:
            owner = getattr(signal.getsignal(number), "__self__", None)
            if isinstance(owner, cls):
                return owner
        return cls()

    @property
    def exit_code(self) -> int:
        """The exit code of a command that the first signal ended."""
        return EXIT_OF_SIGNALS + (self.received[0] if self.received else signal.SIGINT)

    def install(self) -> dict[int, Any]:
        """Handle the signals that have the default handlers or that of the script; return these.

        A signal that the parent has had ignored stays so. Only the main thread can do this.
        """
        before: dict[int, Any] = {}
        if current_thread() is main_thread():
            for number in SIGNALS:
                handler = signal.getsignal(number)
                if handler in (signal.SIG_DFL, signal.default_int_handler, end_at_once):
                    before[number] = handler
                    signal.signal(number, self._handle)
        return before

    @contextmanager
    def raised(self) -> Iterator[None]:
        """Raise `KeyboardInterrupt` in this block; after it, ignore signals until `settle`.

        Where the script has not installed its own, handlers are installed for the block only.
        """
        before, hook = dict[int, Any](), sys.unraisablehook
        try:
            sys.unraisablehook = self._unraisable
            self._act = self._raise
            before = self.install()
            yield
        finally:
            self._act = self._ignore
            sys.unraisablehook = hook
            for number, handler in before.items():
                if handler is not end_at_once:
                    signal.signal(number, handler)

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """End the process at once in this block: slow imports, before there is anything to lose."""
        act, self._act = self._act, self._end
        try:
            yield
        finally:
            self._act = act

    def settle(self, *, is_told: bool) -> None:
        """End the process at once on further signals, without a line if the user has one already.

        After an interruption, the remains of interrupted work complain no more.
        """
        self._is_told = is_told
        self._act = self._end
        if is_told and self.received:
            sys.unraisablehook = _say_nothing

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self._act(number, frame)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.received.append(number)
        if _is_importing(frame):
            self._later(number)
            return
        raise KeyboardInterrupt

    def _ignore(self, number: int, frame: FrameType | None) -> None:
        pass

    def _end(self, number: int, frame: FrameType | None) -> None:
        if self._is_told:
            end_silently(number)
        end_at_once(number, frame)

    def _unraisable(self, unraisable: "sys.UnraisableHookArgs") -> None:
        """Raise an interruption anew that came where no exception can be raised."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt) and self.received:
            self._later(self.received[-1])
        else:
            sys.__unraisablehook__(unraisable)

    def _later(self, number: int) -> None:
        """Send this process a signal again, in a moment."""
        timer = Timer(_AGAIN_S, _send, (number, get_ident()))
        timer.daemon = True
        timer.start()


def _send(number: int, thread: int) -> None:
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(thread, number)  # ends what the thread waits for, too
    else:
        signal.raise_signal(number)


def _is_importing(frame: FrameType | None) -> bool:
    """Return whether a frame, or one that called it, is that of an import."""
    while frame is not None and frame.f_code.co_filename != _IMPORTING:
        frame = frame.f_back
    return frame is not None


def _say_nothing(_unraisable: "sys.UnraisableHookArgs") -> None:
    pass
