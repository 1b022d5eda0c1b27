"""Common form of maps and drawings: outlines, lines and points with their tags."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from traceback import walk_tb
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, shortened
from blast_env.io.importing.plane import DrawingPlane, MapCoordinates

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

MOST_BYTES: Final = 50_000_000
"""Most bytes of a file; an extract of a town has a few megabytes."""

MOST_FEATURES: Final = 100_000
"""Most outlines and lines of a file."""

MOST_POINTS: Final = 500_000
"""Most points of all outlines and lines."""

MOST_COORDINATE: Final = 1e12
"""Largest coordinate in any unit; in millimetres the Earth's circumference is 4e10."""

Tags = Mapping[str, str | float | bool]
Remark = tuple[str, str, str]


@dataclass(frozen=True)
class MapFeature:
    """An object of a map.

    Attributes:
        geometry: Its outline, line or point, in the coordinates of the source.
        tags: Its properties, tags or layer in the source.
        place: Its place in the file, for messages: `features[12]`, `way 4711`.
    """

    geometry: BaseGeometry
    tags: Tags
    place: str


@dataclass(frozen=True)
class LostFeature(MapFeature):
    """An object of a map that is not usable; its geometry is as much as the file has.

    Attributes:
        reason: The kind of the fault, in the plural: `ways without all nodes`.
    """

    reason: str


@dataclass(frozen=True)
class SiteMap:
    """A map or drawing.

    Attributes:
        path: The file.
        coordinates: System of the coordinates.
        features: All outlines, lines and points; texts are points.
        lost: Objects that are not usable.
        remarks: Guesses and mends of reading, as (kind, place, detail).
        merged: Parts of its objects, as (kind, place, detail).
    """

    path: Path
    coordinates: MapCoordinates | DrawingPlane
    features: tuple[MapFeature, ...]
    lost: tuple[LostFeature, ...] = ()
    remarks: tuple[Remark, ...] = ()
    merged: tuple[Remark, ...] = ()

    @property
    def is_drawing(self) -> bool:
        """Whether its objects have layers instead of tags."""
        return self.path.suffix.lower() == ".dxf"

    def __post_init__(self) -> None:
        """Refuse a map with too many points or too large coordinates.

        Raises:
            BlastEnvError: If it has more than `MOST_POINTS` points, or a coordinate beyond
                `MOST_COORDINATE`.
        """
        geometries = [each.geometry for each in self.features]
        coordinates, owners = shapely.get_coordinates(geometries, return_index=True)
        is_wrong = ~(np.abs(coordinates) <= MOST_COORDINATE)
        if is_wrong.any():
            owner = self.features[owners[is_wrong.any(axis=1)][0]]
            raise BlastEnvError(
                f"{self.path}: {owner.place}: has the coordinate {coordinates[is_wrong][0]:g}, "
                f"must be within {MOST_COORDINATE:g}"
            )
        points = shapely.get_num_coordinates(geometries)
        if points.sum() > MOST_POINTS:
            raise too_many_points(self.path)


def checked_file(path: Path) -> Path:
    """Return a path after checking that its file exists and is not too large.

    Raises:
        BlastEnvError: If there is no such file, or it has more than `MOST_BYTES` bytes.
    """
    if not path.exists():
        raise BlastEnvError(f"{path}: there is no such file")
    if not path.is_file():
        raise BlastEnvError(f"{path}: is not a file")
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise BlastEnvError(
            f"{path}: has {size:,} bytes, must have at most {MOST_BYTES:,}: cut a smaller extract"
        )
    return path


@contextmanager
def errors_of(package: str, path: Path, kind: str) -> Iterator[None]:
    """Convert any exception of a library in the block to the error of an unreadable file.

    Libraries report faults of a file with exceptions of many types. An exception without the
    library in its traceback is a fault of this package, and passes unchanged.

    Args:
        package: Name of the library.
        path: The file.
        kind: Format of the file, for the message.

    Raises:
        BlastEnvError: If the library raises an exception.
    """
    try:
        yield
    except Exception as error:
        frames = (frame for frame, _ in walk_tb(error.__traceback__))
        modules = {str(frame.f_globals.get("__name__")).partition(".")[0] for frame in frames}
        if isinstance(error, BlastEnvError | MemoryError) or package not in modules:
            raise
        what = shortened(" ".join(str(error).split()) or type(error).__name__, 300)
        raise BlastEnvError(f"{path}: cannot be read as {kind}: {what}") from error


def too_many_points(path: Path) -> BlastEnvError:
    """Return the error of a file with more than `MOST_POINTS` points."""
    return BlastEnvError(
        f"{path}: has more than {MOST_POINTS:,} points, must have at most that many: cut a smaller "
        "extract"
    )


def too_many(path: Path) -> BlastEnvError:
    """Return the error of a file with more than `MOST_FEATURES` features."""
    return BlastEnvError(
        f"{path}: has more than {MOST_FEATURES:,} outlines and lines, must have at most that many: "
        "cut a smaller extract"
    )
