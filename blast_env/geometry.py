"""Axis-parallel rectangles, walls in plan; cells, pieces and layouts."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final, Literal, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.units import MODULE_SIDE_M

Cell = tuple[int, int]
"""(row, column) of a build-zone cell, from 0; rows count upwards, columns to the right."""


class Piece(NamedTuple):
    """A placed item of a build zone's catalogue.

    Attributes:
        row: Row of its lower left cell.
        column: Column of that cell.
        turned: Whether its length runs upwards rather than to the right.
    """

    row: int
    column: int
    item: str
    turned: bool = False


class Measure(Piece):
    """A piece that covers no cell: it hardens parts of facades or removes a structure.

    Its row and column are 0. It is equal to the plain tuple.
    """

    __slots__ = ()

    @classmethod
    def named(cls, item: str) -> "Measure":
        """Return the measure with a name."""
        return cls(0, 0, item)


class Removal(Measure):
    """A measure that removes structures; unlike hardening, it changes loads."""

    __slots__ = ()


Element = Cell | Piece
"""An element of a layout: a single module, or a piece if the build zone has a catalogue."""


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
        """Return the smallest rectangle that contains all the given ones, at least one."""
        left, bottom, right, top = zip(*rectangles, strict=True)
        return cls(min(left), min(bottom), max(right), max(top))

    @property
    def centre(self) -> tuple[float, float]:
        """The centre point."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2

    def distance_to(self, point: tuple[float, float]) -> float:
        """Return the distance to a point; 0 inside."""
        across = max(self.left - point[0], point[0] - self.right, 0.0)
        along = max(self.bottom - point[1], point[1] - self.top, 0.0)
        return hypot(across, along)

    def grown(self, margin: float) -> "Rectangle":
        """Return the rectangle with every side moved outwards by `margin`."""
        return Rectangle(
            self.left - margin, self.bottom - margin, self.right + margin, self.top + margin
        )

    def scaled(self, factor: float) -> "Rectangle":
        """Return the rectangle with all coordinates multiplied by `factor`."""
        left, bottom, right, top = self
        return Rectangle(factor * left, factor * bottom, factor * right, factor * top)

    def contains(self, other: "Rectangle") -> bool:
        """Whether `other` lies inside; sides may touch."""
        left, bottom, right, top = self.grown(TOLERANCE_M)
        inside = left <= other.left and bottom <= other.bottom
        return inside and other.right <= right and other.top <= top

    def overlaps(self, other: "Rectangle", tolerance: float = 1e-9) -> bool:
        """Whether the interiors intersect; rectangles that only touch do not overlap."""
        return (
            self.left < other.right - tolerance
            and other.left < self.right - tolerance
            and self.bottom < other.top - tolerance
            and other.bottom < self.top - tolerance
        )

    def intersects_segment(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether the segment from `start` to `end` has a point in the open rectangle."""
        return bool(self.intersects_segments(start, np.array(end[0]), np.array(end[1])))

    def intersects_segments(
        self, start: tuple[float, float], x: FloatArray, y: FloatArray
    ) -> BoolArray:
        """Return a mask of the segments that have a point in the open rectangle.

        Args:
            start: The common start of the segments.
            x: x of their ends, of any shape.
            y: y of their ends, of the same shape.
        """
        # Clipping by slabs (Liang & Barsky, ACM Trans. Graph. 3 (1984) 1): the shares of the
        # segment at which it enters and leaves, the stricter ones of both axes. One that runs along
        # an axis outside its slab never enters.
        enter, leave = np.zeros(x.shape), np.ones(x.shape)
        bounds = ((self.left, self.right, x), (self.bottom, self.top, y))
        for begin, (low, high, finish) in zip(start, bounds, strict=True):
            step = finish - begin
            along = step != 0.0
            first, last = ((side - begin) / np.where(along, step, 1.0) for side in (low, high))
            enter = np.where(along, np.maximum(enter, np.minimum(first, last)), enter)
            leave = np.where(along, np.minimum(leave, np.maximum(first, last)), leave)
            if not low < begin < high:
                leave = np.where(along, leave, -1.0)
        met: BoolArray = enter < leave
        return met


Place = tuple[float, float]
"""x and y."""

_ALIGNED_COSINE: Final = 1e-9


WallName = Literal["west", "east", "south", "north"]
"""A wall of a structure, by the side that it faces: west is towards smaller x."""

WALLS: Final[tuple[WallName, ...]] = ("west", "east", "south", "north")

OUTWARDS: Final[Mapping[str, tuple[float, float]]] = {
    "west": (-1.0, 0.0),
    "east": (1.0, 0.0),
    "south": (0.0, -1.0),
    "north": (0.0, 1.0),
}
"""Outward normal of each wall."""


@dataclass(frozen=True)
class WallLine:
    """A wall in plan; the building is on its left.

    Attributes:
        start_m: One end.
        end_m: The other end.
    """

    start_m: Place
    end_m: Place

    @property
    def length_m(self) -> float:
        """Its length."""
        return hypot(self.end_m[0] - self.start_m[0], self.end_m[1] - self.start_m[1])

    @property
    def along(self) -> Place:
        """Unit vector from start to end."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return (x1 - x0) / self.length_m, (y1 - y0) / self.length_m

    @property
    def normal(self) -> Place:
        """Unit normal out of the building."""
        x, y = self.along
        return y, -x

    @property
    def side(self) -> WallName:
        """The side that it mostly faces."""
        x, y = self.normal
        if abs(x) > abs(y) - _ALIGNED_COSINE:
            return "west" if x < 0.0 else "east"
        return "south" if y < 0.0 else "north"

    @property
    def is_oblique(self) -> bool:
        """Whether its modules are a staircase: it crosses a module on its way along an axis."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return min(abs(x1 - x0), abs(y1 - y0)) >= MODULE_SIDE_M

    @property
    def bounds_m(self) -> Rectangle:
        """The rectangle around it."""
        (x0, y0), (x1, y1) = self.start_m, self.end_m
        return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))

    def point_at(self, along_m: float) -> Place:
        """Return the point at a distance from the start."""
        return (
            self.start_m[0] + along_m * self.along[0],
            self.start_m[1] + along_m * self.along[1],
        )

    def along_m(self, points_m: FloatArray) -> FloatArray:
        """Return the distances of points (n, 2) from the start, along the wall (n,)."""
        found: FloatArray = (points_m - np.array(self.start_m)) @ np.array(self.along)
        return found

    def distances_m(self, points_m: FloatArray) -> FloatArray:
        """Return the distances of points (n, 2) from the wall (n,)."""
        # The nearest point of a segment: the foot of the perpendicular, or the nearer end.
        at_m = np.clip(self.along_m(points_m), 0.0, self.length_m)[:, np.newaxis]
        away_m = points_m - np.array(self.start_m) - at_m * np.array(self.along)
        found: FloatArray = np.hypot(*away_m.T)
        return found


def stacked_runs(cells: BoolArray) -> IntArray:
    """Return disjoint rectangles that together cover the cells exactly.

    Rows are cut into runs, and equal runs above each other become one rectangle.

    Args:
        cells: The cells (rows, columns).

    Returns:
        Lowest row, leftmost column, number of rows and number of columns of each rectangle
        (rectangles, 4), ordered by row and column.
    """
    # 1. Runs of each row, between the steps up and down of a framed mask.
    framed = np.zeros((cells.shape[0], cells.shape[1] + 2), dtype=np.int8)
    framed[:, 1:-1] = cells
    steps = np.diff(framed, axis=1)
    row, first = np.nonzero(steps > 0)
    _, after = np.nonzero(steps < 0)
    # 2. Sorted by their ends, so that equal runs of neighbouring rows follow each other.
    order = np.lexsort((row, after, first))
    row, first, after = row[order], first[order], after[order]
    goes_on = (np.diff(row) == 1) & (np.diff(first) == 0) & (np.diff(after) == 0)
    lowest = np.flatnonzero(np.concatenate((np.ones(len(row[:1]), dtype=bool), ~goes_on)))
    # 3. One rectangle of each stack.
    heights = np.diff(np.append(lowest, len(row)))
    row, first, after = row[lowest], first[lowest], after[lowest]
    found: IntArray = np.column_stack((row, first, heights, after - first))
    return found[np.lexsort((first, row))]


def fewest_runs(cells: BoolArray) -> IntArray:
    """Return the `stacked_runs` of cells along rows or columns, whichever are fewer.

    So two walls of every rectangle are hidden by no other.
    """
    by_rows, by_columns = stacked_runs(cells), stacked_runs(cells.T)
    return by_rows if len(by_rows) <= len(by_columns) else by_columns[:, [1, 0, 3, 2]]


Layout = tuple[Element, ...]
"""The modules, or the pieces, in the order of placement."""


def standing(layout: "Iterable[Element]") -> "Layout":
    """Return the elements of a layout that stand on the ground: all but its measures."""
    return tuple([element for element in layout if not isinstance(element, Measure)])


def layout_text(layout: Iterable[Element]) -> str:
    """Return a layout for one field of a table: `3,4 3,5`, `3,4,t_wall 7,4,t_wall,turned`."""
    return " ".join(map(_element_text, layout))


def layout_counts(layout: Iterable[Element], kind: str = "", of: int | None = None) -> str:
    """Return a layout in counts: `1 module`, `3 of 9 pieces (2 wall, 1 post), new glass`.

    Args:
        layout: Modules or pieces, and measures.
        kind: Adjective before the word, such as `barrier`.
        of: Number in stock.
    """
    elements = tuple(layout)
    measures = [element.item for element in elements if isinstance(element, Measure)]
    pieces = standing(elements)
    if measures and not pieces and of is None:
        return ", ".join(measures)
    items = Counter(str(element[2]) for element in pieces if len(element) > 2)
    word = f"{kind} {'piece' if items else 'module'}".strip()
    plural = "" if len(pieces) == 1 and of is None else "s"
    number = f"{len(pieces)}" if of is None else f"{len(pieces)} of {of}"
    named = ", ".join(f"{count} {item}" for item, count in items.items())
    return ", ".join((f"{number} {word}{plural}" + (f" ({named})" if named else ""), *measures))


def layout_words(layout: "Layout") -> str:
    """Return a layout in counts, `nothing` for an empty one."""
    return layout_counts(layout) if layout else "nothing"


def _element_text(element: Element) -> str:
    row, column, *item = element
    words = [str(element) for element in item[:1]] + ["turned" for element in item[1:] if element]
    return ",".join((f"{row},{column}", *words))


TOLERANCE_M: Final = 1e-9
"""Largest overlap of rectangles that counts as touching, as in `Rectangle.overlaps`."""

Boxes = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Left, bottom, right and top of many rectangles; the four arrays broadcast."""


def box_distances_m(box: Rectangle, boxes: Boxes) -> FloatArray:
    """Return the distances between one rectangle and others, m; 0 if they overlap."""
    left, bottom, right, top = map(np.asarray, box)
    return distances_between_m((left, bottom, right, top), boxes)


def distances_between_m(some: Boxes, others: Boxes) -> FloatArray:
    """Return the distances between rectangles, m, which broadcast; 0 where they overlap."""
    left, bottom, right, top = others
    along_x = np.maximum(0.0, np.maximum(left - some[2], some[0] - right))
    along_y = np.maximum(0.0, np.maximum(bottom - some[3], some[1] - top))
    distances_m: FloatArray = np.hypot(along_x, along_y)
    return distances_m


def overlapping(rectangle: Rectangle, boxes: Boxes) -> BoolArray:
    """Return whether each rectangle overlaps one; touching is not overlapping."""
    left, bottom, right, top = boxes
    along_x = (left < rectangle.right - TOLERANCE_M) & (right > rectangle.left + TOLERANCE_M)
    along_y = (bottom < rectangle.top - TOLERANCE_M) & (top > rectangle.bottom + TOLERANCE_M)
    return along_x & along_y


def overlapping_any(rectangles: Sequence[Rectangle], boxes: Boxes) -> BoolArray:
    """Return whether each rectangle overlaps any of some others, at least one."""
    found: BoolArray = np.any([overlapping(rectangle, boxes) for rectangle in rectangles], axis=0)
    return found


def covered_m2(rectangle: Rectangle, boxes: Boxes) -> FloatArray:
    """Return the area of each rectangle's intersection with one, m2."""
    left, bottom, right, top = boxes
    along_x = np.minimum(right, rectangle.right) - np.maximum(left, rectangle.left)
    along_y = np.minimum(top, rectangle.top) - np.maximum(bottom, rectangle.bottom)
    area_m2: FloatArray = np.maximum(along_x, 0.0) * np.maximum(along_y, 0.0)
    return area_m2


def distance_to_rectangle(position: FloatArray, rectangle: Rectangle) -> FloatArray:
    """Return the distance (n,) of points (n, 2) to a rectangle, 0 inside."""
    low = np.array([rectangle.left, rectangle.bottom])
    high = np.array([rectangle.right, rectangle.top])
    outside = np.maximum(np.maximum(low - position, position - high), 0.0)
    distance: FloatArray = np.hypot(outside[:, 0], outside[:, 1])
    return distance


Wall = Rectangle | WallLine
"""A wall in plan; that of a rectangular structure is a rectangle of width 0."""
