"""The objects of the model: a fan of explosive balls, a lattice of air balls, modules, the border.

They are those of the paper's sections 2.3, 2.4 and 2.7, with the surface that balls can reach.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import product
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle, distance_to_rectangle
from blast_env.site.parameters import AirParameters, BallParameters, ExplosiveParameters
from blast_env.site.structures import BARRIER_NAME, StructureOutline, module_name
from blast_env.units import MODULE_SIDE_UNITS, UNITS_PER_M

_ROUNDING: Final = 1e-9  # of distances, units


def in_units(place_m: tuple[float, float]) -> tuple[float, float]:
    """Return a place in metres in simulation units."""
    return place_m[0] * UNITS_PER_M, place_m[1] * UNITS_PER_M


class CollisionType(IntEnum):
    """The paper's four kinds of objects (section 2.4), with its names."""

    ExplosionBall = 1
    AirBall = 2
    ModularPart = 3
    Border = 4


@dataclass(frozen=True, eq=False)
class Balls:
    """Any number of balls, in simulation units.

    Attributes:
        kind: `CollisionType` of each ball, uint8 (n,).
        position: Centres (n, 2).
        velocity: Velocities, units per second (n, 2).
        mass: Masses (n,).
        radius: Radii (n,).
    """

    kind: NDArray[np.uint8]
    position: FloatArray
    velocity: FloatArray
    mass: FloatArray
    radius: FloatArray

    def __len__(self) -> int:
        return len(self.kind)

    @classmethod
    def of_one_kind(
        cls,
        kind: CollisionType,
        parameters: BallParameters,
        position: FloatArray,
        velocity: FloatArray,
    ) -> "Balls":
        """Return balls of one kind, all with the mass and radius of `parameters`."""
        count = len(position)
        return cls(
            kind=np.full(count, kind, dtype=np.uint8),
            position=position,
            velocity=velocity,
            mass=np.full(count, parameters.mass),
            radius=np.full(count, parameters.radius_units),
        )

    @classmethod
    def concatenate(cls, groups: Sequence["Balls"]) -> "Balls":
        """Return the balls of all groups, in their order."""
        return cls(
            kind=np.concatenate([group.kind for group in groups]),
            position=np.concatenate([group.position for group in groups]),
            velocity=np.concatenate([group.velocity for group in groups]),
            mass=np.concatenate([group.mass for group in groups]),
            radius=np.concatenate([group.radius for group in groups]),
        )


def explosion_fan(
    parameters: ExplosiveParameters,
    centre: tuple[float, float],
    rng: np.random.Generator,
) -> Balls:
    """Return the charge: N `ExplosionBall`s at the angles 2 pi i / N (section 2.3).

    With a thermal share, the velocities have a normally distributed part besides the radial one;
    the mean kinetic energy is the same.

    Args:
        centre: The charge's centre, units.
        rng: Generator for the phase of the fan and the random part of the velocities.
    """
    # Drawn in any case: the velocities after it do not depend on the option.
    drawn = rng.random()
    phase = drawn if parameters.fan_phase == "random" else 0.0
    index = np.arange(1, parameters.ball_count + 1)
    angle = 2.0 * np.pi * (index + phase) / parameters.ball_count
    direction = np.column_stack((np.cos(angle), np.sin(angle)))
    share = parameters.thermal_share
    # Energies add up: (1 - share) of the kinetic energy is radial, share / 2 goes to each axis.
    random_part = np.sqrt(share / 2.0) * rng.normal(size=direction.shape)
    return Balls.of_one_kind(
        CollisionType.ExplosionBall,
        parameters,
        position=np.asarray(centre) + parameters.offset_units * direction,
        velocity=parameters.speed_units_per_s * (np.sqrt(1.0 - share) * direction + random_part),
    )


