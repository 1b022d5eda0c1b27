"""The record of collisions with modules that an engine writes (section 2.8)."""

import numpy as np
from numpy.typing import NDArray

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
        ("transferred_impulse", np.float64),  # along the normal, what the solver really gave
        ("earlier_collisions", np.int64),  # of this ball, with anything
        ("first_contact", np.bool_),  # of this module
    ]
)

CollisionArray = NDArray[np.void]


class CollisionLog:
    """Collisions in the order in which they happened."""

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

    The angle between the reversed velocity before the collision and the module's normal.
    """
    columns = ("vx", "vy", "normal_x", "normal_y")
    vx, vy, normal_x, normal_y = (_floats(collisions, name) for name in columns)
    towards = -(vx * normal_x + vy * normal_y)
    across = np.abs(vx * normal_y - vy * normal_x)
    angle: NDArray[np.float64] = np.arctan2(across, towards)
    return angle
