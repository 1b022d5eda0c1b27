"""Scenes made by hand: balls and modules exactly where a test wants them."""

from collections.abc import Sequence

import numpy as np

from blast_env.geometry import Rectangle
from blast_env.physics.parameters import SimulationParameters
from blast_env.physics.particles import Balls, CollisionType
from blast_env.physics.presets import with_overrides
from blast_env.physics.structure import ModularObstacle
from blast_env.scenario import Charge
from blast_env.scene import Scene, StructureOutline

EXPLOSIVE, AIR = CollisionType.ExplosionBall, CollisionType.AirBall


def parameters(**overrides: dict[str, object]) -> SimulationParameters:
    """Return the default parameters with some replaced, group by group.

    The time limit is long, so that balls far from any structure are not out of reach.
    """
    stepping = {"time_limit_s": 5.0} | overrides.pop("stepping", {})
    return with_overrides(SimulationParameters(), overrides | {"stepping": stepping})


def balls(
    kinds: Sequence[CollisionType],
    positions: Sequence[tuple[float, float]],
    velocities: Sequence[tuple[float, float]],
    mass: float | Sequence[float] = 1.0,
    radius: float | Sequence[float] = 1.0,
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
        kind=ModularObstacle,
        name=name,
        corner=corner,
        rows=rows,
        columns=columns,
        protected=True,
        weight=1.0,
        cells=cells,
        capacity=capacity,
    )


def scene(
    of_balls: Balls,
    structures: Sequence[StructureOutline],
    of_parameters: SimulationParameters,
    size: tuple[float, float] = (200.0, 200.0),
) -> Scene:
    """Return a scene with exactly these balls and structures."""
    return Scene(
        site=Rectangle(0.0, 0.0, *size),
        charge_centre=(size[0] / 2, size[1] / 2),
        charge=Charge((size[0] / 8, size[1] / 8), 100.0),
        balls=of_balls,
        structures=tuple(structures),
        parameters=of_parameters,
    )
