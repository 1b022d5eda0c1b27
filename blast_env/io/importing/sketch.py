"""The buildings of a map in its own coordinates, to choose one before an import."""

from dataclasses import dataclass
from math import cos, radians
from pathlib import Path
from typing import Final

from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import Rectangle
from blast_env.io.importing.convert import read_map, selectors_of
from blast_env.io.importing.ledger import Ledger
from blast_env.io.importing.options import ImportOptions, PlaceXY
from blast_env.io.importing.plane import MapCoordinates
from blast_env.io.importing.roles import things_of
from blast_env.io.importing.things import Role

with import_extra("maps", "maps and drawings"):
    import shapely
    from pyproj import CRS

_MOST: Final = 3000
_DETAIL: Final = 2e-4  # of the map's extent


@dataclass(frozen=True)
class MapSketch:
    """The outlines of the buildings of a map.

    Attributes:
        outlines: The corners of each, in the coordinates of the file; the largest first.
        stretch: Length of a unit along x over that of one along y.
    """

    outlines: tuple[tuple[PlaceXY, ...], ...]
    stretch: float

    @property
    def bounds(self) -> Rectangle:
        """The rectangle around all outlines."""
        return Rectangle(*shapely.total_bounds(shapely.multipoints(sum(self.outlines, ()))))


def sketch_of(path: Path, options: ImportOptions) -> MapSketch:
    """Return the outlines of the buildings of a map: the largest, if there are very many.

    Raises:
        BlastEnvError: If it cannot be read, or has no building.
    """
    site_map = read_map(path, options)
    things = things_of(site_map, selectors_of(site_map, options), options, Ledger())
    areas = [each.geometry for each in things if each.role is Role.BUILDING and not each.fault]
    parts = [each for each in shapely.get_parts(areas) if each.geom_type == "Polygon"]
    if not parts:
        raise BlastEnvError(f"{path}: has no building; define them with --buildings-from")
    left, bottom, right, top = shapely.total_bounds(parts)
    parts.sort(key=lambda each: -float(each.area))
    detail = _DETAIL * max(right - left, top - bottom)
    rings = [shapely.simplify(each.exterior, detail).coords[:-1] for each in parts[:_MOST]]
    coordinates = site_map.coordinates
    is_map = isinstance(coordinates, MapCoordinates) and CRS(coordinates.crs).is_geographic
    stretch = cos(radians(0.5 * (bottom + top))) if is_map else 1.0
    return MapSketch(tuple(tuple((x, y) for x, y in ring) for ring in rings), stretch)
