"""Points that represent the protected walls of a site."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.bays import Bay
from blast_env.geometry import OUTWARDS, WallLine
from blast_env.site import AnyStructure
from blast_env.units import MODULE_SIDE_M


class Spacing(NamedTuple):
    """How far apart points are; farther where there would be too many.

    Attributes:
        along_m: Spacing along a wall.
        up_m: Spacing up a wall.
        most_points: Approximate largest number of points on all walls of a site. More cost time
            and do not change the loads, since large walls are far away.
    """

    along_m: float
    up_m: float
    most_points: int


CLOSE: Final = Spacing(1.0, 1.5, 250)
"""Spacing for peaks, which are local, and for the data of a fit."""

WIDE: Final = Spacing(1.5, 2.0, 125)
"""Spacing for the mean impulse alone: half as many points, errors hardly larger."""

_BEFORE_M: Final = 0.05
"""Distance of points in front of their wall, so that the wall does not obstruct their paths."""


class WallPoints(NamedTuple):
    """Points that represent the protected walls.

    Attributes:
        starts: Index of the first point of each structure (structures,).
        parts: The same of each part that has a load of its own: a bay, or a structure without bays
            (parts,).
        points_m: Positions (points, 3).
        outward: Outward normals of their walls, in plan (points, 2).
        area_m2: Wall area represented by each point (points,).
        to_edge_m: Distance to the nearest vertical edge of the wall (points,).
        to_roof_m: Distance to the roof (points,).
    """

    starts: IntArray
    parts: IntArray
    points_m: FloatArray
    outward: FloatArray
    area_m2: FloatArray
    to_edge_m: FloatArray
    to_roof_m: FloatArray

    @classmethod
    def on(
        cls,
        structures: Sequence[AnyStructure],
        air_m: float,
        spacing: Spacing = CLOSE,
        bays: Sequence[Bay] = (),
    ) -> "WallPoints":
        """Place points on structures.

        Args:
            structures: The structures.
            air_m: Height of structures without a height of their own.
            spacing: About how far apart the points are.
            bays: Bays that have points of their own, those of a structure one after the other.
        """
        heights_m = [structure.height_m or air_m for structure in structures]
        own = _widened(spacing, structures, heights_m)
        tables: list[FloatArray] = []
        first_parts = []
        for structure, height_m in zip(structures, heights_m, strict=True):
            first_parts.append(len(tables))
            of_structure = [bay for bay in bays if bay.structure == structure.name]
            tables += [_on_bay(bay, structure, height_m, own) for bay in of_structure]
            if not of_structure:
                tables.append(_on_structure(structure, height_m, own))
        parts: IntArray = np.cumsum([0, *(len(table) for table in tables[:-1])])
        table = np.concatenate(tables) if tables else np.empty((0, 8))
        places_m, outward = (np.ascontiguousarray(item) for item in (table[:, :3], table[:, 3:5]))
        columns = (np.ascontiguousarray(table[:, column]) for column in (5, 6, 7))
        return cls(parts[first_parts], parts, places_m, outward, *columns)


Wall = tuple[float, tuple[float, float], WallLine | None]
"""Length, m, outward normal and, of a polygon, line of a wall."""

Range = tuple[float, float]
"""Two ends, m."""


def _on_structure(structure: AnyStructure, height_m: float, spacing: Spacing) -> FloatArray:
    """Return position, outward normal, area, and distances to edge and roof (points, 8)."""
    rise_m = structure.base_m, height_m
    tables = [
        _on_part(structure, wall, (0.0, wall[0]), rise_m, spacing) for wall in walls_of(structure)
    ]
    return np.concatenate(tables)


def _on_bay(bay: Bay, structure: AnyStructure, height_m: float, spacing: Spacing) -> FloatArray:
    """Return the same of the points on a bay, whose edge and roof are those of its wall."""
    left, bottom, right, top = structure.rectangle_m
    if bay.line is not None:
        wall: Wall = bay.line.length_m, bay.line.normal, bay.line
        begin_m = 0.0
    else:
        outward = OUTWARDS[bay.wall]
        wall = (top - bottom if outward[0] else right - left), outward, None
        begin_m = bottom if outward[0] else left
    along_m = bay.left_m - begin_m, bay.right_m - begin_m
    table = _on_part(structure, wall, along_m, (bay.floor_m, bay.top_m), spacing)
    table[:, 7] += height_m - bay.top_m
    return table


def _on_part(
    structure: AnyStructure, wall: Wall, along_m: Range, rise_m: Range, spacing: Spacing
) -> FloatArray:
    """Return the same of the points on a part of a wall, between its ends and heights."""
    # 1. Levels of points over the height; 2. along the wall, points in the middle of equal parts,
    # in the air before it.
    left, bottom, right, top = structure.rectangle_m
    length_m, (x_out, y_out), line = wall
    wide_m, high_m = along_m[1] - along_m[0], rise_m[1] - rise_m[0]
    levels = max(1, round(high_m / spacing.up_m))
    number = max(1, round(wide_m / spacing.along_m))
    z_m = rise_m[0] + (np.arange(levels) + 0.5) * high_m / levels
    area_m2 = wide_m * high_m / (number * levels)
    rows = []
    for at_m in along_m[0] + (np.arange(number) + 0.5) * wide_m / number:
        if line is not None:
            before_m = MODULE_SIDE_M if line.is_oblique else _BEFORE_M  # of the steps
            x_m, y_m = line.point_at(at_m) + before_m * np.array(line.normal)
        elif x_out:
            x_m, y_m = (left if x_out < 0 else right) + _BEFORE_M * x_out, bottom + at_m
        else:
            x_m, y_m = left + at_m, (bottom if y_out < 0 else top) + _BEFORE_M * y_out
        edge_m = min(at_m, length_m - at_m)
        rows += [(x_m, y_m, z, x_out, y_out, area_m2, edge_m, rise_m[1] - z) for z in z_m]
    return np.array(rows)


def walls_of(structure: AnyStructure) -> Iterator[Wall]:
    """Yield the counted walls of a structure."""
    left, bottom, right, top = structure.rectangle_m
    if structure.footprint is not None:
        own = (wall for wall in structure.footprint.walls if wall.side in structure.faces)
        yield from ((wall.length_m, wall.normal, wall) for wall in own)
        return
    for face in structure.faces:
        yield top - bottom if OUTWARDS[face][0] else right - left, OUTWARDS[face], None


def _widened(
    spacing: Spacing, structures: Sequence[AnyStructure], heights_m: Sequence[float]
) -> Spacing:
    """Return the spacing that keeps the number of points near its largest one."""
    # Points are per area: their number falls with the square of their distance.
    area_m2 = 0.0
    for structure, height_m in zip(structures, heights_m, strict=True):
        area_m2 += height_m * sum(length_m for length_m, *_ in walls_of(structure))
    along_m, up_m, most = spacing
    factor = float(max(1.0, (area_m2 / (along_m * up_m * most)) ** 0.5))
    return Spacing(along_m * factor, up_m * factor, most)
