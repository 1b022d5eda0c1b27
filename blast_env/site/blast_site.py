"""The site of one blast, the input common to all engines, and what its charge has in sight."""

from dataclasses import dataclass
from math import cbrt, hypot, inf, pi
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle
from blast_env.site.structures import StructureOutline

TNT_KG_M3: Final = 1630.0
"""Density of a charge of TNT."""


class Charge(NamedTuple):
    """One charge: its position in plan, its TNT-equivalent mass, and the height of its centre.

    The particle engines ignore the height; for gas dynamics, 0 is a charge on the ground.
    """

    position_m: tuple[float, float]
    tnt_kg: float
    height_m: float = 0.0

    @property
    def is_raised(self) -> bool:
        """Whether it is above the ground: higher than the radius of a sphere of TNT."""
        return self.height_m > cbrt(3.0 * self.tnt_kg / (4.0 * pi * TNT_KG_M3))


class Gauge(NamedTuple):
    """A place in the air at which the overpressure is recorded: x, y, height above the ground."""

    name: str
    position_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class BlastSite:
    """The site, charge and structures of a blast, common to all engines.

    Attributes:
        site_m: The simulated area.
        structures: The structures and, if there is one, the barrier.
        gauges: Virtual gauges; the particle engines ignore them.
        air_height_m: Height of the simulated air; the particle engines ignore it.
        build_zone: The whole build zone as if full of modules, independent of the layout; `None`
            without one. For gas dynamics only.
    """

    site_m: Rectangle
    charge: Charge
    structures: tuple[StructureOutline, ...]
    gauges: tuple[Gauge, ...] = ()
    air_height_m: float = 12.0
    build_zone: StructureOutline | None = None

    def scaled_distance(self, structure: StructureOutline) -> float:
        """Return the scaled distance of a structure from the charge, m/kg^(1/3).

        The distance is that of its nearest point: in plan, and below its base or above its top.
        """
        distance_m = min(box.distance_to(self.charge.position_m) for box in structure.boxes_m)
        height_m, top_m = self.charge.height_m, structure.height_m or self.air_height_m
        up_m = max(structure.base_m - height_m, height_m - top_m, 0.0)
        return hypot(distance_m, up_m) / cbrt(self.charge.tnt_kg)


_TOUCH: Final = 1e-6  # share of a line, within which contact with a block does not cut it


def in_sight(site: BlastSite, points_m: FloatArray, outward: FloatArray) -> BoolArray:
    """Return whether points on walls are visible from the charge, with all blocks of a site (n,).

    Args:
        site: The site with its charge, structures and barrier.
        points_m: The points (n, 3).
        outward: Outward normals there; a wall that faces away is not visible (n, 3).
    """
    start_m = np.array([*site.charge.position_m, site.charge.height_m])
    seen = np.asarray(((start_m - points_m) * outward).sum(axis=1) > 0.0)
    for block in (block for outline in site.structures for block in outline.blocks):
        left, bottom, right, top = block.rectangle_m
        high_m = inf if block.height_m is None else block.height_m
        base_m = block.base_m or -inf  # a block on the ground also cuts lines along the ground
        low_m, end_m = np.array([left, bottom, base_m]), np.array([right, top, high_m])
        left_over = np.flatnonzero(seen)
        seen[left_over] = ~_cut(start_m, points_m[left_over], low_m, end_m)
    return seen


def _cut(
    start_m: FloatArray, points_m: FloatArray, low_m: FloatArray, high_m: FloatArray
) -> BoolArray:
    """Return whether lines from a place to points pass through the inside of a box (n,)."""
    way_m = points_m - start_m
    # Slab method: a line is in the box between its last entry into and its first exit from the
    # spaces between two opposite sides. A line along a side is in that space or never.
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.stack(((low_m - start_m) / way_m, (high_m - start_m) / way_m))
    enter, leave = at.min(axis=0), at.max(axis=0)
    level = way_m == 0.0
    inside = (low_m <= start_m) & (start_m <= high_m)  # with ends: no gap between adjacent boxes
    enter[level] = np.broadcast_to(np.where(inside, -inf, inf), level.shape)[level]
    leave[level] = np.broadcast_to(np.where(inside, inf, -inf), level.shape)[level]
    first = np.maximum(enter.max(axis=1), _TOUCH)
    last = np.minimum(leave.min(axis=1), 1.0 - _TOUCH)
    return np.asarray(first < last - _TOUCH)
