"""What the elements of layouts are for vehicles."""

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.geometry import Element, Rectangle, standing
from blast_env.site.catalogue import Catalogue, Variant, element_text
from blast_env.site.models import Scenario
from blast_env.site.structures import ground_below_m, ground_m
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.vehicle import (
    NOTHING,
    OTHER,
    SOLID,
    STOPS,
    CrashPiece,
    Obstacles,
)


def obstacles_of(scenario: Scenario, layout: Iterable[Element]) -> Obstacles:
    """Return the obstacles of a layout.

    Single modules stop vehicles; items of a catalogue do if `stops_vehicles` is true. Elements on a
    terrace are out of reach, and no obstacles.
    """
    met = scenario.obstacles_met
    stops, solid, rated = list[Rectangle](), list[Rectangle](), list[CrashPiece]()
    # In the order of their places, so that equal layouts have equal obstacles, and one search.
    for element in sorted(standing(layout)):
        found = met.get(element)
        if found is None:
            found = met[element] = _obstacle_of(scenario, element)
        own_stops, own_solid, own_rated = found
        stops += own_stops
        solid += own_solid
        rated += own_rated
    return Obstacles(tuple(stops), tuple(solid), tuple(rated))


def _obstacle_of(scenario: Scenario, element: Element) -> Obstacles:
    """Return the obstacle that an element is; none on a terrace."""
    zone, (row, column) = scenario.zone, element[:2]
    variant = zone.catalogue.variant(element)
    rectangle = zone.cells_rectangle_m(row, column, variant.rows, variant.columns)
    terraces = [structure for structure in scenario.structures if structure.carries]
    if terraces and ground_below_m(terraces, rectangle) > 0.0:
        return NOTHING
    if variant.crash_rating is not None:
        piece = CrashPiece(rectangle, variant.crash_rating, element_text(element))
        return Obstacles(rated=(piece,))
    return Obstacles((rectangle,)) if variant.stops_vehicles else Obstacles(solid=(rectangle,))


_NONE: Final = 1


class ObstacleTable:
    """The obstacles of the numbered elements of a site.

    Args:
        scenario: The scenario.
        catalogue: Its catalogue, which numbers the elements.

    Attributes:
        boxes_m: Left, bottom, right and top of each, m (elements, 4).
        kinds: What each is (elements,); see `blast_env.vehicles.vehicle`.
    """

    def __init__(self, scenario: Scenario, catalogue: Catalogue) -> None:
        variants, zone = catalogue.variants, scenario.zone
        shape = len(variants), *catalogue.shape
        # 1. Rectangles as by `BuildZone.cells_rectangle_m`, of all cells at once.
        row, column = (np.arange(count) * MODULE_SIDE_M for count in catalogue.shape)
        left_m, bottom_m = zone.corner_m[0] + column, (zone.corner_m[1] + row)[:, np.newaxis]
        boxes_m = np.empty((*shape, 4))
        kinds = np.empty(shape, dtype=np.uint8)
        for number, variant in enumerate(variants):
            width_m, depth_m = variant.columns * MODULE_SIDE_M, variant.rows * MODULE_SIDE_M
            sides_m = left_m, bottom_m, left_m + width_m, bottom_m + depth_m
            for side, side_m in enumerate(sides_m):
                boxes_m[number, :, :, side] = side_m
            kinds[number] = _kind(variant)
        self.boxes_m: FloatArray = boxes_m.reshape(-1, 4)
        self.kinds: NDArray[np.uint8] = kinds.ravel()
        # 2. Elements on a terrace are out of reach.
        terraces = [structure for structure in scenario.structures if structure.carries]
        left, bottom, right, top = self.boxes_m.T
        self.kinds[ground_m(terraces, (left, bottom, right, top)) > 0.0] = _NONE


def _kind(variant: Variant) -> int:
    """Return what the pieces of a variant are for vehicles."""
    if variant.is_measure:
        return _NONE
    if variant.crash_rating is not None:
        return STOPS if variant.crash_rating.penetration_m == 0.0 else OTHER
    return STOPS if variant.stops_vehicles else SOLID
