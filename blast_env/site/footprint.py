"""Footprints of buildings: polygons, rasterised once to modules, with walls along their edges.

A module belongs to a footprint if its centre does. So modules of adjoining buildings neither
overlap nor leave a gap, and their area is that of the polygon on average. Engines use the modules;
loads are along the normals of the walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
import shapely

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Cell, Place, Rectangle, WallLine, fewest_runs
from blast_env.units import MODULE_SIDE_M

Ring = tuple[Place, ...]
"""Corners of a closed line; the last one is joined to the first."""

_MOST_BEND_M: Final = 0.5 * MODULE_SIDE_M
"""Largest distance of a corner from a wall that passes it by: modules resolve no more."""

_OFF_CENTRE_M: Final = (1e-7, 1.7e-7)  # so that no centre lies on an edge
_LEAST_COSINE: Final = 1e-9
_TIE_M: Final = 1e-3  # advantage of a wall that a face is parallel to
_PAIRS: Final = 2**21


@dataclass(frozen=True, eq=False)
class Footprint:
    """A polygon in plan with its modules and walls.

    Attributes:
        rings: The outline counterclockwise, then the courtyards clockwise.
    """

    rings: tuple[Ring, ...]

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The polygon."""
        return shapely.Polygon(self.rings[0], self.rings[1:])

    @property
    def area_m2(self) -> float:
        """Area of the polygon."""
        return float(self.polygon.area)

    @cached_property
    def grid(self) -> tuple[Place, BoolArray]:
        """Lower left corner of the modules, and where there is one (rows, columns)."""
        left, bottom, right, top = (bound / MODULE_SIDE_M for bound in self.polygon.bounds)
        first = int(np.floor(left)), int(np.floor(bottom))
        columns, rows = int(np.ceil(right)) - first[0], int(np.ceil(top)) - first[1]
        x_m = MODULE_SIDE_M * (first[0] + np.arange(columns) + 0.5) + _OFF_CENTRE_M[0]
        y_m = MODULE_SIDE_M * (first[1] + np.arange(rows) + 0.5) + _OFF_CENTRE_M[1]
        # A module belongs to the polygon if its centre does; centres are a little off the grid, so
        # that none lies on an outline along it.
        shapely.prepare(self.polygon)
        filled = shapely.contains_xy(self.polygon, x_m[np.newaxis], y_m[:, np.newaxis])
        used = [np.flatnonzero(filled.any(axis=axis)) for axis in (1, 0)]
        if not len(used[0]):
            return (first[0] * MODULE_SIDE_M, first[1] * MODULE_SIDE_M), filled[:0, :0]
        (low, high), (begin, end) = ((int(name[0]), int(name[-1]) + 1) for name in used)
        corner_m = MODULE_SIDE_M * (first[0] + begin), MODULE_SIDE_M * (first[1] + low)
        return corner_m, filled[low:high, begin:end]

    @property
    def corner_m(self) -> Place:
        """Lower left corner of the grid of its modules."""
        return self.grid[0]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of that grid."""
        rows, columns = self.grid[1].shape
        return rows, columns

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Rows and columns of its modules, row by row."""
        return tuple((row, column) for row, column in np.argwhere(self.grid[1]).tolist())

    @cached_property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """Few rectangles that together are its modules."""
        left, bottom = self.corner_m
        return tuple(
            Rectangle(
                left + column * MODULE_SIDE_M,
                bottom + row * MODULE_SIDE_M,
                left + (column + columns) * MODULE_SIDE_M,
                bottom + (row + rows) * MODULE_SIDE_M,
            )
            for row, column, rows, columns in fewest_runs(self.grid[1]).tolist()
        )

    @cached_property
    def walls(self) -> tuple[WallLine, ...]:
        """Its walls: the edges of its rings, with bends finer than the modules straightened."""
        most_m = min(_MOST_BEND_M, 0.5 * self.area_m2 / float(self.polygon.length))
        return tuple(
            WallLine(start, end)
            for ring in self.rings
            for corners in [_straightened(ring, most_m)]
            for start, end in zip(corners, (*corners[1:], corners[0]), strict=True)
        )

    def walls_of(self, centres_m: FloatArray, outwards: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the wall of each face of modules or cells, and the cosine between their normals.

        It is the nearest wall that faces the same way. The cosine is the area of the wall per area
        of the face.

        Args:
            centres_m: Centres of the faces in plan (n, 2).
            outwards: Their normals in plan (n, 2).
        """
        # 1. Equal places of a column of faces once: walls are upright, so that heights do not
        # matter.
        faces = np.asarray(np.round(np.hstack((centres_m, outwards)), 9), dtype=np.float64)
        places, owner = np.unique(faces, axis=0, return_inverse=True)
        number = np.zeros(len(places), dtype=np.int64)
        normals = np.array([wall.normal for wall in self.walls]).T
        step = max(_PAIRS // len(self.walls), 1)
        for first in range(0, len(places), step):
            some: FloatArray = places[first : first + step]
            # 2. The nearest of the walls that look the same way; of two equally near ones the more
            # parallel.
            cosines = some[:, 2:] @ normals
            away_m = np.stack([wall.distances_m(some[:, :2]) for wall in self.walls], axis=1)
            away_m = np.where(cosines > _LEAST_COSINE, away_m - _TIE_M * cosines, np.inf)
            number[first : first + step] = away_m.argmin(axis=1)
        cosine = (places[:, 2:] * normals.T[number]).sum(axis=1)
        owner = owner.ravel()
        return number[owner], np.clip(cosine, _LEAST_COSINE, 1.0)[owner]


def footprint_problem(outline_m: Sequence[Place], courtyards_m: Sequence[Sequence[Place]]) -> str:
    """Return the reason why rings are no footprint, or an empty text."""
    for words, ring in (
        ("the outline", outline_m),
        *(
            (f"courtyard {number}", courtyard_m)
            for number, courtyard_m in enumerate(courtyards_m, start=1)
        ),
    ):
        if len(set(ring)) < 3:
            return f"{words} has {len(set(ring))} different corners, must have at least 3"
        reason = shapely.is_valid_reason(shapely.Polygon(ring))
        if reason != "Valid Geometry":
            return f"{words} {_in_words(reason)}"
    whole = shapely.Polygon(outline_m, courtyards_m)
    reason = shapely.is_valid_reason(whole)
    if reason != "Valid Geometry":
        return (
            f"a courtyard must lie inside the outline and apart from the others: {_place(reason)}"
        )
    return ""


def _in_words(reason: str) -> str:
    kind = "crosses or touches itself" if "ntersection" in reason else "encloses no area"
    return f"{kind} {_place(reason)}".strip()


def _place(reason: str) -> str:
    """Return the place in an explanation of shapely: `Self-intersection[3 4]`."""
    _, bracket, rest = reason.partition("[")
    values = rest.rstrip("]").split()
    return f"at ({', '.join(f'{float(value):g}' for value in values[:2])}) m" if bracket else reason


@lru_cache(maxsize=512)
def footprint_of(outline_m: Ring, courtyards_m: tuple[Ring, ...] = ()) -> Footprint:
    """Return the footprint of an outline with courtyards, cached.

    Args:
        outline_m: Corners of the outline, in either order.
        courtyards_m: Corners of the courtyards.
    """
    problem = footprint_problem(outline_m, courtyards_m)
    if problem:
        raise BlastEnvError(problem)
    outer = _turned(outline_m, is_left=True)
    return Footprint(
        (outer, *(_turned(courtyard_m, is_left=False) for courtyard_m in courtyards_m))
    )


def _turned(ring: Ring, *, is_left: bool) -> Ring:
    """Return a ring counterclockwise or clockwise, without repeated corners."""
    kept = [
        point for point, after in zip(ring, (*ring[1:], ring[0]), strict=True) if point != after
    ]
    counterclockwise = bool(shapely.is_ccw(shapely.LinearRing(kept)))
    return tuple(kept) if counterclockwise == is_left else tuple(reversed(kept))


def _straightened(ring: Ring, most_m: float) -> Ring:
    """Return the corners of a ring without bends of less than a distance.

    The corners farthest from the middle and from each other stay.
    """
    places = np.array(ring)
    # Douglas and Peucker's simplification keeps the ends of a line: a ring is cut into two lines
    # at corners that are surely corners.
    first = int(np.hypot(*(places - places.mean(axis=0)).T).argmax())
    places = np.roll(places, -first, axis=0)
    middle = int(np.hypot(*(places - places[0]).T).argmax())
    chains = places[: middle + 1], np.vstack((places[middle:], places[:1]))
    corners = [
        corner
        for chain in chains
        for corner in shapely.get_coordinates(
            shapely.simplify(shapely.LineString(chain), most_m, preserve_topology=False)
        ).tolist()[:-1]
    ]
    if len(corners) < 3:
        return ring
    return tuple((float(x), float(y)) for x, y in corners)
