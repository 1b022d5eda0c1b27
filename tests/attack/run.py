"""A long attack on everything that reads and writes files: `make attack`."""

import json
import resource
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time, time
from types import FrameType
from typing import Annotated, Any, Final

import numpy as np
import typer

from blast_env.errors import BlastEnvError
from tests.attack.disks import outcome_after_full_device, size_of, small_device
from tests.attack.formats import FORMATS, Format
from tests.attack.hostile import FAMILIES as HOSTILE
from tests.attack.kills import JOBS, outcome_after_kill, steps_and_outcome
from tests.attack.made import FAMILIES, suffix_of
from tests.attack.mutants import mutants
from tests.attack.web import ATTACKS, attempts_of, victim

_KB: Final = 1024
_RESET_PEAK: Final = "5"
_TIME_S: Final = 3.0  # processor time of one file
_BYTES: Final = 2**28  # memory of one file
_STOP_S: Final = 30.0  # processor time after which a reader is stopped
_MOST_BYTES: Final = 2**32  # of all together
_MADE_TIME_S: Final = 10.0
_MADE_BYTES: Final = 500_000_000
_MADE_STOP_S: Final = 120.0  # on the clock

Row = tuple[Sequence[object], Sequence[str]]
"""The cells of a row, and what is wrong with what it stands for."""

Only = Annotated[str, typer.Option(help="Those with this in their names.")]


class Overtime(BaseException):
    """What no reader can turn into an error of its own."""


@dataclass
class Outcome:
    """What became of the files of a format.

    Attributes:
        files: How many there were.
        refused: How many were refused as documented.
        slowest_s: The longest that one took, processor time.
        largest_bytes: The most memory that one took.
        failures: What went wrong otherwise, once each, with the file.
        failed: How many went wrong.
    """

    files: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    largest_bytes: int = 0
    failures: dict[str, bytes] = field(default_factory=dict)
    failed: int = 0


def attack(form: Format, count: int, seed: int = 0) -> Outcome:
    """Read so many wrong files of a format; the seed decides which."""
    sound = [form.read(each) for each in form.samples]
    outcome = Outcome()
    for content in mutants(form.samples, count, seed):
        began_s, before = process_time(), _size_bytes()
        with _stopped_after(_STOP_S):
            problem = _problem(form, content, sound, outcome)
        took_s, more = process_time() - began_s, _peak_bytes() - before
        if problem is None and took_s > _TIME_S:
            problem = f"took more than {_TIME_S:g} s"
        if problem is None and more > _BYTES:
            problem = f"took more than {_BYTES >> 20} MiB"
        if problem is not None:
            outcome.failed += 1
            outcome.failures.setdefault(problem, content)
        outcome.files += 1
        outcome.slowest_s = max(outcome.slowest_s, took_s)
        outcome.largest_bytes = max(outcome.largest_bytes, more)
    return outcome


def _problem(form: Format, content: bytes, sound: list[Any], outcome: Outcome) -> str | None:
    """Read a file; return what went wrong, apart from time and memory."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = form.read(content)
    except BlastEnvError as error:
        outcome.refused += 1
        return None if str(error) else "an error without a message"
    except (Exception, Overtime) as error:
        frames = traceback.extract_tb(error.__traceback__)
        where = [each for each in frames if each.filename != __file__][-1]
        return f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}"
    if found is None:
        outcome.refused += 1
    elif form.has_checksum and found not in sound:
        return "another result than what was written"
    return None


def _size_bytes() -> int:
    """Return the memory that the process has now, and let its peak begin there.

    Without the right to do so, memory counts only as far as it exceeds all before.
    """
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text(_RESET_PEAK, encoding="ascii")
    return _peak_bytes()


def _peak_bytes() -> int:
    return _KB * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextmanager
def _stopped_after(time_s: float) -> Iterator[None]:
    """Raise `Overtime` in the block after this much processor time."""

    def stop(_: int, __: FrameType | None) -> None:
        raise Overtime

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, time_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def memory_limit(more_bytes: int) -> Iterator[None]:
    """Let the process have this much more memory in the block, and end with it otherwise."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    most_bytes = resource.getpagesize() * pages + more_bytes
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def _table(
    headers: Sequence[str], names: Iterable[str], only: str, row_of: Callable[[str, Path], Row]
) -> None:
    """Print a row for each name, made in a folder of its own; exit with 1 if anything is wrong."""
    print(f"| {' | '.join(headers)} |\n|{'---|' * len(headers)}")
    wrong = 0
    for name in names:
        if only not in name:
            continue
        with TemporaryDirectory() as folder:
            cells, problems = row_of(name, Path(folder))
        print(f"| {' | '.join(map(str, (name, *cells)))} |", flush=True)
        print("".join(f"    {each}\n" for each in problems), end="", flush=True)
        wrong += len(problems)
    raise typer.Exit(1 if wrong else 0)


app = typer.Typer(pretty_exceptions_enable=False)


