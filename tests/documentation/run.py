"""Runs what the pages show, page by page, as a reader would: `make docs`.

Each page has a folder of its own, which begins with copies of what a checkout has and commands
read, and with what the page takes for granted. What one command writes is there for the next.
"""

import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Annotated, Final

import typer

from tests.documentation.exceptions import (
    BACKGROUND,
    CODE_NOT_RUN,
    GIVEN,
    NOT_RUN,
    SERVERS,
    SMALLER,
    Server,
)
from tests.documentation.pages import OTHERS, ROOT, STEPS, Cell, Command, Step

COPIED: Final = ("docs", "examples", "scenarios", "studies", "tests", "blast_env/surrogate")
MOST_S: Final = 1200.0
"""The longest that a step may take."""

MOST_SAID: Final = 2000
"""Characters of what a step that fails has printed at last."""


@dataclass
class Page:
    """A page that is being run.

    Attributes:
        folder: Where its commands run.
        source: The code of the page so far: its blocks go on where the last one ended.
    """

    folder: Path
    source: str = ""


@dataclass
class Tally:
    """What became of the steps.

    Attributes:
        counts: Steps by what became of them.
        failures: Steps that failed, with the end of what they printed.
        studies: Studies that have run: they depend on no page, and once is enough.
    """

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    studies: set[tuple[str, ...]] = field(default_factory=set)


class StepError(Exception):
    """A step that does not do what its page says."""


def environment() -> dict[str, str]:
    """Return the environment of a reader: our commands are found, and no window opens."""
    own = dict(os.environ)
    own["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), own.get("PATH", "")))
    own["MPLBACKEND"] = "agg"
    own.setdefault("SDL_VIDEODRIVER", "dummy")
    own.setdefault("OMP_NUM_THREADS", "1")
    return own


def run(words: tuple[str, ...], folder: Path, given: str | None = None) -> None:
    """Run a program to its end.

    Raises:
        StepError: It did not end well.
    """
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment(),
        input=given,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=MOST_S,
    )
    if done.returncode:
        raise StepError(f"exit code {done.returncode}\n{done.stdout[-MOST_SAID:]}")


_ANSWERS_WITHIN_S = 60.0


def serve(server: Server, words: tuple[str, ...], folder: Path) -> None:
    """Run a program that only ends when it is told to, until it answers.

    Raises:
        StepError: It ended, or did not answer.
    """
    log = folder / "server.log"
    with log.open("wb") as said:
        process = subprocess.Popen(words, cwd=folder, env=environment(), stdout=said, stderr=said)
    until_s = monotonic() + _ANSWERS_WITHIN_S
    try:
        while monotonic() < until_s:
            if process.poll() is not None:
                words_said = log.read_text(errors="replace")[-MOST_SAID:]
                raise StepError(f"ended by itself, exit code {process.returncode}\n{words_said}")
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", server.port)) == 0:
                    return
            sleep(0.2)
        raise StepError(f"no answer at port {server.port} within {_ANSWERS_WITHIN_S:g} s")
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(30)


def run_command(command: Command, page: Page, tally: Tally) -> str:
    """Run a command line of a page; return what became of it."""
    words, line = command.words, command.line
    if command.is_name:
        return "a name"
    if line in SERVERS:
        serve(SERVERS[line], words, page.folder)
        return "served"
    if words[0] in OTHERS:
        return f"not run: {OTHERS[words[0]]}"
    if line in NOT_RUN:
        return f"not run: {NOT_RUN[line]}"
    if words[0] == "python":
        if words in tally.studies:
            return "ran before"
        tally.studies.add(words)
    run((*words, *shlex.split(SMALLER.get(line, ""))), page.folder)
    return "smaller" if line in SMALLER else "ran"


def run_step(step: Step, page: Page, tally: Tally) -> str:
    """Run what a page shows; return what became of it.

    Raises:
        StepError: It does not work.
    """
    if isinstance(step, Command):
        return run_command(step, page, tally)
    if isinstance(step, Cell):
        run(("bash", "-e", "-o", "pipefail"), page.folder, step.source)
        return "ran"
    if (step.page, step.number) in CODE_NOT_RUN:
        return f"not run: {CODE_NOT_RUN[step.page, step.number]}"
    page.source += step.source
    run((sys.executable, "-"), page.folder, page.source)
    return "ran"


def copy_checkout(folder: Path) -> None:
    """Copy what commands of the pages read beside the package."""
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))


def provide(page: str, folder: Path, kept: Path) -> None:
    """Put what a page takes for granted into its folder.

    Args:
        page: The page.
        folder: Its folder.
        kept: What was made for pages before, a folder for each command.
    """
    for given in GIVEN:
        if page not in given.pages:
            continue
        source = folder
        if given.command:
            source = kept / str(abs(hash(given.command)))
            if not source.exists():
                copy_checkout(source)
                run(("bash", "-c", given.command), source)
        target = folder / given.path
        target.parent.mkdir(parents=True, exist_ok=True)
        if (source / given.made).is_dir():
            shutil.copytree(source / given.made, target)
        else:
            shutil.copy(source / given.made, target)


@contextmanager
def beside(page: str, folder: Path) -> Iterator[None]:
    """Keep running what a page's commands need beside them."""
    running = [
        subprocess.Popen(
            shlex.split(line), cwd=folder, env=environment(), stderr=subprocess.DEVNULL
        )
        for line in BACKGROUND.get(page, ())
    ]
    try:
        yield
    finally:
        for process in reversed(running):
            process.send_signal(signal.SIGTERM)
            process.wait(30)


def run_page(name: str, steps: Sequence[Step], kept: Path, tally: Tally) -> None:
    """Run steps in a folder of the page's own, which is thrown away."""
    with TemporaryDirectory() as scratch:
        page = Page(Path(scratch))
        copy_checkout(page.folder)
        provide(name, page.folder, kept)
        with beside(name, page.folder):
            for step in steps:
                run_and_tell(step, page, tally)


def run_and_tell(step: Step, page: Page, tally: Tally) -> None:
    """Run a step; print and keep what became of it."""
    before_s, began_s = used_s(), monotonic()
    try:
        became = run_step(step, page, tally)
    except (StepError, OSError, subprocess.TimeoutExpired) as failure:
        became = "FAILED"
        tally.failures.append(f"{step}\n{failure}")
    tally.counts[became.partition(":")[0]] += 1
    if became != "a name":
        spent_s = used_s() - before_s
        print(f"{spent_s:7.1f} {monotonic() - began_s:7.1f} s  {step}: {became}", flush=True)


def used_s() -> float:
    """Return the processor time of all that was run."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(
    pages: Annotated[list[str] | None, typer.Argument(help="Only these: README.md, ...")] = None,
) -> None:
    """Run every command and every block of Python of the pages."""
    tally = Tally()
    print("processor and passed time of each step")
    with TemporaryDirectory() as kept:
        for name in dict.fromkeys(pages or STEPS):
            if STEPS[name]:
                run_page(name, STEPS[name], Path(kept), tally)
    print(", ".join(f"{count} {became}" for became, count in tally.counts.most_common()))
    print(f"{used_s():.0f} s of processor time")
    for failure in tally.failures:
        print(f"\nFAILED {failure}")
    raise typer.Exit(code=min(len(tally.failures), 1))


if __name__ == "__main__":
    typer.run(main)
