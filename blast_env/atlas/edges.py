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
    "along",
)
"""Names of the columns of `numbers_of_edges`."""

LEAST_TO_WALL: Final = 0.33
"""Distance of a charge from a wall, m/kg^(1/3), nearer than which no blast of the law is."""

_LEAST: Final = 0.02
_LEAST_ALONG: Final = 0.05
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
        ends: Distances of each bay from the ends of the wall on the right and on the left (bays,
            2), seen from outside.
        high: Height of the wall over each bay's ground (bays,).
    """
    way = charge - bays
    distance = np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    near, far = np.sort(np.maximum(ends, 0.0), axis=1).T
    aside, there = _along(way, normal, ends)
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
            np.clip(there / np.maximum(aside, _LEAST), _LEAST_ALONG, 1.0),
        ]
    )


def to_the_wall(
    charge: FloatArray, bays: FloatArray, normal: FloatArray, ends: FloatArray
) -> FloatArray:
    """Return the distance of the charge from the wall, in plan (bays,), see `numbers_of_edges`."""
    way = charge - bays
    aside, there = _along(way, normal, ends)
    return np.hypot(way @ normal, np.maximum(aside - there, 0.0))


def _along(way: FloatArray, normal: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far the charge is aside of bays, and how far their wall goes on there (bays,)."""
    to_left = way @ np.array([normal[1], -normal[0], 0.0])
    return np.abs(to_left), np.maximum(np.where(to_left > 0.0, ends[:, 1], ends[:, 0]), 0.0)


def factors_of_edges(law: Law, numbers: FloatArray, to_wall: FloatArray) -> Factors:
    """Return the factors for edges and angles; outside the range they take nothing off.

    A charge that is too near to the wall adds up to what twice its mass would.

    Args:
        law: The law of edges.
        numbers: Numbers of bays that face the charge (bays, numbers).
        to_wall: Distance of the charge from their wall, see `to_the_wall` (bays,).
    """
    found = law.factors(numbers)
    unknown = (~found.in_range | is_against(to_wall))[:, np.newaxis]
    share = np.clip(1.0 - to_wall / LEAST_TO_WALL, 0.0, 1.0)[:, np.newaxis]

    def within(own: FloatArray) -> FloatArray:
        own = np.where(unknown, np.maximum(own, 1.0), own)
        return np.asarray((1.0 - share) * own + share * np.maximum(own, _TWICE))

    middle, low, high = (within(own) for own in found[:3])
    return Factors(middle, low, high, found.in_range)


def is_against(to_wall: FloatArray) -> BoolArray:
    """Return whether the charge is nearer to the wall than the law knows (bays,)."""
    return np.asarray(to_wall < LEAST_TO_WALL - 1e-6)
