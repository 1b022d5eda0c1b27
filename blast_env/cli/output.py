"""Output of all commands: consoles, tables, errors, a progress bar."""

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Final, TextIO

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from blast_env.answers.document import AnyPart
from blast_env.answers.terminal import plain_console, print_line, print_parts
from blast_env.cli.interruptions import Interruptions
from blast_env.errors import BlastEnvError, BlastEnvWarning, MissingExtraError
from blast_env.gas.cost import CostGuess, cost_words
from blast_env.geometry import Element
from blast_env.site import Scenario
from blast_env.values import printable
from blast_env_command import NOTHING_HALF_WRITTEN

if TYPE_CHECKING:  # a third of a second to import
    from matplotlib.figure import Figure

_LINE_EVERY_S: Final = 30.0

LAYOUT_NAME: Final = "layout.json"
"""File of the layout in the folder of `--out`."""

LAYOUT_PICTURE: Final = "layout.png"
"""File of the picture of a layout in the folder of `--out`."""


def message_console() -> Console:
    """Return the console for messages and progress (standard error)."""
    return plain_console(stderr=True, soft_wrap=True)


class InterruptedCommandError(Exception):
    """A command was interrupted after a part of its result; sentences on it and the way on."""

    def __init__(self, *parts: str) -> None:
        self.parts = parts
        super().__init__(*parts)


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn errors of the user into a message and exit code 2, interruptions into 130 or 143.

    SIGTERM ends the block as Ctrl-C does. An error that follows an interruption is a consequence of
    it, as when a library reports a missing worker.
    """
    interruptions = Interruptions.current()
    try:
        with interruptions.raised():
            yield
    except KeyboardInterrupt:
        parts: tuple[str, ...] = (NOTHING_HALF_WRITTEN,)
    except InterruptedCommandError as interrupted:
        parts = interrupted.parts
    except Exception as error:
        if not interruptions.received:
            if not isinstance(error, BlastEnvError):
                raise
            message_console().print(printable(f"error: {error}"), style="red")
            interruptions.settle(is_told=True)
            raise typer.Exit(2) from error
        parts = (NOTHING_HALF_WRITTEN,)
    else:
        interruptions.settle(is_told=False)
        return
    text = "; ".join(part for part in parts if part)
    message_console().print(printable(f"interrupted: {text}"), style="yellow")
    interruptions.settle(is_told=True)
    raise typer.Exit(interruptions.exit_code)


@contextmanager
def plain_notes() -> Iterator[None]:
    """Print each `BlastEnvWarning` of the block as one line, without its place in the program."""
    before = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, BlastEnvWarning):
            message_console().print(printable(f"note: {message}"), style="yellow")
        else:
            before(message, category, filename, lineno, file, line)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = before


@contextmanager
def resumable(words: str | Callable[[], str]) -> Iterator[None]:
    """End an interruption of the block with the way to resume, if there is one."""
    try:
        yield
    except KeyboardInterrupt as interruption:
        resume = words if isinstance(words, str) else words()
        raise InterruptedCommandError(NOTHING_HALF_WRITTEN, resume) from interruption


def print_outcome(parts: Iterable[AnyPart], written: Sequence[Path] = ()) -> None:
    """Print the parts of an answer, and the files written."""
    print_parts(parts)
    print_written(written)


def print_record(record: Mapping[str, object], written: Iterable[Path]) -> None:
    """Print the record of an answer and the files written, as JSON, to standard output."""
    content = {**record, "files": [str(path) for path in written]}
    print_line(json.dumps(content, indent=2, allow_nan=False))


def save_figures(*asked: "tuple[Path | None, Callable[[], Figure]]") -> list[Path]:
    """Draw and save the figures that have a path; return their files."""
    figures = [(path, draw()) for path, draw in asked if path is not None]
    if not figures:
        return []
    # Here, because pictures need the extra `render`.
    from blast_env.plots.figures import save_figure

    return [save_figure(figure, path) for path, figure in figures]


def save_pictures(*asked: "tuple[Path | None, Callable[[], Figure]]") -> list[Path]:
    """Do as `save_figures`; print a note if the extra `render` is not installed."""
    try:
        return save_figures(*asked)
    except MissingExtraError as error:
        message_console().print(printable(f"note: {error}"), style="yellow")
        return []


def layout_picture(scenario: Scenario, layout: Sequence[Element]) -> "Figure":
    """Draw the plan of a layout on its site."""
    # Here, because pictures need the extra `render`.
    from blast_env.plots.site_picture import site_picture

    return site_picture(scenario, layout)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error, and remove it at the end of the work.

    If standard error is no terminal, as in a log file, print a line every half minute instead.

    Yields:
        A function to call with the completed share, 0 to 1, and perhaps words on the state.
    """
    console = message_console()
    if not console.is_terminal:
        yield _progress_lines(console, printable(label))
        return
    text = "{task.description} {task.fields[words]}"
    columns = (TextColumn(text, markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(printable(label), total=1.0, words="")
        yield lambda share, words="": progress.update(task, completed=share, words=words)


@contextmanager
def blasts_running(
    label: str,
    words: str,
    costs: Iterable[CostGuess | None],
    *,
    drawn: int = 0,
    is_quiet: bool = False,
) -> Iterator[Callable[..., None]]:
    """Say what runs the blasts of a block, and their cost; then show their progress.

    Args:
        label: What runs, beside the bar.
        words: The engine in words.
        costs: Estimated cost of each blast; `None` for one without an estimate.
        drawn: Number of blasts with pictures, which take time as well.
        is_quiet: Whether only the progress is shown, since standard output is for JSON.

    Yields:
        A function to call with the completed share, as of `progress_bar`.
    """
    if not is_quiet:
        print_line(words)
        known = [cost for cost in costs if cost is not None]
        if known:
            print_line(f"up to {cost_words(known, drawn)}")
    with progress_bar(label) as progress:
        yield progress


def _progress_lines(console: Console, label: str) -> Callable[..., None]:
    """Return a function that writes the completed share, at most every half minute."""
    began = printed_s = perf_counter()

    def show(share: float, words: str = "") -> None:
        nonlocal printed_s
        now = perf_counter()
        if now - printed_s >= _LINE_EVERY_S:
            printed_s = now
            text = f"{label}: {share:.0%} after {now - began:,.0f} s"
            console.print(f"{text}, {words}" if words else text)

    return show


def print_written(paths: Iterable[Path]) -> None:
    """Print the files written."""
    for path in paths:
        print_line(f"wrote {path}")
