"""A long attack on everything that reads and writes files: `make attack`."""

import json
import resource
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
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


class Overtime(BaseException):
    """What no reader can turn into an error of its own."""


@dataclass(frozen=True)
class Limits:
    """What one file may cost.

    Attributes:
        time_s: Processor time.
        most_bytes: Memory.
        stop_s: Processor time after which a reader is stopped.
    """

    time_s: float = 3.0
    most_bytes: int = 2**28
    stop_s: float = 30.0


_LIMITS: Final = Limits()
_MOST_BYTES: Final = 2**32  # of all together
_MADE_TIME_S: Final = 10.0
_MADE_BYTES: Final = 500_000_000
_MADE_STOP_S: Final = 120.0  # on the clock


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

    @property
    def accepted(self) -> int:
        """How many were read."""
        return self.files - self.refused - self.failed


def attack(form: Format, count: int, seed: int = 0, limits: Limits = _LIMITS) -> Outcome:
    """Read wrong files.

    Args:
        form: The format.
        count: How many files.
        seed: Decides which.
        limits: What each of them may cost.
    """
    sound = [form.read(each) for each in form.samples]
    outcome = Outcome()
    for content in mutants(form.samples, count, seed):
        began_s, before = process_time(), _size_bytes()
        with _stopped_after(limits.stop_s):
            problem = _problem(form, content, sound, outcome)
        took_s, more = process_time() - began_s, _peak_bytes() - before
        if problem is None and took_s > limits.time_s:
            problem = f"took more than {limits.time_s:g} s"
        if problem is None and more > limits.most_bytes:
            problem = f"took more than {limits.most_bytes >> 20} MiB"
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


app = typer.Typer(pretty_exceptions_enable=False)


@app.command()
def files(
    count: Annotated[int, typer.Option(help="Files of each format.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Decides which.")] = 0,
    only: Annotated[str, typer.Option(help="Formats with this in their names.")] = "",
    out: Annotated[Path, typer.Option(help="Where files that failed are kept.")] = Path(
        "out/attack"
    ),
) -> None:
    """Read thousands of wrong files of each format; print what became of them."""
    failed = 0
    print("| format | files | refused | accepted | failures | slowest, ms | most, MiB | time, s |")
    print("|---|---|---|---|---|---|---|---|")
    with memory_limit(_MOST_BYTES):
        for name, make in FORMATS.items():
            if only not in name:
                continue
            began_s = process_time()
            with TemporaryDirectory() as folder:
                outcome = attack(make(Path(folder)), count, seed)
            cells = (
                *(name, outcome.files, outcome.refused, outcome.accepted, outcome.failed),
                *(f"{1000.0 * outcome.slowest_s:.0f}", f"{outcome.largest_bytes / 2**20:.0f}"),
                f"{process_time() - began_s:.0f}",
            )
            print(f"| {' | '.join(map(str, cells))} |", flush=True)
            for number, (problem, content) in enumerate(outcome.failures.items()):
                out.mkdir(parents=True, exist_ok=True)
                kept = out / f"{name.replace('/', '_')}_{number}"
                kept.write_bytes(content)
                print(f"    {problem}: {kept}")
            failed += outcome.failed
    raise typer.Exit(1 if failed else 0)


@app.command()
def made(
    only: Annotated[str, typer.Option(help="Files with this in their names.")] = "",
) -> None:
    """Read files that were made on purpose to take long or much; print what they took."""
    failed = 0
    print("| file | size, MB | outcome | processor time, s | memory, MB |")
    print("|---|---|---|---|---|")
    for name in FAMILIES:
        if only not in name:
            continue
        with TemporaryDirectory() as folder:
            found = read_made(name, Path(folder))
        cells = (name, f"{found.size / 1e6:.1f}", found.outcome)
        print(f"| {' | '.join(cells)} | {found.time_s:.1f} | {found.peak_bytes / 1e6:.0f} |")
        failed += not found.is_within
    raise typer.Exit(1 if failed else 0)


@app.command()
def hostile(
    only: Annotated[str, typer.Option(help="Families with this in their names.")] = "",
) -> None:
    """Read files of other kinds, with wrong numbers and texts; print how often it was refused."""
    failed = 0
    print("| family | tried | held | processor time, s |")
    print("|---|---|---|---|")
    for name, attempts in HOSTILE.items():
        if only not in name:
            continue
        began_s, tried, through = process_time(), 0, list[str]()
        with TemporaryDirectory() as folder:
            for what, problem in attempts(Path(folder)):
                tried += 1
                through += [f"{what}: {problem}"] if problem else []
        cells = (name, tried, tried - len(through), f"{process_time() - began_s:.0f}")
        print(f"| {' | '.join(map(str, cells))} |", flush=True)
        print("".join(f"    {each}\n" for each in through[:9]), end="", flush=True)
        failed += len(through)
    raise typer.Exit(1 if failed else 0)


