"""Offline reading of OpenStreetMap extracts: XML (`.osm`) and PBF (`.osm.pbf`)."""

import bz2
import gzip
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Final
from xml.parsers import expat

from blast_env.errors import BlastEnvError, import_extra
from blast_env.files import scratch_folder, write_atomically
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MOST_POINTS,
    LostFeature,
    MapCoordinates,
    MapFeature,
    Remark,
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
    from shapely.geometry import LineString, MultiLineString, MultiPolygon, Point, Polygon
    from shapely.geometry.base import BaseGeometry

SUFFIXES: Final = (".osm", ".pbf", ".osm.bz2", ".osm.gz")

MOST_UNPACKED_BYTES: Final = 100_000_000
"""Most bytes of an unpacked file."""

_PACKED: Final[Mapping[str, Callable[[Path, str], Any]]] = MappingProxyType(
    {".gz": gzip.open, ".bz2": bz2.open}
)
_PART_BYTES: Final = 2**20
_WGS84: Final = "EPSG:4326"
_LEAST_RING: Final = 4  # points, the first one again at the end
_NEW_IDS: Final = 2**40
"""Objects that JOSM has not uploaded have negative ids, for which osmium has no index of nodes."""

_KINDS: Final = ("node", "way", "relation")
_AREAS: Final = ("multipolygon", "boundary")
"""The types of relations that are outlines."""

CUT: Final = "ways of which the extract does not have all nodes"
SHORT: Final = "ways of fewer than two nodes"
INCOMPLETE: Final = "relations of which the extract does not have all ways"
OPEN: Final = "relations with rings that do not close"
TOUCHING: Final = "relations with rings that touch or cross, put together from their ways"


def read_osm(path: Path) -> SiteMap:
    """Return the map of an OpenStreetMap extract: tagged ways, areas and nodes, in any order.

    Closed ways without `highway` and multipolygon relations are outlines. Objects that JOSM has
    marked as deleted are not read.

    Raises:
        BlastEnvError: If it cannot be read.
    """
    found = _Found()
    points = 0
    with (
        _unpacked(checked_file(path)) as plain,
        scratch_folder() as folder,
        errors_of("osmium", path, "OpenStreetMap data"),
    ):
        for feature in found.features_of(_in_order(plain, folder)):
            points += int(shapely.get_num_coordinates(feature.geometry))
            if len(found.features) > MOST_FEATURES:
                raise too_many(path)
            if points > MOST_POINTS:
                raise too_many_points(path)
    lost, remarks = tuple(found.lost), tuple(found.remarks)
    return SiteMap(path, MapCoordinates(_WGS84), tuple(found.features), lost, remarks)


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


def _in_order(path: Path, folder: Path) -> Path:
    """Return a file of the same objects: nodes, ways, relations, each by ids above 0."""
    order = _Order.of(path)
    if order.is_plain:
        return path
    if order.must_change:
        changed = folder / "changed.osm.pbf"
        with osmium.SimpleWriter(str(changed)) as writer:
            for _ in osmium.FileProcessor(str(path)).with_filter(
                _Renumbered(writer, order.deleted)
            ):
                pass
        path = changed
    ordered = folder / "ordered.osm.pbf"
    reader = osmium.MergeInputReader()
    try:
        reader.add_file(str(path))
    except RuntimeError as error:  # from C++, so `errors_of` finds no frame of osmium
        raise BlastEnvError(f"{path}: cannot be read as OpenStreetMap data: {error}") from error
    with osmium.SimpleWriter(str(ordered)) as writer:
        reader.apply(writer)
    return ordered


