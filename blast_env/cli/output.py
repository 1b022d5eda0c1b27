"""What all commands share: consoles, tables, errors, a progress bar."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from blast_env.errors import BlastEnvError, MissingExtraError

_PIPE_COLUMNS = 120


def result_console() -> Console:
    """Return the console for results (standard output); wide enough for tables in a pipe."""
    width = None if sys.stdout.isatty() else _PIPE_COLUMNS
    return Console(highlight=False, width=width)


def print_line(text: str, style: str | None = None) -> None:
    """Print a line to standard output as it is: not wrapped, no markup in it."""
    result_console().print(text, markup=False, soft_wrap=True, style=style)


def message_console() -> Console:
    """Return the console for messages and progress (standard error)."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn errors of the user into a message and exit code 2, Ctrl-C into exit code 130."""
    try:
        yield
    except BlastEnvError as error:
        message_console().print(f"error: {error}", markup=False, style="red")
        raise typer.Exit(2) from error
    except KeyboardInterrupt:
        message_console().print("interrupted: no file was left half-written", style="yellow")
        raise typer.Exit(130) from None


def save_pictures(save: Callable[[], list[Path]]) -> list[Path]:
    """Save pictures, or say that there are none for want of the extra `render`.

    Args:
        save: Saves them, and returns their paths.
    """
    try:
        return save()
    except MissingExtraError as error:
        message_console().print(f"note: {error}", markup=False, style="yellow")
        return []


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on standard error; it is gone when the work is done.

    Args:
        label: What is going on.

    Yields:
        A function to call with the share that is done.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=message_console(), transient=True) as progress:
        task = progress.add_task(label, total=1.0)
        yield lambda share: progress.update(task, completed=share)


def make_table(title: str, headers: Sequence[str], text_columns: int = 1) -> Table:
    """Return an empty table; all columns but the first `text_columns` are set to the right."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for number, header in enumerate(headers):
        table.add_column(header, justify="left" if number < text_columns else "right")
    return table
