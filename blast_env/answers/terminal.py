"""The renderer of documents for the terminal."""

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement, measure_renderables
from rich.table import Table as RichTable
from rich.text import Text

from blast_env.answers.document import PLAIN, AnyCell, AnyPart, Line, Table
from blast_env.values import printable, printable_line

_PIPE_COLUMNS: Final = 120
_BETWEEN: Final = 2  # characters between columns


def result_console() -> Console:
    """Return the console for results (standard output).

    In a pipe it is wide enough for most tables, unless `COLUMNS` sets the width.
    """
    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    width = None if known else _PIPE_COLUMNS
    return plain_console(width=width)


def print_line(text: str, style: str | None = None) -> None:
    """Print a line to standard output verbatim: without wrapping or markup."""
    result_console().print(printable(text), soft_wrap=True, style=style)


def plain_console(**options: Any) -> Console:
    """Return a console that shows texts verbatim: a path may look like markup or an emoji."""
    return Console(highlight=False, markup=False, emoji=False, **options)


def print_parts(parts: Iterable[AnyPart]) -> None:
    """Print the lines and tables of a document, each as soon as it is known."""
    for part in parts:
        if isinstance(part, Line):
            print_line(part.text(PLAIN))
        elif isinstance(part, Table):
            result_console().print(TableView(part))


def print_table(
    title: str, headers: Sequence[str], rows: Iterable[Sequence[AnyCell]], texts: int = 1
) -> None:
    """Print a table to standard output."""
    print_parts([Table.of(title, headers, rows, texts)])


@dataclass(frozen=True)
class TableView:
    """A table on a terminal: its columns wrap between words, never inside a word.

    Rich's table cuts words if columns do not fit. This one then splits the columns into several
    tables one below the other, each with the first column, so that rows keep their names.
    """

    table: Table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(printable_line(self.table.title), style="bold")
        lines = zip(self.table.headers, *self.table.cells(PLAIN), strict=True)
        columns = [[printable_line(cell) for cell in column] for column in lines]
        free = options.update(width=10_000)
        widths = [measure_renderables(console, free, [*map(Text, column)]) for column in columns]
        for place, group in enumerate(self._groups(widths, options.max_width)):
            if place:
                yield Text()
            part = RichTable(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
            room = options.max_width - _BETWEEN * (len(group) - 1)
            for index, width in zip(
                group, _shared([widths[index] for index in group], room), strict=True
            ):
                side: Literal["left", "right"] = "right" if self.table.is_number(index) else "left"
                part.add_column(columns[index][0], justify=side, width=width)
            rows = zip(*(columns[index][1:] for index in group), strict=True)
            for number, row in enumerate(rows):
                part.add_row(*row, style="bold" if number in self.table.main else None)
            yield part

    def _groups(self, widths: Sequence[Measurement], width: int) -> list[list[int]]:
        """Return the column numbers of each table, by the width of their longest words."""
        names = [0] if self.table.texts > 0 else []
        groups = [[*names]]
        for index in range(len(names), len(widths)):
            taken = [*groups[-1], index]
            needed = sum(widths[own].minimum + _BETWEEN for own in taken) - _BETWEEN
            if needed > width and len(groups[-1]) > len(names):
                groups.append([*names])
            groups[-1].append(index)
        return groups


def _shared(widths: Sequence[Measurement], room: int) -> list[int]:
    """Return the widths of columns: their longest words, and a share of the space left."""
    shared = [width.minimum for width in widths]
    left = room - sum(shared)
    # The smallest demand first: it takes the least space to avoid a second line.
    for index in sorted(range(len(widths)), key=lambda own: widths[own].span):
        given = min(widths[index].span, max(left, 0))
        shared[index] += given
        left -= given
    return shared
