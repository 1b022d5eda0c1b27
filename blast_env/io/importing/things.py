"""The objects of a map that matter to a site."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from blast_env.errors import import_extra

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

_TO_KERB_M: Final = 1.0  # from the middle of a parked vehicle


class Role(StrEnum):
    """Role of an object of a map in a site."""

    SITE = "site"
    BUILDING = "building"
    CHARGE = "place of a charge"
    ZONE = "build zone"
    KEEP_OUT = "no-build area"
    NAME = "name"
    OTHER = "other"


@dataclass(frozen=True)
class Thing:
    """An object of a map with a role in the site.

    Attributes:
        role: Its role.
        geometry: Its outline, line or point, in the coordinates of the source.
        name: Its name in the source, or an empty string.
        place: Its place in the file.
        height_m: Its height, m, if the source has one.
        protected: Whether the source marks it as protected.
        tnt_kg: Mass of a charge there, if the source has one.
        kind: The value of `building` or `man_made`, or the layer.
        part_of: Name of the building of which it is a rectangle, in files of blast-env.
        base_m: Height of its underside above the ground, m.
        diameter_m: Diameter of a point that is a round building, m: a silo, a tank, a column.
        carries: Whether the source marks it as a terrace.
        width_m: Width of a street, m.
        is_part: Whether it is a part of a building with a height of its own.
        facade: Number of storeys, width, height and sill of its windows, and the width of a bay,
            m; empty if the source has none.
        fault: Why it cannot be used; an empty string if it can.
    """

    role: Role
    geometry: BaseGeometry
    name: str
    place: str
    height_m: float | None = None
    protected: bool = False
    tnt_kg: float | None = None
    part_of: str = ""
    base_m: float = 0.0
    diameter_m: float | None = None
    carries: bool = False
    kind: str = ""
    width_m: float | None = None
    is_part: bool = False
    facade: Mapping[str, float] = field(default_factory=dict)
    fault: str = ""

    @property
    def is_line(self) -> bool:
        """Whether it is a line, not an outline or a point."""
        return self.geometry.geom_type in ("LineString", "MultiLineString")

    @property
    def kerbs(self) -> Iterator[BaseGeometry]:
        """The lines of vehicles at both kerbs of a street; a line without a width itself."""
        aside_m = 0.0 if self.width_m is None else 0.5 * self.width_m - _TO_KERB_M
        if aside_m < _TO_KERB_M:  # too narrow for two rows of vehicles
            yield self.geometry
            return
        for side in (aside_m, -aside_m):
            yield from shapely.get_parts(
                shapely.offset_curve(self.geometry, side, join_style="mitre")
            )
