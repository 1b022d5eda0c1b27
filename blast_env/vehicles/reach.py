"""The reach of a vehicle: the positions of its centre that are connected to its entries.

The computation is exact, without a grid. Obstacles, grown by half of the vehicle's width on all
sides, cut the plane of its centre into rectangles, edges and corners, each of which is open or
closed as a whole. Lengths are whole micrometres. Places of the charge form a finer lattice, and
each has the state of its part of the plane.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.sections import Site
from blast_env.units import MODULE_SIDE_M

PER_M: Final = 1_000_000
"""Micrometres in a metre; whole numbers make equal lengths compare equal."""

_MOST_STEPS: Final = 1000
"""Most regular places of the charge along a side of the site."""


Steps = NDArray[np.int64]
"""Lengths in micrometres."""

_Ends = tuple[NDArray[np.intp], NDArray[np.intp]]
"""The first row or column of each of several rectangles, and the one after the last."""


def places_on(site: Site) -> int:
    """Return the number of places of a vehicle's charge on a site without obstacles."""
    along_x, along_y = (
        steps_of(side_m) // places_apart(steps_of(side_m))
        for side_m in (site.width_m, site.height_m)
    )
    return along_x * along_y


@dataclass(frozen=True, eq=False)
class Reach:
    """The reach of a vehicle.

    The plane of its centre is cut at `x_m` and `y_m` into corners, edges and rectangles: those of
    even row and column are corners, those of odd row and column the rectangles between.

    Attributes:
        width_m: Side of its square.
        x_m: Cuts along x, rising (columns,).
        y_m: Cuts along y, rising (rows,).
        start: Parts with its centre just after entry (2 rows - 1, 2 columns - 1).
        reached: Parts that its centre can reach, of the same shape.
        clear: Parts at which it covers no obstacle that it drives over, of the same shape.
        lattice_x_m: x of the places of its charge, rising, all cuts included.
        lattice_y_m: The same along y.
    """

    width_m: float
    x_m: FloatArray
    y_m: FloatArray
    start: BoolArray
    reached: BoolArray
    clear: BoolArray
    lattice_x_m: FloatArray
    lattice_y_m: FloatArray

    @property
    def enters(self) -> bool:
        """Whether it can enter."""
        return bool(self.reached.any())

    @cached_property
    def places_m(self) -> FloatArray:
        """Places of its charge (places, 2): the clear ones of the lattice within reach."""
        return self._places_m(self.reached & self.clear)

    @property
    def starts_m(self) -> FloatArray:
        """Places of its centre just after entry (places, 2)."""
        return self._places_m(self.start)

    def _places_m(self, where: BoolArray) -> FloatArray:
        """Return the places of the lattice in some parts of the plane (places, 2)."""
        of_row = _parts(self.y_m, self.lattice_y_m)
        of_column = _parts(self.x_m, self.lattice_x_m)
        rows, columns = np.nonzero(where[of_row[:, np.newaxis], of_column])
        return np.column_stack((self.lattice_x_m[columns], self.lattice_y_m[rows]))

    def near(self, rows: int, columns: int, step_m: float) -> BoolArray:
        """Return whether each point of a grid has a reached place within half a step.

        Args:
            rows: Points upwards, from the lower border.
            columns: Points to the right, from the left border.
            step_m: Spacing of the points.
        """
        row, column = np.nonzero(self.reached)  # each part is a rectangle of points
        ends = list[_Ends]()
        for cuts_m, index, most in ((self.y_m, row, rows), (self.x_m, column, columns)):
            low = np.ceil(cuts_m[index // 2] / step_m - 0.5 - 1e-6).astype(np.intp)
            high = np.floor(cuts_m[(index + 1) // 2] / step_m + 0.5 + 1e-6).astype(np.intp) + 1
            ends.append((low.clip(0, most), high.clip(0, most)))
        return _covered(rows, columns, *ends)

    def touches(self, rectangle: Rectangle) -> tuple[bool, bool, bool, bool]:
        """Return whether it reaches the left, lower, right and upper side of a rectangle."""
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
        """Return whether it can cover each square of 0.5 m from the site's lower left corner.

        Args:
            rows: Squares upwards.
            columns: Squares to the right.
        """
        row, column = np.nonzero(self.reached)
        upwards = _squares(self.y_m, row, self.width_m, rows)
        across = _squares(self.x_m, column, self.width_m, columns)
        return _covered(rows, columns, upwards, across)


def _covered(rows: int, columns: int, upwards: _Ends, across: _Ends) -> BoolArray:
    """Return which squares of a grid rectangles cover, by the ends of their rows and columns."""
    # Differences at the corners of rectangles, then two cumulative sums: how many cover a square.
    counts = np.zeros((rows + 1, columns + 1), dtype=np.int64)
    for y, sign in zip(upwards, (1, -1), strict=True):
        for x, other in zip(across, (1, -1), strict=True):
            np.add.at(counts, (y, x), sign * other)
    covered: BoolArray = counts.cumsum(axis=0).cumsum(axis=1)[:rows, :columns] > 0
    return covered


def _parts(cuts_m: FloatArray, values_m: FloatArray) -> NDArray[np.intp]:
    """Return the part of an axis in which each value lies: at a cut, or between two."""
    before = np.searchsorted(cuts_m, values_m, side="left")
    return before + np.searchsorted(cuts_m, values_m, side="right") - 1


def _inner_parts(cuts_m: FloatArray, low_m: float, high_m: float) -> slice:
    """Return the parts of an axis strictly between two cuts."""
    first = 2 * int(np.searchsorted(cuts_m, low_m + 1e-6)) - 1
    after = 2 * int(np.searchsorted(cuts_m, high_m - 1e-6))
    return slice(max(first, 0), after)


def _squares(cuts_m: FloatArray, index: NDArray[np.intp], width_m: float, count: int) -> _Ends:
    """Return the first square covered from each part of the plane, and the one after the last."""
    low_m = cuts_m[index // 2] - width_m / 2.0
    high_m = cuts_m[(index + 1) // 2] + width_m / 2.0
    first = np.floor(low_m / MODULE_SIDE_M + 1e-5).astype(np.intp)
    after = np.ceil(high_m / MODULE_SIDE_M - 1e-5).astype(np.intp)
    return first.clip(0, count), after.clip(0, count)


@dataclass(frozen=True)
class ReachQuery:
    """The input of the computation of a vehicle's reach.

    Attributes:
        width_m: Side of the vehicle's square.
        entries_m: Strips of its entries, just inside the border.
        closed_m: Obstacles that it must not cover.
        solid_m: Obstacles that it drives over, but on which no charge goes off.
        level_m: Rectangles with corners that add their x and y to the lattice of the charge.
    """

    site: Site
    width_m: float
    entries_m: tuple[Rectangle, ...]
    closed_m: tuple[Rectangle, ...]
    solid_m: tuple[Rectangle, ...]
    level_m: tuple[Rectangle, ...]

    @property
    def half(self) -> int:
        """Half of the vehicle's width, micrometres."""
        return steps_of(self.width_m) // 2

    @cached_property
    def ends(self) -> tuple[int, int]:
        """Width and height of the site, micrometres."""
        return steps_of(self.site.width_m), steps_of(self.site.height_m)

    @cached_property
    def boxes(self) -> tuple[Steps, Steps, Steps, Steps]:
        """Closed and solid obstacles, entries, and level rectangles, micrometres (boxes, 4)."""
        # Obstacles grow by half of the vehicle, which becomes a point (configuration space,
        # Lozano-Perez 1983); entries shrink. In whole micrometres, touching is exact.
        closed, solid = grown_steps(self.closed_m, self.half), grown_steps(self.solid_m, self.half)
        # The places nearest to a structure touch it, or are level with its corners.
        return closed, solid, grown_steps(self.entries_m, -self.half), grown_steps(self.level_m, 0)

    def answer(self) -> Reach:
        """Compute the reach of the vehicle."""
        from blast_env.vehicles.reach_kernels import (  # Numba takes long to import
            plane_of,
            reached_parts,
        )

        # 1. Obstacles and entries as boxes in whole micrometres.
        closed, solid, starts, level = self.boxes
        boxes = np.concatenate((closed, solid, starts))
        # 2. The edges of all boxes cut the plane into parts that are open or closed as a whole.
        (x, lattice_x), (y, lattice_y) = (
            plane_of(boxes, level, self.half, end, places_apart(end), axis)
            for axis, end in enumerate(self.ends)
        )
        # 3. The parts that are connected with an entry.
        start, reached, clear = reached_parts(x, y, closed, solid, starts)
        return Reach(
            width_m=self.width_m,
            x_m=x / PER_M,
            y_m=y / PER_M,
            start=start,
            reached=reached,
            clear=clear,
            lattice_x_m=lattice_x / PER_M,
            lattice_y_m=lattice_y / PER_M,
        )


def steps_of(length_m: float) -> int:
    """Return a length in micrometres."""
    return round(length_m * PER_M)


def grown_steps(rectangles_m: Iterable[Rectangle], by: int) -> Steps:
    """Return left, bottom, right and top of rectangles, grown on all sides (rectangles, 4)."""
    sides_m = np.array([*rectangles_m], dtype=np.float64).reshape(-1, 4)
    steps = np.rint(sides_m * PER_M).astype(np.int64)  # as `steps_of`
    grown: Steps = steps + np.array((-by, -by, by, by))
    return grown


def places_apart(end: int) -> int:
    """Return the spacing of regular places of the charge on a side of the site, micrometres."""
    module = steps_of(MODULE_SIDE_M)
    return module * ceil(end / module / _MOST_STEPS)
