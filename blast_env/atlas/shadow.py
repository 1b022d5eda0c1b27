"""Walls of a building that face away from the charge, as dimensionless numbers.

The wave comes round the ends of the building and over its roof. Loads are relative to the side-on
load of the open ground at the same distance.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray

NUMBERS: Final[Sequence[str]] = (
    "away",
    "ln_distance",
    "cosine",
    "round_the_end",
    "over_the_roof",
    "bay_height",
    "building_height",
    "across",
)
"""Names of the columns of `numbers_of_shadow`."""

_LEAST: Final = 0.02


def numbers_of_shadow(
    charge: FloatArray, bays: FloatArray, normals: FloatArray, box: FloatArray
) -> FloatArray:
    """Return the numbers of the law of shadows (bays, numbers), see `NUMBERS`.

    Args:
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays (bays, 3).
        normals: Their outward normals (bays, 3).
        box: Low x, y, high x, y, base and top of the building (6,).
    """
    charge = np.broadcast_to(charge, bays.shape)
    way = charge - bays
    distance = np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    corners = np.array([[box[0], box[1]], [box[2], box[1]], [box[2], box[3]], [box[0], box[3]]])
    to_charge = np.linalg.norm(corners - charge[:, np.newaxis, :2], axis=2)
    to_bays = np.linalg.norm(corners[np.newaxis] - bays[:, np.newaxis, :2], axis=2)
    # Round the nearest end of the bay's own wall.
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    out = ((corners[np.newaxis] - bays[:, np.newaxis, :2]) * normals[:, np.newaxis, :2]).sum(axis=2)
    own_wall = out > out.max(axis=1, keepdims=True) - 1e-3
    plan = np.linalg.norm(way[:, :2], axis=1)
    round_the_end = np.where(own_wall, to_charge + to_bays, np.inf).min(axis=1) - plan
    size = np.abs(((corners[np.newaxis, 2] - corners[np.newaxis, 0]) * along).sum(axis=1))
    return np.column_stack(
        [
            np.ones(len(bays)),
            np.log(distance),
            (way * normals).sum(axis=1) / distance,
            np.sqrt(np.maximum(round_the_end, 0.0)),
            np.maximum(box[5] - bays[:, 2], 0.0),
            bays[:, 2],
            np.full(len(bays), box[5]),
            size,
        ]
    )
