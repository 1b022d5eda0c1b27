"""Bodies of models and drawings as the parts of a building: outline, underside and top.

A building of several heights, such as a tower on a podium, has a part for each.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import BoolArray, FloatArray
from blast_env.io.importing.outlines import areas_of

LEAST_STOREY_M: Final = 1.5
"""Least height of a storey: what is lower is no building, and tops that differ by less are one."""

_GRID_M: Final = 1e-4  # of unions, so that the triangles of a plane meet
_LEAST_FACE_M2: Final = 1e-6
_GAP_M: Final = 0.3  # between walls and slabs
_THIN_M: Final = 0.5 * LEAST_STOREY_M
_ROUNDING_M: Final = 0.05
_LEAST_M2: Final = 0.01
_HALF: Final = 0.5
_HAIR_M: Final = 1e-3
_NOISE_M: Final = 5e-3
_MITRE: Final = 1.5  # a right angle has 1.41


@dataclass(frozen=True)
class BodyPart:
    """A part of a building.

    Attributes:
        outline: Its outline, m.
        base_m: Height of its underside.
        top_m: Height of its top.
    """

    outline: BaseGeometry
    base_m: float
    top_m: float


@dataclass(frozen=True)
class Faces:
    """Faces of bodies as they are seen from above.

    Attributes:
        plans: Their areas in plan, m, or lines of vertical faces, (n,).
        low_m: Their lowest heights, (n,).
        high_m: Their highest ones, (n,).
    """

    plans: NDArray[np.object_]
    low_m: FloatArray
    high_m: FloatArray

    @classmethod
    def of(cls, corners_m: Sequence[FloatArray]) -> "Faces":
        """Return the faces with these corners, each (k, 3), k at least 3."""
        plans = np.empty(len(corners_m), dtype=object)
        plans[:] = [_plan(face_m[:, :2]) for face_m in corners_m]
        low_m = np.array([face_m[:, 2].min() for face_m in corners_m])
        return cls(plans, low_m, np.array([face_m[:, 2].max() for face_m in corners_m]))

    @classmethod
    def of_rings(cls, rings_m: Sequence[Sequence[FloatArray]]) -> "Faces":
        """Return the faces with these outer borders and holes, each (k, 3), k at least 3."""
        faces = cls.of([outer_m for outer_m, *_ in rings_m])
        for number, (_, *holes_m) in enumerate(rings_m):
            if holes_m and shapely.get_dimensions(faces.plans[number]) == 2:
                holes = shapely.union_all([_plan(hole_m[:, :2]) for hole_m in holes_m])
                faces.plans[number] = _without(faces.plans[number], holes)
        return faces

    @classmethod
    def of_triangles(cls, corners_m: FloatArray) -> "Faces":
        """Return the faces with these corners, (n, 3, 3)."""
        plans = np.asarray(shapely.polygons(corners_m[:, :, :2]), dtype=object)
        flat = shapely.area(plans) <= _LEAST_FACE_M2
        sides = np.stack([corners_m[flat], np.roll(corners_m[flat], -1, axis=1)], axis=2)[..., :2]
        longest = np.hypot(*np.diff(sides, axis=2)[:, :, 0].transpose(2, 0, 1)).argmax(axis=1)
        plans[flat] = shapely.linestrings(sides[np.arange(len(sides)), longest])
        return cls(plans, corners_m[:, :, 2].min(axis=1), corners_m[:, :, 2].max(axis=1))

    @classmethod
    def joined(cls, several: Iterable["Faces"]) -> "Faces":
        """Return the faces of several bodies."""
        found = [cls.of([]), *several]
        return cls(
            *(np.concatenate([getattr(faces, key.name) for faces in found]) for key in fields(cls))
        )

    @property
    def is_area(self) -> BoolArray:
        """Whether each is more than a line in plan."""
        return np.asarray(shapely.get_dimensions(self.plans) == 2)

    @property
    def shadow(self) -> BaseGeometry:
        """The area below all."""
        return self._union(np.ones(len(self.plans), dtype=bool))

    def _union(self, chosen: BoolArray) -> BaseGeometry:
        return shapely.union_all(self.plans[chosen & self.is_area], grid_size=_GRID_M)

    def parts(
        self,
        ground_m: float,
        feet: Sequence[BaseGeometry],
        least_m2: float,
        least_height_m: float = LEAST_STOREY_M,
    ) -> list[BodyPart]:
        """Return the parts of the building that has these faces, the highest first.

        1. Tops within a storey are one level. From the highest level on, a part is what is below
           its faces but not below a higher part. A chimney, smaller than the least area, is none.
           A storey without a roof has its walls for one.
        2. A part is raised where nothing that stands on the ground is around, and its faces are
           more than a storey above the ground: a storey over a passage, a canopy. Raised strips
           narrower than a storey, such as eaves, are no part.

        Args:
            ground_m: Height of the ground.
            feet: Walls, posts and other areas or lines in plan that stand on the ground.
            least_height_m: Least height of its top above the ground.
        """
        inside = enclosed(feet)
        found = []
        for outline, top_m in self._levels(ground_m + least_height_m, least_m2):
            stands = common(outline, inside)
            for piece, is_thin in _pieces(_without(outline, inside)):
                base_m = self._base_m(piece, ground_m, top_m)
                if base_m is None:
                    stands = shapely.union(stands, piece)
                elif not is_thin:
                    found.append(BodyPart(_apart(piece), base_m, top_m))
            stands = areas_of(stands)
            if stands.area > _LEAST_M2:
                found.append(BodyPart(_apart(stands), ground_m, top_m))
        return found

    def _levels(self, above_m: float, least_m2: float) -> Iterator[tuple[BaseGeometry, float]]:
        """Yield the outlines of parts with their tops above a height, the highest first."""
        left = self.is_area & (self.high_m > above_m)
        higher: BaseGeometry = shapely.Polygon()
        while left.any():
            level = left & (self.high_m > self.high_m[left].max() - LEAST_STOREY_M)
            left &= ~level
            shape = _closed(shapely.union(higher, self._union(level)))
            for walls in shapely.get_parts(_without(shape, higher)):
                outline = self._roofed(walls, above_m, float(self.high_m[level].max()))
                if outline.area >= least_m2:
                    higher = shapely.union(higher, outline, grid_size=_GRID_M)
                    yield outline, float(self.high_m[level & self._over(outline)].max())

    def _roofed(self, walls: BaseGeometry, above_m: float, top_m: float) -> BaseGeometry:
        """Return thin walls with the storey that they enclose, if it has a floor above the ground.

        Models without a roof are of such walls.
        """
        holes = shapely.get_rings(walls)[1:]
        if not len(holes) or not shapely.buffer(walls, -_THIN_M).is_empty:
            return walls
        floor = self._union((self.high_m > above_m) & (self.high_m < top_m - LEAST_STOREY_M))
        rooms = [
            room
            for room in np.atleast_1d(np.asarray(shapely.polygons(holes)))
            if common(room, floor).area > _HALF * room.area
        ]
        return areas_of(shapely.union_all([walls, *rooms], grid_size=_GRID_M))

    def _over(self, piece: BaseGeometry) -> BoolArray:
        """Return which faces are over a piece, not only over its border."""
        inner: BaseGeometry = shapely.buffer(piece, -_ROUNDING_M)
        inner = piece if inner.is_empty else inner
        shapely.prepare(inner)
        return self.is_area & shapely.intersects(inner, self.plans)

    def _base_m(self, piece: BaseGeometry, ground_m: float, top_m: float) -> float | None:
        """Return the underside of a piece; `None` if it stands on the ground."""
        low_m = float(self.low_m[self._over(piece) & self._is_high(ground_m)].min(initial=top_m))
        is_raised = ground_m + LEAST_STOREY_M < low_m < top_m - _ROUNDING_M
        return low_m if is_raised else None

    def _is_high(self, ground_m: float) -> BoolArray:
        """Return which faces are no paving."""
        return np.asarray(self.high_m > ground_m + LEAST_STOREY_M)


def common(one: BaseGeometry, other: BaseGeometry) -> BaseGeometry:
    """Return the common area of two, without the lines and points where they only touch."""
    return areas_of(shapely.intersection(one, other))


def _without(one: BaseGeometry, other: BaseGeometry) -> BaseGeometry:
    """Return the area of one without that of another."""
    # Where borders in any direction run together, the difference has lines too.
    return areas_of(shapely.difference(one, other))


def _plan(corners_m: FloatArray) -> BaseGeometry:
    """Return the area of a face in plan, or the line of a vertical one."""
    area = shapely.Polygon(corners_m)
    if area.is_valid and area.area > _LEAST_FACE_M2:
        return area
    if area.area > _LEAST_FACE_M2:
        return areas_of(shapely.make_valid(area))
    first = corners_m[np.hypot(*(corners_m - corners_m[0]).T).argmax()]
    return shapely.LineString([first, corners_m[np.hypot(*(corners_m - first).T).argmax()]])


def _closed(shape: BaseGeometry) -> BaseGeometry:
    """Return a shape without narrow gaps, as between walls and slabs."""
    wider = shapely.buffer(shape, 0.5 * _GAP_M, join_style="mitre")
    return areas_of(shapely.buffer(wider, -0.5 * _GAP_M, join_style="mitre"))


def _apart(shape: BaseGeometry) -> BaseGeometry:
    """Return a shape that no rounding makes cross itself.

    It has no places where it meets itself, and no corners as near to each other as those that
    unions of turned faces leave.
    """
    inner = shapely.buffer(shape, -_HAIR_M, join_style="mitre")
    outer = shapely.buffer(inner, _HAIR_M, join_style="mitre")
    return areas_of(shapely.simplify(outer, _NOISE_M))


def enclosed(feet: Sequence[BaseGeometry]) -> BaseGeometry:
    """Return the areas that walls and posts enclose; doors and gaps to two storeys are closed."""
    plans = np.array([*feet], dtype=object)
    is_area = shapely.get_dimensions(plans) == 2
    areas = shapely.union_all(plans[is_area], grid_size=_GRID_M)
    lines = shapely.buffer(plans[~is_area], LEAST_STOREY_M, join_style="mitre", cap_style="square")
    # A long mitre, as at the tip of a triangle, would reach across a passage.
    around = shapely.buffer(areas, LEAST_STOREY_M, join_style="mitre", mitre_limit=_MITRE)
    wide = shapely.union_all([around, *lines])
    parts = shapely.get_parts(wide)
    filled = shapely.union_all(shapely.polygons(shapely.get_exterior_ring(parts)))
    return shapely.buffer(filled, -LEAST_STOREY_M, join_style="mitre")


def _pieces(shape: BaseGeometry) -> Iterator[tuple[BaseGeometry, bool]]:
    """Yield the parts of a shape that are wide, and those that are narrower than a storey."""
    inner = shapely.buffer(shape, -_THIN_M, join_style="mitre")
    wide = common(shapely.buffer(inner, _THIN_M, join_style="mitre"), shape)
    for area, is_thin in ((wide, False), (_without(shape, wide), True)):
        for piece in shapely.get_parts(area):
            yield piece, is_thin
