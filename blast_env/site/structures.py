"""The structures of a scenario, their facades, and the terraces that carry others."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Field, StrictBool, StrictFloat, StrictInt, model_validator

from blast_env.arrays import BoolArray, FloatArray
from blast_env.bays import BAY_M, STOREY_M, Bay
from blast_env.geometry import (
    TOLERANCE_M,
    WALLS,
    Boxes,
    Cell,
    Rectangle,
    Wall,
    WallLine,
    WallName,
    covered_m2,
    overlapping,
    stacked_runs,
)
from blast_env.problems import Problem, ScenarioError
from blast_env.response.components import PaneSide
from blast_env.sections import (
    FOR_PEOPLE,
    MOST_MODULES,
    Coordinate,
    Count,
    HashMark,
    Height,
    Name,
    PointM,
    Section,
)
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # shapely takes a tenth of a second to import
    from blast_env.site.footprint import Footprint


def _check_faces(faces: tuple[WallName, ...]) -> tuple[WallName, ...]:
    """Refuse a repeated wall, and return the walls in the order of `WALLS`."""
    for wall in WALLS:
        if faces.count(wall) > 1:
            raise ValueError(f"must name each wall at most once, not {wall!r} twice")
    return tuple(wall for wall in WALLS if wall in faces)


Walls = Annotated[tuple[WallName, ...], Field(min_length=1, max_length=4)]

Storeys = Annotated[
    tuple[Annotated[StrictInt, Field(ge=1, le=200)], ...], Field(min_length=1, max_length=200)
]


class FacadePart(Section):
    """Bays with other components than the rest of the facade.

    Attributes:
        walls: Their walls; all unless given.
        storeys: Their storeys, from 1; all unless given.
        glazing: Name of the component of their windows; that of the facade unless given.
        wall: Name of the component of their wall panels; that of the facade unless given.
    """

    walls: Walls = WALLS
    storeys: Storeys | None = None
    glazing: Name | None = None
    wall: Name | None = None

    def covers(self, bay: Bay) -> bool:
        """Return whether a bay belongs to them."""
        return bay.wall in self.walls and (self.storeys is None or bay.storey in self.storeys)


class FacadeSection(Section):
    """The components of a structure's walls.

    Attributes:
        storey_m: Height of a storey; the ground floor has the remaining height of the building.
        storeys: Number of storeys of equal height, in the place of `storey_m`.
        bay_m: Width of a bay; bays of a wall are made equally wide.
        glazing: Name of the component of its windows; none unless given.
        pane_width_m: Width of their panes; by default that of the component.
        pane_height_m: Height of their panes; by default that of the component.
        wall: Name of the component of its walls; none unless given.
        parts: Bays with other components; the last one that covers a bay counts.
    """

    storey_m: Annotated[StrictFloat, Field(ge=2.0, le=20.0)] = STOREY_M
    storeys: Annotated[Annotated[StrictInt, Field(ge=1, le=200)] | None, HashMark.IF_SET] = None
    bay_m: Annotated[StrictFloat, Field(ge=0.5, le=50.0)] = BAY_M
    glazing: Name | None = None
    pane_width_m: Annotated[PaneSide | None, HashMark.IF_SET] = None
    pane_height_m: Annotated[PaneSide | None, HashMark.IF_SET] = None
    wall: Name | None = None
    parts: Annotated[tuple[FacadePart, ...], Field(max_length=100)] = ()

    def of_side(self, side: WallName) -> FacadePart:
        """Return the part that is all bays of a side; an empty one if there is none."""
        own = (part for part in self.parts if part.walls == (side,) and part.storeys is None)
        return next(own, FacadePart(walls=(side,)))

    def with_side(self, side: WallName, **names: str | None) -> Self:
        """Return the facade with other components in all bays of a side.

        Args:
            names: Names of components by `glazing` or `wall`; `None`: that of the facade.
        """
        before = self.of_side(side)
        own = before.model_copy(update=names)
        parts = [part for part in self.parts if part != before]
        parts += [own] if own.glazing or own.wall else []
        return self.model_copy(update={"parts": tuple(parts)})

    def names(self) -> Iterator[tuple[str, str]]:
        """Yield the key and the name of each component."""
        for key in ("glazing", "wall"):
            if (name := getattr(self, key)) is not None:
                yield key, name
            for index, part in enumerate(self.parts):
                if (name := getattr(part, key)) is not None:
                    yield f"parts[{index}].{key}", name


PASSAGE_M: Final = 2.0
"""Least height of a structure's underside at which vehicles pass below."""


