"""Distances and overlaps between one rectangle and arrays of rectangles."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Rectangle

TOLERANCE_M: Final = 1e-9
"""Largest overlap of rectangles that counts as touching, as in `Rectangle.overlaps`."""

Boxes = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Left, bottom, right and top of many rectangles; the four arrays broadcast."""


def box_distances_m(box: Rectangle, boxes: Boxes) -> FloatArray:
    """Return the distances between one rectangle and others, m; 0 if they overlap."""
    left, bottom, right, top = boxes
    along_x = np.maximum(0.0, np.maximum(left - box.right, box.left - right))
    along_y = np.maximum(0.0, np.maximum(bottom - box.top, box.bottom - top))
    distances_m: FloatArray = np.hypot(along_x, along_y)
    return distances_m


def overlapping(rectangle: Rectangle, boxes: Boxes) -> BoolArray:
    """Return whether each rectangle overlaps one; touching is not overlapping."""
    left, bottom, right, top = boxes
    along_x = (left < rectangle.right - TOLERANCE_M) & (right > rectangle.left + TOLERANCE_M)
    along_y = (bottom < rectangle.top - TOLERANCE_M) & (top > rectangle.bottom + TOLERANCE_M)
    return along_x & along_y


def overlapping_any(rectangles: Sequence[Rectangle], boxes: Boxes) -> BoolArray:
    """Return whether each rectangle overlaps any of some others, at least one."""
    found: BoolArray = np.any([overlapping(each, boxes) for each in rectangles], axis=0)
    return found


def covered_m2(rectangle: Rectangle, boxes: Boxes) -> FloatArray:
    """Return the area of each rectangle's intersection with one, m2."""
    left, bottom, right, top = boxes
    along_x = np.minimum(right, rectangle.right) - np.maximum(left, rectangle.left)
    along_y = np.minimum(top, rectangle.top) - np.maximum(bottom, rectangle.bottom)
    area_m2: FloatArray = np.maximum(along_x, 0.0) * np.maximum(along_y, 0.0)
    return area_m2