@dataclass
class _Order:
    """The order of a file, and the marks of JOSM, which osmium ignores.

    Attributes:
        is_plain: Whether the objects are in the order of types and ids, none new or deleted.
        has_new: Whether there are negative ids.
        deleted: Kinds and ids of the objects marked as deleted.
    """

    is_plain: bool = True
    has_new: bool = False
    deleted: set[tuple[str, int]] = field(default_factory=set)
    _last: tuple[int, int] = (0, 0)

    @classmethod
    def of(cls, path: Path) -> "_Order":
        """Return the order of a file; damaged ones are for osmium to refuse."""
        order = cls()
        if path.suffix.lower() == ".pbf":
            for _ in osmium.FileProcessor(str(path)).with_filter(order):
                pass
            return order
        parser = expat.ParserCreate()
        parser.StartElementHandler = order._start
        try:
            with path.open("rb") as file:
                parser.ParseFile(file)
        except (expat.ExpatError, ValueError):
            pass
        return order

    @property
    def must_change(self) -> bool:
        """Whether objects must be changed or dropped."""
        return self.has_new or bool(self.deleted)

    def node(self, node: Any) -> bool:
        """Note the place of a node; true, which filters it out."""
        return self._see(0, node.id)

    def way(self, way: Any) -> bool:
        """Note the place of a way."""
        return self._see(1, way.id)

    def relation(self, relation: Any) -> bool:
        """Note the place of a relation."""
        return self._see(2, relation.id)

    def _start(self, kind: str, attributes: dict[str, str]) -> None:
        """Note the place of an element of XML."""
        if kind in _KINDS:
            number = int(attributes.get("id", "0"))
            self._see(_KINDS.index(kind), number)
            if attributes.get("action") == "delete":
                self.deleted.add((kind, number))
                self.is_plain = False

    def _see(self, kind: int, number: int) -> bool:
        if number <= 0 or (kind, number) <= self._last:
            self.has_new = self.has_new or number < 0
            self.is_plain = False
        self._last = (kind, number)
        return True


def _new_id(number: int) -> int:
    return number if number >= 0 else _NEW_IDS - number


def _old_id(number: int) -> int:
    return number if number < _NEW_IDS else _NEW_IDS - number


class _Renumbered:
    """Writes objects with ids above 0, without the deleted ones; a filter that lets none pass.

    Args:
        writer: The writer of the new file.
        deleted: Kinds and ids of the deleted objects.
    """

    def __init__(self, writer: Any, deleted: set[tuple[str, int]]) -> None:
        self._writer = writer
        self._deleted = deleted

    def node(self, node: Any) -> bool:
        """Write a node."""
        if ("node", node.id) not in self._deleted:
            self._writer.add_node(node.replace(id=_new_id(node.id)))
        return True

    def way(self, way: Any) -> bool:
        """Write a way."""
        if ("way", way.id) not in self._deleted:
            nodes = [_new_id(node.ref) for node in way.nodes]
            self._writer.add_way(way.replace(id=_new_id(way.id), nodes=nodes))
        return True

    def relation(self, relation: Any) -> bool:
        """Write a relation."""
        if ("relation", relation.id) not in self._deleted:
            members = [(each.type, _new_id(each.ref), each.role) for each in relation.members]
            self._writer.add_relation(relation.replace(id=_new_id(relation.id), members=members))
        return True


