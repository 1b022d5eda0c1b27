"""The interface of a run of the particle model, from a scene to its collisions.

The main result is the record of the collisions with modules (paper, section 2.8).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import distance_to_rectangle
from blast_env.particles.scene import Scene
from blast_env.particles.structure import ModularObstacle
from blast_env.results import EndReason
from blast_env.units import UNITS_PER_M

COLLISION_DTYPE = np.dtype(
    [
        ("time_s", np.float64),
        ("kind", np.uint8),  # CollisionType of the ball
        ("ball", np.int64),  # index into the scene's balls
        ("module", np.int64),  # index into the scene's modules
        ("mass", np.float64),  # before the collision
        ("vx", np.float64),  # velocity before the collision, units per second
        ("vy", np.float64),
        ("normal_x", np.float64),  # unit vector out of the module
        ("normal_y", np.float64),
        ("impulse", np.float64),  # m |v| before the collision, see `Scene.impulse_quantum`
        ("transferred_impulse", np.float64),  # along the normal, as given by the solver
        ("earlier_collisions", np.int64),  # of this ball, with anything
        ("first_contact", np.bool_),  # of this module
    ]
)

CollisionArray = NDArray[np.void]


class CollisionLog:
    """Collisions in the order of time."""

    def __init__(self) -> None:
        self._arrays: list[CollisionArray] = []
        self._rows: list[tuple[float, ...]] = []  # after those of the arrays

    def __len__(self) -> int:
        return sum(map(len, self._arrays)) + len(self._rows)

    def extend(self, collisions: CollisionArray) -> None:
        """Add an array of `COLLISION_DTYPE`."""
        self._gather_rows()
        self._arrays.append(collisions)

    def append(
        self,
        *,
        time_s: float,
        kind: int,
        ball: int,
        module: int,
        mass: float,
        velocity: tuple[float, float],
        normal: tuple[float, float],
        impulse: float,
        transferred_impulse: float,
        earlier_collisions: int,
        first_contact: bool,
    ) -> None:
        """Add a collision; the arguments are the fields of `COLLISION_DTYPE`."""
        who = (time_s, kind, ball, module, mass)
        what = (*velocity, *normal, impulse, transferred_impulse)
        self._rows.append((*who, *what, earlier_collisions, first_contact))

    def to_array(self, start: int = 0) -> CollisionArray:
        """Return the collisions from `start` on as an array of `COLLISION_DTYPE`."""
        self._gather_rows()
        if len(self._arrays) != 1:
            empty = np.empty(0, dtype=COLLISION_DTYPE)
            self._arrays = [np.concatenate([empty, *self._arrays])]
        return self._arrays[0][start:].copy()

    def _gather_rows(self) -> None:
        if self._rows:
            self._arrays.append(np.array(self._rows, dtype=COLLISION_DTYPE))
            self._rows = []


def _floats(collisions: CollisionArray, column: str) -> NDArray[np.float64]:
    values: NDArray[np.float64] = collisions[column]
    return values


def incidence_angle_rad(collisions: CollisionArray) -> NDArray[np.float64]:
    """Return the angle of incidence (n,): 0 is head-on, pi/2 grazing.

    It is the angle between the reversed velocity before the collision and the module's normal.
    """
    columns = ("vx", "vy", "normal_x", "normal_y")
    vx, vy, normal_x, normal_y = (_floats(collisions, name) for name in columns)
    towards = -(vx * normal_x + vy * normal_y)
    across = np.abs(vx * normal_y - vy * normal_x)
    angle: NDArray[np.float64] = np.arctan2(across, towards)
    return angle


@dataclass(frozen=True, eq=False)
class BallStates:
    """The remaining balls, in simulation units.

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
    """Return whether any moving ball can still act on a structure in the remaining time.

    Directions are ignored, since a collision may change them, and speeds are doubled, because a
    ball at rest leaves a collision with at most twice the speed of the ball that hits it.

    Args:
        scene: The scene; its barrier does not count as a structure.
    """
    # A bound that is cheap and never wrong: straight distance to the nearest structure against the
    # farthest way that is left.
    distance = np.full(len(balls), np.inf)
    for outline in scene.structures:
        for box in () if outline.is_barrier else outline.boxes_m:
            to_this = distance_to_rectangle(balls.position, box.scaled(UNITS_PER_M))
            distance = np.minimum(distance, to_this)
    reach = 2.0 * balls.speed * within_s
    return bool(((reach > 0.0) & (distance - balls.radius <= reach)).any())


class BlastRun(Protocol):
    """One blast in progress.

    Attributes:
        scene: The initial state.
        obstacles: The structures with their current hits.
        log: The collisions with modules up to now.
        time_s: Simulated time.
        steps: Number of steps of the engine.
        end_reason: Reason for the end of the run; `None` before it.
    """

    scene: Scene
    obstacles: tuple[ModularObstacle, ...]
    log: CollisionLog
    time_s: float
    steps: int
    end_reason: EndReason | None

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`, or the run has ended.

        The division of a run into calls does not change its results.
        """

    def balls(self) -> BallStates:
        """Return the remaining balls."""