@dataclass(frozen=True)
class MadeOutcome:
    """What became of a file that was made on purpose.

    Attributes:
        size: Of the file, in bytes.
        outcome: A word.
        time_s: Processor time of all processes that read it, their start included.
        peak_bytes: Most memory of one of them.
    """

    size: int
    outcome: str
    time_s: float
    peak_bytes: int

    @property
    def is_within(self) -> bool:
        """Whether it was read or refused, and took no more than it may."""
        fine = self.outcome in ("read", "refused")
        return fine and self.time_s <= _MADE_TIME_S and self.peak_bytes <= _MADE_BYTES


def read_made(name: str, folder: Path) -> MadeOutcome:
    """Make a file and read it, each in a process of its own."""
    path = folder / f"made{suffix_of(name)}"
    program = [sys.executable, "-m", "tests.attack.made"]
    subprocess.run([*program, "make", name, str(path)], check=True)
    reader = [*program, "read", name, str(path)]
    size = path.stat().st_size
    try:
        done = subprocess.run(reader, capture_output=True, timeout=_MADE_STOP_S, check=False)
    except subprocess.TimeoutExpired:
        return MadeOutcome(size, "stopped", _MADE_STOP_S, 0)
    if done.returncode != 0:
        return MadeOutcome(size, "failed", 0.0, 0)
    return MadeOutcome(size, *json.loads(done.stdout))


@app.command()
def kills(
    most: Annotated[int, typer.Option(help="Most kills of each job, evenly spread.")] = 40,
    only: Annotated[str, typer.Option(help="Jobs with this in their names.")] = "",
) -> None:
    """Kill each job at one step on the disk after the other; print whether it goes on."""
    _attack_jobs("steps on the disk | killed at", only, partial(_killed, most))


@app.command()
def disks(
    most: Annotated[int, typer.Option(help="Devices for each job, evenly spread.")] = 12,
    only: Annotated[str, typer.Option(help="Jobs with this in their names.")] = "",
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
    _attack_jobs("KiB on the disk | devices", only, partial(_without_room, most))


@app.command()
def web(
    only: Annotated[str, typer.Option(help="Attacks with this in their names.")] = "",
) -> None:
    """Attack a server of the page; print how often, and what got through."""
    failed = 0
    print("| attack | tried | held | time, s |")
    print("|---|---|---|---|")
    with TemporaryDirectory() as folder, victim(Path(folder, "work")) as server:
        for name in ATTACKS:
            if only not in name:
                continue
            began_s = time()
            tried, through = attempts_of(name, server)
            cells = (name, tried, tried - len(through), f"{time() - began_s:.0f}")
            print(f"| {' | '.join(map(str, cells))} |", flush=True)
            print("".join(f"    {each}\n" for each in through), end="", flush=True)
            failed += len(through)
    raise typer.Exit(1 if failed else 0)


@dataclass(frozen=True)
class JobOutcome:
    """What became of a job that was attacked.

    Attributes:
        size: How long or large it is.
        attacks: How often it was attacked.
        wrong: What went wrong.
    """

    size: int
    attacks: int
    wrong: list[str]


def _attack_jobs(columns: str, only: str, attacked: Callable[[str, Path], JobOutcome]) -> None:
    failed = 0
    print(f"| job | {columns} | goes on to the same result | time, s |")
    print("|---|---|---|---|---|")
    for name in JOBS:
        if only not in name:
            continue
        began_s = time()
        with TemporaryDirectory() as folder:
            found = attacked(name, Path(folder))
        right = found.attacks - len(found.wrong)
        cells = (name, found.size, found.attacks, right, f"{time() - began_s:.0f}")
        print(f"| {' | '.join(map(str, cells))} |", flush=True)
        print("".join(f"    {each}\n" for each in found.wrong), end="", flush=True)
        failed += len(found.wrong)
    raise typer.Exit(1 if failed else 0)


def _killed(most: int, name: str, folder: Path) -> JobOutcome:
    steps, whole = steps_and_outcome(name, folder / "whole")
    places = spread(steps - 1, min(most, steps))
    problems = (
        problem_with(partial(outcome_after_kill, name, folder / f"{at}", at), whole)
        for at in places
    )
    return JobOutcome(steps, len(places), _known("step", places, problems))


def _without_room(most: int, name: str, folder: Path) -> JobOutcome:
    _, whole = steps_and_outcome(name, folder / "whole")
    size = size_of(folder / "whole")
    rooms = spread(size, most)
    problems = (
        problem_with(partial(outcome_after_full_device, name, folder / "disk", size, left), whole)
        for left in rooms
    )
    return JobOutcome(size // _KB, len(rooms), _known("bytes left", rooms, problems))


def spread(last: int, count: int) -> list[int]:
    """Return whole numbers from 0 to the last, evenly spread, each once."""
    return sorted({int(each) for each in np.linspace(0, last, count).round()})


def _known(what: str, places: Sequence[int], problems: Iterable[str]) -> list[str]:
    return [f"{what} {at}: {each}" for at, each in zip(places, problems, strict=True) if each]


def problem_with(attacked: Callable[[], Any], whole: Any) -> str:
    """Return what is wrong with a job that was attacked and begun again; empty if nothing is.

    Args:
        attacked: Attacks it, begins it again and returns what came of it.
        whole: What comes of it otherwise.
    """
    try:
        found = attacked()
    except (RuntimeError, BlastEnvError, OSError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    return "" if found == whole else "another result"


if __name__ == "__main__":
    app()
