"""The obstacles of a layout for vehicles."""

from collections.abc import Iterable, Sequence

from blast_env.geometry import Element, Rectangle, standing
from blast_env.site.catalogue import element_text
from blast_env.site.structures import AnyStructure
from blast_env.site.terraces import ground_below_m
from blast_env.site.zone import BuildZone
from blast_env.vehicles.drive import CrashPiece, Obstacles


def obstacles_of(
    zone: BuildZone, layout: Iterable[Element], structures: Sequence[AnyStructure]
) -> Obstacles:
    """Return the obstacles of a layout.

    Single modules stop vehicles; items of a catalogue do if `stops_vehicles` is true. Elements on a
    terrace are out of reach, and no obstacles.

    Raises:
        LayoutError: If there is no such item, or it cannot be turned.
    """
    terraces = [structure for structure in structures if structure.carries]
    stops: list[Rectangle] = []
    solid: list[Rectangle] = []
    rated: list[CrashPiece] = []
    for element in sorted(standing(layout)):
        variant, (row, column) = zone.catalogue.variant(element), element[:2]
        rectangle = zone.cells_rectangle_m(row, column, variant.rows, variant.columns)
        if terraces and ground_below_m(terraces, rectangle) > 0.0:
            continue
        if variant.crash_rating is not None:
            rated.append(CrashPiece(rectangle, variant.crash_rating, element_text(element)))
        else:
            (stops if variant.stops_vehicles else solid).append(rectangle)
    return Obstacles(tuple(stops), tuple(solid), tuple(rated))
