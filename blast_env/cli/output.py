"""Output of all commands: consoles, tables, errors, a progress bar."""

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final, Literal

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement, measure_renderables
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from blast_env.cli.interruptions import Interruptions
from blast_env.errors import BlastEnvError, MissingExtraError
from blast_env.evaluation.answers import AnswerPart, AnswerTable
from blast_env.gas.cost import CostGuess, cost_words
from blast_env.geometry import Element
from blast_env.site import AnyCharge, Scenario
from blast_env.values import printable, printable_line
from blast_env_command import NOTHING_HALF_WRITTEN

if TYPE_CHECKING:  # a third of a second to import
    from matplotlib.figure import Figure

    from blast_env.evaluation.engines import Engine

_PIPE_COLUMNS = 120
_LINE_EVERY_S: Final = 30.0
_BETWEEN: Final = 2  # characters between columns

LAYOUT_NAME: Final = "layout.json"
"""File of the layout in the folder of `--out`."""

LAYOUT_PICTURE: Final = "layout.png"
"""File of the picture of a layout in the folder of `--out`."""


def result_console() -> Console:
    """Return the console for results (standard output).

    In a pipe it is wide enough for most tables, unless `COLUMNS` sets the width.
    """
    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    width = None if known else _PIPE_COLUMNS
    return _plain(width=width)


def print_line(text: str, style: str | None = None) -> None:
    """Print a line to standard output verbatim: without wrapping or markup."""
    result_console().print(printable(text), soft_wrap=True, style=style)


def message_console() -> Console:
    """Return the console for messages and progress (standard error)."""
    return _plain(stderr=True, soft_wrap=True)


def _plain(**options: Any) -> Console:
    """Return a console that shows texts verbatim: a path may look like markup or an emoji."""
    return Console(highlight=False, markup=False, emoji=False, **options)


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
def resumable(words: str | Callable[[], str]) -> Iterator[None]:
    """End an interruption of the block with the way to resume, if there is one."""
    try:
        yield
    except KeyboardInterrupt as interruption:
        resume = words if isinstance(words, str) else words()
        raise InterruptedCommandError(NOTHING_HALF_WRITTEN, resume) from interruption


def print_json(content: Mapping[str, object]) -> None:
    """Print plain data as JSON to standard output."""
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


def print_cost(asked: "Iterable[tuple[Engine | None, Scenario, AnyCharge]]") -> None:
    """Print the cost of blasts before they start, if it can be estimated."""
    known: dict[Any, CostGuess | None] = {}
    costs = []
    for engine, scenario, charge in asked:
        key = engine, id(scenario), charge
        if key not in known:
            known[key] = None if engine is None else engine.cost(scenario, charge)
        costs.append(known[key])
    found = [each for each in costs if each is not None]
    if found:
        print_line(f"up to {cost_words(found)}")


def judged_blasts(
    engine: "Engine", scenario: Scenario, charges: Sequence[AnyCharge], layouts: int
) -> "Iterator[tuple[Engine | None, Scenario, AnyCharge]]":
    """Yield the blasts of a judgement, for their cost: one charge has coarser cells as well."""
    for charge in charges:
        yield from [(engine, scenario, charge)] * layouts
    yield from [(engine.coarser, scenario, charges[0])] * layouts


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


@dataclass(frozen=True)
class ResultTable(AnswerTable):
    """A table whose columns get narrower by wrapping between words, never inside a word.

    Rich's table cuts words if columns do not fit. This one then splits the columns into several
    tables one below the other, each with the first column, so that rows keep their names.
    """

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(printable_line(self.title), style="bold")
        lines = zip(self.headers, *self.rows, strict=True)
        columns = [[printable_line(str(cell)) for cell in column] for column in lines]
        free = options.update(width=10_000)
        widths = [measure_renderables(console, free, [*map(Text, column)]) for column in columns]
        for number, group in enumerate(self._groups(widths, options.max_width)):
            if number:
                yield Text()
            part = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
            room = options.max_width - _BETWEEN * (len(group) - 1)
            for index, width in zip(
                group, _shared([widths[index] for index in group], room), strict=True
            ):
                side: Literal["left", "right"] = "left" if index < self.text_columns else "right"
                part.add_column(columns[index][0], justify=side, width=width)
            for row in zip(*(columns[index][1:] for index in group), strict=True):
                part.add_row(*row)
            yield part

    def _groups(self, widths: Sequence[Measurement], width: int) -> list[list[int]]:
        """Return the column numbers of each table, by the width of their longest words."""
        names = [0] if self.text_columns > 0 else []
        groups = [[*names]]
        for index in range(len(names), len(widths)):
            taken = [*groups[-1], index]
            needed = sum(widths[each].minimum + _BETWEEN for each in taken) - _BETWEEN
            if needed > width and len(groups[-1]) > len(names):
                groups.append([*names])
            groups[-1].append(index)
        return groups


def _shared(widths: Sequence[Measurement], room: int) -> list[int]:
    """Return the widths of columns: their longest words, and a share of the space left."""
    shared = [each.minimum for each in widths]
    left = room - sum(shared)
    # The smallest demand first: it takes the least space to avoid a second line.
    for index in sorted(range(len(widths)), key=lambda each: widths[each].span):
        given = min(widths[index].span, max(left, 0))
        shared[index] += given
        left -= given
    return shared


def print_table(
    title: str, headers: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1
) -> None:
    """Print a table to standard output; see `ResultTable`."""
    result_console().print(ResultTable.of(title, headers, rows, text_columns))


def print_written(paths: Iterable[Path]) -> None:
    """Print the files written."""
    for path in paths:
        print_line(f"wrote {path}")


def print_answer(parts: Iterable[AnswerPart]) -> None:
    """Print the lines and tables of an answer, each as soon as it is known."""
    for part in parts:
        if isinstance(part, AnswerTable):
            print_table(part.title, part.headers, part.rows, part.text_columns)
        else:
            print_line(part)
