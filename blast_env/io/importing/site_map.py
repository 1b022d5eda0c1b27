"""Common form of maps and drawings: outlines, lines and points with their tags."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from traceback import walk_tb
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, reason_of
from blast_env.io.importing.ledger import FATES, Fate, Ledger, LedgerEntry
from blast_env.io.importing.options import ImportOptions

MOST_BYTES: Final = 50_000_000
"""Most bytes of a file; an extract of a town has a few megabytes."""

MOST_FEATURES: Final = 100_000
"""Most outlines and lines of a file."""

MOST_POINTS: Final = 500_000
"""Most points of all outlines and lines."""

MOST_VALUES: Final = 3_000_000
"""Most numbers, arrays and tables of a file: each takes some hundred bytes in memory."""

MOST_COORDINATE: Final = 1e12
"""Largest coordinate in any unit; in millimetres the Earth's circumference is 4e10."""

WGS84: Final = "EPSG:4326"
"""Longitude and latitude."""

_UNUSED: Final = "objects of no use to the site"

Tags = Mapping[str, str | float | bool]


@dataclass(frozen=True)
class MapFeature:
    """An object of a map.

    Attributes:
        geometry: Its outline, line or point, in the coordinates of the source; as much of it as the
            file has, if it is not usable.
        tags: Its properties, tags or layer in the source.
        place: Its place in the file, for messages: `features[12]`, `way 4711`.
        fault: Why it is not usable, in the plural: `ways without all nodes`; an empty string if it
            is.
        facade: Number of storeys, width, height and sill of its windows, and the width of a bay,
            m; empty if the source has none.
        extent_m: Its lowest and highest z, m, in a drawing or model; `None` if tags say its
            heights.
        part_of: Place in the file of the building of which it is a part, or an empty string.
        ground_m: Height of the ground under it, in the same coordinate; `None` if the file does not
            state it.
        is_levelled: Whether that coordinate counts from the sea or the like: its zero is no ground.
    """

    geometry: BaseGeometry
    tags: Tags
    place: str
    fault: str = ""
    facade: Mapping[str, float] = field(default_factory=dict)
    extent_m: tuple[float, float] | None = None
    part_of: str = ""
    ground_m: float | None = None
    is_levelled: bool = False


@dataclass
class SiteMap:
    """A map or drawing, to which its reader adds all objects.

    Attributes:
        ledger: The ledger of the import.
        crs: Reference system of its coordinates, as pyproj reads it; x is easting or longitude.
            `None` for a drawing, whose place on the Earth is unknown.
        unit_m: Length of the unit of a drawing, m.
        has_layers: Whether its objects have layers instead of tags.
        features: All outlines, lines and points; texts are points.
    """

    path: Path
    content: bytes
    options: ImportOptions
    ledger: Ledger = field(default_factory=Ledger)
    crs: str | None = None
    unit_m: float = 1.0
    has_layers: bool = False
    features: list[MapFeature] = field(default_factory=list)
    points: int = 0

    def add(self, feature: MapFeature) -> None:
        """Add an object."""
        self.features.append(feature)
        self.points += int(shapely.get_num_coordinates(feature.geometry))
        check_count(self.path, len(self.features), MOST_FEATURES, "outlines and lines")
        check_count(self.path, self.points, MOST_POINTS, "points")

    def settle(self, used: Mapping[str, str]) -> None:
        """Complete the ledger: one fate for each object of the file, no guess about others.

        Of an object that is used, pieces that are left out or part of others are a remark.

        Args:
            used: The kinds of those used on the site, by their places in the file.
        """
        bounds = shapely.bounds([feature.geometry for feature in self.features]).reshape(-1, 4)
        middles = 0.5 * (bounds[:, :2] + bounds[:, 2:])
        positions = {
            feature.place: (float(x), float(y))
            for feature, (x, y) in zip(self.features, middles, strict=True)
            if x == x
        }
        self.ledger.entries = list(_with_one_fate(self.ledger.entries, set(used)))
        fates = {entry.place for entry in self.ledger.of(*FATES)}
        for place in dict.fromkeys(feature.place for feature in self.features):
            if place in used:
                self.ledger.add(Fate.READ, used[place], place)
            elif place not in fates:
                self.ledger.add(Fate.LEFT_OUT, _UNUSED, place)
        elsewhere = {entry.place for entry in self.ledger.of(Fate.PASSED)}
        self.ledger.entries = [
            replace(entry, position=positions.get(entry.place))
            for entry in self.ledger.entries
            if entry.fate is not Fate.GUESSED or entry.place not in elsewhere
        ]

    def check_coordinates(self) -> None:
        """Refuse a map with a coordinate beyond `MOST_COORDINATE`."""
        geometries = [feature.geometry for feature in self.features]
        coordinates, owners = shapely.get_coordinates(geometries, return_index=True)
        is_wrong = ~(np.abs(coordinates) <= MOST_COORDINATE)
        if is_wrong.any():
            owner = self.features[owners[is_wrong.any(axis=1)][0]]
            raise BlastEnvError(
                f"{self.path}: {owner.place}: has the coordinate {coordinates[is_wrong][0]:g}, "
                f"must be within {MOST_COORDINATE:g}"
            )


def _with_one_fate(entries: Iterable[LedgerEntry], used: set[str]) -> Iterator[LedgerEntry]:
    """Yield the entries, with one fate for each object at most, and none for those used.

    Other fates are those of pieces: a remark, unless the piece is outside the site.
    """
    known = set(used)
    for entry in entries:
        if entry.fate not in FATES or entry.place not in known:
            known |= {entry.place} if entry.fate in FATES else set()
            yield entry
        elif entry.fate is not Fate.PASSED:
            yield replace(entry, fate=Fate.CUT)


def code_of(path: Path, system: str) -> str:
    """Return a reference system by the code of its authority, such as EPSG:25832.

    Args:
        system: As pyproj reads it: a code, WKT or PROJJSON.
    """
    from pyproj import CRS  # takes a tenth of a second to import

    with errors_of("pyproj", path, "a map with a reference system"):
        authority = CRS.from_user_input(system).to_authority()
    if authority is None:
        raise BlastEnvError(
            f"{path}: its reference system has no code of an authority: say --crs ({system[:60]})"
        )
    return ":".join(authority)


def check_count(path: Path, count: int, most: int, what: str) -> None:
    """Refuse a file that has too many of something."""
    if count > most:
        raise BlastEnvError(
            f"{path}: has more than {most:,} {what}, must have at most that many: cut a smaller "
            "extract"
        )


@contextmanager
def errors_of(package: str, path: object, kind: str) -> Iterator[None]:
    """Convert any exception of a library in the block to the error of an unreadable file.

    Libraries report faults of a file with exceptions of many types. An exception without the
    library in its traceback is a fault of this package, and passes unchanged.

    Args:
        path: The file, or a place in it.
        kind: Its format, for the message.
    """
    try:
        yield
    except Exception as error:
        frames = (frame for frame, _ in walk_tb(error.__traceback__))
        modules = {str(frame.f_globals.get("__name__")).partition(".")[0] for frame in frames}
        if isinstance(error, BlastEnvError | MemoryError) or package not in modules:
            raise
        raise BlastEnvError(f"{path}: cannot be read as {kind}: {reason_of(error)}") from error
