"""What lies where on the squares of 0.5 m that a site is drawn on."""

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.scenario import AnySource, RectangleSource, Site
from blast_env.scenario.sections import PointM
from blast_env.scenario.vehicles import squares_of
from blast_env.units import MODULE_SIDE_M

Plane = NDArray[np.float32]


_POINTS_PER_MODULE: Final = 8  # along a segment where a charge may be


@dataclass(frozen=True)
class SiteGrid:
    """Planes of (rows, columns) squares of 0.5 m; row 0 is the lower edge of the site.

    Attributes:
        rows: Squares upwards.
        columns: Squares to the right.
    """

    rows: int
    columns: int

    @classmethod
    def of(cls, site: Site) -> "SiteGrid":
        """Return the grid of a site; the last squares jut out of one that is no whole number."""
        return cls(*squares_of(site))

    def lattice(self, corner_m: tuple[float, float], rows: int, columns: int) -> "Lattice":
        """Return where a lattice of modules lies on the grid.

        Args:
            corner_m: Its lower left corner.
            rows: Modules upwards.
            columns: Modules to the right.
        """
        return Lattice(
            _shares(self.rows, corner_m[1], rows), _shares(self.columns, corner_m[0], columns)
        )

    def rectangle(self, rectangle_m: Rectangle) -> Plane:
        """Return the share of each square that a rectangle covers, (rows, columns)."""
        left, bottom, right, top = rectangle_m
        along_y = _covered(self.rows, np.array([bottom]), np.array([top]))
        along_x = _covered(self.columns, np.array([left]), np.array([right]))
        return (along_y @ along_x.T).astype(np.float32)

    def source(self, source: AnySource) -> Plane:
        """Return how likely the charge of a source is in each square, (rows, columns).

        The plane adds up to 1. A point is shared between the four squares around it such that
        their mean place is the point's. That of a vehicle is where it enters.
        """
        if isinstance(source, RectangleSource):
            plane = self.rectangle(source.rectangle_m)
        else:
            plane = np.sum([self._line(*ends_m) for ends_m in source.lines_m], axis=0)
        # A narrow rectangle covers next to nothing of its squares, which rounding must not lose.
        return plane / np.float32(plane.sum(dtype=np.float64))

    def _line(self, start_m: PointM, end_m: PointM) -> Plane:
        """Return points close to each other along a line."""
        start, end = np.array(start_m), np.array(end_m)
        length_m = float(np.hypot(*(end - start)))
        count = 1 + _POINTS_PER_MODULE * ceil(length_m / MODULE_SIDE_M)
        share = (np.arange(count) + 0.5) / count
        return self._points(start + share[:, np.newaxis] * (end - start))

    def _points(self, points_m: NDArray[np.float64]) -> Plane:
        """Return points (n, 2), each shared between the four squares around it."""
        plane = np.zeros((self.rows, self.columns), dtype=np.float32)
        places = points_m[:, ::-1] / MODULE_SIDE_M - 0.5
        low = np.floor(places).astype(int)
        beyond = places - low
        for up in (0, 1):
            for right in (0, 1):
                row = np.clip(low[:, 0] + up, 0, self.rows - 1)
                column = np.clip(low[:, 1] + right, 0, self.columns - 1)
                along_y = beyond[:, 0] if up else 1.0 - beyond[:, 0]
                along_x = beyond[:, 1] if right else 1.0 - beyond[:, 1]
                np.add.at(plane, (row, column), along_y * along_x)
        return plane


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where a lattice of modules lies on the grid; modules on the 0.5 m grid fill one square each.

    Attributes:
        along_y: Share of each row of squares that each row of modules covers (grid rows, rows).
        along_x: The same for columns (grid columns, columns).
    """

    along_y: Plane
    along_x: Plane

    def plane(self, values: NDArray[np.generic]) -> Plane:
        """Return values of the modules (..., rows, columns) on the grid, by the area covered."""
        plane: Plane = self.along_y @ values.astype(np.float32) @ self.along_x.T
        return plane


def _shares(squares: int, start_m: float, modules: int) -> Plane:
    low_m = np.asarray(start_m + MODULE_SIDE_M * np.arange(modules), dtype=np.float64)
    return _covered(squares, low_m, low_m + MODULE_SIDE_M).astype(np.float32)


def _covered(
    squares: int, low_m: NDArray[np.float64], high_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the share of each square that each interval covers (squares, intervals)."""
    first = np.arange(squares)[:, np.newaxis]
    low, high = low_m / MODULE_SIDE_M, high_m / MODULE_SIDE_M
    common = np.minimum(first + 1, high) - np.maximum(first, low)
    # Rounded, so that what lies on the grid but for the last bit fills whole squares.
    covered: NDArray[np.float64] = np.round(np.clip(common, 0.0, 1.0), 9)
    return covered
