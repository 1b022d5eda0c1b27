"""Conversion between the coordinates of maps and drawings and the metres of a site."""

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, degrees
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, import_extra, reason_of, value_text
from blast_env.sections import AnyGeoreference, DrawingGeoreference, MapGeoreference

with import_extra("maps", "maps and drawings"):
    from pyproj import CRS, Transformer
    from pyproj.enums import TransformDirection
    from pyproj.exceptions import CRSError, ProjError

_FAR_DEG: Final = 1.0  # outside the area of use of a reference system
_STEP_M: Final = 100.0
_MOST_LATITUDE_DEG: Final = 89.0


@dataclass(frozen=True)
class LocalPlane:
    """A plane of true metres around a place of a map: transverse Mercator, WGS 84, scale 1.

    Attributes:
        crs: Reference system of the map, as pyproj reads it.
        longitude_deg: Longitude of the plane's origin, WGS 84.
        latitude_deg: Latitude of the plane's origin, WGS 84.
    """

    crs: str
    longitude_deg: float
    latitude_deg: float

    @classmethod
    def around(cls, crs: str, place: tuple[float, float]) -> "LocalPlane":
        """Return the plane around a place in the coordinates of a map.

        Raises:
            BlastEnvError: If the reference system is unknown, or the place is not on the Earth, too
                near a pole, or far outside the system's area of use.
        """
        system = _system(crs)
        longitude, latitude = _transformed(_to_degrees(crs), np.array([place]))[0]
        x, y = place
        words = f"the place ({x:.10g}, {y:.10g})"
        outside = not np.isfinite([longitude, latitude]).all() or abs(latitude) > 90.0
        if outside or abs(longitude) > 180.0:
            raise BlastEnvError(
                f"{words} is not on the Earth in {value_text(crs)}: say with --crs which "
                "system the coordinates are of"
            )
        if abs(latitude) > _MOST_LATITUDE_DEG:
            raise BlastEnvError(
                f"{words} has the latitude {latitude:.2f}, must be at most "
                f"{_MOST_LATITUDE_DEG:g} from the equator"
            )
        _check_area_of_use(system, crs, words, (longitude, latitude))
        return cls(crs, float(longitude), float(latitude))

    def to_metres(self, places: FloatArray) -> FloatArray:
        """Return places of the map (n, 2) in metres of the plane (n, 2).

        Raises:
            BlastEnvError: If one is too far away for the plane.
        """
        return _transformed(self._to_plane, places)

    def to_source(self, places_m: FloatArray) -> FloatArray:
        """Return places of the plane (n, 2), in metres, in the coordinates of the map (n, 2)."""
        return _transformed(self._to_plane, places_m, TransformDirection.INVERSE)

    def georeference(self, corner_m: tuple[float, float], rotation_deg: float) -> MapGeoreference:
        """Return the georeference of a site whose lower left corner lies in this plane.

        Args:
            corner_m: The corner, m.
            rotation_deg: From the plane's x axis to the site's, counterclockwise.
        """
        angle = np.radians(rotation_deg)
        beside_m = np.array(corner_m) + _STEP_M * np.array([np.cos(angle), np.sin(angle)])
        geographic = LocalPlane("EPSG:4326", self.longitude_deg, self.latitude_deg)
        corner, beside = geographic.to_source(np.array([corner_m, beside_m]))
        # North at the corner is not quite north at the origin of this plane.
        there = LocalPlane("EPSG:4326", float(corner[0]), float(corner[1]))
        x_m, y_m = there.to_metres(beside[np.newaxis])[0]
        return MapGeoreference(
            longitude_deg=float(corner[0]),
            latitude_deg=float(corner[1]),
            rotation_deg=degrees(atan2(y_m, x_m)),
            crs=self.crs,
        )

    @property
    def _to_plane(self) -> Transformer:
        return _to_plane(self.crs, self.longitude_deg, self.latitude_deg)


@dataclass(frozen=True)
class DrawingPlane:
    """The plane of a drawing, whose place on the Earth is unknown.

    Attributes:
        metres_per_unit: Length of the drawing's unit.
    """

    metres_per_unit: float

    def to_metres(self, places: FloatArray) -> FloatArray:
        """Return places of the drawing (n, 2) in metres (n, 2)."""
        return places * self.metres_per_unit

    def to_source(self, places_m: FloatArray) -> FloatArray:
        """Return places in metres (n, 2) in the unit of the drawing (n, 2)."""
        return places_m / self.metres_per_unit

    def georeference(
        self, corner_m: tuple[float, float], rotation_deg: float
    ) -> DrawingGeoreference:
        """Return the georeference of a site from its lower left corner in metres."""
        return DrawingGeoreference(
            x_m=corner_m[0],
            y_m=corner_m[1],
            rotation_deg=rotation_deg,
            metres_per_unit=self.metres_per_unit,
        )


