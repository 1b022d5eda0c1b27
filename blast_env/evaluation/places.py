"""Places of bays relative to a charge: their distance, and whether it sees them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.response.facade import Bay
from blast_env.site.scene import OUTWARDS, BlastSite
from blast_env.site.sight import in_sight
from blast_env.units import MODULE_SIDE_M


class BayPlaces(NamedTuple):
    """The places of bays relative to a charge.

    Attributes:
        distance_m: Distance of the middle of each bay from the charge (bays,).
        seen: Whether the middle of each bay is in sight of the charge (bays,).
    """

    distance_m: FloatArray
    seen: BoolArray


def bay_places(site: BlastSite, bays: Sequence[Bay]) -> BayPlaces:
    """Return the places of bays relative to the charge of a site."""
    points, outward = bay_middles({each.name: each.rectangle_m for each in site.structures}, bays)
    charge_m = np.array([*site.charge.position_m, site.charge.height_m])
    distance_m = np.linalg.norm(points - charge_m, axis=1)
    return BayPlaces(distance_m, in_sight(site, points + MODULE_SIDE_M * outward, outward))


def bay_middles(
    rectangles_m: Mapping[str, Rectangle], bays: Sequence[Bay]
) -> tuple[FloatArray, FloatArray]:
    """Return the middles of bays on their walls, m, and their outward normals (bays, 3).

    `rectangles_m` has the rectangle around each structure, by name.
    """
    points = np.array([_middle_m(rectangles_m[each.structure], each) for each in bays])
    outward = np.array([(*_outward(each), 0.0) for each in bays])
    return points.reshape(-1, 3), outward.reshape(-1, 3)


def _middle_m(rectangle_m: Rectangle, bay: Bay) -> tuple[float, float, float]:
    along_m, height_m = 0.5 * (bay.left_m + bay.right_m), 0.5 * (bay.floor_m + bay.top_m)
    if bay.line is not None:
        return (*bay.line.point_at(along_m), height_m)
    left, bottom, right, top = rectangle_m
    if bay.wall in ("west", "east"):
        return left if bay.wall == "west" else right, along_m, height_m
    return along_m, bottom if bay.wall == "south" else top, height_m


def _outward(bay: Bay) -> tuple[float, float]:
    return OUTWARDS[bay.wall] if bay.line is None else bay.line.normal