class StructureSection(Section):
    """Base of the structures.

    Attributes:
        name: Name in tables and pictures; `barrier` is taken by the modules of a layout.
        protected: Whether the load on it counts.
        weight: Weight of its load among the protected structures.
        peak_weight: Weight of its peak overpressure, if the objective counts peaks; `weight` unless
            given.
        module_capacity: Impulse, simulation units, at which a module is removed; modules never fail
            unless given.
        height_m: Height of its top above the ground; the height of the air unless given.
        base_m: Height of its underside: above 0 it is a canopy, or a storey over a passage. For gas
            dynamics only.
        carries: Whether it is a terrace: solid from the ground, and barriers may stand on its top.
            For gas dynamics only.
        faces: The walls whose load counts; a wall is named by the side that it faces.
        building: Name of its building, if that has several structures, for tables; no result
            depends on it.
        title: Its name for readers, as on the map, for pictures and tables; no result depends on
            it.
        facade: The components of its walls; no load depends on it.
    """

    name: Annotated[Name, HashMark.OF_PLACES]
    protected: StrictBool = False
    weight: Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] = 1.0
    peak_weight: Annotated[
        Annotated[StrictFloat, Field(ge=1e-6, le=1e6)] | None, HashMark.IF_SET
    ] = None
    module_capacity: Annotated[StrictFloat, Field(gt=0.0, le=1e12)] | None = None
    height_m: Annotated[Height | None, HashMark.IF_SET, HashMark.OF_PLACES] = None
    base_m: Annotated[Coordinate, HashMark.IF_SET, HashMark.OF_PLACES] = 0.0
    carries: Annotated[StrictBool, HashMark.IF_SET, HashMark.OF_PLACES] = False
    faces: Annotated[
        tuple[WallName, ...],
        Field(min_length=1, max_length=len(WALLS)),
        AfterValidator(_check_faces),
        HashMark.IF_SET,
    ] = WALLS
    building: Annotated[Name | None, HashMark.NEVER] = None
    title: Annotated[str, Field(max_length=100), FOR_PEOPLE, HashMark.NEVER] = ""
    facade: Annotated[FacadeSection | None, HashMark.IF_SET, HashMark.IF_RESPONSE] = None

    @property
    def lets_through(self) -> bool:
        """Whether people and vehicles pass below it: its base is at least `PASSAGE_M` high."""
        return self.base_m >= PASSAGE_M

    @property
    def building_name(self) -> str:
        """Name of its building; the name of the structure if it has none."""
        return self.building or self.name

    @property
    def counted_peak_weight(self) -> float:
        """Weight of its peak: `peak_weight`, or `weight` unless given."""
        return self.weight if self.peak_weight is None else self.peak_weight

    @property
    def footprint(self) -> "Footprint | None":
        """Its polygon; `None` for a rectangle of modules."""
        return None

    @property
    def cells(self) -> tuple[Cell, ...] | None:
        """Rows and columns of its modules, row by row; `None` for all of its grid."""
        return None


class ModularObstacleSection(StructureSection):
    """A `ModularObstacle`: a rectangle of rows x columns modules."""

    kind: Annotated[Literal["ModularObstacle"], HashMark.OF_PLACES]
    corner_m: Annotated[PointM, HashMark.OF_PLACES]
    rows: Annotated[Count, HashMark.OF_PLACES]
    columns: Annotated[Count, HashMark.OF_PLACES]

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return self.rows * self.columns

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """The footprint, as for every structure in rectangles of modules."""
        return (self.rectangle_m,)

    @cached_property
    def rectangle_m(self) -> Rectangle:
        """The footprint."""
        size = (self.columns * MODULE_SIDE_M, self.rows * MODULE_SIDE_M)
        return Rectangle.from_corner(self.corner_m, size)


