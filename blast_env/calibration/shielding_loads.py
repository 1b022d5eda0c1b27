"""The loads on the faces of a structure, from the collision record of a blast."""

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.collisions import CollisionArray
from blast_env.simulation import BlastResult

FloatArray = NDArray[np.float64]

LATE_SHARE_OF_TIME: Final = 0.2
"""The last part of the time limit; what arrives in it shows whether loads are complete."""

_LEAST_COSINE: Final = 0.99  # of a normal with its face's; hits on corners belong to no face


class Face(IntEnum):
    """A side of a structure, for someone who looks along x, from the charge."""

    FRONT = 0
    BACK = 1
    LEFT = 2
    RIGHT = 3


class LoadKind(IntEnum):
    """What is summed up.

    Attributes:
        TRANSFERRED: Momentum really transferred along the normal, simulation units.
        IMPULSE: The paper's m |v|, simulation units.
        LATE: As `TRANSFERRED`, of the last fifth of the time limit.
    """

    TRANSFERRED = 0
    IMPULSE = 1
    LATE = 2


def face_loads(result: BlastResult) -> FloatArray:
    """Return the loads on the faces of the modules of the one structure of a blast.

    Returns:
        Loads (kinds, faces, rows, columns), indexed by `LoadKind` and `Face`.
    """
    collisions = result.collision_array
    (structure,) = result.obstacles
    limit_s = result.blast.scene.parameters.stepping.time_limit_s
    late = collisions["time_s"] >= (1.0 - LATE_SHARE_OF_TIME) * limit_s
    transferred = collisions["transferred_impulse"]
    amounts = {
        LoadKind.TRANSFERRED: transferred,
        LoadKind.IMPULSE: collisions["impulse"],
        LoadKind.LATE: np.where(late, transferred, 0.0),
    }
    # The modules of a whole grid are numbered row by row.
    loads = np.zeros((len(LoadKind), len(Face), structure.rows * structure.columns))
    for face, on_face in faces_hit(collisions).items():
        for kind, amount in amounts.items():
            np.add.at(loads[kind, face], collisions["module"][on_face], amount[on_face])
    return loads.reshape(len(LoadKind), len(Face), structure.rows, structure.columns)


def faces_hit(collisions: CollisionArray) -> dict[Face, NDArray[np.bool_]]:
    """Return for each face which collisions (n,) are with it."""
    x, y = collisions["normal_x"], collisions["normal_y"]
    outward = {Face.FRONT: -x, Face.BACK: x, Face.LEFT: y, Face.RIGHT: -y}
    return {face: cosine > _LEAST_COSINE for face, cosine in outward.items()}
