"""Reading of untrusted files, in a separate process that has limits and can be ended.

A malicious file can keep a parser busy for hours, or exhaust the memory. Readers check sizes
first; this module guards against the cases that they do not foresee.
"""

import os
import pickle
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, Self, TypeVar

from blast_env.errors import BlastEnvError

Found = TypeVar("Found")


@dataclass(frozen=True)
class ReadingLimits:
    """Limits of a process that reads a file.

    Attributes:
        processor_s: Processor time of all threads; not limited on Windows.
        memory_bytes: Memory beyond that of the libraries; limited on Linux only.
        wall_s: Wall time, on all systems; longer, because a computer may be busy.
    """

    processor_s: int = 6
    memory_bytes: int = 350_000_000
    wall_s: float = 60.0


LIMITS: Final = ReadingLimits()

_WITHIN: Final = "BLAST_ENV_READING"
"""Set in reading processes: a nested `read_apart` counts towards their limits."""

_FRUGAL: Final = {"ARROW_DEFAULT_MEMORY_POOL": "system", "OMP_NUM_THREADS": "1"}
"""Settings of libraries in reading processes: other pools, and threads, set memory aside unused."""


class ReadingError(BlastEnvError):
    """Reading a file exceeded a limit, or ended its process."""


class Reading(Generic[Found]):
    """A function that reads an untrusted file in a separate process.

    The process starts at once, and receives its work in `result`. A context manager ends it with
    the block, also after an error.

    Args:
        what: Name of the file, for errors.
        function: The reader. It, its arguments and its result must pickle.
        arguments: Its arguments.
        limits: Limits of the process.
    """

    def __init__(
        self,
        what: str,
        function: Callable[..., Found],
        *arguments: Any,
        limits: ReadingLimits = LIMITS,
    ) -> None:
        self._what, self._limits = what, limits
        self._message = pickle.dumps(limits) + pickle.dumps((function, arguments))
        # Not multiprocessing: that runs the caller's script once more in the new process.
        program = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **_FRUGAL, _WITHIN: "1"},
        )

    def result(self) -> Found:
        """Wait for the function, and return its result.

        Raises:
            ReadingError: If it exceeded a limit, or its process was ended.
            BaseException: Any error of the function.
        """
        try:
            answer, _ = self._process.communicate(self._message, self._limits.wall_s)
        except subprocess.TimeoutExpired as error:
            raise self._exceeded(f"{self._limits.wall_s:g} s on the clock") from error
        finally:
            self.end()
        try:
            outcome: tuple[Found, BaseException | None] = pickle.loads(answer)
        except (EOFError, pickle.UnpicklingError):
            raise self._died() from None
        found, fault = outcome
        if isinstance(fault, MemoryError):
            raise self._too_large()
        if fault is not None:
            raise fault
        return found

    def end(self) -> None:
        """End the process if it still runs; safe to call from another thread."""
        with suppress(OSError):
            self._process.kill()
        self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def _died(self) -> ReadingError:
        """Return the error for a process that ended without an answer."""
        code = self._process.returncode
        if -code == getattr(signal, "SIGXCPU", None):
            return self._exceeded(f"{self._limits.processor_s} s of processor time")
        if -code == getattr(signal, "SIGABRT", None):  # C++ without memory
            return self._too_large()
        return ReadingError(f"{self._what}: cannot be read: the process that did was ended")

    def _too_large(self) -> ReadingError:
        return self._exceeded(f"{self._limits.memory_bytes / 1e6:.0f} MB of memory")

    def _exceeded(self, bound: str) -> ReadingError:
        return ReadingError(
            f"{self._what}: takes more than {bound} to read, must take at most that: is it damaged,"
            " or can it be made smaller?"
        )


def read_apart(
    what: str,
    function: Callable[..., Found],
    *arguments: Any,
    limits: ReadingLimits = LIMITS,
) -> Found:
    """Return the result of a function, called in a separate process; see `Reading`.

    Within such a process the function is called directly: it is subject to its limits.

    Raises:
        ReadingError: If it exceeded a limit, or its process was ended.
        BaseException: Any error of the function.
    """
    if _WITHIN in os.environ:
        return function(*arguments)
    with Reading(what, function, *arguments, limits=limits) as reading:
        return reading.result()


def serve() -> None:
    """Run the pickled function from standard input, and answer on standard output."""
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # keep the output of libraries out of the answer
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
        limits = pickle.load(sys.stdin.buffer)
        function, arguments = pickle.load(sys.stdin.buffer)
        _limit(limits)
        answers.write(_answer(function, arguments))


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """Call a function, and return its pickled result or error."""
    try:
        # In the newest protocol, arrays and tables are copied once: by default three times.
        return pickle.dumps((function(*arguments), None), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        if isinstance(error, MemoryError) or "bad_alloc" in str(error):
            return pickle.dumps((None, MemoryError()))
        if not isinstance(error, BlastEnvError):  # a fault of the program
            error.add_note("".join(traceback.format_exception(error)))
        return pickle.dumps((None, error))


def _limit(limits: ReadingLimits) -> None:
    """Limit this process, in addition to the time and memory that its libraries took."""
    try:
        import resource
    except ImportError:  # Windows
        return
    usage = resource.getrusage(resource.RUSAGE_SELF)
    used_s = int(usage.ru_utime + usage.ru_stime) + 1
    _lower(resource.RLIMIT_CPU, used_s + limits.processor_s)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pages = Path("/proc/self/statm")
    if pages.exists():
        data = int(pages.read_text(encoding="ascii").split()[5]) * resource.getpagesize()
        _lower(resource.RLIMIT_DATA, data + limits.memory_bytes)


def _lower(kind: int, most: int) -> None:
    """Lower a limit of this process, unless it is lower already."""
    import resource

    hard = resource.getrlimit(kind)[1]
    allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (allowed, hard))
