"""Offline reading of OpenStreetMap extracts: XML (`.osm`) and PBF (`.osm.pbf`)."""

import bz2
import gzip
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Final
from xml.parsers import expat

import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, import_extra, reason_of
from blast_env.files import scratch_folder, write_atomically
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.site_map import (
    MOST_POINTS,
    WGS84,
    MapFeature,
    SiteMap,
    Tags,
    check_count,
    errors_of,
)

with import_extra("maps", "maps and drawings"):
    import osmium
    from osmium import osm

SUFFIXES: Final = (".osm", ".pbf", ".osm.bz2", ".osm.gz")

MOST_UNPACKED_BYTES: Final = 100_000_000
"""Most bytes of an unpacked file."""

_PACKED: Final[Mapping[str, Callable[[Path, str], Any]]] = MappingProxyType(
    {".gz": gzip.open, ".bz2": bz2.open}
)
_PART_BYTES: Final = 2**20
_LEAST_RING: Final = 4  # points, the first one again at the end
_AREAS: Final = ("multipolygon", "boundary")
"""The types of relations that are outlines."""

Places = list[tuple[float, float]]
_Way = tuple[Tags, list[int]]
_Relation = tuple[Tags, list[int]]

CUT: Final = "ways of which the extract does not have all nodes"
SHORT: Final = "ways of fewer than two nodes"
INCOMPLETE: Final = "relations of which the extract does not have all ways"
OPEN: Final = "relations with rings that do not close"
TOUCHING: Final = "relations with rings that touch or cross, put together from their ways"


def read_osm(site_map: SiteMap) -> None:
    """Read an OpenStreetMap extract into a map: tagged ways, areas and nodes, in any order.

    Closed ways without `highway` and multipolygon relations are outlines. Objects that JOSM has
    marked as deleted are not read.

    Raises:
        BlastEnvError: If it cannot be read, or options do not fit.
    """
    options, path = site_map.options, site_map.path
    options.refuse("OpenStreetMap, which is in longitude and latitude", "units", "crs")
    site_map.crs = WGS84
    with _unpacked(path) as plain, errors_of("osmium", path, "OpenStreetMap data"):
        _Extract(site_map, _deleted(plain)).read(plain)


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
            raise BlastEnvError(f"{path}: cannot be unpacked: {reason_of(error)}") from error
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


def _deleted(path: Path) -> set[tuple[str, int]]:
    """Return kinds and ids of the objects that JOSM has marked as deleted, which osmium ignores."""
    found: set[tuple[str, int]] = set()

    def start(kind: str, attributes: dict[str, str]) -> None:
        if attributes.get("action") == "delete":
            found.add((kind, int(attributes.get("id", "0"))))

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    if path.suffix.lower() != ".pbf":
        with suppress(expat.ExpatError, ValueError), path.open("rb") as file:
            parser.ParseFile(file)  # osmium refuses a damaged file
    return found


@dataclass
class _Extract:
    """The objects of an extract.

    Attributes:
        site_map: The map to which they are added.
        deleted: Kinds and ids of the objects that are marked as deleted.
        lines: Known part of each way, by id.
    """

    site_map: SiteMap
    deleted: set[tuple[str, int]]
    lines: dict[int, Places] = field(default_factory=dict)

    def read(self, plain: Path) -> None:
        """Collect the objects with tags of the unpacked file, which may be in any order."""
        ways, relations = dict[int, _Way](), dict[int, _Relation]()
        points = 0
        item: Any  # a way or a relation
        for item in osmium.FileProcessor(str(plain), osm.WAY | osm.RELATION):
            kind = "way" if isinstance(item, osm.Way) else "relation"
            if (kind, item.id) in self.deleted:
                continue
            tags: Tags = {tag.k: tag.v for tag in item.tags}
            if kind == "way":
                ways[item.id] = tags, [node.ref for node in item.nodes]
                points += len(item.nodes) if tags else 0
            elif tags:
                members = [each.ref for each in item.members if each.type == "w"]
                relations[item.id] = tags, members
            check_count(self.site_map.path, points, MOST_POINTS, "points")
        places = self._nodes(plain, {node for _, nodes in ways.values() for node in nodes})
        for number in sorted(ways, key=_by_age):
            self._way(number, *ways[number], places)
        for number in sorted(relations, key=_by_age):
            self._relation(f"relation {number}", *relations[number])

    def _nodes(self, plain: Path, needed: set[int]) -> dict[int, tuple[float, float]]:
        """Collect the nodes with tags; return longitude and latitude of the needed ones."""
        places, tagged = dict[int, tuple[float, float]](), dict[int, MapFeature]()
        node: Any
        for node in osmium.FileProcessor(str(plain), osm.NODE):
            if node.id not in needed and not len(node.tags):
                continue
            if node.location.valid() and ("node", node.id) not in self.deleted:
                places[node.id] = node.lon, node.lat
                if tags := {tag.k: tag.v for tag in node.tags}:
                    point = Point(node.lon, node.lat)
                    tagged[node.id] = MapFeature(point, tags, f"node {node.id}")
        for number in sorted(tagged, key=_by_age):
            self.site_map.add(tagged[number])
        return places

    def _way(
        self, number: int, tags: Tags, nodes: list[int], known: Mapping[int, tuple[float, float]]
    ) -> None:
        """Collect a way as an outline if it is closed and not a street, otherwise as a line."""
        places = self.lines[number] = [known[node] for node in nodes if node in known]
        if not tags:
            return
        geometry, fault = _line(places), ""
        if len(places) < len(nodes) or len(places) < 2:
            fault = SHORT if len(nodes) < 2 else CUT
        elif nodes[0] == nodes[-1] and len(places) >= _LEAST_RING and "highway" not in tags:
            geometry = Polygon(places)
        self.site_map.add(MapFeature(geometry, tags, f"way {number}", fault))

    def _relation(self, place: str, tags: Tags, ways: list[int]) -> None:
        """Collect a relation, as an outline if its ways give one."""
        lines = [LineString(self.lines[each]) for each in ways if len(self.lines.get(each, ())) > 1]
        geometry: BaseGeometry = shapely.MultiLineString(lines)
        fault = ""
        if tags.get("type") not in _AREAS:
            fault = "relations that are no outlines"
        elif any(each not in self.lines for each in ways):
            fault = INCOMPLETE
        else:
            area = shapely.build_area(shapely.GeometryCollection(lines))
            if area.is_empty:
                fault = OPEN
            else:
                if not area.is_valid or not isclose(area.length, geometry.length):
                    self.site_map.ledger.add(Fate.GUESSED, TOUCHING, place)
                # Holes that touch the border or each other are not valid, and become notches.
                geometry = shapely.normalize(area if area.is_valid else area.buffer(0.0))
        self.site_map.add(MapFeature(geometry, tags, place, fault))


def _by_age(number: int) -> tuple[bool, int]:
    """Return the order of ids; those of objects that are not uploaded are negative, and last."""
    return number < 0, abs(number)


def _line(places: Places) -> BaseGeometry:
    """Return the known part of a way."""
    return LineString(places) if len(places) > 1 else shapely.MultiPoint(places)