def air_lattice(
    parameters: AirParameters,
    site: Rectangle,
    obstacles: Sequence[Rectangle],
    charge_centre: tuple[float, float],
    charge_radius: float,
    rng: np.random.Generator,
) -> Balls:
    """Return the air: `AirBall`s at rest on a square lattice that fills the site.

    A ball that would touch an obstacle, the charge or the border is left out.

    Args:
        site: The simulated area, units.
        obstacles: Rectangles without air, units.
        charge_centre: The charge's centre, units.
        charge_radius: Radius of the charge's disc, units.
        rng: Generator for the offset of the lattice and the jitter.
    """
    if parameters.spacing_units == 0.0:
        empty = np.empty((0, 2))
        return Balls.of_one_kind(CollisionType.AirBall, parameters, empty, empty)
    spacing, radius = parameters.spacing_units, parameters.radius_units
    # Always drawn, so that a centred lattice does not shift the random stream of the jitter.
    drawn_x, drawn_y = rng.random(2)
    if parameters.lattice_offset == "centred":
        drawn_x = _centring_share(site.right - site.left, spacing)
        drawn_y = _centring_share(site.top - site.bottom, spacing)
    x = np.arange(site.left + drawn_x * spacing, site.right, spacing)
    y = np.arange(site.bottom + drawn_y * spacing, site.top, spacing)
    position = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # Half of the free gap at most, so that neighbours never overlap.
    reach = parameters.jitter * max(0.0, spacing / 2.0 - radius)
    position = position + rng.uniform(-reach, reach, size=position.shape)

    # (1) Clear of the border and the charge, all at once; (2) clear of obstacles, each on the part
    # of the lattice around it: the cost goes with the area of obstacles, not with their number
    # times the air.
    inner = site.grown(-radius)
    free = (
        (position[:, 0] > inner.left)
        & (position[:, 0] < inner.right)
        & (position[:, 1] > inner.bottom)
        & (position[:, 1] < inner.top)
        & (np.hypot(*(position - charge_centre).T) > charge_radius + radius)
    )
    places, is_free = position.reshape(len(y), len(x), 2), free.reshape(len(y), len(x))
    near = radius + reach + _ROUNDING
    for obstacle in obstacles:
        around = obstacle.grown(near)
        rows = slice(*np.searchsorted(y, (around.bottom, around.top)))
        columns = slice(*np.searchsorted(x, (around.left, around.right)))
        distance = distance_to_rectangle(places[rows, columns].reshape(-1, 2), obstacle)
        is_free[rows, columns] &= (distance > radius).reshape(is_free[rows, columns].shape)
    position = position[free]
    return Balls.of_one_kind(CollisionType.AirBall, parameters, position, np.zeros_like(position))


