"""Oblique walls: sides of buildings of several parts that are staircases of modules.

Seen from one side, the first modules of a plan form a profile. A run of the profile is an oblique
wall if a straight line passes within one module of all its modules. Lines steeper than 45 degrees
are found from the adjacent side.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, IntArray
from blast_env.geometry import Rectangle
from blast_env.physics.scene import WallName
from blast_env.scenario.sections import AnyStructure, buildings_of
from blast_env.units import MODULE_SIDE_M

LEAST_STEPS: Final = 3
"""Least steps of an oblique wall."""

STEPPED: Final = (
    "an oblique wall is a staircase of modules: its loads are those along its own normal, with"
    " which components of 10 ms bend 3 to 7 % too far"
)
"""Note on a building with an oblique wall (`python -m studies.gas oblique`)."""


class Edge(NamedTuple):
    """A side of a module: the plan's row and column from the building's corner, and the wall."""

    row: int
    column: int
    wall: WallName


@dataclass(frozen=True)
class ObliqueWall:
    """A wall that is a staircase of modules.

    Attributes:
        building: Name of the building.
        corner_m: Lower left corner of the building's plan.
        normal: Unit normal in plan, out of the building.
        edges: The sides of modules that form it.
    """

    building: str
    corner_m: tuple[float, float]
    normal: tuple[float, float]
    edges: frozenset[Edge]


def oblique_walls(structures: Iterable[AnyStructure]) -> tuple[ObliqueWall, ...]:
    """Return the oblique walls of buildings.

    Args:
        structures: The structures; those of one building are combined in plan.
    """
    return tuple(
        wall
        for name, parts in buildings_of(structures).items()
        if len(parts) >= LEAST_STEPS
        for wall in _walls_of(name, [each.rectangle_m for each in parts])
    )


def stepped_buildings(structures: Iterable[AnyStructure]) -> frozenset[str]:
    """Return the names of the buildings with an oblique wall."""
    return frozenset(each.building for each in oblique_walls(structures))


def _walls_of(building: str, parts: list[Rectangle]) -> Iterator[ObliqueWall]:
    """Yield the oblique walls of a building, the longest first; no edge is in two of them."""
    around = Rectangle.around(parts)
    found = [each for side in _sides(_modules(parts, around)) for each in side.oblique()]
    taken: set[Edge] = set()
    for normal, edges in sorted(found, key=lambda each: -len(each[1])):
        own = edges - taken
        if 2 * len(own) > len(edges):
            taken |= own
            yield ObliqueWall(building, (around.left, around.bottom), normal, own)


def _modules(parts: list[Rectangle], around: Rectangle) -> BoolArray:
    """Return whether the parts of a building fill each module (rows, columns)."""

    def modules(length_m: float) -> int:
        return round(length_m / MODULE_SIDE_M)

    shape = modules(around.top - around.bottom), modules(around.right - around.left)
    filled = np.zeros(shape, dtype=bool)
    for left, bottom, right, top in parts:
        rows = slice(modules(bottom - around.bottom), modules(top - around.bottom))
        filled[rows, modules(left - around.left) : modules(right - around.left)] = True
    return filled


@dataclass(frozen=True, eq=False)
class _Side:
    """A plan seen from one side, turned so that this is the left one.

    Attributes:
        filled: Whether each module is filled (rows, columns).
        place: Row and column of each module in the plan (rows, columns, 2).
        front: The wall that faces this side.
        up: The wall that faces higher rows.
        down: The wall that faces lower rows.
        outwards: Direction in plan, x and y, of lower columns.
        upwards: Direction in plan of higher rows.
    """

    filled: BoolArray
    place: IntArray
    front: WallName
    up: WallName
    down: WallName
    outwards: tuple[int, int]
    upwards: tuple[int, int]

    def oblique(self) -> Iterator[tuple[tuple[float, float], frozenset[Edge]]]:
        """Yield normal and edges of each oblique wall, up to 45 degrees."""
        rows = np.flatnonzero(self.filled.any(axis=1))
        if not (np.diff(rows) == 1).all():
            return
        profile = self.filled[rows].argmax(axis=1)
        if np.abs(np.diff(profile)).sum() < LEAST_STEPS:
            return
        for first, last, slope in _straight_runs(profile):
            if abs(profile[last] - profile[first]) >= LEAST_STEPS and abs(slope) <= 1.0:
                normal = np.array(self.outwards) + slope * np.array(self.upwards)
                x, y = (normal / np.hypot(*normal)).tolist()
                yield (x, y), frozenset(self._edges(rows, profile, first, last, slope))

    def _edges(
        self, rows: IntArray, profile: IntArray, first: int, last: int, slope: float
    ) -> Iterator[Edge]:
        for index in range(first, last + 1):
            row, column = rows[index], profile[index]
            yield self._edge(row, column, self.front)
            after = profile[min(index + 1, len(profile) - 1)]
            if index < last or 0.0 < slope * (after - column) <= 1.0:
                for beside in range(column, after):
                    yield self._edge(row, beside, self.up)
                for beside in range(after, column):
                    yield self._edge(row + 1, beside, self.down)

    def _edge(self, row: int, column: int, wall: WallName) -> Edge:
        plan_row, plan_column = self.place[row, column].tolist()
        return Edge(plan_row, plan_column, wall)


def _sides(filled: BoolArray) -> tuple[_Side, ...]:
    """Return a plan seen from the west, the east, the south and the north."""
    place = np.moveaxis(np.indices(filled.shape), 0, -1)
    over, other = filled.T, place.transpose(1, 0, 2)
    return (
        _Side(filled, place, "west", "north", "south", (-1, 0), (0, 1)),
        _Side(filled[:, ::-1], place[:, ::-1], "east", "north", "south", (1, 0), (0, 1)),
        _Side(over, other, "south", "east", "west", (0, -1), (1, 0)),
        _Side(over[:, ::-1], other[:, ::-1], "north", "east", "west", (0, 1), (1, 0)),
    )


def _straight_runs(profile: IntArray) -> Iterator[tuple[int, int, float]]:
    """Yield first, last and slope of the longest straight runs of a profile.

    Each is extended backwards as far as it stays straight, so that neighbours overlap.
    """
    last, first = 0, 0
    bounds = (-np.inf, np.inf)
    while True:
        while last + 1 < len(profile):
            wider = _slopes(profile, last + 1, np.arange(first, last + 1), bounds)
            if not wider[0] < wider[1]:
                break
            bounds, last = wider, last + 1
        yield first, last, 0.5 * (bounds[0] + bounds[1]) if last > first else 0.0
        if last + 1 == len(profile):
            return
        last = last + 1
        first, bounds = last, (-np.inf, np.inf)
        while first:
            wider = _slopes(profile, first - 1, np.arange(first, last + 1), bounds)
            if not wider[0] < wider[1]:
                break
            bounds, first = wider, first - 1


def _slopes(
    profile: IntArray, new: int, known: IntArray, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Return the bounds of the slopes of lines within a module of known places and a new one."""
    along = new - known
    across = np.sign(along) * (profile[new] - profile[known])
    low = ((across - 1) / np.abs(along)).max()
    high = ((across + 1) / np.abs(along)).min()
    return max(bounds[0], float(low)), min(bounds[1], float(high))
