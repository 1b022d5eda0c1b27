"""Where a vehicle gets to at all: its places on a plane that is cut by what it must not cover.

All of it is worked out without a grid, on the places of the vehicle's centre: obstacles grow by
half of the width on all sides, and cut the plane into rectangles, edges and corners, each of which
is open to the centre as a whole or not at all. Lengths are whole micrometres there.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.scenario.sections import Site
from blast_env.units import MODULE_SIDE_M

_PER_M: Final = 1_000_000
"""Steps of length in a metre: micrometres, so that what is equal is equal to the last bit."""

_MOST_STEPS: Final = 1000
"""Most places along a side of the site at which the charge may go off, obstacles aside."""


def places_on(site: Site) -> int:
    """Return at how many places of a site a vehicle's charge may go off, obstacles aside."""
    along_x, along_y = (
        steps_of(side_m) // _step(steps_of(side_m)) for side_m in (site.width_m, site.height_m)
    )
    return along_x * along_y


def squares_of(site: Site) -> tuple[int, int]:
    """Return how many rows and columns of squares of 0.5 m cover a site."""
    rows, columns = (ceil(m / MODULE_SIDE_M - 1e-9) for m in (site.height_m, site.width_m))
    return rows, columns


@dataclass(frozen=True, eq=False)
class Reach:
    """Where a vehicle can get to.

    The plane of its centre is cut at `x_m` and `y_m` into corners, edges and rectangles: those of
    even row and column are corners, those of odd ones the rectangles between.

    Attributes:
        width_m: Side of its square.
        x_m: Cuts along x, rising (columns,).
        y_m: Cuts along y, rising (rows,).
        start: Where its centre is when it has just entered (2 rows - 1, 2 columns - 1).
        reached: Where its centre can get to, of the same shape.
        clear: Where it would cover nothing that it can drive over, of the same shape.
    """

    width_m: float
    x_m: FloatArray
    y_m: FloatArray
    start: BoolArray
    reached: BoolArray
    clear: BoolArray

    @property
    def enters(self) -> bool:
        """Whether it can enter at all."""
        return bool(self.reached.any())

    @cached_property
    def places_m(self) -> FloatArray:
        """Places where its charge may go off, (places, 2): corners that are clear."""
        return self._corners_m(self.reached & self.clear)

    @property
    def starts_m(self) -> FloatArray:
        """Those of the places where it has just entered, (places, 2)."""
        return self._corners_m(self.start)

    def _corners_m(self, where: BoolArray) -> FloatArray:
        rows, columns = np.nonzero(where[::2, ::2])
        return np.column_stack((self.x_m[columns], self.y_m[rows]))

    def near(self, rows: int, columns: int, step_m: float) -> BoolArray:
        """Return which points of a lattice have a place that is reached within half a step.

        Args:
            rows: Points upwards, from the lower border.
            columns: Points to the right, from the left border.
            step_m: How far apart they are.
        """
        row, column = np.nonzero(self.reached)
        count = np.zeros((rows + 1, columns + 1), dtype=np.int64)
        ends = []
        for cuts_m, index, most in ((self.y_m, row, rows), (self.x_m, column, columns)):
            low = np.ceil(cuts_m[index // 2] / step_m - 0.5 - 1e-6).astype(np.intp)
            high = np.floor(cuts_m[(index + 1) // 2] / step_m + 0.5 + 1e-6).astype(np.intp) + 1
            ends.append((low.clip(0, most), high.clip(0, most)))
        (bottom, top), (left, right) = ends
        for y, sign in ((bottom, 1), (top, -1)):
            np.add.at(count, (y, left), sign)
            np.add.at(count, (y, right), -sign)
        near: BoolArray = count.cumsum(axis=0).cumsum(axis=1)[:rows, :columns] > 0
        return near

    def touches(self, rectangle: Rectangle) -> tuple[bool, bool, bool, bool]:
        """Return whether it gets to the left, lower, right and upper side of a rectangle."""
        half_m = self.width_m / 2.0
        left, bottom, right, top = rectangle.grown(half_m)
        across = _inner_parts(self.y_m, bottom, top), _inner_parts(self.x_m, left, right)
        found = []
        for edge_m, cuts_m, columns in (
            (left, self.x_m, True),
            (bottom, self.y_m, False),
            (right, self.x_m, True),
            (top, self.y_m, False),
        ):
            at = int(np.searchsorted(cuts_m, edge_m - 1e-6))
            if at == len(cuts_m) or abs(cuts_m[at] - edge_m) > 1e-6:
                found.append(False)
            elif columns:
                found.append(bool(self.reached[across[0], 2 * at].any()))
            else:
                found.append(bool(self.reached[2 * at, across[1]].any()))
        return found[0], found[1], found[2], found[3]

    def ground(self, rows: int, columns: int) -> BoolArray:
        """Return which squares of 0.5 m from the lower left corner of the site it can cover.

        Args:
            rows: Squares upwards.
            columns: Squares to the right.
        """
        row, column = np.nonzero(self.reached)
        left, right = _squares(self.x_m, column, self.width_m, columns)
        bottom, top = _squares(self.y_m, row, self.width_m, rows)
        # Corners of many rectangles, added up twice: how many of them cover a square.
        counts = np.zeros((rows + 1, columns + 1), dtype=np.int64)
        for y, sign in ((bottom, 1), (top, -1)):
            np.add.at(counts, (y, left), sign)
            np.add.at(counts, (y, right), -sign)
        covered: BoolArray = counts.cumsum(axis=0).cumsum(axis=1)[:rows, :columns] > 0
        return covered


def _inner_parts(cuts_m: FloatArray, low_m: float, high_m: float) -> slice:
    """Return the parts of a direction strictly between two cuts."""
    first = 2 * int(np.searchsorted(cuts_m, low_m + 1e-6)) - 1
    after = 2 * int(np.searchsorted(cuts_m, high_m - 1e-6))
    return slice(max(first, 0), after)


def _squares(
    cuts_m: FloatArray, index: NDArray[np.intp], width_m: float, count: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first square that is covered from some part of the plane, and the one after."""
    low_m = cuts_m[index // 2] - width_m / 2.0
    high_m = cuts_m[(index + 1) // 2] + width_m / 2.0
    first = np.floor(low_m / MODULE_SIDE_M + 1e-5).astype(np.intp)
    after = np.ceil(high_m / MODULE_SIDE_M - 1e-5).astype(np.intp)
    return first.clip(0, count), after.clip(0, count)


@dataclass(frozen=True)
class ReachQuery:
    """What decides where a vehicle gets to.

    Attributes:
        site: The site.
        width_m: Side of the vehicle's square.
        entries_m: The strips just inside the border where it enters.
        closed_m: What it must not cover.
        solid_m: What it drives over, but where no charge goes off.
        level_m: Whose corners the places of the charge are level with.
    """

    site: Site
    width_m: float
    entries_m: tuple[Rectangle, ...]
    closed_m: tuple[Rectangle, ...]
    solid_m: tuple[Rectangle, ...]
    level_m: tuple[Rectangle, ...]

    def answer(self) -> Reach:
        """Work out where the vehicle gets to."""
        from scipy.ndimage import label  # takes a third of a second to import

        plane = _Plane.of(self)
        closed = plane.covering(self.closed_m)
        start = np.zeros_like(closed)
        for strip_m in self.entries_m:
            start[plane.start(strip_m)] = True
        start &= ~closed
        # Corners hang together along edges, and edges along rectangles: side by side, never
        # cornerwise.
        labels, count = label(~closed)
        connected = np.zeros(count + 1, dtype=bool)
        connected[labels[start]] = True
        return Reach(
            width_m=self.width_m,
            x_m=plane.x / _PER_M,
            y_m=plane.y / _PER_M,
            start=start,
            reached=connected[labels],
            clear=~plane.covering(self.solid_m),
        )


@dataclass(frozen=True, eq=False)
class _Plane:
    """The plane of the centres of a vehicle, cut by all that it must not cover, micrometres.

    Attributes:
        x: Cuts along x, rising; the first and the last are where it touches the border.
        y: Cuts along y.
        half: Half of its width.
    """

    x: NDArray[np.int64]
    y: NDArray[np.int64]
    half: int

    @classmethod
    def of(cls, query: ReachQuery) -> "_Plane":
        half = steps_of(query.width_m) // 2
        grown = [_grown(each, half) for each in (*query.closed_m, *query.solid_m)]
        inner = [_grown(strip_m, -half) for strip_m in query.entries_m]
        # Nearest to a structure are places that touch it, or that are level with its corners.
        level = [_grown(each, 0) for each in query.level_m]
        width, height = steps_of(query.site.width_m), steps_of(query.site.height_m)
        boxes = (*grown, *inner, *level)
        return cls(
            x=_cuts([edge for box in boxes for edge in box[0::2]], half, width),
            y=_cuts([edge for box in boxes for edge in box[1::2]], half, height),
            half=half,
        )

    def covering(self, rectangles_m: Iterable[Rectangle]) -> BoolArray:
        """Return where the vehicle would cover any of the rectangles; to touch is not to cover."""
        covered = np.zeros((2 * len(self.y) - 1, 2 * len(self.x) - 1), dtype=bool)
        for rectangle in rectangles_m:
            left, bottom, right, top = _grown(rectangle, self.half)
            covered[_between(self.y, bottom, top), _between(self.x, left, right)] = True
        return covered

    def start(self, strip_m: Rectangle) -> tuple[slice, slice]:
        """Return where the vehicle stands within the strip behind an entry."""
        left, bottom, right, top = _grown(strip_m, -self.half)
        return _within(self.y, bottom, top), _within(self.x, left, right)


Box = tuple[int, int, int, int]
"""Left, bottom, right and top in micrometres."""


def steps_of(length_m: float) -> int:
    """Return a length in micrometres."""
    return round(length_m * _PER_M)


def _grown(rectangle: Rectangle, by: int) -> Box:
    left, bottom, right, top = map(steps_of, rectangle)
    return left - by, bottom - by, right + by, top + by


def _cuts(edges: Sequence[int], half: int, end: int) -> NDArray[np.int64]:
    """Return where a direction is cut: at edges, and at regular places of the charge.

    Args:
        edges: Of what has grown by half of the width.
        half: Half of the width.
        end: Where the site ends.
    """
    last = max(end - half, half)
    regular = np.arange(half, last + 1, _step(end), dtype=np.int64)
    cuts = np.concatenate((regular, np.array([*edges, half, last], dtype=np.int64)))
    return np.unique(cuts[(cuts >= half) & (cuts <= last)])


def _step(end: int) -> int:
    """Return how far apart regular places of the charge are on a site that ends there."""
    module = steps_of(MODULE_SIDE_M)
    return module * ceil(end / module / _MOST_STEPS)


def _between(cuts: NDArray[np.int64], low: int, high: int) -> slice:
    """Return the parts of a direction that lie strictly between two values.

    A value that is no cut lies beyond all of them.
    """
    first = 2 * int(np.searchsorted(cuts, low, side="right")) - 1
    after = 2 * int(np.searchsorted(cuts, high, side="left"))
    return slice(max(first, 0), after)


def _within(cuts: NDArray[np.int64], low: int, high: int) -> slice:
    """Return the parts of a direction from one cut to another one, both within the site."""
    first, last = np.searchsorted(cuts, np.clip([low, high], cuts[0], cuts[-1]))
    return slice(2 * int(first), 2 * int(last) + 1)