class ConcreteSquareSection(StructureSection):
    """A `ConcreteSquare`: a square of modules."""

    kind: Annotated[Literal["ConcreteSquare"], HashMark.OF_PLACES]
    corner_m: Annotated[PointM, HashMark.OF_PLACES]
    side_modules: Annotated[Count, HashMark.OF_PLACES]

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return self.rows * self.columns

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """The footprint, as for every structure in rectangles of modules."""
        return (self.rectangle_m,)

    @property
    def rows(self) -> int:
        """Rows of modules."""
        return self.side_modules

    @property
    def columns(self) -> int:
        """Columns of modules."""
        return self.side_modules

    @cached_property
    def rectangle_m(self) -> Rectangle:
        """The footprint."""
        side = self.side_modules * MODULE_SIDE_M
        return Rectangle.from_corner(self.corner_m, (side, side))


Corners = Annotated[tuple[PointM, ...], Field(min_length=3, max_length=5000)]
"""Corners of a closed line."""


class PolygonSection(StructureSection):
    """A building with a polygon in plan, in modules whose centres it covers.

    Attributes:
        outline_m: Corners of its outline, in either order.
    """

    kind: Annotated[Literal["polygon"], HashMark.OF_PLACES]
    outline_m: Annotated[Corners, HashMark.OF_PLACES]
    courtyards_m: Annotated[tuple[Corners, ...], Field(max_length=100), HashMark.OF_PLACES] = ()

    @model_validator(mode="after")
    def _check_rings(self) -> Self:
        """Refuse outlines that cross themselves, and those without a module or with too many."""
        from blast_env.site.footprint import footprint_problem

        problem = footprint_problem(self.outline_m, self.courtyards_m)
        if not problem and self.footprint.area_m2 > MOST_MODULES * MODULE_SIDE_M**2:
            most_m2 = MOST_MODULES * MODULE_SIDE_M**2
            problem = f"encloses {self.footprint.area_m2:,.0f} m2, must be at most {most_m2:,.0f}"
        if not problem and not self.footprint.cells:
            problem = (
                f"encloses {self.footprint.area_m2:.3g} m2 and the centre of no module, must cover"
                f" the centre of a square of the grid of {MODULE_SIDE_M:g} m"
            )
        if problem:
            raise ScenarioError(self.name, [Problem("outline_m", problem)])
        return self

    @property
    def footprint(self) -> "Footprint":
        """Its polygon."""
        from blast_env.site.footprint import footprint_of

        return footprint_of(self.outline_m, self.courtyards_m)

    @property
    def corner_m(self) -> PointM:
        """Lower left corner of the grid of its modules."""
        return self.footprint.corner_m

    @property
    def rows(self) -> int:
        """Rows of the grid of its modules."""
        return self.footprint.shape[0]

    @property
    def columns(self) -> int:
        """Columns of the grid of its modules."""
        return self.footprint.shape[1]

    @property
    def modules(self) -> int:
        """Number of its modules."""
        return len(self.footprint.cells)

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Rows and columns of its modules, row by row."""
        return self.footprint.cells

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """Its modules in few rectangles."""
        return self.footprint.boxes_m

    @property
    def rectangle_m(self) -> Rectangle:
        """The rectangle around its modules."""
        return Rectangle.around(self.boxes_m)


AnyStructure = Annotated[
    ModularObstacleSection | ConcreteSquareSection | PolygonSection, Field(discriminator="kind")
]


def loaded_walls(structures: Iterable[AnyStructure]) -> tuple[Wall, ...]:
    """Return the walls of protected structures that their `faces` name."""
    return tuple(
        wall for structure in structures if structure.protected for wall in _faces_of(structure)
    )


def _faces_of(structure: AnyStructure) -> Iterator[Wall]:
    if structure.footprint is not None:
        yield from (wall for wall in structure.footprint.walls if wall.side in structure.faces)
        return
    left, bottom, right, top = structure.rectangle_m
    sides: dict[WallName, Rectangle] = {
        "west": Rectangle(left, bottom, left, top),
        "east": Rectangle(right, bottom, right, top),
        "south": Rectangle(left, bottom, right, bottom),
        "north": Rectangle(left, top, right, top),
    }
    yield from (sides[wall] for wall in structure.faces)


def buildings_of(structures: Iterable[AnyStructure]) -> dict[str, list[AnyStructure]]:
    """Return structures by the names of their buildings, in order."""
    buildings: dict[str, list[AnyStructure]] = {}
    for structure in structures:
        buildings.setdefault(structure.building_name, []).append(structure)
    return buildings


def without_facade(structures: Iterable[AnyStructure]) -> list[str]:
    """Return the names of protected buildings without a facade, which have no response."""
    return [
        name
        for name, parts in buildings_of(structures).items()
        if any(part.protected for part in parts) and all(part.facade is None for part in parts)
    ]


def terrace_problems(structures: Iterable[AnyStructure]) -> Iterator[Problem]:
    """Yield the problems of terraces, each of which must be solid and have a height."""
    for index, structure in enumerate(structures):
        if structure.carries and structure.height_m is None:
            message = "is true, needs the structure's height_m: barriers stand on its top"
            yield Problem(f"structures[{index}].carries", message)
        if structure.carries and structure.base_m > 0.0:
            message = f"is {structure.base_m:g}, must be 0: a terrace is solid"
            yield Problem(f"structures[{index}].base_m", message)


def ground_m(structures: Iterable[AnyStructure], boxes: Boxes) -> FloatArray:
    """Return the height of the ground below squares, m: the highest terrace that each overlaps."""
    return _highest(_terraces(structures), boxes)


def _highest(terraces: Iterable[tuple[Rectangle, float]], boxes: Boxes) -> FloatArray:
    ground = np.zeros(np.broadcast_shapes(*(side.shape for side in boxes)))
    for terrace_m, height_m in terraces:
        own = overlapping(terrace_m, boxes)
        ground[own] = np.maximum(ground[own], height_m)
    return ground


def ground_below_m(structures: Iterable[AnyStructure], rectangle_m: Rectangle) -> float:
    """Return the height of the ground below one rectangle, m; 0 beside all terraces."""
    own_m = (high_m for plan_m, high_m in _terraces(structures) if plan_m.overlaps(rectangle_m))
    return max(own_m, default=0.0)


def levels_of(
    structures: Iterable[AnyStructure], rectangle_m: Rectangle
) -> dict[float, list[Rectangle]]:
    """Return the parts of a rectangle by the height of the ground below them, m."""
    terraces = [terrace for terrace in _terraces(structures) if terrace[0].overlaps(rectangle_m)]
    left, bottom, right, top = rectangle_m
    plans = [item for item, _ in terraces]
    xs = sorted({left, right, *(x for plan in plans for x in plan[::2] if left < x < right)})
    ys = sorted({bottom, top, *(y for plan in plans for y in plan[1::2] if bottom < y < top)})
    across, up = np.array(xs)[np.newaxis], np.array(ys)[:, np.newaxis]
    ground = _highest(terraces, (across[:, :-1], up[:-1], across[:, 1:], up[1:]))
    return {
        float(height_m): [
            Rectangle(xs[column], ys[row], xs[column + columns], ys[row + rows])
            for row, column, rows, columns in stacked_runs(ground == height_m).tolist()
        ]
        for height_m in np.unique(ground)
    }


def lie_wholly_on(
    structures: Iterable[AnyStructure], height_m: float | None, boxes: Boxes
) -> BoolArray:
    """Return whether terraces of one height cover each square without a gap."""
    left, bottom, right, top = boxes
    open_m2 = (right - left) * (top - bottom)
    for terrace_m, top_m in _terraces(structures):
        if top_m == height_m:
            open_m2 = open_m2 - covered_m2(terrace_m, boxes)
    whole: BoolArray = open_m2 <= TOLERANCE_M
    return whole


def is_open_below(structure: AnyStructure, structures: Iterable[AnyStructure]) -> bool:
    """Return whether there is air below a structure: it is not on the ground or on a terrace."""
    if structure.base_m == 0.0:
        return False
    left, bottom, right, top = np.array(structure.boxes_m).T
    return not lie_wholly_on(structures, structure.base_m, (left, bottom, right, top)).all()


def _terraces(structures: Iterable[AnyStructure]) -> Iterator[tuple[Rectangle, float]]:
    """Yield plan and height of each terrace."""
    for structure in structures:
        if structure.carries and structure.height_m is not None:
            yield from ((box, structure.height_m) for box in structure.boxes_m)


def is_over_or_below(height_m: float, structure: AnyStructure) -> bool:
    """Return whether a height is above a structure's roof, if it has one, or below its base."""
    is_over = structure.height_m is not None and height_m > structure.height_m
    return is_over or height_m < structure.base_m


