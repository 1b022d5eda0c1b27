"""Structures as collections of modules (sections 2.6 to 2.8), and the site's border.

A blast makes its own objects of these classes: they hold the hits of that one blast.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from blast_env.geometry import Rectangle
from blast_env.physics.particles import CollisionType
from blast_env.units import MODULE_SIDE_UNITS, UNITS_PER_M

Colour = tuple[int, int, int]

BARRIER_NAME: Final = "barrier"
"""Name of the structure that the modules of a layout form."""


class LoadColours(NamedTuple):
    """The colours between which a module's colour moves as its load grows."""

    unloaded: Colour = (236, 226, 198)
    half: Colour = (240, 128, 48)
    full: Colour = (122, 4, 46)


@dataclass(slots=True)
class ModularPart:
    """The basic building element: a static square of 2 units (section 2.7).

    Attributes:
        structure: Name of the structure that it is part of.
        row: Row in the structure's grid, upwards.
        column: Column in the structure's grid.
        x: Centre, units.
        y: Centre, units.
        capacity: Impulse, simulation units, that it bears before it is removed; None: any.
        hits: Collisions so far.
        impulse: Sum of m |v| of these collisions (section 2.8), simulation units.
        transferred_impulse: Sum of the momentum that the contacts really transferred along
            their normals, simulation units.
        first_hit_s: Time of the first collision; None before it.
    """

    collision_type = CollisionType.ModularPart

    structure: str
    row: int
    column: int
    x: float
    y: float
    capacity: float | None = None
    hits: int = 0
    impulse: float = 0.0
    transferred_impulse: float = 0.0
    first_hit_s: float | None = None

    @property
    def module_id(self) -> str:
        """Identifier made from the position of the centre in metres, unique on a site."""
        return f"x{self.x / UNITS_PER_M:.3f}_y{self.y / UNITS_PER_M:.3f}"

    @property
    def rectangle(self) -> Rectangle:
        """The square, units."""
        half = MODULE_SIDE_UNITS / 2.0
        return Rectangle(self.x - half, self.y - half, self.x + half, self.y + half)

    @property
    def destroyed(self) -> bool:
        """Whether the accumulated impulse has passed the capacity."""
        return self.capacity is not None and self.impulse > self.capacity

    def register(self, time_s: float, impulse: float, transferred_impulse: float) -> None:
        """Count one collision.

        Args:
            time_s: When it happened.
            impulse: Its m |v|, simulation units.
            transferred_impulse: The momentum that it transferred, simulation units.
        """
        if self.first_hit_s is None:
            self.first_hit_s = time_s
        self.hits += 1
        self.impulse += impulse
        self.transferred_impulse += transferred_impulse

    def colour(self, full_impulse: float) -> Colour:
        """Return the colour that shows the load.

        Args:
            full_impulse: The impulse that has the last colour, simulation units.
        """
        return load_colour(self.impulse / full_impulse if full_impulse > 0.0 else 0.0)


@dataclass
class ModularObstacle:
    """A grid of `ModularPart`s that it creates and manages (section 2.7).

    Attributes:
        name: Name of the structure.
        corner: Lower left corner, units.
        rows: Rows of the grid.
        columns: Columns of the grid.
        protected: Whether its load counts.
        weight: Its weight among the protected structures.
        cells: The (row, column) that hold a module; None: all.
        capacity: Capacity of each module; None: modules never fail.
    """

    name: str
    corner: tuple[float, float]
    rows: int
    columns: int
    protected: bool = False
    weight: float = 1.0
    cells: Sequence[tuple[int, int]] | None = None
    capacity: float | None = None
    parts: list[ModularPart] = field(init=False)

    def __post_init__(self) -> None:
        """Create the parts."""
        half = MODULE_SIDE_UNITS / 2.0
        self.parts = [
            ModularPart(
                structure=self.name,
                row=row,
                column=column,
                x=self.corner[0] + column * MODULE_SIDE_UNITS + half,
                y=self.corner[1] + row * MODULE_SIDE_UNITS + half,
                capacity=self.capacity,
            )
            for row, column in self._used_cells()
        ]

    @property
    def kind(self) -> str:
        """The class's name, as in scenario files."""
        return type(self).__name__

    @property
    def rectangle(self) -> Rectangle:
        """The rectangle of the whole grid, units."""
        size = (self.columns * MODULE_SIDE_UNITS, self.rows * MODULE_SIDE_UNITS)
        return Rectangle.from_corner(self.corner, size)

    @property
    def hits(self) -> int:
        """Collisions with any of the modules."""
        return sum(part.hits for part in self.parts)

    @property
    def first_hit_s(self) -> float | None:
        """Time of the first collision; None before it."""
        times = (part.first_hit_s for part in self.parts if part.first_hit_s is not None)
        return min(times, default=None)

    @property
    def impulse(self) -> float:
        """Sum of the modules' impulses, simulation units."""
        return float(sum(part.impulse for part in self.parts))

    @property
    def transferred_impulse(self) -> float:
        """Sum of the momentum really transferred to the modules, simulation units."""
        return float(sum(part.transferred_impulse for part in self.parts))

    def _used_cells(self) -> Iterator[tuple[int, int]]:
        if self.cells is not None:
            return iter(self.cells)
        return ((row, column) for row in range(self.rows) for column in range(self.columns))


class ConcreteSquare(ModularObstacle):
    """A square concrete structure: as many rows as columns of modules (section 2.7)."""

    def __post_init__(self) -> None:
        """Create the parts, after a check of the shape.

        Raises:
            ValueError: If rows and columns differ.
        """
        if self.rows != self.columns:
            raise ValueError(
                f"ConcreteSquare {self.name!r} has {self.rows} rows and {self.columns} columns, "
                "must have as many rows as columns"
            )
        super().__post_init__()


@dataclass(frozen=True)
class Border:
    """The boundary of the simulated space; a ball that reaches it is removed (section 2.4).

    Attributes:
        site: The simulated area, units.
    """

    collision_type = CollisionType.Border

    site: Rectangle

    def lines(self) -> tuple[tuple[tuple[float, float], tuple[float, float]], ...]:
        """Return the four border lines, each from its start to its end."""
        left, bottom, right, top = self.site
        corners = ((left, bottom), (right, bottom), (right, top), (left, top))
        return tuple(zip(corners, corners[1:] + corners[:1], strict=True))


def load_colour(share: float) -> Colour:
    """Return the colour of a load between 0 (none) and 1 (full), clipped to that range."""
    colours = LoadColours()
    share = min(max(share, 0.0), 1.0)
    low, high = (colours.unloaded, colours.half) if share < 0.5 else (colours.half, colours.full)
    part = 2.0 * share if share < 0.5 else 2.0 * share - 1.0
    red, green, blue = (
        round(start + part * (end - start)) for start, end in zip(low, high, strict=True)
    )
    return red, green, blue
