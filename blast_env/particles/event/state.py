"""The arrays of the compiled loop, and their construction from a scene."""

from math import floor, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.particles.objects import Balls, CollisionType, ModularPart, wall_surface
from blast_env.particles.run import Scene
from blast_env.units import MODULE_SIDE_UNITS, UNITS_PER_M

RecordArray = NDArray[np.void]

Record = Any
"""One element of a `RecordArray`."""


# Partners of a ball that are not balls.
NOBODY: Final = -1
BORDER: Final = -2
FIRST_SURFACE: Final = -3  # surface k is FIRST_SURFACE - k


# Kinds of surfaces.
FACE_X: Final = 0  # its normal is along x
FACE_Y: Final = 1
CORNER: Final = 2


# Stages: tasks of the loop before it continues.
NEW: Final = 0  # put the balls into their cells
RUNNING: Final = 1
CHANGED: Final = 2  # predict the events again, after a change of the walls

BALL: Final = np.dtype(
    [
        ("x", np.float64),  # at the last collision
        ("y", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
        ("since_s", np.float64),  # time of the last collision
        ("radius", np.float64),
        ("mass", np.float64),
        ("following", np.int32),  # next ball in the list of the cell, -1 for none
        ("collisions", np.int32),  # number of collisions
        # Up to here one cache line: the fields that other balls read.
        ("spin", np.float64),  # radians per second
        ("contact_s", np.float64),  # time of the next collision, inf for none
        ("crossing_s", np.float64),  # time at which the ball leaves its cell
        ("module_s", np.float64),  # time of the last collision with a module
        ("partner", np.int32),  # of the next collision: a ball, or one of the numbers above
        # `collisions` of the partner at the prediction: a different number now means that the
        # partner was hit in between.
        ("partner_collisions", np.int32),
        ("cell", np.int32),
        ("crossing", np.int32),  # step to the number of the next cell
        ("previous", np.int32),  # ball before in that list, -1 for none
        ("rattles", np.int32),  # successive collisions with modules only, within one contact
        ("presses", np.int32),  # successive collisions of any kind, within one contact
        ("explosive", np.int16),  # 1 for a ball of the charge, 0 for air
        ("alive", np.int16),  # 1 while it is on the site
    ],
    align=True,
)

CELL: Final = np.dtype(
    [
        ("left", np.float64),
        ("bottom", np.float64),
        ("first_air", np.int32),  # first ball of each list, -1 for none
        ("first_explosive", np.int32),
        ("surfaces_from", np.int32),  # the surfaces that a ball in this cell can touch
        ("surfaces_to", np.int32),
    ]
)

HEAP_ENTRY: Final = np.dtype(
    [
        ("time_s", np.float64),
        ("ball", np.int32),
        # Place in the heap of the ball with this entry's number; 0 if absent. Every move in the
        # heap writes a place: here they lie closer together than they would in `BALL`.
        ("place", np.int32),
    ]
)
"""Entry 0 is not in the queue: its `ball` is the number of entries."""

SURFACE: Final = np.dtype(
    [
        ("a", np.float64),  # faces: sign of the normal; corners: x
        ("b", np.float64),  # faces: coordinate along the normal; corners: y
        ("low", np.float64),  # faces: the ends across the normal
        ("high", np.float64),
        ("modules_from", np.int32),  # its modules, ordered along it, in the array of modules
        ("modules_to", np.int32),
        ("kind", np.int64),  # FACE_X, FACE_Y or CORNER
    ],
    align=True,
)

LOAD: Final = np.dtype(
    [
        ("hits", np.int64),
        ("impulse", np.float64),  # sum of m |v|
        ("transferred", np.float64),  # sum of the momentum along the normals
        ("first_hit_s", np.float64),  # inf before the first
        ("capacity", np.float64),  # impulse that the module bears, inf for any
    ]
)

RULES: Final = np.dtype(
    [
        ("left", np.float64),  # the site
        ("bottom", np.float64),
        ("right", np.float64),
        ("top", np.float64),
        ("cell_units", np.float64),  # side of a cell
        ("columns", np.int64),  # cells in a row, with the two of the ring around the site
        # By the number of explosive balls among the two:
        ("restitution", np.float64, (3,)),
        ("friction", np.float64, (3,)),
        # Of air and of explosive balls:
        ("inertia_factor", np.float64, (2,)),  # moment of inertia over m r^2
        ("module_friction", np.float64, (2,)),
        ("module_restitution", np.float64),
        ("module_shrink", np.float64),
        ("air_shrink", np.float64),
        ("minimum_radius", np.float64),
        ("base_impulse", np.float64),
        ("charge_collides", np.int64),  # 1 if balls of the charge collide with each other
        ("contact_time_s", np.float64),  # hits within this time belong to one contact
        ("rest_speed", np.float64),  # a ball slower than this within one contact is at rest
        ("quantum", np.float64),  # recorded impulses are multiples of this
        ("time_limit_s", np.float64),
        ("most_collisions", np.int64),
    ],
    align=True,
)

PROGRESS: Final = np.dtype(
    [
        ("time_s", np.float64),  # of the last collision
        ("collisions", np.int64),
        ("next_check", np.int64),  # collisions at the next check whether a structure is in reach
        ("records", np.int64),  # rows written
        ("stage", np.int64),  # NEW, RUNNING or CHANGED
        ("looked_again", np.int64),  # with CHANGED: balls already predicted again
    ]
)

RECORD_COLUMNS: Final = (
    "time_s",
    "ball",
    "module",
    "mass",
    "vx",
    "vy",
    "normal_x",
    "normal_y",
    "impulse",
    "transferred_impulse",
    "earlier_collisions",
    "first_contact",
)
"""Columns of the record by the compiled code; fields of `COLLISION_DTYPE`."""

_HALF: Final = MODULE_SIDE_UNITS / 2.0
_TOLERANCE: Final = 1e-9  # units; faces overlap by it, so that rounding opens no gap

_CORNERS: Final = _HALF * np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
"""Corners relative to the centre of a module, in the order of `WallSurface.covered_corners`."""


class Walls(NamedTuple):
    """The surfaces of all walls.

    Attributes:
        surfaces: Array of `SURFACE` (k,).
        modules: The modules of the surfaces, in order along each face, then those of corners.
    """

    surfaces: RecordArray
    modules: NDArray[np.int32]


def walls_of(centres: NDArray[np.float64], standing: NDArray[np.int64]) -> Walls:
    """Return the surfaces of the intact modules.

    Args:
        centres: Centres of all modules, units (m, 2).
        standing: Indices of the intact ones.
    """
    own = centres[standing]
    surface = wall_surface(own)
    faces, along_faces = _joined_faces(own, surface.free_faces)
    corners, at_corners = _free_corners(own, surface.covered_corners)
    corners["modules_from"] += len(along_faces)
    corners["modules_to"] += len(along_faces)
    modules = standing[np.concatenate((along_faces, at_corners))]
    return Walls(np.concatenate((faces, corners)), modules.astype(np.int32))


def spread_over_cells(
    surfaces: RecordArray,
    reach: float,
    corner: tuple[float, float],
    cell_units: float,
    shape: tuple[int, int],
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Copy each surface to all cells from which a ball can touch it.

    Args:
        surfaces: The surfaces (k,).
        reach: Largest radius of a ball.
        corner: Lower left corner of the site.
        cell_units: Side of a cell.
        shape: Rows and columns of cells, the ring around the site included.

    Returns:
        The copies, cell by cell, and the number of the first copy of each cell (cells + 1,).
    """
    # (1) The rectangle of cells that each surface, grown by the largest radius, overlaps; (2) as
    # many copies of it as cells; (3) sorted by cell, so that the surfaces of a cell are one slice.
    rows, columns = shape
    low, high = _boxes(surfaces)
    first = np.floor((low - reach - _TOLERANCE - corner) / cell_units).astype(np.int64) + 1
    last = np.floor((high + reach + _TOLERANCE - corner) / cell_units).astype(np.int64) + 1
    limit = np.array([columns - 1, rows - 1])
    first, last = np.clip(first, 0, limit), np.clip(last, 0, limit)
    width, height = (last - first + 1).T
    which = np.repeat(np.arange(len(surfaces)), width * height)
    place = np.arange(len(which)) - np.repeat(
        np.cumsum(width * height) - width * height, width * height
    )
    row, column = np.divmod(place, width[which])
    cell = (first[which, 1] + row) * columns + first[which, 0] + column
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    return surfaces[which[order]], start


def _joined_faces(
    centres: NDArray[np.float64], free_faces: NDArray[np.bool_]
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Join adjacent free faces of modules (m, 4) in one line.

    Returns:
        The faces, whose modules are numbered from 0, and the modules in order along each face.
    """
    face, member = np.nonzero(free_faces.T)
    # (1) Each free face with its line and its place along it; (2) sorted by direction, line and
    # place; (3) a face begins where the one before does not adjoin; (4) one joined face per run. A
    # ball that slides along a wall thus meets no seams between modules.
    is_x = face < 2
    across, along = np.where(is_x, centres[member].T, centres[member, ::-1].T)
    # Rounding of the metres in a scenario file must not decide which faces lie in one line.
    line, place = np.round((across, along), 9)
    order = np.lexsort((place, line, face))
    face, line, place = face[order], line[order], place[order]
    begins = np.ones(len(order), dtype=np.bool_)
    begins[1:] = np.abs(np.diff(place) - MODULE_SIDE_UNITS) > _TOLERANCE
    begins[1:] |= (np.diff(line) != 0.0) | (np.diff(face) != 0)
    starts = np.flatnonzero(begins)
    ends = np.flatnonzero(np.roll(begins, -1)) + 1
    faces = np.zeros(len(starts), dtype=SURFACE)
    faces["kind"] = np.where(face[starts] < 2, FACE_X, FACE_Y)
    sign = faces["a"] = np.where(face[starts] % 2 == 0, -1.0, 1.0)
    faces["b"] = across[order[starts]] + sign * _HALF
    faces["low"] = along[order[starts]] - _HALF - _TOLERANCE
    faces["high"] = along[order[ends - 1]] + _HALF + _TOLERANCE
    faces["modules_from"], faces["modules_to"] = starts, ends
    return faces, member[order]


def _free_corners(
    centres: NDArray[np.float64], covered_corners: NDArray[np.bool_]
) -> tuple[RecordArray, NDArray[np.int64]]:
    """Return the corners of modules beyond which no wall continues, and their modules."""
    # A corner within a wall is none: the faces beside it are in one line.
    corner, member = np.nonzero(~covered_corners.T)
    corners = np.zeros(len(member), dtype=SURFACE)
    corners["kind"] = CORNER
    corners["a"], corners["b"] = (centres[member] + _CORNERS[corner]).T
    corners["modules_from"] = np.arange(len(member))
    corners["modules_to"] = corners["modules_from"] + 1
    return corners, member


def _boxes(surfaces: RecordArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower left and the upper right ends of the surfaces (k, 2)."""
    kind, a, b = surfaces["kind"], surfaces["a"], surfaces["b"]
    low, high = surfaces["low"], surfaces["high"]
    corner, face_x = kind == CORNER, kind == FACE_X
    lower = np.where(corner, (a, b), np.where(face_x, (b, low), (low, b)))
    upper = np.where(corner, (a, b), np.where(face_x, (b, high), (high, b)))
    return lower.T, upper.T


_CELL_SPACINGS: Final = 1.2
"""Side of a cell in spacings of the air, about the fastest by measurement."""

_CELL_MARGIN: Final = 1e-6

_REST_SHARE: Final = 1e-12
"""Rest speed within one contact, as a share of the fastest ball's initial speed."""


class World(NamedTuple):
    """One blast as arrays, in the order in which the compiled loop takes them.

    Attributes:
        balls: Balls, array of `BALL` (n,).
        cells: Grid of the broad phase, array of `CELL`.
        heap: Event queue, array of `HEAP_ENTRY` (n + 1,).
        surfaces: Surfaces cell by cell, array of `SURFACE`.
        modules: Modules of the surfaces.
        loads: Loads of the modules, array of `LOAD` (m,).
        targets: Left, bottom, right and top of the structures, units (s, 4).
        rules: Constants of the run, a record of `RULES`.
        progress: State of the loop, a record of `PROGRESS`.
    """

    balls: RecordArray
    cells: RecordArray
    heap: RecordArray
    surfaces: RecordArray
    modules: NDArray[np.int32]
    loads: RecordArray
    targets: NDArray[np.float64]
    rules: Record
    progress: Record


def world_of(scene: Scene, parts: list[ModularPart], cell_units: float | None = None) -> World:
    """Return a scene as arrays.

    Args:
        cell_units: Side of a cell, at least the diameter of the largest ball; affects only the
            time of computation. By default a side suitable for the scene.

    Raises:
        BlastEnvError: If the cells are too small to hold a ball, or a ball is off the site.
    """
    rules = _rules(scene, _cell_side(scene, cell_units))
    balls = _balls(scene.balls)
    heap = np.zeros(len(balls) + 1, dtype=HEAP_ENTRY)
    loads = np.zeros(len(parts), dtype=LOAD)
    loads["first_hit_s"] = np.inf
    loads["capacity"] = [np.inf if part.capacity is None else part.capacity for part in parts]
    structures = [
        box
        for structure in scene.structures
        if not structure.is_barrier
        for box in structure.boxes_m
    ]
    # Only structures end a run that reaches none of them any more; the barrier does not count.
    targets = UNITS_PER_M * np.array(structures, dtype=np.float64).reshape(-1, 4)
    progress = np.zeros(1, dtype=PROGRESS)[0]
    cells = _cells(scene.site, rules)
    surfaces, modules = np.empty(0, dtype=SURFACE), np.empty(0, dtype=np.int32)
    world = World(balls, cells, heap, surfaces, modules, loads, targets, rules, progress)
    return with_walls(world, scene, parts)


def _cell_side(scene: Scene, wanted: float | None) -> float:
    """Return the side of a cell: the wanted one, else by the air's spacing and the number of balls.

    Input with which the compiled code would miss collisions or leave its arrays is refused.
    """
    diameter = 2.0 * float(scene.balls.radius.max(initial=0.01))
    if wanted is not None and not diameter <= wanted < np.inf:
        raise BlastEnvError(
            f"cell_units is {wanted:g}, must be at least {diameter:g}, "
            "the diameter of the largest ball, and finite"
        )
    position, site = scene.balls.position, scene.site
    on_site = (position >= site[:2]) & (position <= site[2:])
    for ball in np.flatnonzero(~on_site.all(axis=1))[:1].tolist():
        raise BlastEnvError(
            f"ball {ball} is at {tuple(position[ball].tolist())}, must be on the site {site}"
        )
    area = (site.right - site.left) * (site.top - site.bottom)
    sparse = sqrt(area / (4.0 * len(scene.balls) + 1024.0))
    usual = max(sparse, _CELL_SPACINGS * scene.parameters.air.spacing_units)
    # A little more, so that touching balls are in neighbouring cells despite rounding.
    return max((1.0 + _CELL_MARGIN) * diameter, wanted or usual)


def with_walls(world: World, scene: Scene, parts: list[ModularPart]) -> World:
    """Return a world with the walls of the modules that are not destroyed."""
    standing = np.flatnonzero(world.loads["impulse"] <= world.loads["capacity"])
    centres = np.array([(part.x, part.y) for part in parts], dtype=np.float64).reshape(-1, 2)
    walls = walls_of(centres, standing)
    surfaces, start = spread_over_cells(
        walls.surfaces,
        float(scene.balls.radius.max(initial=0.0)),
        (scene.site.left, scene.site.bottom),
        float(world.rules["cell_units"]),
        _grid_shape(scene.site, world.rules),
    )
    world.cells["surfaces_from"], world.cells["surfaces_to"] = start[:-1], start[1:]
    return world._replace(surfaces=surfaces, modules=walls.modules)


def _cells(site: Rectangle, rules: Record) -> RecordArray:
    rows, columns = _grid_shape(site, rules)
    cells = np.zeros((rows, columns), dtype=CELL)
    cells["left"] = site.left + (np.arange(columns) - 1) * rules["cell_units"]
    cells["bottom"] = site.bottom + (np.arange(rows)[:, np.newaxis] - 1) * rules["cell_units"]
    cells["first_air"] = cells["first_explosive"] = NOBODY
    return cells.ravel()


def _balls(of_scene: Balls) -> RecordArray:
    balls = np.zeros(len(of_scene), dtype=BALL)
    balls["x"], balls["y"] = of_scene.position.T
    balls["vx"], balls["vy"] = of_scene.velocity.T
    balls["radius"], balls["mass"] = of_scene.radius, of_scene.mass
    balls["explosive"] = of_scene.kind == CollisionType.ExplosionBall
    balls["alive"], balls["partner"] = 1, NOBODY
    balls["contact_s"], balls["crossing_s"], balls["module_s"] = np.inf, np.inf, -np.inf
    return balls


def _rules(scene: Scene, cell_units: float) -> Record:
    rules = np.zeros(1, dtype=RULES)[0]
    air, explosive = scene.parameters.air, scene.parameters.explosive
    contact, stepping = scene.parameters.contact, scene.parameters.stepping
    for name in ("left", "bottom", "right", "top"):
        rules[name] = getattr(scene.site, name)
    rules["cell_units"] = cell_units
    rules["columns"] = floor((scene.site.right - scene.site.left) / cell_units) + 3
    # Chipmunk multiplies what both sides have: for air and air, air and charge, charge and charge.
    for name, of_air, of_explosive in (
        ("restitution", air.elasticity, explosive.elasticity),
        ("friction", air.friction, explosive.friction),
    ):
        rules[name] = of_air * of_air, of_air * of_explosive, of_explosive * of_explosive
    rules["inertia_factor"] = air.inertia_factor, explosive.inertia_factor
    rules["module_friction"] = np.array([air.friction, explosive.friction])
    rules["module_friction"] *= contact.module_friction
    for name in ("module_restitution", "module_shrink", "air_shrink", "base_impulse"):
        rules[name] = getattr(contact, name)
    rules["minimum_radius"] = contact.minimum_radius_units
    rules["charge_collides"] = explosive.collide_within_charge
    rules["contact_time_s"] = stepping.contact_time_s
    rules["rest_speed"] = _REST_SHARE * float(
        np.linalg.norm(scene.balls.velocity, axis=1).max(initial=0.0)
    )
    rules["quantum"] = scene.impulse_quantum
    rules["time_limit_s"] = stepping.time_limit_s
    rules["most_collisions"] = stepping.most_collisions
    return rules


def _grid_shape(site: Rectangle, rules: Record) -> tuple[int, int]:
    """Return rows and columns of cells, with a ring of empty ones around the site."""
    return floor((site.top - site.bottom) / float(rules["cell_units"])) + 3, int(rules["columns"])
