"""Raised ground: terraces and podiums that carry barriers and other structures."""

from collections.abc import Iterable, Iterator

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import TOLERANCE_M, Boxes, Rectangle, covered_m2, overlapping, stacked_runs
from blast_env.problems import Problem
from blast_env.site.structures import AnyStructure


def terrace_problems(structures: Iterable[AnyStructure]) -> Iterator[Problem]:
    """Yield the problems of terraces, each of which must be solid and have a height."""
    for index, structure in enumerate(structures):
        if structure.carries and structure.height_m is None:
            message = "is true, needs the structure's height_m: barriers stand on its top"
            yield Problem(f"structures[{index}].carries", message)
        if structure.carries and structure.base_m > 0.0:
            message = f"is {structure.base_m:g}, must be 0: a terrace is solid"
            yield Problem(f"structures[{index}].base_m", message)


def ground_m(structures: Iterable[AnyStructure], boxes: Boxes) -> FloatArray:
    """Return the height of the ground below squares, m: the highest terrace that each overlaps."""
    return _highest(_terraces(structures), boxes)


def _highest(terraces: Iterable[tuple[Rectangle, float]], boxes: Boxes) -> FloatArray:
    ground = np.zeros(np.broadcast_shapes(*(side.shape for side in boxes)))
    for terrace_m, height_m in terraces:
        own = overlapping(terrace_m, boxes)
        ground[own] = np.maximum(ground[own], height_m)
    return ground


def ground_below_m(structures: Iterable[AnyStructure], rectangle_m: Rectangle) -> float:
    """Return the height of the ground below one rectangle, m; 0 beside all terraces."""
    own_m = (high_m for plan_m, high_m in _terraces(structures) if plan_m.overlaps(rectangle_m))
    return max(own_m, default=0.0)


def levels_of(
    structures: Iterable[AnyStructure], rectangle_m: Rectangle
) -> dict[float, list[Rectangle]]:
    """Return the parts of a rectangle by the height of the ground below them, m."""
    terraces = [terrace for terrace in _terraces(structures) if terrace[0].overlaps(rectangle_m)]
    left, bottom, right, top = rectangle_m
    plans = [item for item, _ in terraces]
    xs = sorted({left, right, *(x for plan in plans for x in plan[::2] if left < x < right)})
    ys = sorted({bottom, top, *(y for plan in plans for y in plan[1::2] if bottom < y < top)})
    across, up = np.array(xs)[np.newaxis], np.array(ys)[:, np.newaxis]
    ground = _highest(terraces, (across[:, :-1], up[:-1], across[:, 1:], up[1:]))
    return {
        float(height_m): [
            Rectangle(xs[column], ys[row], xs[column + columns], ys[row + rows])
            for row, column, rows, columns in stacked_runs(ground == height_m).tolist()
        ]
        for height_m in np.unique(ground)
    }


def lie_wholly_on(
    structures: Iterable[AnyStructure], height_m: float | None, boxes: Boxes
) -> BoolArray:
    """Return whether terraces of one height cover each square without a gap."""
    left, bottom, right, top = boxes
    open_m2 = (right - left) * (top - bottom)
    for terrace_m, top_m in _terraces(structures):
        if top_m == height_m:
            open_m2 = open_m2 - covered_m2(terrace_m, boxes)
    whole: BoolArray = open_m2 <= TOLERANCE_M
    return whole


def is_open_below(structure: AnyStructure, structures: Iterable[AnyStructure]) -> bool:
    """Return whether there is air below a structure: it is not on the ground or on a terrace."""
    if structure.base_m == 0.0:
        return False
    left, bottom, right, top = np.array(structure.boxes_m).T
    return not lie_wholly_on(structures, structure.base_m, (left, bottom, right, top)).all()


def _terraces(structures: Iterable[AnyStructure]) -> Iterator[tuple[Rectangle, float]]:
    """Yield plan and height of each terrace."""
    for structure in structures:
        if structure.carries and structure.height_m is not None:
            yield from ((box, structure.height_m) for box in structure.boxes_m)
