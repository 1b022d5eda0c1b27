"""What the elements of layouts are for vehicles."""

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray, IntArray
from blast_env.geometry import Element, standing
from blast_env.site.catalogue import Catalogue, element_text
from blast_env.site.models import Scenario
from blast_env.site.terraces import ground_below_m
from blast_env.vehicles.crash_rating import NOTHING, OTHER, SOLID, STOPS, CrashPiece, Obstacles


def obstacles_of(scenario: Scenario, layout: Iterable[Element]) -> Obstacles:
    """Return the obstacles of a layout.

    Single modules stop vehicles; items of a catalogue do if `stops_vehicles` is true. Elements on a
    terrace are out of reach, and no obstacles.
    """
    met, parts = scenario.obstacles_met, list[Obstacles]()
    # In the order of their places, so that equal layouts have equal obstacles, and one search.
    for element in sorted(standing(layout)):
        found = met.get(element)
        if found is None:
            found = met[element] = _obstacle_of(scenario, element)
        parts.append(found)
    stops, solid, rated = zip(*parts, strict=True) if parts else ((), (), ())
    return Obstacles(
        tuple([part for own in stops for part in own]),
        tuple([part for own in solid for part in own]),
        tuple([part for own in rated for part in own]),
    )


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


_UNKNOWN: Final = 0
_NONE: Final = 1


class ObstacleTable:
    """The obstacles of the numbered elements of a site, each found when it is asked for first.

    Args:
        scenario: The scenario.
        catalogue: Its catalogue, which numbers the elements.

    Attributes:
        boxes_m: Left, bottom, right and top of each, m (elements, 4).
        kinds: What each is (elements,); see `blast_env.vehicles.crash_rating`.
    """

    def __init__(self, scenario: Scenario, catalogue: Catalogue) -> None:
        self._scenario, self._catalogue = scenario, catalogue
        self.boxes_m: FloatArray = np.zeros((catalogue.finish, 4))
        self.kinds: NDArray[np.uint8] = np.zeros(catalogue.finish, dtype=np.uint8)

    def learn(self, numbers: IntArray) -> None:
        """Find the obstacles of elements."""
        for number in np.unique(numbers[self.kinds[numbers] == _UNKNOWN]).tolist():
            found = obstacles_of(self._scenario, (self._catalogue.element(number),))
            kind = _NONE
            if found.rated:
                stops_all = found.rated[0].rating.penetration_m == 0.0
                kind, box = (STOPS if stops_all else OTHER), found.rated[0].rectangle
                self.boxes_m[number] = box
            elif found.stops or found.solid:
                kind = STOPS if found.stops else SOLID
                self.boxes_m[number] = (*found.stops, *found.solid)[0]
            self.kinds[number] = kind
