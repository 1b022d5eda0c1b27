"""How far rectangles are from each other and from the places where a charge may be."""

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.scenario.sections import AnySource, PointM, RectangleSource

Array = NDArray[np.float64]
Boxes = tuple[Array, Array, Array, Array]
"""Left, bottom, right and top of many rectangles; the four arrays broadcast."""


def source_bounds_m(source: AnySource) -> Rectangle:
    """Return the smallest rectangle around all the places that the charge's centre may be at."""
    if isinstance(source, RectangleSource):
        return source.rectangle_m
    (x0, y0), (x1, y1) = source.segment_m
    return Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))


def distances_m(source: AnySource, boxes: Boxes) -> Array:
    """Return how near the centre of a charge from this source can come to each rectangle."""
    if isinstance(source, RectangleSource):
        return box_distances_m(source.rectangle_m, boxes)
    return _segment_distances(*source.segment_m, boxes)


def distance_m(source: AnySource, rectangle: Rectangle) -> float:
    """Return how near the centre of a charge from this source can come to a rectangle."""
    left, bottom, right, top = (np.array(side) for side in rectangle)
    return float(distances_m(source, (left, bottom, right, top)))


def _gaps(box: Rectangle, boxes: Boxes) -> tuple[Array, Array]:
    """Return the gaps along x and y between one rectangle and others; 0 where they overlap."""
    left, bottom, right, top = boxes
    along_x = np.maximum(0.0, np.maximum(left - box.right, box.left - right))
    along_y = np.maximum(0.0, np.maximum(bottom - box.top, box.bottom - top))
    return along_x, along_y


def box_distances_m(box: Rectangle, boxes: Boxes) -> Array:
    """Return the distances between one rectangle and others."""
    return np.hypot(*_gaps(box, boxes))


def _segment_distances(start: PointM, end: PointM, boxes: Boxes) -> Array:
    """Return the distances between a segment and rectangles.

    Two convex figures that do not meet are nearest at a corner of one of them.
    """
    (x0, y0), (x1, y1) = start, end
    step_x, step_y = x1 - x0, y1 - y0
    square = step_x**2 + step_y**2
    nearest = np.minimum(
        box_distances_m(Rectangle(x0, y0, x0, y0), boxes),
        box_distances_m(Rectangle(x1, y1, x1, y1), boxes),
    )
    left, bottom, right, top = boxes
    sides = []
    for x, y in ((left, bottom), (left, top), (right, bottom), (right, top)):
        along = (x - x0) * step_x + (y - y0) * step_y
        share = np.clip(along / square, 0.0, 1.0) if square > 0.0 else np.zeros_like(along)
        nearest = np.minimum(nearest, np.hypot(x - x0 - share * step_x, y - y0 - share * step_y))
        sides.append((x - x0) * step_y - (y - y0) * step_x)
    both_sides = (np.minimum.reduce(sides) <= 0.0) & (np.maximum.reduce(sides) >= 0.0)
    bounds = Rectangle(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    meets = both_sides & (box_distances_m(bounds, boxes) == 0.0)
    return np.where(meets, 0.0, nearest)
