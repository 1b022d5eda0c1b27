"""The arrays of the event engine, for what a run does not show: the spins of the balls."""

import numpy as np

from blast_env.particles.event.engine import run_world
from blast_env.particles.event.state import RECORD_COLUMNS, RecordArray, World, world_of
from blast_env.site.scene import Scene


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


def inertia(balls: RecordArray, factor: float) -> np.ndarray:
    """Return the moments of inertia (n,) of balls that have `factor` m r^2."""
    moments: np.ndarray = factor * balls["mass"] * balls["radius"] ** 2
    return moments


def whole_energy(balls: RecordArray, inertia_factor: float) -> float:
    """Return the kinetic energy with that of the spins."""
    of_motion = balls["mass"] * (balls["vx"] ** 2 + balls["vy"] ** 2)
    of_spin = inertia(balls, inertia_factor) * balls["spin"] ** 2
    return float(0.5 * (of_motion + of_spin).sum())


def angular_momentum(balls: RecordArray, inertia_factor: float) -> float:
    """Return the angular momentum about the origin with that of the spins."""
    of_motion = balls["mass"] * (balls["x"] * balls["vy"] - balls["y"] * balls["vx"])
    return float((of_motion + inertia(balls, inertia_factor) * balls["spin"]).sum())
