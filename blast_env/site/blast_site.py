"""The site of one blast: the input common to all engines, in metres."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cbrt, hypot, pi
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from blast_env.geometry import Cell, Rectangle, WallLine, WallName
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # shapely takes a tenth of a second to import
    from blast_env.site.footprint import Footprint

WALLS: Final[tuple[WallName, ...]] = ("west", "east", "south", "north")

OUTWARDS: Final[Mapping[str, tuple[float, float]]] = {
    "west": (-1.0, 0.0),
    "east": (1.0, 0.0),
    "south": (0.0, -1.0),
    "north": (0.0, 1.0),
}
"""Outward normal of each wall."""


TNT_KG_M3: Final = 1630.0
"""Density of a charge of TNT."""

BARRIER_NAME: Final = "barrier"
"""Name of the structure formed by the modules of a layout."""


def module_name(x_m: float, y_m: float) -> str:
    """Return the identifier of the module with this centre."""
    return f"x{x_m:.3f}_y{y_m:.3f}"


class Charge(NamedTuple):
    """One charge: its position in plan, its TNT-equivalent mass, and the height of its centre.

    The particle engines ignore the height; for gas dynamics, 0 is a charge on the ground.
    """

    position_m: tuple[float, float]
    tnt_kg: float
    height_m: float = 0.0

    @property
    def is_raised(self) -> bool:
        """Whether it is above the ground: higher than the radius of a sphere of TNT."""
        return self.height_m > cbrt(3.0 * self.tnt_kg / (4.0 * pi * TNT_KG_M3))


class Gauge(NamedTuple):
    """A place in the air at which the overpressure is recorded: x, y, height above the ground."""

    name: str
    position_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class BlastSite:
    """The site, charge and structures of a blast, common to all engines.

    Attributes:
        site_m: The simulated area.
        structures: The structures and, if there is one, the barrier.
        gauges: Virtual gauges; the particle engines ignore them.
        air_height_m: Height of the simulated air; the particle engines ignore it.
        build_zone: The whole build zone as if full of modules, independent of the layout; `None`
            without one. For gas dynamics only.
    """

    site_m: Rectangle
    charge: Charge
    structures: tuple["StructureOutline", ...]
    gauges: tuple[Gauge, ...] = ()
    air_height_m: float = 12.0
    build_zone: "StructureOutline | None" = None

    def scaled_distance(self, structure: "StructureOutline") -> float:
        """Return the scaled distance of a structure from the charge, m/kg^(1/3).

        The distance is that of its nearest point: in plan, and below its base or above its top.
        """
        distance_m = min(box.distance_to(self.charge.position_m) for box in structure.boxes_m)
        height_m, top_m = self.charge.height_m, structure.height_m or self.air_height_m
        up_m = max(structure.base_m - height_m, height_m - top_m, 0.0)
        return hypot(distance_m, up_m) / cbrt(self.charge.tnt_kg)


class Block(NamedTuple):
    """A single solid: a structure, a piece of a barrier, or a module.

    Attributes:
        name: Its name; empty for a module.
        rectangle_m: Its plan.
        height_m: Height of its top; `None` for as high as the air.
        base_m: Height of its base above the ground.
    """

    name: str
    rectangle_m: Rectangle
    height_m: float | None
    base_m: float


@dataclass(frozen=True)
class StructureOutline:
    """A structure before any blast; attributes as in `particles.objects.ModularObstacle`.

    `kind` is the name of its class in the particle model.
    `footprint` is its polygon, `None` for a rectangle and for a barrier.

    Six more are for gas dynamics: `height_m`, the height of its top, `None` for as high as the air;
    `base_m`, the height of its base above the ground; `heights_m` and `bases_m`, the same for
    single cells, in the order of `cells`, if they differ; `faces`, the walls whose load counts; and
    `is_lasting`, whether it is present in every layout.
    """

    kind: Literal["ModularObstacle", "ConcreteSquare"]
    name: str
    corner_m: tuple[float, float]
    rows: int
    columns: int
    protected: bool
    weight: float
    cells: tuple[Cell, ...] | None
    capacity: float | None
    height_m: float | None = None
    faces: tuple[WallName, ...] = WALLS
    heights_m: tuple[float | None, ...] | None = None
    pieces: tuple[str, ...] | None = None
    base_m: float = 0.0
    bases_m: tuple[float, ...] | None = None
    is_lasting: bool = True
    footprint: "Footprint | None" = None

    @property
    def is_barrier(self) -> bool:
        """Whether it is the barrier of a layout."""
        return self.name == BARRIER_NAME

    @property
    def walls(self) -> tuple[WallLine, ...]:
        """The walls of its polygon; none for a rectangle, whose walls are its sides."""
        return () if self.footprint is None else self.footprint.walls

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """Its plan in rectangles: of a barrier, the whole grid."""
        return (self.rectangle_m,) if self.footprint is None else self.footprint.boxes_m

    @property
    def filled(self) -> tuple[Cell, ...]:
        """Rows and columns of its modules, row by row."""
        if self.cells is not None:
            return self.cells
        return tuple((row, column) for row in range(self.rows) for column in range(self.columns))

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle of the whole grid."""
        size_m = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size_m)

    def module_name(self, row: int, column: int) -> str:
        """Return the identifier of the module in a cell."""
        left, bottom = self.corner_m
        return module_name(
            left + (column + 0.5) * MODULE_SIDE_M, bottom + (row + 0.5) * MODULE_SIDE_M
        )

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The whole structure; the pieces of a barrier, or its modules if it has no pieces."""
        if self.cells is None or self.footprint is not None:
            return tuple(Block(self.name, box, self.height_m, self.base_m) for box in self.boxes_m)
        count = len(self.cells)
        heights_m = self.heights_m or (self.height_m,) * count
        bases_m = self.bases_m or (self.base_m,) * count
        pieces = self.pieces or ("",) * count
        groups: dict[str | Cell, list[tuple[Cell, float | None, float]]] = {}
        for cell, piece, top_m, base_m in zip(self.cells, pieces, heights_m, bases_m, strict=True):
            groups.setdefault(piece or cell, []).append((cell, top_m, base_m))
        return tuple(
            Block(
                key if isinstance(key, str) else "",
                self._around_m([cell for cell, *_ in group]),
                *group[0][1:],
            )
            for key, group in groups.items()
        )

    def _around_m(self, cells: Sequence[Cell]) -> Rectangle:
        """Return the bounding rectangle of cells."""
        rows, columns = zip(*cells, strict=True)
        side, (left, bottom) = MODULE_SIDE_M, self.corner_m
        return Rectangle(
            left + min(columns) * side,
            bottom + min(rows) * side,
            left + (max(columns) + 1) * side,
            bottom + (max(rows) + 1) * side,
        )
