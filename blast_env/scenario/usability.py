"""What holds for the cells of a build zone before any module is placed."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.scenario.build_zone import BuildZone
from blast_env.scenario.clearance import Boxes, box_distances_m, distances_m
from blast_env.scenario.sections import AnySource, AnyStructure
from blast_env.units import MODULE_SIDE_M

BoolArray = NDArray[np.bool_]

TOLERANCE_M: Final = 1e-9
"""Rectangles that overlap by less than this only touch, as in `Rectangle.overlaps`."""


@dataclass(frozen=True)
class Surroundings:
    """A build zone and everything that decides, before any module, which cells may be used.

    Attributes:
        zone: The build zone.
        structures: The structures on the site.
        sources: Where the charge may come from.
        charge_radius_m: Radius of the disc that the charge fills.
    """

    zone: BuildZone
    structures: tuple[AnyStructure, ...]
    sources: tuple[AnySource, ...]
    charge_radius_m: float


@dataclass(frozen=True)
class EmptyZone:
    """The cells of a build zone without modules; all arrays are read-only.

    Attributes:
        usable: Which cells may be used, shape (rows, columns).
        passable: Which cells no structure covers, shape (rows, columns).
        module_costs: What a module on each cell costs, shape (rows, columns).
    """

    usable: BoolArray
    passable: BoolArray
    module_costs: NDArray[np.float64]


@lru_cache(maxsize=16)
def empty_zone(surroundings: Surroundings) -> EmptyZone:
    """Return what holds for the cells; for the same surroundings, the same object."""
    zone = surroundings.zone
    boxes = _boxes(zone, np.arange(zone.rows), np.arange(zone.columns))
    usable = np.ones((zone.rows, zone.columns), dtype=bool)
    for _, blocked in _blocked(surroundings, boxes):
        usable &= ~blocked
    passable = np.ones_like(usable)
    for structure in surroundings.structures:
        passable &= ~_overlapping(structure.rectangle_m, boxes)
    costs = _module_costs(zone, boxes)
    for array in (usable, passable, costs):
        array.flags.writeable = False
    return EmptyZone(usable, passable, costs)


def reason_against(surroundings: Surroundings, cell: tuple[int, int]) -> str | None:
    """Return why a cell of the grid may not be used, or `None` if it may."""
    boxes = _boxes(surroundings.zone, np.array([cell[0]]), np.array([cell[1]]))
    for reason, blocked in _blocked(surroundings, boxes):
        if blocked.any():
            return reason
    return None


def _boxes(zone: BuildZone, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Boxes:
    """Return the squares of cells, as arrays that broadcast to (rows, columns)."""
    left = np.asarray(zone.corner_m[0] + columns[np.newaxis, :] * MODULE_SIDE_M, dtype=np.float64)
    bottom = np.asarray(zone.corner_m[1] + rows[:, np.newaxis] * MODULE_SIDE_M, dtype=np.float64)
    return left, bottom, left + MODULE_SIDE_M, bottom + MODULE_SIDE_M


def _blocked(surroundings: Surroundings, boxes: Boxes) -> Iterator[tuple[str, BoolArray]]:
    """Yield each reason against cells, with the cells that it holds for."""
    zone, radius_m = surroundings.zone, surroundings.charge_radius_m
    for keep_out in zone.keep_outs:
        yield f"must stay empty: {keep_out.reason}", _overlapping(keep_out.rectangle_m, boxes)
    for structure in surroundings.structures:
        reason = f"overlaps the structure {structure.name!r}"
        yield reason, _overlapping(structure.rectangle_m, boxes)
    if zone.clearance_m > 0.0:
        yield from _too_close(surroundings, boxes)
    for index, source in enumerate(surroundings.sources):
        yield (
            f"is closer than the charge's radius of {radius_m:g} m to where the charge"
            f" may be (charge[{index}])",
            distances_m(source, boxes) < radius_m - TOLERANCE_M,
        )


def _too_close(surroundings: Surroundings, boxes: Boxes) -> Iterator[tuple[str, BoolArray]]:
    """Yield the cells without the clearance from each structure."""
    clearance_m = surroundings.zone.clearance_m
    for structure in surroundings.structures:
        distances = box_distances_m(structure.rectangle_m, boxes)
        yield (
            f"is closer than {clearance_m:g} m to the structure {structure.name!r}"
            f" ({distances.min():g} m)",
            distances < clearance_m - TOLERANCE_M,
        )


def _module_costs(zone: BuildZone, boxes: Boxes) -> NDArray[np.float64]:
    """Return what a module on each cell costs: the highest cost of the areas around it."""
    highest = np.zeros((zone.rows, zone.columns))
    for area in zone.cost_areas:
        inside = _overlapping(area.rectangle_m, boxes)
        highest[inside] = np.maximum(highest[inside], area.module_cost)
    return np.where(highest > 0.0, highest, zone.module_cost)


def _overlapping(rectangle: Rectangle, boxes: Boxes) -> BoolArray:
    """Return which squares overlap a rectangle; to touch is not to overlap."""
    left, bottom, right, top = boxes
    along_x = (left < rectangle.right - TOLERANCE_M) & (right > rectangle.left + TOLERANCE_M)
    along_y = (bottom < rectangle.top - TOLERANCE_M) & (top > rectangle.bottom + TOLERANCE_M)
    return along_x & along_y
