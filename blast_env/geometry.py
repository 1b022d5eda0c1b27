"""Axis-parallel rectangles, the only plane figure that sites are made of; cells of a grid."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

Cell = tuple[int, int]
"""(row, column) of a build-zone cell, from 0; rows count upwards, columns to the right."""


class Piece(NamedTuple):
    """An item of a build zone's catalogue that was set down.

    Attributes:
        row: Row of its lower left cell.
        column: Column of that cell.
        item: Name of the item.
        turned: Whether its length runs upwards rather than to the right.
    """

    row: int
    column: int
    item: str
    turned: bool = False


Element = Cell | Piece
"""What a layout consists of: single modules, or pieces where the build zone has a catalogue."""


class Rectangle(NamedTuple):
    """An axis-parallel rectangle from (`left`, `bottom`) to (`right`, `top`)."""

    left: float
    bottom: float
    right: float
    top: float

    @classmethod
    def from_corner(cls, corner: tuple[float, float], size: tuple[float, float]) -> "Rectangle":
        """Return the rectangle with this lower left corner and (width, height)."""
        return cls(corner[0], corner[1], corner[0] + size[0], corner[1] + size[1])

    @classmethod
    def around(cls, rectangles: "Sequence[Rectangle]") -> "Rectangle":
        """Return the smallest rectangle that contains all of at least one."""
        left, bottom, right, top = zip(*rectangles, strict=True)
        return cls(min(left), min(bottom), max(right), max(top))

    @property
    def centre(self) -> tuple[float, float]:
        """The centre point."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2

    def grown(self, margin: float) -> "Rectangle":
        """Return the rectangle with every side moved outwards by `margin`."""
        return Rectangle(
            self.left - margin, self.bottom - margin, self.right + margin, self.top + margin
        )

    def scaled(self, factor: float) -> "Rectangle":
        """Return the rectangle with all coordinates multiplied by `factor`."""
        return Rectangle(*(factor * value for value in self))

    def contains(self, other: "Rectangle", tolerance: float = 1e-9) -> bool:
        """Whether `other` lies inside, its sides touching allowed."""
        return (
            other.left >= self.left - tolerance
            and other.bottom >= self.bottom - tolerance
            and other.right <= self.right + tolerance
            and other.top <= self.top + tolerance
        )

    def overlaps(self, other: "Rectangle", tolerance: float = 1e-9) -> bool:
        """Whether the interiors meet; rectangles that only touch do not overlap."""
        return (
            self.left < other.right - tolerance
            and other.left < self.right - tolerance
            and self.bottom < other.top - tolerance
            and other.bottom < self.top - tolerance
        )

    def meets_segment(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether the segment from `start` to `end` has a point in the open rectangle."""
        enter, leave = 0.0, 1.0
        bounds = ((self.left, self.right), (self.bottom, self.top))
        for (low, high), begin, finish in zip(bounds, start, end, strict=True):
            step = finish - begin
            if step == 0.0:
                if not low < begin < high:
                    return False
                continue
            first, last = sorted(((low - begin) / step, (high - begin) / step))
            enter, leave = max(enter, first), min(leave, last)
        return enter < leave or (start == end and enter <= leave)


Layout = tuple[Element, ...]
"""The modules, or the pieces, in the order of their placing."""


def layout_text(layout: Iterable[Element]) -> str:
    """Return a layout for one field of a table: `3,4 3,5`, `3,4,t_wall 7,4,t_wall,turned`."""
    return " ".join(map(_element_text, layout))


def layout_counts(layout: Collection[Element], kind: str = "", of: int | None = None) -> str:
    """Return what a layout consists of: `1 module`, `3 of 9 pieces (2 wall, 1 post)`.

    Args:
        layout: Modules or pieces.
        kind: What kind of them, before the word: `barrier`.
        of: How many there are in stock.
    """
    items = Counter(str(element[2]) for element in layout if len(element) > 2)
    word = f"{kind} {'piece' if items else 'module'}".strip()
    plural = "" if len(layout) == 1 and of is None else "s"
    number = f"{len(layout)}" if of is None else f"{len(layout)} of {of}"
    named = ", ".join(f"{count} {item}" for item, count in items.items())
    return f"{number} {word}{plural}" + (f" ({named})" if named else "")


def _element_text(element: Element) -> str:
    row, column, *item = element
    words = [str(each) for each in item[:1]] + ["turned" for each in item[1:] if each]
    return ",".join((f"{row},{column}", *words))
