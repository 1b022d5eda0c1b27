"""Whether protected walls can lose all their air to other structures, and pieces between them."""

from collections.abc import Iterator, Sequence

from blast_env.geometry import Place, Rectangle
from blast_env.site import AnyStructure, Scenario
from blast_env.surrogate.points import walls_of
from blast_env.units import MODULE_SIDE_M


def may_be_hidden(protected: Sequence[AnyStructure], scenario: Scenario) -> bool:
    """Return whether other structures and pieces may hide all assessed walls of a structure.

    It is `False` for most sites, at once: a look from the middle of one wall meets open ground
    where no piece can stand.
    """
    zone = scenario.build_zone
    zone_m = None if zone is None else zone.rectangle_m
    for own in protected:
        others = [box for it in scenario.structures if it is not own for box in it.boxes_m]
        if all(_meets(look, others, zone_m) for look in _looks(own)):
            return True
    return False


def _looks(structure: AnyStructure) -> Iterator[tuple[Place, tuple[float, float]]]:
    """Yield a place just before the middle of each assessed wall, and the outward normal there."""
    left, bottom, right, top = structure.rectangle_m
    for length_m, (x_out, y_out), line in walls_of(structure):
        if line is not None:
            x_m, y_m = line.point_at(0.5 * length_m)
        elif x_out:
            x_m, y_m = (left if x_out < 0 else right), 0.5 * (bottom + top)
        else:
            x_m, y_m = 0.5 * (left + right), (bottom if y_out < 0 else top)
        half_m = 0.5 * MODULE_SIDE_M
        yield (x_m + half_m * x_out, y_m + half_m * y_out), (x_out, y_out)


def _meets(
    look: tuple[Place, tuple[float, float]], others: Sequence[Rectangle], zone_m: Rectangle | None
) -> bool:
    """Return whether a look meets another structure, with nothing but the zone before it."""
    (x_m, y_m), (x_out, y_out) = look
    while not any(_is_in(box, x_m, y_m) for box in others):
        if zone_m is None or not _is_in(zone_m, x_m, y_m):
            return False
        x_m, y_m = x_m + MODULE_SIDE_M * x_out, y_m + MODULE_SIDE_M * y_out
    return True


def _is_in(box: Rectangle, x_m: float, y_m: float) -> bool:
    left, bottom, right, top = box
    return left <= x_m <= right and bottom <= y_m <= top
