"""Lines of squares in a build zone's grid, and the fewest posts that close one to vehicles."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor, fsum
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, any_in_windows, counts_before
from blast_env.geometry import Cell, Element, Rectangle
from blast_env.layout import LayoutState
from blast_env.site import BuildZone, Scenario
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles import is_open

_TOLERANCE: Final = 1e-6
"""Tolerance of lengths in modules."""


class Run(NamedTuple):
    """A straight run of squares of the span, to the right or upwards.

    Attributes:
        row: Row of its first square.
        column: Column of its first square.
        squares: Number of its squares.
        is_row: Whether it runs to the right.
    """

    row: int
    column: int
    squares: int
    is_row: bool

    def square(self, at: int) -> Cell:
        """Return the row and column of a square by its number in the run."""
        return (self.row, self.column + at) if self.is_row else (self.row + at, self.column)

    def of(self, mask: BoolArray, less: int = 0) -> BoolArray:
        """Return the part of a mask (rows, columns) along the run, but for its last squares."""
        squares = max(self.squares - less, 0)
        if self.is_row:
            return mask[self.row, self.column : self.column + squares]
        return mask[self.row : self.row + squares, self.column]


Line = tuple[Run, ...]
"""Runs that posts close together."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Where vehicles could pass between squares that are closed to them.

    Attributes:
        squares: Number of squares beside each other through which the narrowest vehicle passes.
        along_rows: Whether so many squares are open, from each square to the right.
        along_columns: The same upwards.
    """

    squares: int
    along_rows: BoolArray
    along_columns: BoolArray

    @classmethod
    def between(cls, closed: BoolArray, squares: int) -> "Gaps":
        """Return the gaps between closed squares (rows, columns)."""
        counts = counts_before(closed)
        return cls(
            squares, ~any_in_windows(counts, 1, squares), ~any_in_windows(counts, squares, 1)
        )

    def are_in(self, run: Run) -> bool:
        """Return whether a run has a gap."""
        starts = self.along_rows if run.is_row else self.along_columns
        return bool(run.of(starts, self.squares - 1).any())


@dataclass(frozen=True, eq=False)
class PostLines:
    """The lines along which posts can stand, and the posts that close them.

    Squares are those of the span: the build zone's grid, continued to the border of the site. They
    are counted from its lower left one.

    Attributes:
        empty: The empty placement of a scenario with a build zone and a vehicle.
    """

    empty: LayoutState

    @cached_property
    def items(self) -> list[int]:
        """The indices of the items that stop vehicles, or that of the single module."""
        variants = self.empty.catalogue.variants
        return sorted({variant.item for variant in variants if variant.stops_vehicles})

    @cached_property
    def with_gaps(self) -> list[Line]:
        """The lines that are open: straight ones, then rings from the innermost outwards."""
        gaps = Gaps.between(self.closed, self.gap)
        found = (tuple(filter(gaps.are_in, line)) for line in self._all())
        return [line for line in found if line]

    def closed_by(self, item: int, line: Line) -> LayoutState | None:
        """Return the placement of the fewest posts of an item that close a line, if any do."""
        # Where posts in all places together leave a gap, no choice of them is looked for.
        if any(map(self._gaps_beside[item].are_in, line)):
            return None
        posts = _Posts(self, item)
        return posts.placement if all(map(posts.close, line)) else None

    @cached_property
    def gap(self) -> int:
        """Number of squares beside each other through which the narrowest vehicle passes."""
        width_m = min(vehicle.width_m for vehicle in self._scenario.vehicles)
        return ceil(width_m / MODULE_SIDE_M - _TOLERANCE)

    @cached_property
    def closed(self) -> BoolArray:
        """Mask of the squares that are closed to every vehicle (rows, columns)."""
        rows, columns = self._span
        closed = np.ones((len(rows), len(columns)), dtype=bool)
        for source in self._scenario.vehicles:
            own = np.zeros_like(closed)
            for rectangle in self._scenario.vehicle_ground(source).closed_m:
                own[self._squares(rectangle)] = True
            # Closed to every vehicle: a line must stop the one that it stops least.
            closed &= own
        return closed

    @cached_property
    def fits(self) -> BoolArray:
        """Whether each variant may stand on the empty site (variants, rows, columns)."""
        legal = self.empty.legal
        fits = np.zeros((len(legal), *self.closed.shape), dtype=bool)
        fits[:, *self.in_zone] = legal
        return fits

    @property
    def in_zone(self) -> tuple[slice, slice]:
        """The squares of the build zone."""
        (rows, columns), zone = self._span, self._scenario.zone
        up, right = -rows.start, -columns.start
        return slice(up, up + zone.rows), slice(right, right + zone.columns)

    def cell(self, square: Cell) -> Cell:
        """Return the cell of the build zone that a square is."""
        rows, columns = self._span
        return square[0] + rows.start, square[1] + columns.start

    @cached_property
    def _gaps_beside(self) -> dict[int, Gaps]:
        """The gaps that remain where each item stands in all of its places together."""
        return {
            item: Gaps.between(self.closed | self._covered(item), self.gap) for item in self.items
        }

    def _covered(self, item: int) -> BoolArray:
        """Return the squares that posts of an item could cover (rows, columns)."""
        covered = np.zeros_like(self.closed)
        rows, columns = covered.shape
        for fits, variant in zip(self.fits, self.empty.catalogue.variants, strict=True):
            for up, right in variant.cells_at(0, 0) if variant.item == item else ():
                covered[up:, right:] |= fits[: rows - up, : columns - right]
        return covered

    @property
    def _scenario(self) -> Scenario:
        return self.empty.scenario

    @cached_property
    def _span(self) -> tuple[range, range]:
        """Rows and columns of the span, as the zone's grid counts them."""
        zone, site = self._scenario.zone, self._scenario.site
        (left, bottom), side = zone.corner_m, MODULE_SIDE_M
        rows = range(-floor(bottom / side), ceil((site.height_m - bottom) / side - _TOLERANCE))
        columns = range(-floor(left / side), ceil((site.width_m - left) / side - _TOLERANCE))
        return rows, columns

    def _all(self) -> Iterator[Line]:
        """Yield all lines, also closed ones."""
        rows, columns = self.closed.shape
        in_zone = self.in_zone
        for row in range(in_zone[0].start, in_zone[0].stop):
            yield (Run(row, 0, columns, is_row=True),)
        for column in range(in_zone[1].start, in_zone[1].stop):
            yield (Run(0, column, rows, is_row=rows == 1),)
        protected = [
            structure.rectangle_m for structure in self._scenario.structures if structure.protected
        ]
        around = Rectangle.around(protected)
        for steps in range(max(rows, columns)):
            yield self._ring(around.grown(steps * MODULE_SIDE_M))

    def _ring(self, inner_m: Rectangle) -> Line:
        """Return the runs of squares directly outside a rectangle, within the span."""
        (rows, columns), (vertical, horizontal) = self.closed.shape, self._squares(inner_m)
        low, high = vertical.start - 1, vertical.stop
        left, right = horizontal.start - 1, horizontal.stop
        bottom, first = max(low, 0), max(left, 0)
        up, across = min(high + 1, rows) - bottom, min(right + 1, columns) - first
        upright = [
            Run(bottom, column, up, is_row=up == 1)
            for column in (left, right)
            if 0 <= column < columns
        ]
        flat = [Run(row, first, across, is_row=True) for row in (low, high) if 0 <= row < rows]
        return *upright, *flat

    def _squares(self, rectangle_m: Rectangle) -> tuple[slice, slice]:
        """Return the squares of the span that a rectangle overlaps."""
        (left, bottom), side = self._scenario.zone.corner_m, MODULE_SIDE_M
        rows, columns = self._span
        low = floor((rectangle_m.bottom - bottom) / side + _TOLERANCE) - rows.start
        high = ceil((rectangle_m.top - bottom) / side - _TOLERANCE) - rows.start
        first = floor((rectangle_m.left - left) / side + _TOLERANCE) - columns.start
        last = ceil((rectangle_m.right - left) / side - _TOLERANCE) - columns.start
        return slice(max(low, 0), max(high, 0)), slice(max(first, 0), max(last, 0))


