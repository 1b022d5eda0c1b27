"""Bays: the divisions of a building's walls by storeys and axes.

A bay is one storey high and about one module of the facade wide.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import floor
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle, WallLine

STOREY_M = 3.5
"""Default height of a storey."""

BAY_M = 3.0
"""Default width of a bay."""

_ROUNDING: Final = 1e-9


@dataclass(frozen=True)
class Bay:
    """A part of a wall.

    Attributes:
        wall: The side that it faces: west, east, south or north.
        storey: Counted from 1 at the ground.
        number: Counted from 1 along the wall, from west to east or from south to north; for a
            polygon around it, over all walls that mostly face this side.
        left_m: Its beginning along the wall: x or y on the site, or the distance from the start of
            the wall of a polygon.
        right_m: Its end along the wall.
        floor_m: Height of its floor above the ground.
        top_m: Height of its upper edge.
        line_number: Index of the wall of a polygon; `None` for a rectangle.
    """

    structure: str
    wall: str
    storey: int
    number: int
    left_m: float
    right_m: float
    floor_m: float
    top_m: float
    line_number: int | None = None
    line: WallLine | None = None

    @property
    def name(self) -> str:
        """`office/west/2/5`: structure, wall, storey, number."""
        return f"{self.structure}/{self.wall}/{self.storey}/{self.number}"

    @property
    def width_m(self) -> float:
        """Its width."""
        return self.right_m - self.left_m

    @property
    def height_m(self) -> float:
        """Its height."""
        return self.top_m - self.floor_m

    @property
    def area_m2(self) -> float:
        """Its area."""
        return self.width_m * self.height_m


def floors_m(rise_m: float, storey_m: float = STOREY_M, storeys: int | None = None) -> list[float]:
    """Return the heights of the floors above the base, m, the ground floor's first.

    The ground floor has the remaining height if the storeys do not fill the building.

    Args:
        storey_m: Height of the other storeys.
        storeys: Number of storeys, which then are equally high.
    """
    if storeys is not None:
        storey_m = rise_m / storeys
    # As many whole storeys as fit; what is left over is on the ground floor, where entrances are
    # high.
    count = max(1, floor(rise_m / storey_m + _ROUNDING))
    ground_m = max(rise_m - storey_m * (count - 1), storey_m)
    return [0.0] + [ground_m + storey_m * number for number in range(count - 1)]


def bays_in(
    ground_m: Rectangle,
    rise_m: float,
    walls: Sequence[str],
    storey_m: float,
    bay_m: float,
    lines: Sequence[WallLine] = (),
    storeys: int | None = None,
) -> int:
    """Return the number of bays that `divide` makes, from the rise between base and top."""
    along = (
        _bays_along(high - low, bay_m)
        for wall in walls
        for *_, low, high in _stretches(ground_m, wall, lines)
    )
    return len(floors_m(rise_m, storey_m, storeys)) * sum(along)


def _bays_along(length_m: float, bay_m: float) -> int:
    return max(1, round(length_m / bay_m))


def divide(
    structure: str,
    ground_m: Rectangle,
    height_m: float,
    walls: Sequence[str],
    storey_m: float = STOREY_M,
    bay_m: float = BAY_M,
    base_m: float = 0.0,
    lines: Sequence[WallLine] = (),
    storeys: int | None = None,
) -> tuple[Bay, ...]:
    """Return the bays of a building, wall by wall, storey by storey.

    The bays of a wall have equal widths, as close as possible to `bay_m`.

    Args:
        ground_m: Its outline on the ground.
        height_m: Height of its top above the ground.
        walls: The walls to divide, of west, east, south, north.
        storey_m: Height of a storey, see `floors_m`.
        bay_m: Intended width of a bay.
        base_m: Height of its base above the ground.
        lines: The walls of a polygon; without them it is a block with four walls.
        storeys: Number of storeys of equal height, in the place of `storey_m`.

    Raises:
        BlastEnvError: If a size is not positive.
    """
    rise_m = height_m - base_m
    for name, value in (("height_m", rise_m), ("storey_m", storey_m), ("bay_m", bay_m)):
        if not value > 0.0:
            raise BlastEnvError(f"facade of {structure!r}: {name} is {value}, must be above 0")
    # 1. Floors; 2. along each wall, bays of equal width; 3. one bay for each floor and part.
    levels_m = floors_m(rise_m, storey_m, storeys)
    floors = [base_m + level_m for level_m in levels_m] + [height_m]
    bays: list[Bay] = []
    for wall in walls:
        before = 0
        for line_number, line, low, high in _stretches(ground_m, wall, lines):
            # Bays of a polygon's side are counted on over all of its walls.
            count = _bays_along(high - low, bay_m)
            ends = np.linspace(low, high, count + 1).tolist()
            bays += [
                Bay(
                    structure,
                    wall,
                    storey + 1,
                    before + number + 1,
                    ends[number],
                    ends[number + 1],
                    floors[storey],
                    floors[storey + 1],
                    line_number,
                    line,
                )
                for storey in range(len(levels_m))
                for number in range(count)
            ]
            before += count
    return tuple(bays)


def _stretches(
    ground_m: Rectangle, side: str, lines: Sequence[WallLine]
) -> Iterator[tuple[int | None, WallLine | None, float, float]]:
    """Yield number and line of each wall on a side, and its ends; of a block, the side itself."""
    if lines:
        own = ((number, line) for number, line in enumerate(lines) if line.side == side)
        yield from ((number, line, 0.0, line.length_m) for number, line in own)
    elif side in ("west", "east"):
        yield None, None, ground_m.bottom, ground_m.top
    else:
        yield None, None, ground_m.left, ground_m.right
