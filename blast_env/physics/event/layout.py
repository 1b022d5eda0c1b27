"""A scene as the arrays of the event engine."""

from math import floor, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.physics.event.arrays import (
    BALL,
    CELL,
    HEAP_ENTRY,
    LOAD,
    NOBODY,
    PROGRESS,
    RULES,
    SURFACE,
    Record,
    RecordArray,
)
from blast_env.physics.event.walls import spread_over_cells, walls_of
from blast_env.physics.particles import Balls, CollisionType
from blast_env.physics.structure import ModularPart
from blast_env.scene import Scene

_CELL_SPACINGS: Final = 1.2
"""Side of a cell in spacings of the air; measured to be about the fastest."""

_CELL_MARGIN: Final = 1e-6

_REST_SHARE: Final = 1e-12
"""Of the fastest ball's first speed: slower than that, within one contact, is at rest."""


class World(NamedTuple):
    """One blast as arrays, in the order in which the compiled loop takes them.

    Attributes:
        balls: Of `BALL` (n,).
        cells: Of `CELL`.
        heap: Of `HEAP_ENTRY` (n + 1,).
        surfaces: Of `SURFACE`, cell by cell.
        modules: Modules of the surfaces.
        loads: Of `LOAD` (m,).
        targets: Left, bottom, right and top of the structures (s, 4).
        rules: Of `RULES`.
        progress: Of `PROGRESS`.
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
        scene: The scene.
        parts: Its modules.
        cell_units: Side of a cell, which changes the speed and nothing else; at least the
            diameter of the largest ball. By default what suits the scene.

    Raises:
        BlastEnvError: If the cells are too small to hold a ball, or a ball is off the site.
    """
    _check(scene, cell_units)
    # A little more, so that balls in touch are in neighbouring cells whatever the rounding.
    smallest = (1.0 + _CELL_MARGIN) * _largest_diameter(scene)
    rules = _rules(scene, max(smallest, cell_units or _cell_units(scene)))
    balls = _balls(scene.balls)
    heap = np.zeros(len(balls) + 1, dtype=HEAP_ENTRY)
    loads = np.zeros(len(parts), dtype=LOAD)
    loads["first_hit_s"] = np.inf
    loads["capacity"] = [np.inf if part.capacity is None else part.capacity for part in parts]
    structures = [outline.rectangle for outline in scene.structures if outline.cells is None]
    targets = np.array(structures, dtype=np.float64).reshape(-1, 4)
    progress = np.zeros(1, dtype=PROGRESS)[0]
    cells = _cells(scene.site, rules)
    surfaces, modules = np.empty(0, dtype=SURFACE), np.empty(0, dtype=np.int32)
    world = World(balls, cells, heap, surfaces, modules, loads, targets, rules, progress)
    return with_walls(world, scene, parts)


def _check(scene: Scene, cell_units: float | None) -> None:
    """Refuse what would make the compiled code miss collisions or leave its arrays."""
    diameter = _largest_diameter(scene)
    if cell_units is not None and not diameter <= cell_units < np.inf:
        raise BlastEnvError(
            f"cell_units is {cell_units:g}, must be at least {diameter:g}, "
            "the diameter of the largest ball, and finite"
        )
    position, site = scene.balls.position, scene.site
    on_site = (position >= site[:2]) & (position <= site[2:])
    for ball in np.flatnonzero(~on_site.all(axis=1))[:1].tolist():
        raise BlastEnvError(
            f"ball {ball} is at {tuple(position[ball].tolist())}, must be on the site {site}"
        )


def with_walls(world: World, scene: Scene, parts: list[ModularPart]) -> World:
    """Return a world with the walls that are left when some modules are destroyed."""
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


def _cell_units(scene: Scene) -> float:
    """Return a good side of a cell: the spacing of the air, and not many more cells than balls."""
    width, height = scene.site.right - scene.site.left, scene.site.top - scene.site.bottom
    sparse = sqrt(width * height / (4.0 * len(scene.balls) + 1024.0))
    return max(sparse, _CELL_SPACINGS * scene.parameters.air.spacing_units)


def _largest_diameter(scene: Scene) -> float:
    return 2.0 * float(scene.balls.radius.max(initial=0.01))


def _grid_shape(site: Rectangle, rules: Record) -> tuple[int, int]:
    """Return rows and columns of cells, with a ring of empty ones around the site."""
    return floor((site.top - site.bottom) / float(rules["cell_units"])) + 3, int(rules["columns"])
