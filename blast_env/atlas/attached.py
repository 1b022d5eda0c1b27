"""What adjoins a wall, under or over its bays, as dimensionless numbers.

A canopy, and storeys that project, catch the wave over a bay; a podium, or a storey that stands
before the rest, keeps it off the bays above. Both count by the angle that they fill, seen from the
bay, and by the share of the wall's length about the bay that they cover. Without them the factor is
1.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray

NUMBERS: Final[Sequence[str]] = (
    "roofed",
    "podium",
    "depth",
    "storeys",
    "ln_distance",
    "cosine",
    "bay_height",
    "charge_height",
    "building_height",
)
"""Names of the columns of `numbers_of_attached`."""

_ABOUT: Final = 0.3  # m/kg^(1/3): width of the bell along the wall
_GAP: Final = 0.05  # m/kg^(1/3): nearer to the wall it adjoins it
_LEAST: Final = 0.02
_STOREYS: Final = 1.5


def is_attached(bays: FloatArray, normal: FloatArray, boxes: FloatArray) -> BoolArray:
    """Return which boxes adjoin the wall of some bays, under or over one of them (boxes,).

    Args:
        bays: Middles of the bays of one wall (bays, 3).
        normal: Its outward normal (3,).
        boxes: Low x, y, high x, y, base and top of each box (boxes, 6).
    """
    near, far, left, right = _in_the_wall(normal, boxes)
    plane, along = float(bays[0] @ normal), bays @ _across(normal)
    over = ((along[:, np.newaxis] > left) & (along[:, np.newaxis] < right)).any(axis=0)
    return np.asarray((near < plane + _GAP) & (far > plane + _GAP) & over)


def numbers_of_attached(
    charge: FloatArray, bays: FloatArray, normal: FloatArray, boxes: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the numbers of the law of what adjoins a wall (bays, numbers), see `NUMBERS`.

    Args:
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays of one wall (bays, 3).
        normal: Its outward normal (3,).
        boxes: Low x, y, high x, y, base and top of each box that adjoins it (boxes, 6).
        high: Height of the building of each bay (bays,).
    """
    from scipy.special import ndtr  # takes a while to import

    charge = np.broadcast_to(charge, bays.shape)
    way = charge - bays
    distance = np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    _, far, left, right = _in_the_wall(normal, boxes)
    along, up = (bays @ _across(normal))[:, np.newaxis], bays[:, 2, np.newaxis]
    covered = ndtr((right - along) / _ABOUT) - ndtr((left - along) / _ABOUT)
    depth = np.maximum(far - float(bays[0] @ normal), _LEAST)
    base, top = boxes[:, 4], boxes[:, 5]
    roofed, podium = (
        np.where(gap > 0.0, covered * depth / (depth + np.maximum(gap, 0.0)), 0.0)
        for gap in (base - up, up - top)
    )
    storeys = np.where(base > up, covered * np.minimum(top - base, _STOREYS), 0.0)
    return np.column_stack(
        [
            np.minimum(roofed.sum(axis=1), 1.0),
            np.minimum(podium.sum(axis=1), 1.0),
            (covered * depth).sum(axis=1),
            np.minimum(storeys.sum(axis=1), _STOREYS),
            np.log(distance),
            way @ normal / distance,
            bays[:, 2],
            charge[:, 2],
            high,
        ]
    )


def _across(normal: FloatArray) -> FloatArray:
    return np.array([-normal[1], normal[0], 0.0])


def _in_the_wall(
    normal: FloatArray, boxes: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the ends of boxes out of the wall and along it (boxes,) each."""
    ends = []
    for axis in (normal, _across(normal)):
        first, last = boxes[:, :2] * axis[:2], boxes[:, 2:4] * axis[:2]
        ends += [np.minimum(first, last).sum(axis=1), np.maximum(first, last).sum(axis=1)]
    near, far, left, right = ends
    return near, far, left, right
