"""A wall in the open that faces the charge, as dimensionless numbers of its bays.

The curves are of an endless wall. Before a real one the wave flows off round its ends and over its
roof: the reflected pressure falls sooner, and the impulse is less ("clearing"). Where the wave
comes at a slant, and near the charge, it is more than by the rule of the curves. Loads are relative
to those of the curves at the same distance and angle; peaks, which come before the relief, are
those of the curves.

A charge against a wall is one of twice the mass over open ground, by its image in the wall. Nearer
to the wall than the blasts of the law, loads go over to that limit.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.atlas.laws import Factors, Law

NUMBERS: Final[Sequence[str]] = (
    "facing",
    "ln_distance",
    "cosine",
    "ln_charge_to_wall",
    "root_to_near_end",
    "root_to_far_end",
    "root_to_roof",
    "bay_height",
    "charge_height",
)
"""Names of the columns of `numbers_of_edges`."""

_LEAST: Final = 0.02
_TWICE: Final = np.array([2.0 ** (2.0 / 3.0), 2.0])
"""Most that twice the mass adds to impulse and peak: by Hopkinson and Cranz, loads that fall at
least with the distance, and at most with its cube."""


def numbers_of_edges(
    charge: FloatArray, bays: FloatArray, normal: FloatArray, ends: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the numbers of the law of edges (bays, numbers), see `NUMBERS`.

    Args:
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays of one wall (bays, 3).
        normal: Its outward normal (3,).
        ends: Distances of each bay from both ends of the wall (bays, 2).
        high: Height of the wall over each bay's ground (bays,).
    """
    way = charge - bays
    distance = np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    near, far = np.sort(np.maximum(ends, 0.0), axis=1).T
    return np.column_stack(
        [
            np.ones(len(bays)),
            np.log(distance),
            way @ normal / distance,
            np.log(np.maximum(way @ normal, _LEAST)),
            np.sqrt(near),
            np.sqrt(far),
            np.sqrt(np.maximum(high - bays[:, 2], 0.0)),
            bays[:, 2],
            np.broadcast_to(charge[..., 2], len(bays)),
        ]
    )


def factors_of_edges(law: Law, numbers: FloatArray) -> Factors:
    """Return the factors for edges and angles; outside the range they take nothing off.

    A charge that is too near to the wall adds up to what twice its mass would.

    Args:
        law: The law of edges.
        numbers: Numbers of bays that face the charge (bays, numbers).
    """
    found = law.factors(numbers)
    unknown = ~found.in_range[:, np.newaxis]
    column = NUMBERS.index("ln_charge_to_wall")
    share = np.clip(1.0 - np.exp(numbers[:, column] - law.least[column]), 0.0, 1.0)[:, np.newaxis]

    def within(own: FloatArray) -> FloatArray:
        own = np.where(unknown, np.maximum(own, 1.0), own)
        return np.asarray((1.0 - share) * own + share * np.maximum(own, _TWICE))

    middle, low, high = (within(own) for own in found[:3])
    return Factors(middle, low, high, found.in_range)


def is_against(law: Law, numbers: FloatArray) -> BoolArray:
    """Return whether the charge is nearer to the wall than the law knows (bays,)."""
    column = NUMBERS.index("ln_charge_to_wall")
    return np.asarray(numbers[:, column] < law.least[column] - 1e-6)
