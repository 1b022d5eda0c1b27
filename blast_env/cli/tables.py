"""Tables that fit the width of the terminal without cutting a word."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

_BETWEEN: Final = 2  # characters


class _Widths(NamedTuple):
    """How wide a column must be for its longest word, and would like to be for its longest line."""

    least: int
    most: int


class ResultTable(Table):
    """A table whose columns get narrower by wrapping between words, never inside of one.

    Where the longest words leave no room, the columns are shown in several tables one below the
    other, each with the columns of text first, so that rows keep their names.

    Args:
        title: What stands above it.
        headers: The headers.
        text_columns: How many of the first columns are text; numbers are set to the right.
    """

    def __init__(self, title: str, headers: Sequence[str], text_columns: int = 1) -> None:
        super().__init__()
        self.heading = title
        self._text_columns = text_columns
        for number, header in enumerate(headers):
            self.add_column(header, justify="left" if number < text_columns else "right")

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(self.heading, style="bold")
        widths = [self._widths(index) for index in range(len(self.columns))]
        groups = self._groups([each.least for each in widths], options.max_width)
        for number, group in enumerate(groups):
            if number:
                yield Text()
            room = options.max_width - _BETWEEN * (len(group) - 1)
            yield self._part(group, _shared([widths[index] for index in group], room))

    def _widths(self, index: int) -> _Widths:
        column = self.columns[index]
        cells = [str(cell) for cell in (column.header, *column.cells)]
        words = [cell_len(word) for cell in cells for word in cell.split()]
        lines = [cell_len(line) for cell in cells for line in cell.splitlines()]
        return _Widths(max(words, default=0), max(lines, default=0))

    def _groups(self, least: Sequence[int], width: int) -> list[list[int]]:
        """Return which columns stand in which table, by the width that they need at least."""

        def needed(columns: Sequence[int]) -> int:
            return sum(least[index] + _BETWEEN for index in columns) - _BETWEEN

        every = list(range(len(self.columns)))
        if needed(every) <= width:
            return [every]
        names = every[: min(self._text_columns, 1)]
        groups = [[*names]]
        for index in every[len(names) :]:
            if len(groups[-1]) > len(names) and needed([*groups[-1], index]) > width:
                groups.append([*names])
            groups[-1].append(index)
        return groups

    def _part(self, columns: Sequence[int], widths: Sequence[int]) -> Table:
        part = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        rows = [list(self.columns[index].cells) for index in columns]
        for index, width in zip(columns, widths, strict=True):
            each = self.columns[index]
            part.add_column(str(each.header), justify=each.justify, width=width)
        for row in zip(*rows, strict=True):
            part.add_row(*row)
        return part


def _shared(widths: Sequence[_Widths], room: int) -> list[int]:
    """Return the widths of columns: what they need, and of what is left as much as they wish."""
    shared = [each.least for each in widths]
    left = room - sum(shared)
    while left > 0:
        wishes = [each.most - now for each, now in zip(widths, shared, strict=True)]
        open_ones = [index for index, wish in enumerate(wishes) if wish > 0]
        if not open_ones:
            break
        # The smallest wish first: it takes least to spare a column a second line.
        index = min(open_ones, key=lambda each: wishes[each])
        given = min(wishes[index], left)
        shared[index] += given
        left -= given
    return shared
