"""Visibility of points on walls from a charge: no solid is on the straight line between them."""

from math import inf
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.site.blast_site import BlastSite

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
