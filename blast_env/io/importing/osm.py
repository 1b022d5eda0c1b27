"""Offline reading of OpenStreetMap extracts: XML (`.osm`) and PBF (`.osm.pbf`)."""

import bz2
import gzip
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, Final
from xml.parsers import expat

from blast_env.errors import BlastEnvError, import_extra
from blast_env.files import scratch_folder, write_atomically
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.plane import MapCoordinates
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MOST_POINTS,
    LostFeature,
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
    from shapely.geometry import LineString, MultiLineString, Point, Polygon
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


def read_osm(path: Path, options: ImportOptions) -> SiteMap:
    """Return the map of an OpenStreetMap extract: tagged ways, areas and nodes, in any order.

    Closed ways without `highway` and multipolygon relations are outlines. Objects that JOSM has
    marked as deleted are not read.

    Raises:
        BlastEnvError: If it cannot be read, or options do not fit.
    """
    options.refuse("OpenStreetMap, which is in longitude and latitude", "units", "crs")
    with (
        _unpacked(checked_file(path)) as plain,
        errors_of("osmium", path, "OpenStreetMap data"),
    ):
        found = _Found(path, _deleted(plain))
        found.read(plain)
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
class _Found:
    """The objects of a file.

    Attributes:
        path: The file, for errors.
        deleted: Kinds and ids of the objects that are marked as deleted.
        features: Those that are usable.
        lost: The others.
        remarks: What was mended.
        lines: Known part of each way, by id.
        left: Number of points that the outlines and lines may still have.
    """

    path: Path
    deleted: set[tuple[str, int]]
    features: list[MapFeature] = field(default_factory=list)
    lost: list[LostFeature] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    lines: dict[int, Places] = field(default_factory=dict)
    left: int = MOST_POINTS

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
            if points > MOST_POINTS:
                raise too_many_points(self.path)
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
            self._add(tagged[number])
        return places

    def _way(
        self, number: int, tags: Tags, nodes: list[int], known: Mapping[int, tuple[float, float]]
    ) -> None:
        """Collect a way as an outline if it is closed and not a street, otherwise as a line."""
        places = self.lines[number] = [known[node] for node in nodes if node in known]
        place = f"way {number}"
        if tags and (len(places) < len(nodes) or len(places) < 2):
            reason = SHORT if len(nodes) < 2 else CUT
            self.lost.append(LostFeature(_line(places), tags, place, reason))
        elif tags:
            is_area = nodes[0] == nodes[-1] and len(places) >= _LEAST_RING
            is_area = is_area and "highway" not in tags
            geometry = Polygon(places) if is_area else LineString(places)
            self._add(MapFeature(geometry, tags, place))

    def _relation(self, place: str, tags: Tags, ways: list[int]) -> None:
        """Collect a relation, if its ways give an outline."""
        lines = [self.lines[each] for each in ways if len(self.lines.get(each, ())) > 1]
        known = MultiLineString(lines)
        if tags.get("type") not in _AREAS:
            self.lost.append(LostFeature(known, tags, place, "relations that are no outlines"))
            return
        if any(each not in self.lines for each in ways):
            self.lost.append(LostFeature(known, tags, place, INCOMPLETE))
            return
        faces, *rest = shapely.polygonize_full([LineString(line) for line in lines])
        rings = shapely.get_exterior_ring(shapely.get_parts(faces))
        geometry: BaseGeometry = Polygon()
        for ring in rings:
            geometry = shapely.symmetric_difference(geometry, Polygon(ring))
        if geometry.area == 0.0:
            self.lost.append(LostFeature(known, tags, place, OPEN))
            return
        if MultiLineString(list(rings)).is_simple and all(each.is_empty for each in rest):
            geometry = _ordered(geometry)
        else:
            self.remarks.append((TOUCHING, place, ""))
        self._add(MapFeature(geometry, tags, place))

    def _add(self, feature: MapFeature) -> None:
        self.left -= int(shapely.get_num_coordinates(feature.geometry))
        self.features.append(feature)
        if len(self.features) > MOST_FEATURES:
            raise too_many(self.path)
        if self.left < 0:
            raise too_many_points(self.path)


def _ordered(area: BaseGeometry) -> BaseGeometry:
    """Return an area with its rings from the left, outer ones counterclockwise."""

    def start(ring: Any) -> tuple[float, float]:
        x, y = ring.coords[0]
        return x, y

    parts = shapely.get_parts(shapely.reverse(shapely.normalize(area)))
    polygons = [
        Polygon(each.exterior, sorted(each.interiors, key=start))
        for each in sorted(parts, key=lambda each: start(each.exterior))
    ]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


def _by_age(number: int) -> tuple[bool, int]:
    """Return the order of ids; those of objects that are not uploaded are negative, and last."""
    return number < 0, abs(number)


def _line(places: Places) -> BaseGeometry:
    """Return the known part of a way."""
    return LineString(places) if len(places) > 1 else shapely.MultiPoint(places)
