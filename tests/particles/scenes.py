"""Scenes made by hand: balls and modules exactly where a test wants them, and how to run them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from blast_env.evaluation.engines import ParticleEngine
from blast_env.evaluation.engines.particles import EventEngine
from blast_env.geometry import Rectangle
from blast_env.particles import Balls, BallStates, BlastRun, CollisionType, Scene
from blast_env.particles.pymunk.engine import PymunkRun
from blast_env.site import Charge, SimulationParameters, StructureOutline, with_overrides
from blast_env.units import UNITS_PER_M

EXPLOSIVE, AIR = CollisionType.ExplosionBall, CollisionType.AirBall
KEEP_MASS: dict[str, object] = {"air_shrink": 1.0, "module_shrink": 1.0}
EVENT = EventEngine()


def parameters(**overrides: Mapping[str, object]) -> SimulationParameters:
    """Return the default parameters with some replaced, group by group.

    The time limit is long, so that balls far from any structure are not out of reach.
    """
    stepping = {"time_limit_s": 5.0, **overrides.pop("stepping", {})}
    return with_overrides(SimulationParameters(), overrides | {"stepping": stepping})


def balls(
    kinds: Sequence[int],
    positions: ArrayLike,
    velocities: ArrayLike,
    mass: ArrayLike = 1.0,
    radius: ArrayLike = 1.0,
) -> Balls:
    """Return balls with the given states."""
    count = len(kinds)
    return Balls(
        kind=np.array(kinds, dtype=np.uint8),
        position=np.array(positions, dtype=np.float64).reshape(-1, 2),
        velocity=np.array(velocities, dtype=np.float64).reshape(-1, 2),
        mass=np.broadcast_to(np.asarray(mass, dtype=np.float64), count).copy(),
        radius=np.broadcast_to(np.asarray(radius, dtype=np.float64), count).copy(),
    )


def wall(
    corner: tuple[float, float],
    rows: int,
    columns: int,
    name: str = "wall",
    cells: tuple[tuple[int, int], ...] | None = None,
    capacity: float | None = None,
) -> StructureOutline:
    """Return a protected structure with its lower left corner at `corner`, units."""
    return StructureOutline(
        kind="ModularObstacle",
        name=name,
        corner_m=(corner[0] / UNITS_PER_M, corner[1] / UNITS_PER_M),
        rows=rows,
        columns=columns,
        protected=True,
        weight=1.0,
        cells=cells,
        capacity=capacity,
    )


FACADE = wall((100.0, 90.0), 10, 1)
"""From (100, 90) to (102, 110), units."""

FAR_WALL = wall((180.0, 180.0), 2, 2)
"""A structure that nothing reaches."""


def scene(
    of_balls: Balls,
    structures: Sequence[StructureOutline],
    of_parameters: SimulationParameters,
    size: tuple[float, float] = (200.0, 200.0),
) -> Scene:
    """Return a scene with exactly these balls and structures."""
    return Scene(
        site_m=Rectangle(0.0, 0.0, *size).scaled(1.0 / UNITS_PER_M),
        charge=Charge((size[0] / 8, size[1] / 8), 100.0),
        balls=of_balls,
        structures=tuple(structures),
        parameters=of_parameters,
    )


def closed_box(
    corner: tuple[float, float], modules: tuple[int, int], name: str = "box"
) -> list[StructureOutline]:
    """Return four walls, one module thick, around a space of (columns, rows) modules.

    Args:
        corner: Lower left corner of the space inside, units.
        modules: Columns and rows of modules that would fit inside.
        name: Prefix of the walls' names.
    """
    (x, y), (columns, rows) = corner, modules
    return [
        wall((x - 2.0, y - 2.0), rows + 2, 1, f"{name} left"),
        wall((x + 2.0 * columns, y - 2.0), rows + 2, 1, f"{name} right"),
        wall((x, y - 2.0), 1, columns, f"{name} lower"),
        wall((x, y + 2.0 * rows), 1, columns, f"{name} upper"),
    ]


def finished(of_scene: Scene, engine: ParticleEngine = EVENT) -> BlastRun:
    """Return the run of a scene at its end."""
    run = engine.start(of_scene)
    run.advance(np.inf)
    return run


def states_at(of_scene: Scene, time_s: float, engine: ParticleEngine = EVENT) -> BallStates:
    """Return the balls of a scene at a time."""
    run = engine.start(of_scene)
    run.advance(time_s)
    return run.balls()


def momentum(states: Balls | BallStates) -> np.ndarray:
    """Return the momentum (2,)."""
    total: np.ndarray = (states.mass[:, None] * states.velocity).sum(axis=0)
    return total


def energy(states: Balls | BallStates) -> float:
    """Return the kinetic energy without that of the spins."""
    return float(0.5 * (states.mass * (states.velocity**2).sum(axis=1)).sum())


def hot_cloud(
    settings: SimulationParameters, structures: Sequence[StructureOutline], seed: int = 3
) -> Scene:
    """Return a dense, hot square of air, ten times as light as the explosive ball shot into it."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2)
    position = 70.0 + 2.2 * grid + rng.uniform(-0.1, 0.1, grid.shape)
    velocity = rng.normal(0.0, 200.0, grid.shape)
    return scene(
        balls(
            [AIR] * len(grid) + [EXPLOSIVE],
            [*map(tuple, position), (60.0, 81.0)],
            [*map(tuple, velocity), (1000.0, 37.0)],
            mass=[0.1] * len(grid) + [1.0],
        ),
        structures,
        settings,
    )


def step_s(run: BlastRun) -> float:
    """Return how far behind an event the engine may notice it."""
    return run.time_step_s if isinstance(run, PymunkRun) else 1e-12