@app.command()
def files(
    count: Annotated[int, typer.Option(help="Files of each format.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Decides which.")] = 0,
    only: Only = "",
    out: Annotated[Path, typer.Option(help="Where files that failed are kept.")] = Path(
        "out/attack"
    ),
) -> None:
    """Read thousands of wrong files of each format; print what became of them."""

    def row(name: str, folder: Path) -> Row:
        began_s = process_time()
        found = attack(FORMATS[name](folder), count, seed)
        problems = []
        for number, (problem, content) in enumerate(found.failures.items()):
            out.mkdir(parents=True, exist_ok=True)
            kept = out / f"{name.replace('/', '_')}_{number}"
            kept.write_bytes(content)
            problems.append(f"{problem}: {kept}")
        read = found.files - found.refused - found.failed
        most = (f"{1000.0 * found.slowest_s:.0f}", f"{found.largest_bytes / 2**20:.0f}")
        counts = (found.files, found.refused, read, found.failed)
        return (*counts, *most, f"{process_time() - began_s:.0f}"), problems

    headers = ("format", "files", "refused", "accepted", "failures")
    with memory_limit(_MOST_BYTES):
        _table((*headers, "slowest, ms", "most, MiB", "time, s"), FORMATS, only, row)


@app.command()
def made(only: Only = "") -> None:
    """Read files that were made on purpose to take long or much; print what they took."""
    headers = ("file", "size, MB", "outcome", "processor time, s", "memory, MB")
    _table(headers, FAMILIES, only, _made)


def _made(name: str, folder: Path) -> Row:
    """Make a file and read it, each in a process of its own."""
    path = folder / f"made{suffix_of(name)}"
    program = [sys.executable, "-m", "tests.attack.made"]
    subprocess.run([*program, "make", name, str(path)], check=True)
    reader = [*program, "read", name, str(path)]
    outcome, time_s, peak_bytes = "failed", 0.0, 0
    try:
        done = subprocess.run(reader, capture_output=True, timeout=_MADE_STOP_S, check=False)
        if done.returncode == 0:
            outcome, time_s, peak_bytes = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        outcome, time_s = "stopped", _MADE_STOP_S
    size_mb, peak_mb = path.stat().st_size / 1e6, peak_bytes / 1e6
    cells = (f"{size_mb:.1f}", outcome, f"{time_s:.1f}", f"{peak_mb:.0f}")
    fine = outcome in ("read", "refused")
    within = fine and time_s <= _MADE_TIME_S and peak_bytes <= _MADE_BYTES
    return cells, [] if within else ["not as it must be"]


@app.command()
def hostile(only: Only = "") -> None:
    """Read files of other kinds, with wrong numbers and texts; print how often it was refused."""

    def row(name: str, folder: Path) -> Row:
        began_s = process_time()
        tried = [*HOSTILE[name](folder)]
        through = [f"{tried_as}: {problem}" for tried_as, problem in tried if problem]
        held = len(tried) - len(through)
        return (len(tried), held, f"{process_time() - began_s:.0f}"), through

    _table(("family", "tried", "held", "processor time, s"), HOSTILE, only, row)


@app.command()
def web(only: Only = "") -> None:
    """Attack a server of the page; print how often, and what got through."""
    with TemporaryDirectory() as work, victim(Path(work, "work")) as server:

        def row(name: str, _: Path) -> Row:
            began_s = time()
            tried, through = attempts_of(name, server)
            return (tried, tried - len(through), f"{time() - began_s:.0f}"), through

        _table(("attack", "tried", "held", "time, s"), ATTACKS, only, row)


@app.command()
def kills(
    most: Annotated[int, typer.Option(help="Most kills of each job, evenly spread.")] = 40,
    only: Only = "",
) -> None:
    """Kill each job at one step on the disk after the other; print whether it goes on."""

    def row(name: str, folder: Path) -> Row:
        steps, whole = steps_and_outcome(name, folder / "whole")
        places = {
            f"step {at}": partial(outcome_after_kill, name, folder / f"{at}", at)
            for at in spread(steps - 1, min(most, steps))
        }
        return _attacked(steps, places, whole)

    _table(("job", "steps on the disk", "killed at", *_GOES_ON), JOBS, only, row)


@app.command()
def disks(
    most: Annotated[int, typer.Option(help="Devices for each job, evenly spread.")] = 12,
    only: Only = "",
) -> None:
    """Do each job on devices without room for all of it, and again with room.

    The devices are of memory, which the superuser may mount.
    """
    try:
        with TemporaryDirectory() as folder, small_device(Path(folder, "disk"), _KB):
            pass
    except PermissionError as error:
        print(f"not tried: {error}")
        return

    def row(name: str, folder: Path) -> Row:
        _, whole = steps_and_outcome(name, folder / "whole")
        size = size_of(folder / "whole")
        rooms = {
            f"bytes left {left}": partial(
                outcome_after_full_device, name, folder / "disk", size, left
            )
            for left in spread(size, most)
        }
        return _attacked(size // _KB, rooms, whole)

    _table(("job", "KiB on the disk", "devices", *_GOES_ON), JOBS, only, row)


_GOES_ON: Final = ("goes on to the same result", "time, s")


def spread(last: int, count: int) -> list[int]:
    """Return whole numbers from 0 to the last, evenly spread, each once."""
    return sorted({int(each) for each in np.linspace(0, last, count).round()})


def _attacked(size: int, attacks: Mapping[str, Callable[[], Any]], whole: Any) -> Row:
    """Attack a job in each way; it must go on to what comes of it otherwise."""
    began_s, wrong = time(), []
    for words, attacked in attacks.items():
        try:
            problem = "" if attacked() == whole else "another result"
        except (RuntimeError, BlastEnvError, OSError, ValueError) as error:
            problem = f"{type(error).__name__}: {error}"
        wrong += [f"{words}: {problem}"] if problem else []
    cells = (size, len(attacks), len(attacks) - len(wrong), f"{time() - began_s:.0f}")
    return cells, wrong


if __name__ == "__main__":
    app()
