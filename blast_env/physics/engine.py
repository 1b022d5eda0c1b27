"""What a run of the particle model offers: a scene goes in, what happened comes out."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.collisions import CollisionLog
from blast_env.physics.particles import distance_to_rectangle
from blast_env.physics.scene import Scene
from blast_env.physics.structure import ModularObstacle
from blast_env.units import UNITS_PER_M


class EndReason(StrEnum):
    """Why a run ended."""

    OUT_OF_REACH = "no moving ball can reach a structure before the time limit"
    TIME_LIMIT = "the time limit was reached"
    LOADS_COMPLETE = "the loads on the structures are complete"
    EVENT_LIMIT = "the limit of collisions was reached before the end"


@dataclass(frozen=True, eq=False)
class BallStates:
    """The balls that are still there, simulation units.

    Attributes:
        index: Index into the scene's balls (n,), ascending.
        kind: `CollisionType` (n,).
        position: Centres (n, 2).
        velocity: Velocities (n, 2).
        mass: Masses (n,).
        radius: Radii (n,).
    """

    index: NDArray[np.int64]
    kind: NDArray[np.uint8]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    mass: NDArray[np.float64]
    radius: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.index)

    @property
    def speed(self) -> NDArray[np.float64]:
        """Speeds (n,)."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])


def can_reach(balls: BallStates, scene: Scene, within_s: float) -> bool:
    """Return whether any moving ball can still act on a structure in the time that is left.

    Directions do not count, since a collision may change them, and speeds count double: a ball
    that is hit leaves at most twice as fast as the one that hit it came.

    Args:
        balls: The balls that are still there.
        scene: The scene; its barrier is no structure here.
        within_s: The time left.
    """
    distance = np.full(len(balls), np.inf)
    for outline in scene.structures:
        if outline.cells is None:
            rectangle = outline.rectangle_m.scaled(UNITS_PER_M)
            to_this = distance_to_rectangle(balls.position, rectangle)
            distance = np.minimum(distance, to_this)
    reach = 2.0 * balls.speed * within_s
    return bool(((reach > 0.0) & (distance - balls.radius <= reach)).any())


class BlastRun(Protocol):
    """One blast on its way.

    Attributes:
        scene: The initial state.
        obstacles: The structures with the hits so far.
        log: The collisions with modules so far.
        time_s: Simulated time so far.
        steps: Steps of the engine so far.
        end_reason: Why the run has ended; None while it has not.
    """

    scene: Scene
    obstacles: tuple[ModularObstacle, ...]
    log: CollisionLog
    time_s: float
    steps: int
    end_reason: EndReason | None

    def advance(self, until_s: float) -> None:
        """Go on until the simulated time is at least `until_s`, or the run has ended.

        How a run is cut into calls does not change it.
        """

    def balls(self) -> BallStates:
        """Return the balls that are still there."""
