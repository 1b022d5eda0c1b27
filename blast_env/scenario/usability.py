"""Which cells of a build zone may hold a barrier module, and why the others may not."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.scenario.clearance import Boxes, distances_m
from blast_env.scenario.sections import AnySource, AnyStructure, BuildZone
from blast_env.units import MODULE_SIDE_M

TOLERANCE_M: Final = 1e-9
"""Rectangles that overlap by less than this only touch, as in `Rectangle.overlaps`."""


def usable_mask(
    zone: BuildZone,
    structures: Iterable[AnyStructure],
    sources: Iterable[AnySource],
    charge_radius_m: float,
) -> NDArray[np.bool_]:
    """Return which cells may be used, shape (rows, columns)."""
    usable = np.ones((zone.rows, zone.columns), dtype=bool)
    boxes = _boxes(zone, np.arange(zone.rows), np.arange(zone.columns))
    for _, blocked in _blocked(zone, boxes, structures, sources, charge_radius_m):
        usable &= ~blocked
    return usable


def reason_against(
    zone: BuildZone,
    cell: tuple[int, int],
    structures: Iterable[AnyStructure],
    sources: Iterable[AnySource],
    charge_radius_m: float,
) -> str | None:
    """Return why a cell of the grid may not be used, or `None` if it may."""
    boxes = _boxes(zone, np.array([cell[0]]), np.array([cell[1]]))
    for reason, blocked in _blocked(zone, boxes, structures, sources, charge_radius_m):
        if blocked.any():
            return reason
    return None


def _boxes(zone: BuildZone, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Boxes:
    """Return the squares of cells, as arrays that broadcast to (rows, columns)."""
    left = np.asarray(zone.corner_m[0] + columns[np.newaxis, :] * MODULE_SIDE_M, dtype=np.float64)
    bottom = np.asarray(zone.corner_m[1] + rows[:, np.newaxis] * MODULE_SIDE_M, dtype=np.float64)
    return left, bottom, left + MODULE_SIDE_M, bottom + MODULE_SIDE_M


def _blocked(
    zone: BuildZone,
    boxes: Boxes,
    structures: Iterable[AnyStructure],
    sources: Iterable[AnySource],
    charge_radius_m: float,
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield each reason against cells, with the cells that it holds for."""
    for keep_out in zone.keep_outs:
        yield f"must stay empty: {keep_out.reason}", _overlapping(keep_out.rectangle_m, boxes)
    for structure in structures:
        reason = f"overlaps the structure {structure.name!r}"
        yield reason, _overlapping(structure.rectangle_m, boxes)
    for index, source in enumerate(sources):
        yield (
            f"is closer than the charge's radius of {charge_radius_m:g} m to where the charge"
            f" may be (charge[{index}])",
            distances_m(source, boxes) < charge_radius_m - TOLERANCE_M,
        )


def _overlapping(rectangle: Rectangle, boxes: Boxes) -> NDArray[np.bool_]:
    """Return which squares overlap a rectangle; to touch is not to overlap."""
    left, bottom, right, top = boxes
    along_x = (left < rectangle.right - TOLERANCE_M) & (right > rectangle.left + TOLERANCE_M)
    along_y = (bottom < rectangle.top - TOLERANCE_M) & (top > rectangle.bottom + TOLERANCE_M)
    return along_x & along_y
