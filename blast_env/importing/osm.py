"""Offline reading of OpenStreetMap extracts: XML (`.osm`) and PBF (`.osm.pbf`)."""

import bz2
import gzip
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Final

from blast_env.errors import BlastEnvError, import_extra
from blast_env.files import scratch_folder, write_atomically
from blast_env.importing.site_map import (
    MOST_FEATURES,
    MOST_POINTS,
    MapCoordinates,
    MapFeature,
    SiteMap,
    Tags,
    checked_file,
    errors_of,
    too_many,
    too_many_points,
)

with import_extra("maps", "maps and drawings"):
    import osmium
    import shapely
    from osmium import osm
    from shapely.geometry import LineString, MultiPolygon, Point, Polygon

SUFFIXES: Final = (".osm", ".pbf", ".osm.bz2", ".osm.gz")

MOST_UNPACKED_BYTES: Final = 100_000_000
"""Most bytes of an unpacked file."""

_PACKED: Final[Mapping[str, Callable[[Path, str], Any]]] = MappingProxyType(
    {".gz": gzip.open, ".bz2": bz2.open}
)
_PART_BYTES: Final = 2**20
_WGS84: Final = "EPSG:4326"
_CUT: Final = "ways of which the extract does not have all nodes, which were left out"
_LEAST_RING: Final = 4  # points, the first one again at the end


def read_osm(path: Path) -> SiteMap:
    """Return the map of an OpenStreetMap extract: tagged ways, areas and nodes.

    Closed ways without `highway` and complete multipolygon relations are outlines. Ways with
    missing nodes and incomplete relations are left out and counted in the notes.

    Raises:
        BlastEnvError: If it cannot be read.
    """
    features, skipped, points = [], _Skipped(), 0
    with _unpacked(checked_file(path)) as plain, errors_of("osmium", path, "OpenStreetMap data"):
        for feature in _features(plain, skipped):
            features.append(feature)
            points += int(shapely.get_num_coordinates(feature.geometry))
            if len(features) > MOST_FEATURES:
                raise too_many(path)
            if points > MOST_POINTS:
                raise too_many_points(path)
    return SiteMap(path, MapCoordinates(_WGS84), tuple(features), skipped.notes)


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """Yield the path of the unpacked file; the file itself if it is not packed.

    Raises:
        BlastEnvError: If it cannot be unpacked, or would be too large.
    """
    opened = next((way for end, way in _PACKED.items() if path.name.lower().endswith(end)), None)
    if opened is None:
        yield path
        return
    with scratch_folder() as folder:
        plain = folder / "unpacked.osm"
        try:
            with (
                opened(path, "rb") as packed,
                write_atomically(plain, durable=False) as target,
                target.open("wb") as file,
            ):
                _copy(packed, file, path)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise BlastEnvError(f"{path}: cannot be unpacked: {error}") from error
        yield plain


def _copy(packed: IO[bytes], plain: IO[bytes], path: Path) -> None:
    size = 0
    while part := packed.read(_PART_BYTES):
        size += len(part)
        if size > MOST_UNPACKED_BYTES:
            raise BlastEnvError(
                f"{path}: unfolds to more than {MOST_UNPACKED_BYTES:,} bytes, must unfold to "
                "at most that many: cut a smaller extract"
            )
        plain.write(part)


@dataclass
class _Skipped:
    """Counter of the omitted objects by reason."""

    counts: Counter[str] = field(default_factory=Counter)

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(f"{what}: {count}" for what, count in self.counts.items())


def _features(path: Path, skipped: _Skipped) -> Iterator[MapFeature]:
    """Yield all tagged objects; untagged member ways occur only in their multipolygons."""
    processor = osmium.FileProcessor(str(path)).with_areas()
    processor.with_filter(osmium.filter.EmptyTagFilter())
    for item in processor:
        tags = {tag.k: tag.v for tag in item.tags}
        if isinstance(item, osm.Node):
            if item.location.valid():
                yield MapFeature(Point(item.lon, item.lat), tags, f"node {item.id}")
        elif isinstance(item, osm.Way):
            feature = _way(item, tags, skipped)
            if feature is not None:
                yield feature
        elif isinstance(item, osm.Area) and not item.from_way():
            rings = list(item.outer_rings())
            if not rings:
                skipped.counts["relations with rings that do not close, which were left out"] += 1
                continue
            polygons = [
                Polygon(_places(ring), [_places(hole) for hole in item.inner_rings(ring)])
                for ring in rings
            ]
            geometry = polygons[0] if len(polygons) == 1 else MultiPolygon(polygons)
            yield MapFeature(geometry, tags, f"relation {item.orig_id()}")


def _way(way: Any, tags: Tags, skipped: _Skipped) -> MapFeature | None:
    """Return a way as an outline if it is closed and not a street, otherwise as a line."""
    try:
        places = _places(way.nodes)
    except osmium.InvalidLocationError:
        skipped.counts[_CUT] += 1
        return None
    if len(places) < 2:
        skipped.counts["ways of fewer than two nodes, which were left out"] += 1
        return None
    is_area = way.is_closed() and len(places) >= _LEAST_RING and "highway" not in tags
    geometry = Polygon(places) if is_area else LineString(places)
    return MapFeature(shapely.force_2d(geometry), tags, f"way {way.id}")


def _places(nodes: Iterable[Any]) -> list[tuple[float, float]]:
    """Return longitude and latitude of nodes."""
    return [(node.lon, node.lat) for node in nodes]