@dataclass
class _Found:
    """The objects of a file.

    Attributes:
        features: Those that are usable.
        lost: The others.
        remarks: What was mended.
        lines: Known part of each way without tags, by id, for relations.
    """

    features: list[MapFeature] = field(default_factory=list)
    lost: list[LostFeature] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    lines: dict[int, list[tuple[float, float]]] = field(default_factory=dict)

    def features_of(self, path: Path) -> Iterator[MapFeature]:
        """Yield all usable objects, and collect them with the others."""
        processor = osmium.FileProcessor(str(path)).with_areas()
        processor.with_filter(osmium.filter.EmptyTagFilter())
        processor.handler_for_filtered(self)
        relations: dict[int, tuple[Tags, list[tuple[str, int, str]]]] = {}
        whole: set[int] = set()  # osmium puts some together before it comes to the relations
        for item in processor:
            tags: Tags = {tag.k: tag.v for tag in item.tags}
            if isinstance(item, osm.Node):
                if item.location.valid():
                    self.features.append(
                        MapFeature(Point(item.lon, item.lat), tags, _place("node", item.id))
                    )
                    yield self.features[-1]
            elif isinstance(item, osm.Way):
                yield from self._way(item, tags)
            elif isinstance(item, osm.Relation):
                members = [(each.type, each.ref, each.role) for each in item.members]
                relations[item.id] = tags, members
            elif isinstance(item, osm.Area) and not item.from_way():
                rings = list(item.outer_rings())
                if rings:
                    whole.add(item.orig_id())
                    parts = [
                        Polygon(_places(ring), [_places(hole) for hole in item.inner_rings(ring)])
                        for ring in rings
                    ]
                    geometry = parts[0] if len(parts) == 1 else MultiPolygon(parts)
                    place = _place("relation", item.orig_id())
                    self.features.append(MapFeature(geometry, tags, place))
                    yield self.features[-1]
        for number in relations.keys() - whole:
            yield from self._relation(_place("relation", number), *relations[number])

    def way(self, way: Any) -> None:
        """Collect a way without tags, which may be the side of a relation."""
        self.lines[way.id] = _known_places(way.nodes)

    def _way(self, way: Any, tags: Tags) -> Iterator[MapFeature]:
        """Yield a way as an outline if it is closed and not a street, otherwise as a line."""
        place, places = _place("way", way.id), _known_places(way.nodes)
        self.lines[way.id] = places
        if len(places) < len(way.nodes) or len(places) < 2:
            reason = SHORT if len(way.nodes) < 2 else CUT
            self.lost.append(LostFeature(_line(places), tags, place, reason))
            return
        is_area = way.is_closed() and len(places) >= _LEAST_RING and "highway" not in tags
        geometry = Polygon(places) if is_area else LineString(places)
        self.features.append(MapFeature(geometry, tags, place))
        yield self.features[-1]

    def _relation(
        self, place: str, tags: Tags, members: list[tuple[str, int, str]]
    ) -> Iterator[MapFeature]:
        """Yield a relation that osmium has not put together, if its ways give an outline."""
        ways = [(self.lines.get(number), role) for kind, number, role in members if kind == "w"]
        known = MultiLineString([line for line, _ in ways if line and len(line) > 1])
        if tags.get("type") not in _AREAS:
            self.lost.append(LostFeature(known, tags, place, "relations that are no outlines"))
            return
        if any(line is None for line, _ in ways):
            self.lost.append(LostFeature(known, tags, place, INCOMPLETE))
            return
        sides = {
            is_inner: [line for line, role in ways if line and (role == "inner") is is_inner]
            for is_inner in (False, True)
        }
        geometry = shapely.difference(_covered(sides[False]), _covered(sides[True]))
        if geometry.area == 0.0:
            self.lost.append(LostFeature(known, tags, place, OPEN))
            return
        self.remarks.append((TOUCHING, place, ""))
        self.features.append(MapFeature(geometry, tags, place))
        yield self.features[-1]


def _place(kind: str, number: int) -> str:
    return f"{kind} {_old_id(number)}"


def _covered(lines: Iterable[list[tuple[float, float]]]) -> BaseGeometry:
    """Return the area that lines enclose."""
    sound = [LineString(line) for line in lines if len(line) > 1]
    return shapely.union_all(shapely.get_parts(shapely.polygonize(sound)))


def _line(places: list[tuple[float, float]]) -> BaseGeometry:
    """Return the known part of a way."""
    return LineString(places) if len(places) > 1 else shapely.MultiPoint(places)


def _known_places(nodes: Iterable[Any]) -> list[tuple[float, float]]:
    """Return longitude and latitude of the nodes that the file has."""
    try:
        return _places(nodes)
    except osmium.InvalidLocationError:
        return [(node.lon, node.lat) for node in nodes if node.location.valid()]


def _places(nodes: Iterable[Any]) -> list[tuple[float, float]]:
    """Return longitude and latitude of nodes."""
    return [(node.lon, node.lat) for node in nodes]
