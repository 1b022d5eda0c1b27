"""Offline reading of OpenStreetMap extracts: XML (`.osm`) and PBF (`.osm.pbf`)."""

import bz2
import gzip
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Final

import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, import_extra, reason_of
from blast_env.files import scratch_folder, write_atomically
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.overpass import Marks, marks_of, readable
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

_UNNAMED: Final = -(2**62)
_NO_KIND: Final = frozenset({"type", "source", "created_by", "note", "fixme"})
"""Tags of a relation that do not say what it is."""

Places = list[tuple[float, float]]
_Way = tuple[Tags, list[int]]
_Relation = tuple[Tags, list[tuple[int, str]]]

CUT: Final = "ways of which the extract does not have all nodes"
SHORT: Final = "ways of fewer than two nodes"
NO_OUTER: Final = "relations without an outer ring"
INCOMPLETE: Final = "relations of which the extract does not have all ways"
OPEN: Final = "relations with rings that do not close"
TOUCHING: Final = "relations with rings that touch or cross, put together from their ways"


def read_osm(site_map: SiteMap) -> None:
    """Read an OpenStreetMap extract into a map: tagged ways, areas and nodes, in any order.

    Closed ways without `highway`, or with `area=yes`, and multipolygon relations are outlines.
    Objects that JOSM has marked as deleted are not read.
    """
    options, path = site_map.options, site_map.path
    options.refuse("OpenStreetMap, which is in longitude and latitude", "units", "crs")
    site_map.crs = WGS84
    with _unpacked(path) as plain, errors_of("osmium", path, "OpenStreetMap data"):
        marks = marks_of(plain)
        with readable(plain, marks) as clean:
            _Extract(site_map, marks).read(clean)


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """Yield the path of the unpacked file; the file itself if it is not packed."""
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


@dataclass
class _Extract:
    """The objects of an extract.

    Attributes:
        site_map: The map to which they are added.
        marks: What osmium does not read of it.
        places: Longitude and latitude of nodes, by id, as ways have them.
        lines: Known part of each way, by id.
        wholes: Ids of the ways of which all is known.
        unnamed: Ids for the places of nodes without one, which Overpass can leave out.
    """

    site_map: SiteMap
    marks: Marks
    places: dict[int, tuple[float, float]] = field(default_factory=dict)
    lines: dict[int, Places] = field(default_factory=dict)
    wholes: set[int] = field(default_factory=set)
    unnamed: dict[tuple[float, float], int] = field(default_factory=dict)

    def read(self, plain: Path) -> None:
        """Collect the objects with tags of the unpacked file, which may be in any order."""
        ways, relations = dict[int, _Way](), dict[int, _Relation]()
        points = 0
        item: Any  # a way or a relation
        for item in osmium.FileProcessor(str(plain), osm.WAY | osm.RELATION):
            kind = "way" if isinstance(item, osm.Way) else "relation"
            if (kind, item.id) in self.marks.deleted:
                continue
            tags: Tags = {tag.k: tag.v for tag in item.tags}
            if kind == "way":
                ways[item.id] = tags, [self._node(node) for node in item.nodes]
                points += len(item.nodes) if tags else 0
            elif tags:
                members = [
                    (member.ref, member.role) for member in item.members if member.type == "w"
                ]
                relations[item.id] = tags, members
            check_count(self.site_map.path, points, MOST_POINTS, "points")
        self._nodes(plain, {node for _, nodes in ways.values() for node in nodes})
        for number in sorted(ways, key=_by_age):
            self._way(number, *ways[number])
        for number, shape in self.marks.shapes.items():
            if number not in self.wholes and None not in shape:
                self.lines[number] = [place for place in shape if place is not None]
                self.wholes.add(number)
        for number in sorted(relations, key=_by_age):
            self._relation(f"relation {number}", *relations[number], ways)

    def _node(self, node: Any) -> int:
        """Return the id of a node of a way, whose place the way itself may have."""
        number = int(node.ref)
        if node.location.valid():
            place = node.lon, node.lat
            if not number:
                number = self.unnamed.setdefault(place, _UNNAMED - len(self.unnamed))
            self.places.setdefault(number, place)
        return number

    def _nodes(self, plain: Path, needed: set[int]) -> None:
        """Collect the places of the needed nodes, and the nodes with tags."""
        tagged = dict[int, MapFeature]()
        node: Any
        for node in osmium.FileProcessor(str(plain), osm.NODE):
            if node.id not in needed and not len(node.tags):
                continue
            if ("node", node.id) in self.marks.deleted:
                self.places.pop(node.id, None)
            elif node.location.valid():
                self.places[node.id] = node.lon, node.lat
                if tags := {tag.k: tag.v for tag in node.tags}:
                    point = Point(node.lon, node.lat)
                    tagged[node.id] = MapFeature(point, tags, f"node {node.id}")
        for number in sorted(tagged, key=_by_age):
            self.site_map.add(tagged[number])

    def _way(self, number: int, tags: Tags, nodes: list[int]) -> None:
        """Collect a way as an outline if it is closed and not a street, otherwise as a line."""
        known = self.places
        places = self.lines[number] = [known[node] for node in nodes if node in known]
        if len(places) == len(nodes):
            self.wholes.add(number)
        if not tags:
            return
        geometry, fault = _line(places), ""
        if len(places) < len(nodes) or len(places) < 2:
            fault = SHORT if len(nodes) < 2 else CUT
        elif nodes[0] == nodes[-1] and len(places) >= _LEAST_RING and _is_area(tags):
            geometry = Polygon(places)
        self.site_map.add(MapFeature(geometry, tags, f"way {number}", fault))

    def _relation(
        self, place: str, tags: Tags, members: list[tuple[int, str]], ways: Mapping[int, _Way]
    ) -> None:
        """Collect a relation, as an outline if its ways give one.

        One without tags of its own has those of its only outer way, as in old extracts.
        """
        lines = [
            LineString(self.lines[way]) for way, _ in members if len(self.lines.get(way, ())) > 1
        ]
        geometry: BaseGeometry = shapely.MultiLineString(lines)
        inner = [way for way, role in members if role == "inner"]
        outer = [way for way, role in members if role != "inner"]
        if tags.keys() <= _NO_KIND and inner and len(outer) == 1 and outer[0] in ways:
            tags = {**ways[outer[0]][0], **tags}
        fault = ""
        if tags.get("type") not in _AREAS:
            fault = "relations that are no outlines"
        elif any(way not in self.wholes for way, _ in members):
            fault = INCOMPLETE
        elif inner and not outer:
            fault = NO_OUTER
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


def _is_area(tags: Tags) -> bool:
    """Return whether a closed way is an outline: a street is one only if it says so."""
    return "highway" not in tags or tags.get("area") == "yes"


def _by_age(number: int) -> tuple[bool, int]:
    """Return the order of ids; those of objects that are not uploaded are negative, and last."""
    return number < 0, abs(number)


def _line(places: Places) -> BaseGeometry:
    """Return the known part of a way."""
    return LineString(places) if len(places) > 1 else shapely.MultiPoint(places)