def _centring_share(length: float, spacing: float) -> float:
    """Return the offset, in spacings, that leaves equal margins at both borders."""
    margin = (length - (length // spacing - 1) * spacing) / 2.0
    return margin / spacing


_HALF: Final = MODULE_SIDE_UNITS / 2.0
_BEYOND: Final = 1e-6  # distance beyond an edge at which modules are looked up, units


@dataclass(frozen=True, eq=False)
class WallSurface:
    """The accessible surface of a set of modules.

    Attributes:
        free_faces: Whether no module adjoins the face (m, 4); the faces are left, right, lower,
            upper.
        covered_corners: Whether the wall continues beyond the corner (m, 4); the corners are lower
            left, lower right, upper left, upper right.
    """

    free_faces: BoolArray
    covered_corners: BoolArray

    @property
    def exposed(self) -> BoolArray:
        """Whether any face of the module is free (m,)."""
        return np.asarray(self.free_faces.any(axis=1))


def wall_surface(centres: FloatArray) -> WallSurface:
    """Find the exposed modules and the covered corners.

    Args:
        centres: Centres of the intact modules, units (m, 2).
    """
    lattices = tuple(_lattices(centres))
    free = np.ones((len(centres), 4), dtype=np.bool_)
    for lattice in lattices:
        free[lattice.members] = lattice.free_faces()
    left, right, lower, upper = ~free.T
    covered = np.stack((left | lower, right | lower, left | upper, right | upper), axis=1)
    if len(lattices) > 1:
        for corner, (x_sign, y_sign) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1))):
            past_in_x = centres + (x_sign * (_HALF + _BEYOND), y_sign * (_HALF - _BEYOND))
            past_in_y = centres + (x_sign * (_HALF - _BEYOND), y_sign * (_HALF + _BEYOND))
            for lattice in lattices:
                covered[:, corner] |= lattice.is_solid(past_in_x) | lattice.is_solid(past_in_y)
    return WallSurface(free_faces=free, covered_corners=covered)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Modules whose centres differ by whole modules.

    Attributes:
        members: Indices of the modules (k,).
        origin: Lower left corner of the occupancy's first cell, units (2,).
        cells: Column and row of each of them in the occupancy (2, k).
        occupied: Occupancy (columns, rows), with a border of empty cells.
    """

    members: NDArray[np.int64]
    origin: FloatArray
    cells: NDArray[np.int64]
    occupied: BoolArray

    def free_faces(self) -> BoolArray:
        """Return whether no module of this lattice adjoins the faces (k, 4)."""
        # West, east, south, north; the border of empty cells saves the bounds.
        column, row = self.cells
        solid = self.occupied
        beside = solid[column - 1, row], solid[column + 1, row]
        return ~np.stack((*beside, solid[column, row - 1], solid[column, row + 1]), axis=1)

    def is_solid(self, points: FloatArray) -> BoolArray:
        """Return whether a module of this lattice covers each point (n, 2)."""
        cell = np.floor((points - self.origin) / MODULE_SIDE_UNITS).astype(np.int64)
        inside: BoolArray = np.all((cell >= 0) & (cell < self.occupied.shape), axis=1)
        cell = np.where(inside[:, None], cell, 0)
        solid: BoolArray = inside & self.occupied[cell[:, 0], cell[:, 1]]
        return solid


def _lattices(centres: FloatArray) -> Iterator[_Lattice]:
    """Group the modules by lattice."""
    if not len(centres):
        return
    # Digits below 1e-9 units are rounding of the metres in a scenario file.
    offsets = np.round(np.mod(centres, MODULE_SIDE_UNITS), 9) % MODULE_SIDE_UNITS
    # Modules that differ by whole modules share faces; others only touch, and keep theirs.
    for offset in np.unique(offsets @ (1.0, 1.0j)):  # much faster than by rows
        members = np.flatnonzero((offsets == (offset.real, offset.imag)).all(axis=1))
        own = centres[members]
        origin = own.min(axis=0) - (_HALF + MODULE_SIDE_UNITS)
        cells = np.floor((own - origin) / MODULE_SIDE_UNITS).astype(np.int64).T
        occupied = np.zeros(cells.max(axis=1) + 2, dtype=np.bool_)
        occupied[*cells] = True
        yield _Lattice(members, origin, cells, occupied)


Colour = tuple[int, int, int]


class LoadColours(NamedTuple):
    """Colours of a module at no, half and full load, for interpolation."""

    unloaded: Colour = (236, 226, 198)
    half: Colour = (240, 128, 48)
    full: Colour = (122, 4, 46)


@dataclass(slots=True)
class ModularPart:
    """The basic building element: a static square of 2 units (section 2.7).

    Attributes:
        structure: Name of its structure.
        row: Row in the structure's grid, upwards.
        column: Column in the structure's grid.
        x: Coordinate x of the centre, units.
        y: Coordinate y of the centre, units.
        capacity: Impulse above which it is removed, simulation units; `None` for no limit.
        piece: Name of its barrier piece; empty for none.
        hits: Number of collisions.
        impulse: Sum of m |v| of these collisions (section 2.8), simulation units.
        transferred_impulse: Sum of the momentum actually transferred along the normals of the
            contacts, simulation units.
        first_hit_s: Time of the first collision; `None` before it.
    """

    collision_type = CollisionType.ModularPart

    structure: str
    row: int
    column: int
    x: float
    y: float
    capacity: float | None = None
    piece: str = ""
    hits: int = 0
    impulse: float = 0.0
    transferred_impulse: float = 0.0
    first_hit_s: float | None = None

    @property
    def module_id(self) -> str:
        """Identifier by the position of the centre in metres, unique on a site."""
        return module_name(*self.centre_m)

    @property
    def centre_m(self) -> tuple[float, float]:
        """The centre."""
        return self.x / UNITS_PER_M, self.y / UNITS_PER_M

    @property
    def rectangle(self) -> Rectangle:
        """The square, units."""
        half = MODULE_SIDE_UNITS / 2.0
        return Rectangle(self.x - half, self.y - half, self.x + half, self.y + half)

    @property
    def rectangle_m(self) -> Rectangle:
        """The square."""
        return self.rectangle.scaled(1.0 / UNITS_PER_M)

    @property
    def destroyed(self) -> bool:
        """Whether the accumulated impulse exceeds the capacity."""
        return self.capacity is not None and self.impulse > self.capacity

    def register(self, time_s: float, impulse: float, transferred_impulse: float) -> None:
        """Count one collision.

        Args:
            impulse: Its m |v|, simulation units.
            transferred_impulse: Its transferred momentum, simulation units.
        """
        if self.first_hit_s is None:
            self.first_hit_s = time_s
        self.hits += 1
        self.impulse += impulse
        self.transferred_impulse += transferred_impulse

    def colour(self, full_impulse: float) -> Colour:
        """Return the colour of the load.

        Args:
            full_impulse: The impulse of full load, simulation units.
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
        cells: The (row, column) of the cells with a module; `None` for all.
        capacity: Capacity of each module; `None` for no limit.
        pieces: Names of the modules' barrier pieces, in the order of `cells`; `None` for none.
        parts: The modules.
    """

    name: str
    corner: tuple[float, float]
    rows: int
    columns: int
    protected: bool = False
    weight: float = 1.0
    cells: Sequence[tuple[int, int]] | None = None
    capacity: float | None = None
    pieces: Sequence[str] | None = None
    parts: list[ModularPart] = field(init=False)

    def __post_init__(self) -> None:
        """Create the parts."""
        # A grid row by row, from the lower left corner.
        half = MODULE_SIDE_UNITS / 2.0
        every_cell = product(range(self.rows), range(self.columns))
        self.parts = [
            ModularPart(
                structure=self.name,
                row=row,
                column=column,
                x=self.corner[0] + column * MODULE_SIDE_UNITS + half,
                y=self.corner[1] + row * MODULE_SIDE_UNITS + half,
                capacity=self.capacity,
                piece="" if self.pieces is None else self.pieces[number],
            )
            for number, (row, column) in enumerate(every_cell if self.cells is None else self.cells)
        ]

    @property
    def kind(self) -> str:
        """Name of the class, as in scenario files."""
        return type(self).__name__

    @property
    def is_barrier(self) -> bool:
        """Whether it is the barrier of a layout."""
        return self.name == BARRIER_NAME

    @property
    def rectangle(self) -> Rectangle:
        """The rectangle of the whole grid, units."""
        size = (self.columns * MODULE_SIDE_UNITS, self.rows * MODULE_SIDE_UNITS)
        return Rectangle.from_corner(self.corner, size)

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle of the whole grid."""
        return self.rectangle.scaled(1.0 / UNITS_PER_M)

    @property
    def boxes_m(self) -> list[Rectangle]:
        """Its plan: the whole grid, or its modules if they do not fill it."""
        if self.cells is None:
            return [self.rectangle_m]
        return [part.rectangle_m for part in self.parts]

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
        """Sum of the momentum actually transferred to the modules, simulation units."""
        return float(sum(part.transferred_impulse for part in self.parts))


class ConcreteSquare(ModularObstacle):
    """A square concrete structure: as many rows as columns of modules (section 2.7)."""

    def __post_init__(self) -> None:
        """Create the parts, after a check of the shape."""
        if self.rows != self.columns:
            raise ValueError(
                f"ConcreteSquare {self.name!r} has {self.rows} rows and {self.columns} columns, "
                "must have as many rows as columns"
            )
        super().__post_init__()


_CLASSES: Final = MappingProxyType(
    {kind.__name__: kind for kind in (ModularObstacle, ConcreteSquare)}
)


def obstacle_of(outline: StructureOutline) -> ModularObstacle:
    """Return the obstacle of a structure, with unloaded parts."""
    return _CLASSES[outline.kind](
        name=outline.name,
        corner=in_units(outline.corner_m),
        rows=outline.rows,
        columns=outline.columns,
        protected=outline.protected,
        weight=outline.weight,
        cells=outline.cells,
        capacity=outline.capacity,
        pieces=outline.pieces,
    )


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
