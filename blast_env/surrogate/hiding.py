"""Whether protected walls can lose all their air to other structures, and pieces between them."""

from collections.abc import Iterator, Sequence
from typing import Final

from blast_env.geometry import Place, Rectangle
from blast_env.site import AnyStructure, Scenario
from blast_env.surrogate.pieces import Box
from blast_env.surrogate.points import walls_of
from blast_env.units import MODULE_SIDE_M

_HALF_M: Final = 0.5 * MODULE_SIDE_M

_SLACK_M: Final = 0.4 * MODULE_SIDE_M
"""How far a place may be off a solid that fills it: cells of gas dynamics round their sides."""


class Gaps:
    """The places before the assessed walls of structures that pieces must fill to hide them.

    A structure is hidden only if a solid as high as its walls stands before every module of them.
    So a look at these places tells of most layouts that they hide nothing, where to find the walls
    that air touches takes longer than a guess.

    Args:
        protected: The structures.
        scenario: The site.
    """

    def __init__(self, protected: Sequence[AnyStructure], scenario: Scenario) -> None:
        zone = scenario.build_zone
        zone_m = None if zone is None else zone.rectangle_m
        # Height and places of each structure that can be hidden.
        self._places: list[tuple[float, list[Place]]] = []
        for own in protected:
            others = [box for it in scenario.structures if it is not own for box in it.boxes_m]
            if all(_meets(look, others, zone_m) for look in _looks(own)):
                places = [place for place, _ in _looks(own) if not _is_in_any(others, place)]
                self._places.append((own.height_m or scenario.air_height_m, places))

    @property
    def are_none(self) -> bool:
        """Whether no layout can hide a structure."""
        return not self._places

    def may_be_filled(self, pieces: Sequence[Box]) -> bool:
        """Return whether pieces may hide a structure, which only its walls tell for sure."""
        for height_m, places in self._places:
            high = [Rectangle(*own) for *own, top_m in pieces if top_m > height_m - MODULE_SIDE_M]
            if all(_is_in_any(high, place) for place in places):
                return True
        return False


def _looks(structure: AnyStructure) -> Iterator[tuple[Place, tuple[float, float]]]:
    """Yield places before each module of the assessed walls, with the outward normal there.

    Of oblique walls, whose modules are stairs, it is the place before the middle alone.
    """
    left, bottom, right, top = structure.rectangle_m
    for length_m, (x_out, y_out), line in walls_of(structure):
        if line is not None and line.is_oblique:
            x_m, y_m = line.point_at(0.5 * length_m)
            yield (x_m + _HALF_M * x_out, y_m + _HALF_M * y_out), (x_out, y_out)
            continue
        for module in range(max(round(length_m / MODULE_SIDE_M), 1)):
            along_m = (module + 0.5) * MODULE_SIDE_M
            if line is not None:
                x_m, y_m = line.point_at(along_m)
            elif x_out:
                x_m, y_m = (left if x_out < 0 else right), bottom + along_m
            else:
                x_m, y_m = left + along_m, (bottom if y_out < 0 else top)
            yield (x_m + _HALF_M * x_out, y_m + _HALF_M * y_out), (x_out, y_out)


def _meets(
    look: tuple[Place, tuple[float, float]], others: Sequence[Rectangle], zone_m: Rectangle | None
) -> bool:
    """Return whether a look meets another structure, with nothing but the zone before it."""
    (x_m, y_m), (x_out, y_out) = look
    while not _is_in_any(others, (x_m, y_m)):
        if zone_m is None or not _is_in_any([zone_m], (x_m, y_m)):
            return False
        x_m, y_m = x_m + MODULE_SIDE_M * x_out, y_m + MODULE_SIDE_M * y_out
    return True


def _is_in_any(boxes: Sequence[Rectangle], place: Place) -> bool:
    x_m, y_m = place
    return any(
        left - _SLACK_M <= x_m <= right + _SLACK_M and bottom - _SLACK_M <= y_m <= top + _SLACK_M
        for left, bottom, right, top in boxes
    )