def depth_inside_m(position_m: tuple[float, float, float], structure: AnyStructure) -> float:
    """Return the depth of a point inside a structure, m: its distance to the nearest surface.

    It is negative or 0 outside. The ground is no surface.
    """
    x_m, y_m, z_m = position_m
    depth_m = max(
        min(x_m - left, right - x_m, y_m - bottom, top - y_m)
        for left, bottom, right, top in structure.boxes_m
    )
    if structure.footprint is not None and depth_m > 0.0:  # boxes of a polygon share sides
        place_m = np.array([(x_m, y_m)])
        depth_m = min(float(wall.distances_m(place_m)[0]) for wall in structure.footprint.walls)
    if structure.base_m > 0.0:
        depth_m = min(depth_m, z_m - structure.base_m)
    return depth_m if structure.height_m is None else min(depth_m, structure.height_m - z_m)


_SLIVER_M: Final = 1e-6
"""Narrower gaps between structures are rounding."""


def solids_around(
    position_m: tuple[float, float, float], within_m: float, structures: Sequence[AnyStructure]
) -> tuple[list[int], bool]:
    """Return the structures near a point, and whether they leave air there.

    Args:
        position_m: The point.
        within_m: Half the side of the cube around the point, whose part above the ground counts.
        structures: The structures.

    Returns:
        Indices of the structures in the cube; whether there is air in it.
    """
    grown_m = within_m + 2.0 * _SLIVER_M
    low_m, high_m = np.array(position_m) - grown_m, np.array(position_m) + grown_m
    low_m[2] = max(low_m[2], 0.0)
    owners, found = list[int](), [np.empty((0, 2, 3))]
    for index, structure in enumerate(structures):
        ends_m = structure.base_m, np.inf if structure.height_m is None else structure.height_m
        plans_m = np.array(structure.boxes_m).reshape(-1, 2, 2)
        heights_m = np.broadcast_to(np.array(ends_m)[:, np.newaxis], (len(plans_m), 2, 1))
        boxes_m = np.clip(np.concatenate((plans_m, heights_m), axis=2), low_m, high_m)
        is_near = (np.diff(boxes_m, axis=1) > _SLIVER_M).all(axis=(1, 2))
        if is_near.any():
            owners.append(index)
            found.append(boxes_m[is_near])
    return owners, not _fill(np.concatenate(found), low_m, high_m)


def _fill(boxes_m: FloatArray, low_m: FloatArray, high_m: FloatArray) -> bool:
    """Return whether boxes (n, 2, 3) fill a space between two corners (3,)."""
    # The sides of the boxes divide the space into blocks, each in a box or in none.
    middles_m = []
    for axis in range(3):
        cuts_m = np.unique([low_m[axis], *boxes_m[..., axis].flat, high_m[axis]])
        widths_m = np.diff(cuts_m)
        middles_m.append((cuts_m[:-1] + 0.5 * widths_m)[widths_m > _SLIVER_M])
    blocks_m = np.stack(np.meshgrid(*middles_m, indexing="ij"), axis=-1)
    is_solid = np.zeros(blocks_m.shape[:-1], dtype=bool)
    for box_m in boxes_m:
        is_solid |= ((box_m[0] < blocks_m) & (blocks_m < box_m[1])).all(axis=-1)
    return bool(is_solid.all())


# ---- Outlines, which engines take.

BARRIER_NAME: Final = "barrier"
"""Name of the structure formed by the modules of a layout."""


def module_name(x_m: float, y_m: float) -> str:
    """Return the identifier of the module with this centre."""
    return f"x{x_m:.3f}_y{y_m:.3f}"


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
