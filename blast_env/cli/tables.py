"""Tables that fit the width of the terminal without cutting a word."""

from collections.abc import Sequence
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement, measure_renderables
from rich.table import Table
from rich.text import Text

_BETWEEN: Final = 2  # characters


class ResultTable(Table):
    """A table whose columns get narrower by wrapping between words, never inside of one.

    Rich's own table cuts words where columns do not fit. Here the columns are then shown in
    several tables one below the other, each with the first column, so that rows keep their names.

    Args:
        title: What stands above it.
        headers: The headers.
        text_columns: How many of the first columns are text; numbers are set to the right.
    """

    def __init__(self, title: str, headers: Sequence[str], text_columns: int = 1) -> None:
        super().__init__()
        self.heading = title
        self._has_names = text_columns > 0
        for number, header in enumerate(headers):
            self.add_column(header, justify="left" if number < text_columns else "right")

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(self.heading, style="bold")
        unlimited = options.update(width=10_000)
        widths = [
            measure_renderables(
                console, unlimited, [Text(str(cell)) for cell in (each.header, *each.cells)]
            )
            for each in self.columns
        ]
        for number, group in enumerate(self._groups(widths, options.max_width)):
            if number:
                yield Text()
            room = options.max_width - _BETWEEN * (len(group) - 1)
            yield self._part(group, _shared([widths[index] for index in group], room))

    def _groups(self, widths: Sequence[Measurement], width: int) -> list[list[int]]:
        """Return which columns stand in which table, by the width of their longest words."""
        names = [0] if self._has_names and widths else []
        groups = [[*names]]
        for index in range(len(names), len(widths)):
            taken = [*groups[-1], index]
            needed = sum(widths[each].minimum + _BETWEEN for each in taken) - _BETWEEN
            if needed > width and len(groups[-1]) > len(names):
                groups.append([*names])
            groups[-1].append(index)
        return groups

    def _part(self, columns: Sequence[int], widths: Sequence[int]) -> Table:
        part = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        for index, width in zip(columns, widths, strict=True):
            each = self.columns[index]
            part.add_column(str(each.header), justify=each.justify, width=width)
        for row in zip(*(list(self.columns[index].cells) for index in columns), strict=True):
            part.add_row(*row)
        return part


def _shared(widths: Sequence[Measurement], room: int) -> list[int]:
    """Return the widths of columns: their longest words, and what is left to spare second lines."""
    shared = [each.minimum for each in widths]
    left = room - sum(shared)
    # The smallest wish first: it takes least to spare a column a second line.
    for index in sorted(range(len(widths)), key=lambda each: widths[each].span):
        given = min(widths[index].span, max(left, 0))
        shared[index] += given
        left -= given
    return shared
