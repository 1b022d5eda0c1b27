"""A long attack on everything that reads files: `make attack`."""

import resource
import signal
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from types import FrameType
from typing import Annotated, Any, Final

import typer

from blast_env.errors import BlastEnvError
from tests.attack.formats import FORMATS, Format
from tests.attack.mutants import mutants

MOST_S: Final = 3.0
"""Processor time for one file."""

MOST_BYTES: Final = 2**30
"""Memory for one file."""

_KB: Final = 1024


class Overtime(BaseException):
    """What no reader can turn into an error of its own."""


@dataclass
class Outcome:
    """What became of the files of a format.

    Attributes:
        files: How many there were.
        refused: How many were refused as documented.
        slowest_s: The longest that one took, processor time.
        failures: What went wrong otherwise, once each, with the file.
    """

    files: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    failures: dict[str, bytes] = field(default_factory=dict)
    failed: int = 0

    @property
    def accepted(self) -> int:
        """How many were read."""
        return self.files - self.refused - self.failed


def attack(form: Format, count: int, seed: int = 0) -> Outcome:
    """Read wrong files.

    Args:
        form: The format.
        count: How many files.
        seed: Decides which.
    """
    sound = [form.read(each) for each in form.samples]
    outcome = Outcome()
    for content in mutants(form.samples, count, seed):
        began_s, peak = process_time(), _peak_bytes()
        problem = _problem(form, content, sound, outcome)
        took_s, more = process_time() - began_s, _peak_bytes() - peak
        if problem is None and took_s > MOST_S:
            problem = f"took {took_s:.1f} s"
        if problem is None and more > MOST_BYTES:
            problem = f"took {more / 2**30:.1f} GiB"
        if problem is not None:
            outcome.failed += 1
            outcome.failures.setdefault(problem, content)
        outcome.files += 1
        outcome.slowest_s = max(outcome.slowest_s, took_s)
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
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}"
    if found is None:
        outcome.refused += 1
    elif form.has_checksum and found not in sound:
        return "another result than what was written"
    return None


def _peak_bytes() -> int:
    return _KB * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextmanager
def limits() -> Iterator[None]:
    """Stop what takes twenty times as long, or more than all memory that it may have."""

    def stop(_: int, __: FrameType | None) -> None:
        raise Overtime

    before = resource.getrlimit(resource.RLIMIT_DATA)
    size = Path("/proc/self/statm").read_text(encoding="ascii").split()
    now = resource.getpagesize() * int(size[5])
    resource.setrlimit(resource.RLIMIT_DATA, (now + 3 * MOST_BYTES, before[1]))
    signal.signal(signal.SIGALRM, stop)
    try:
        yield
    finally:
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_DATA, before)


app = typer.Typer(pretty_exceptions_enable=False)


@app.command()
def main(
    files: Annotated[int, typer.Option(help="Files of each format.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Decides which.")] = 0,
    only: Annotated[str, typer.Option(help="Formats with this in their names.")] = "",
    out: Annotated[Path, typer.Option(help="Where files that failed are kept.")] = Path(
        "out/attack"
    ),
) -> None:
    """Read thousands of wrong files of each format; print what became of them."""
    failed = 0
    print("| format | files | refused | accepted | slowest, ms | failures | time, s |")
    print("|---|---|---|---|---|---|---|")
    with limits():
        for name, make in FORMATS.items():
            if only not in name:
                continue
            began_s = process_time()
            with TemporaryDirectory() as folder:
                outcome = attack(make(Path(folder)), files, seed)
            cells = (
                *(name, outcome.files, outcome.refused, outcome.accepted),
                *(f"{1000.0 * outcome.slowest_s:.0f}", outcome.failed),
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


if __name__ == "__main__":
    app()
