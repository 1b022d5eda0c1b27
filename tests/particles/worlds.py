"""The arrays of the event engine, for what a run does not show: the spins of the balls."""

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.particles import Scene
from blast_env.particles.event import RECORD_COLUMNS, RecordArray, World, run_world, world_of


class WorldRun:
    """A run of a scene that gives access to its arrays.

    Attributes:
        world: The arrays.
    """

    def __init__(self, scene: Scene) -> None:
        parts = [part for obstacle in scene.obstacles() for part in obstacle.parts]
        self.world: World = world_of(scene, parts)
        self._record = np.empty((100_000, len(RECORD_COLUMNS)))

    def balls_at(self, time_s: float) -> RecordArray:
        """Return the balls at a time, of `BALL` (n,)."""
        run_world(self.world, self._record, time_s)
        balls = self.world.balls.copy()
        passed = time_s - balls["since_s"]
        balls["x"] += balls["vx"] * passed
        balls["y"] += balls["vy"] * passed
        return balls


def column(balls: RecordArray, name: str) -> FloatArray:
    """Return one field of the balls (n,), typed: mypy takes seconds for sums of untyped arrays."""
    values: FloatArray = balls[name]
    return values


def inertia(balls: RecordArray, factor: float) -> FloatArray:
    """Return the moments of inertia (n,) of balls that have `factor` m r^2."""
    return factor * column(balls, "mass") * column(balls, "radius") ** 2


def whole_energy(balls: RecordArray, inertia_factor: float) -> float:
    """Return the kinetic energy with that of the spins."""
    square_speed = column(balls, "vx") ** 2 + column(balls, "vy") ** 2
    of_spin = inertia(balls, inertia_factor) * column(balls, "spin") ** 2
    return float(0.5 * (column(balls, "mass") * square_speed + of_spin).sum())


def angular_momentum(balls: RecordArray, inertia_factor: float) -> float:
    """Return the angular momentum about the origin with that of the spins."""
    x, y, vx, vy = (column(balls, name) for name in ("x", "y", "vx", "vy"))
    of_spin = inertia(balls, inertia_factor) * column(balls, "spin")
    return float((column(balls, "mass") * (x * vy - y * vx) + of_spin).sum())
