"""What the readers of maps and drawings give: outlines and lines with their tags."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from traceback import walk_tb
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, shortened

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

MOST_BYTES: Final = 50_000_000
"""Larger files are refused before they are read: an extract of a town has a few megabytes."""

MOST_FEATURES: Final = 100_000
"""Outlines and lines that are taken from a file."""

MOST_POINTS: Final = 500_000
"""Points of all of them."""

MOST_COORDINATE: Final = 1e12
"""In whatever the coordinates are; with millimetres the Earth's circumference is 4e10."""

Tags = Mapping[str, str | float | bool]


@dataclass(frozen=True)
class MapCoordinates:
    """Coordinates on the Earth.

    Attributes:
        crs: Their reference system as pyproj reads it; x is easting or longitude.
    """

    crs: str


@dataclass(frozen=True)
class DrawingCoordinates:
    """Coordinates in a plane whose place on the Earth is unknown.

    Attributes:
        metres_per_unit: Length of a unit.
    """

    metres_per_unit: float


SourceCoordinates = MapCoordinates | DrawingCoordinates


@dataclass(frozen=True)
class MapFeature:
    """One thing on a map.

    Attributes:
        geometry: Its outline, line or point, in the coordinates of the source.
        tags: What the source says of it: properties, tags, or its layer.
        place: Where in the file it is, for messages: `features[12]`, `way 4711`.
    """

    geometry: BaseGeometry
    tags: Tags
    place: str


@dataclass(frozen=True)
class SiteMap:
    """A map or drawing as it was read.

    Attributes:
        path: The file.
        coordinates: What the numbers mean.
        features: Everything that has an outline or a line, and texts as points.
        notes: What was left out, a sentence each.
    """

    path: Path
    coordinates: SourceCoordinates
    features: tuple[MapFeature, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a map with more, or larger, than can be worked on.

        Raises:
            BlastEnvError: If it has too many points, or a coordinate too large.
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
    """Return the path of a file that can be read.

    Raises:
        BlastEnvError: If there is none, or it is too large.
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
    """Turn what a library raises in the block into the error of a file that cannot be read.

    A library says what is wrong with a file in errors of many kinds, wherever it comes to it. One
    that does not come out of it is a mistake here, and stays what it is.

    Args:
        package: Name of the library.
        path: The file.
        kind: What it was read as.

    Raises:
        BlastEnvError: If the library raises anything.
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
    """Return the error of a file whose outlines and lines have more points than are taken."""
    return BlastEnvError(
        f"{path}: has more than {MOST_POINTS:,} points, must have at most that many: cut a smaller "
        "extract"
    )


def too_many(path: Path) -> BlastEnvError:
    """Return the error of a file with more things than are taken."""
    return BlastEnvError(
        f"{path}: has more than {MOST_FEATURES:,} outlines and lines, must have at most that many: "
        "cut a smaller extract"
    )