class _Posts:
    """Posts of one item, which are placed one after the other, each as the zone's conditions allow.

    Args:
        lines: The lines of the site.
        item: The item.
    """

    def __init__(self, lines: PostLines, item: int) -> None:
        self._lines, self._empty = lines, lines.empty
        self._variants = {
            number: variant
            for number, variant in enumerate(self._empty.catalogue.variants)
            if variant.item == item
        }
        self._most = self._empty.stocks_left[item]
        self._taken = np.zeros_like(lines.closed)
        self._posts = list[Element]()
        self._costs = list[float]()

    @property
    def placement(self) -> LayoutState:
        """The placement of the posts."""
        return self._empty.with_legal(self._posts)

    def close(self, run: Run) -> bool:
        """Place the fewest posts that close a run; return whether there are such posts."""
        variant, length = self._along(run)
        end = 0  # of the closed part of the run
        # Posts of another run, which may cross this one, close it, too.
        closed = run.of(self._lines.closed | self._taken)
        for index in (*np.flatnonzero(closed).tolist(), run.squares):
            # Greedy from one end, as far apart as the narrowest vehicle allows, which needs the
            # fewest posts; where the farthest place is not legal, the next nearer one.
            while index - end >= self._lines.gap:
                latest = min(end + self._lines.gap - 1, index - length)
                tried = range(latest, end - 1, -1)
                at = next((at for at in tried if self._may_take(variant, *run.square(at))), None)
                if at is None:
                    return False
                self._place(variant, *run.square(at))
                end = at + length
            end = index + 1
        return True

    def _along(self, run: Run) -> tuple[int, int]:
        """Return the number of the variant with the largest length along a run, and that length."""
        lengths = {
            number: variant.columns if run.is_row else variant.rows
            for number, variant in self._variants.items()
        }
        longest = max(lengths, key=lengths.__getitem__)
        return longest, lengths[longest]

    def _may_take(self, number: int, row: int, column: int) -> bool:
        """Return whether a post may be placed with its first module on a square."""
        # From cheap to costly checks; the last one searches a way across the site.
        if len(self._posts) == self._most or not self._lines.fits[number, row, column]:
            return False
        if self._covered(number, row, column).any():
            return False
        if self._cost(number, row, column) > self._zone.cost_limit - fsum(self._costs):
            return False
        return self._zone.access_way is None or self._leaves_way(number, row, column)

    def _leaves_way(self, number: int, row: int, column: int) -> bool:
        """Return whether the access way stays open beside a further post."""
        way, variant = self._zone.access_way, self._variants[number]
        assert way is not None
        up, right = self._lines.cell((row, column))
        ground = self._empty.empty_zone.passable & ~self._taken[self._lines.in_zone]
        ground[up : up + variant.rows, right : right + variant.columns] = False
        return is_open(way, ground)

    def _place(self, number: int, row: int, column: int) -> None:
        """Place a post with its first module on a square."""
        self._covered(number, row, column)[:] = True
        self._costs.append(self._cost(number, row, column))
        cell = self._lines.cell((row, column))
        self._posts.append(self._empty.catalogue.element_at(number, *cell))

    def _covered(self, number: int, row: int, column: int) -> BoolArray:
        """Return the squares below a post, of those that are taken."""
        variant = self._variants[number]
        return self._taken[row : row + variant.rows, column : column + variant.columns]

    def _cost(self, number: int, row: int, column: int) -> float:
        cell = self._lines.cell((row, column))
        return float(self._empty.costs[number, *cell])

    @property
    def _zone(self) -> BuildZone:
        return self._empty.scenario.zone