Plane = LocalPlane | DrawingPlane


def plane_around(crs: str | None, unit_m: float, place: tuple[float, float]) -> Plane:
    """Return the plane in which a map is measured, around a place of it.

    Args:
        crs: Reference system of the map; `None` for a drawing.
        unit_m: Length of the unit of a drawing, m.
        place: The place, in the coordinates of the map.
    """
    return DrawingPlane(unit_m) if crs is None else LocalPlane.around(crs, place)


def rotated(places: FloatArray, angle_deg: float) -> FloatArray:
    """Return places (n, 2) turned counterclockwise around the origin."""
    sine, cosine = np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))
    return np.asarray(places @ np.array([[cosine, sine], [-sine, cosine]]))


def to_map(georeference: AnyGeoreference, places_m: FloatArray) -> FloatArray:
    """Return places of a site (n, 2), in metres, in the coordinates of its map or drawing.

    Raises:
        BlastEnvError: If its reference system is unknown, or a place cannot be transformed.
    """
    turned = rotated(np.asarray(places_m, dtype=np.float64), georeference.rotation_deg)
    if isinstance(georeference, DrawingGeoreference):
        corner_m = np.array([georeference.x_m, georeference.y_m])
        return DrawingPlane(georeference.metres_per_unit).to_source(turned + corner_m)
    place = georeference.longitude_deg, georeference.latitude_deg
    return LocalPlane(georeference.crs, *place).to_source(turned)


def is_longitude_latitude(crs: str) -> bool:
    """Return whether a reference system is WGS 84 in longitude and latitude, that of GeoJSON."""
    return _system(crs).to_authority() in (("EPSG", "4326"), ("OGC", "CRS84"))


def unit_of(crs: str) -> float:
    """Return the length of the unit of a reference system, m; 1 for longitude and latitude."""
    system = _system(crs)
    return float(system.axis_info[0].unit_conversion_factor) if system.is_projected else 1.0


def _system(crs: str) -> CRS:
    try:
        system = CRS.from_user_input(crs)
    except CRSError as error:
        reason = reason_of(error)
        raise BlastEnvError(
            f"crs is {value_text(crs)}, which pyproj does not know: {reason}"
        ) from error
    if not (system.is_geographic or system.is_projected):
        raise BlastEnvError(
            f"crs is {value_text(crs)}, {system.type_name}, must be geographic or projected"
        )
    return system


# It takes tens of milliseconds to make a transformer, and a site needs few of them many times.
@lru_cache(maxsize=64)
def _to_degrees(crs: str) -> Transformer:
    return Transformer.from_crs(_system(crs), "EPSG:4326", always_xy=True)


@lru_cache(maxsize=64)
def _to_plane(crs: str, longitude_deg: float, latitude_deg: float) -> Transformer:
    plane = CRS.from_proj4(
        f"+proj=tmerc +lat_0={latitude_deg!r} +lon_0={longitude_deg!r} +k=1 +x_0=0 +y_0=0 "
        "+datum=WGS84 +units=m +no_defs"
    )
    return Transformer.from_crs(_system(crs), plane, always_xy=True)


def _check_area_of_use(system: CRS, crs: str, words: str, place: tuple[float, float]) -> None:
    """Refuse a place outside the area of use of a reference system: a sign of the wrong one."""
    area = system.area_of_use
    if area is None:
        return
    longitude, latitude = place
    west, south, east, north = area.bounds
    crosses = west > east  # the antimeridian
    beside = not (west - _FAR_DEG <= longitude <= east + _FAR_DEG)
    if (beside and not crosses) or not south - _FAR_DEG <= latitude <= north + _FAR_DEG:
        raise BlastEnvError(
            f"{words} is at longitude {longitude:.4f}, latitude {latitude:.4f} in "
            f"{value_text(crs)}, which is for longitudes {west:g} to {east:g} and latitudes "
            f"{south:g} to {north:g}: say with --crs which system the "
            "coordinates are of"
        )


def _transformed(
    transformer: Transformer,
    places: FloatArray,
    direction: TransformDirection = TransformDirection.FORWARD,
) -> FloatArray:
    try:
        x, y = transformer.transform(places[:, 0], places[:, 1], direction=direction)
    except ProjError as error:
        raise BlastEnvError(f"coordinates cannot be transformed: {reason_of(error)}") from error
    return np.stack([np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)], axis=1)
