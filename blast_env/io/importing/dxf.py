"""Reading of DXF drawings."""

import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, import_extra, named, quoted, suggestion, value_text
from blast_env.io.importing.bodies import LEAST_STOREY_M, BodyPart, Faces
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import (
    APPLICATION,
    CHARGE_KEYS,
    STRUCTURE_KEYS,
    UNITS_M,
    VEHICLE_KEY,
)
from blast_env.io.importing.site_map import (
    MOST_COORDINATE,
    MOST_POINTS,
    MapFeature,
    SiteMap,
    Tags,
    check_count,
    errors_of,
)

with import_extra("maps", "maps and drawings"):
    from ezdxf import recover, units
    from ezdxf.disassemble import make_primitive
    from ezdxf.document import Drawing
    from ezdxf.entities.attrib import Attrib
    from ezdxf.entities.dxfentity import DXFEntity
    from ezdxf.entities.insert import Insert
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.entities.mesh import Mesh
    from ezdxf.entities.mtext import MText
    from ezdxf.entities.polygon import DXFPolygon as Polygonal
    from ezdxf.entities.polyline import Polyline
    from ezdxf.entities.solid import Face3d
    from ezdxf.entities.spline import Spline
    from ezdxf.entities.text import Text
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError
    from ezdxf.math import Matrix44, Vec2, Vec3
    from ezdxf.path import Path as DrawnPath
    from ezdxf.path import from_hatch, make_path, to_lwpolylines
    from ezdxf.protocols import SupportsVirtualEntities, virtual_entities
    from ezdxf.transform import copies

# What ezdxf mends is on the ledger. Without a handler, its lines with whole texts of a file would
# go to standard error.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())

MOST_LINES: Final = 2_000_000
"""Most lines of a file: each number of an entity takes one line, and its group code another."""

MOST_ENTITIES: Final = 50_000
"""Most entities of a drawing with all blocks expanded."""

_MOST_NESTED: Final = 50
_MOST_TEXT: Final = 1000
_SAG_M: Final = 0.02  # largest deviation of the chords of an arc
_ROUNDING: Final = 1e-9  # of the largest coordinate
_MEET_M: Final = 1e-3  # corners of faces of one body
_NOWHERE: Final = Point()
_HIDDEN: Final = "entities that are not shown"
_AROUND_TEXT: Final = 8  # a hole in a hatch for a text
_OWN_KEYS: Final = (*CHARGE_KEYS, *STRUCTURE_KEYS, VEHICLE_KEY)
_FRAMES: Final = ("IMAGE", "WIPEOUT", "VIEWPORT")
"""Entities whose outline is that of a picture."""

_LEAST_SAG: Final = 1e-9  # of the largest coordinate: rounding must not add ever more points


def read_dxf(site_map: SiteMap) -> None:
    """Read the content of the model space of a DXF file into a map, blocks expanded.

    Closed lines, hatches and footprints of bodies are outlines, texts are points. All have the tag
    `layer`: entities on layer 0 of a block take that of the insert. Texts have the tag `text`,
    entities with a thickness and bodies their extent in z. Meshes are bodies, and 3DFACEs that
    meet. A damaged file is read as far as `ezdxf.recover` can.

    The unit is that of the options, one of `UNITS_M`, or that of the file. A drawing in metres may
    have a reference system.
    """
    path, options = site_map.path, site_map.options
    options.refuse("a drawing, whose heights are in --units", "height_unit")
    site_map.has_layers = True
    check_count(path, site_map.content.count(b"\n"), MOST_LINES, "lines of text")
    with errors_of("ezdxf", path, "DXF"):
        document = _document(site_map)
        _set_scales(site_map, document)
        _check_entities(path, document)
        site_map.unit_m = _metres_per_unit(path, document, options.units)
        for feature in _DrawingFeatures(site_map, document).features():
            site_map.add(feature)
        _note_layers(site_map, document)
    if options.crs is not None and site_map.unit_m != 1.0:
        raise BlastEnvError(f"{path}: --crs needs a drawing in metres: say --units m if it is")
    site_map.crs = options.crs


def _document(site_map: SiteMap) -> Drawing:
    """Return the drawing of a file; if it is damaged, as much as can be recovered."""
    try:
        return readfile(site_map.path)
    except Exception as error:  # of many types: see `errors_of`
        try:
            document, auditor = recover.readfile(site_map.path)
        except Exception:
            raise error from None
        kind = "damaged files, recovered as far as possible"
        count = len(auditor.errors) + len(auditor.fixes)
        faults = f"{count} faults mended or skipped" if count else ""
        site_map.ledger.add(Fate.GUESSED, kind, site_map.path.name, detail=faults)
        return document


def _note_layers(site_map: SiteMap, document: Drawing) -> None:
    """Enter the layers that are switched off, which are read as others."""
    used = {str(feature.tags["layer"]).lower() for feature in site_map.features}
    for layer in document.layers:
        if layer.dxf.name.lower() in used and (layer.is_off() or layer.is_frozen()):
            kind = "layers that are off or frozen, read as others"
            site_map.ledger.add(Fate.NOTED, kind, f"layer {named(layer.dxf.name)}")


def _set_scales(site_map: SiteMap, document: Drawing) -> None:
    """Set the scales of 0 of inserts to 1, which no block can be drawn with.

    CAD programs show such inserts with the scale 1.
    """
    for layout in (document.modelspace(), *document.blocks):
        for insert in layout.query("INSERT"):
            for name in ("xscale", "yscale", "zscale"):
                if insert.dxf.get(name, 1.0) == 0.0:
                    insert.dxf.set(name, 1.0)
                    kind = "inserts with a scale of 0, taken as 1"
                    place = f"INSERT {_handle(insert)}"
                    site_map.ledger.add(Fate.GUESSED, kind, place, detail=name)


def _check_entities(path: Path, document: Drawing) -> None:
    """Refuse a drawing with too many entities or a number out of bounds, before it is expanded."""
    counts: dict[str, int] = {}  # of blocks, by their names in lower case

    def count(entities: Iterable[DXFEntity], above: tuple[str, ...]) -> int:
        total = 0
        for entity in entities:
            for number in _numbers(entity):
                if not abs(number) <= MOST_COORDINATE:
                    raise BlastEnvError(
                        f"{path}: {_kind(entity)} {_handle(entity)}: has the number "
                        f"{number:g}, must be within {MOST_COORDINATE:g}"
                    )
            total += 1
            name, times = _block_of(entity)
            block = document.blocks.get(name) if name else None
            if block is None:
                continue
            if name in above or len(above) == _MOST_NESTED:
                raise BlastEnvError(
                    f"{path}: the block {value_text(name)} lies in itself, or in more than "
                    f"{_MOST_NESTED} others, must do neither"
                )
            if name not in counts:
                counts[name] = count(block, (*above, name))
            total += times * (1 + counts[name])
        return total

    total = count(document.modelspace(), ())
    check_count(path, total, MOST_ENTITIES, "entities once its blocks are taken apart")


def _block_of(entity: DXFEntity) -> tuple[str, int]:
    """Return the name of the block that an entity inserts, or an empty string, and the count."""
    if entity.dxftype() == "INSERT":
        times = max(entity.dxf.row_count, 1) * max(entity.dxf.column_count, 1)
        return str(entity.dxf.get("name", "")).lower(), times
    if entity.dxftype() == "DIMENSION":
        return str(entity.dxf.get("geometry", "")).lower(), 1
    return "", 0


def _numbers(entity: DXFEntity) -> Iterator[float]:
    """Yield the numbers of an entity: coordinates, angles, bulges, factors, knots."""
    for value in entity.dxf.all_existing_dxf_attribs().values():
        if isinstance(value, float):
            yield value
        elif isinstance(value, Vec2 | Vec3):
            yield from (float(part) for part in value)
    if isinstance(entity, LWPolyline):
        yield from np.ravel(entity.lwpoints.values).tolist()
    elif isinstance(entity, Polyline):
        for vertex in entity.vertices:
            yield from _numbers(vertex)
    elif isinstance(entity, Spline):
        yield from (*entity.knots, *entity.weights)


def _kind(entity: DXFEntity) -> str:
    return named(entity.dxftype())


def _handle(entity: DXFEntity) -> str:
    """Return the handle of an entity, or an empty string without one."""
    handle = entity.dxf.get("handle")
    return named(str(handle)) if handle else ""


def _metres_per_unit(path: Path, document: Drawing, unit: str | None) -> float:
    if unit is None:
        code = int(document.units)
        if code == 0:
            raise BlastEnvError(
                f"{path}: does not say its unit ($INSUNITS is 0); say it with --units, one of "
                f"{', '.join(UNITS_M)}"
            )
        unit = str(units.decode(code))
        if unit not in UNITS_M:
            raise BlastEnvError(
                f"{path}: $INSUNITS is {code}, which is none of {', '.join(UNITS_M)}; say --units"
            )
    if unit not in UNITS_M:
        raise BlastEnvError(
            f"units is {quoted(unit)}{suggestion(unit, UNITS_M)}, must be one of "
            f"{', '.join(UNITS_M)}"
        )
    return UNITS_M[unit]


@dataclass
class _DrawingFeatures:
    """The entities of a drawing as features.

    Attributes:
        skipped: Entities that a block has, but ezdxf cannot place, with the reason.
        faces: Places and corners of 3DFACEs by layer and insert; those that meet are a body.
    """

    site_map: SiteMap
    document: Drawing
    skipped: list[tuple[DXFEntity, str]] = field(default_factory=list)
    faces: dict[tuple[str, str], list[tuple[str, FloatArray]]] = field(default_factory=dict)

    def features(self) -> Iterator[MapFeature]:
        """Yield the features, also those that cannot be used."""
        number = 0
        for entity in self.document.modelspace():
            for part, layer in self._parts(entity, "0"):
                number += 1
                handle = _handle(entity) or f"no. {number}"
                own = handle if part is entity else f"{handle}/{number}"
                place = f"{_kind(part)} {own} on the layer {named(layer)}"
                # Faces are parts of a surface: collected by layer and insert, and read together
                # below.
                if isinstance(part, Face3d) and not _is_hidden(part):
                    corners = np.array([tuple(wcs_vertex) for wcs_vertex in part.wcs_vertices()])
                    self._check(corners, place)
                    insert = "" if part is entity else handle
                    self.faces.setdefault((layer, insert), []).append((place, corners))
                else:
                    yield from self._features(part, layer, place)
            for part, reason in self.skipped:
                number += 1
                place = f"{_kind(part)} {_handle(entity)}/{number}"
                kind = f"entities of blocks that cannot be placed ({reason})"
                layer = str(part.dxf.get("layer", "0"))
                yield MapFeature(_NOWHERE, {"layer": layer}, place, kind)
            self.skipped.clear()
        for (layer, _), faces in self.faces.items():
            yield from self._of_faces(faces, layer)

    def _parts(self, entity: DXFEntity, above: str) -> Iterator[tuple[DXFEntity, str]]:
        """Yield the simple entities of an entity, with their layers.

        Args:
            entity: Any entity; blocks, dimensions and lines with many lines are taken apart.
            above: Layer of the insert around it.
        """
        layer = str(entity.dxf.get("layer", "0"))
        layer = above if layer == "0" else layer
        if _is_hidden(entity):
            yield entity, layer
        elif isinstance(entity, Insert):
            block = entity.block()
            if block is None or block.block is None or block.block.is_xref:
                yield entity, layer
                return
            for insert in entity.multi_insert() if entity.mcount > 1 else (entity,):
                for attribute in insert.attribs:
                    yield from self._parts(attribute, layer)
                place = insert.matrix44()
                for inner in block:
                    for part, own in self._parts(inner, layer):
                        yield from ((placed, own) for placed in self._placed(part, place))
        elif isinstance(entity, SupportsVirtualEntities):
            for part in virtual_entities(entity):
                yield from self._parts(part, layer)
        else:
            yield entity, layer

    def _placed(self, entity: DXFEntity, place: Matrix44) -> list[DXFEntity]:
        """Return an entity of a block where its insert has it: in several parts if it must be."""
        if entity.dxftype() == "ATTDEF":
            return []  # the insert has the attribute
        faults, found = copies([entity], place)
        if _rise(entity).any() and not all(path.dxf.is_supported("thickness") for path in found):
            faults, found = copies(self._chords(entity, place), place)
        self.skipped += [(fault.entity, fault.error.name.lower()) for fault in faults]
        return found

    def _chords(self, entity: DXFEntity, place: Matrix44) -> list[LWPolyline]:
        """Return an extruded entity with chords for its arcs.

        A stretched arc is an ellipse, which has no thickness.
        """
        names = ("layer", "thickness", "invisible")
        given = {name: entity.dxf.get(name) for name in names if entity.dxf.hasattr(name)}
        stretch = max(axis.magnitude for axis in (place.ux, place.uy, place.uz))
        sag = _SAG_M / self.site_map.unit_m / max(stretch, _ROUNDING)
        line = make_path(entity)
        largest = max(
            (abs(coordinate) for point in line.control_vertices() for coordinate in point),
            default=0,
        )
        up = Vec3(entity.dxf.get("extrusion", (0.0, 0.0, 1.0)))
        sag = max(sag, _LEAST_SAG * largest)
        return list(to_lwpolylines([line], distance=sag, extrusion=up, dxfattribs=given))

    def _features(self, entity: DXFEntity, layer: str, place: str) -> Iterator[MapFeature]:
        """Yield the features of a simple entity: several if it is a body of several heights."""
        tags: dict[str, str | float | bool] = {"layer": layer, **_own_data(entity)}
        if _is_hidden(entity):
            yield MapFeature(_NOWHERE, tags, place, _HIDDEN)
        elif isinstance(entity, Text | MText):
            yield _text(entity, tags, place)
        elif entity.dxftype() == "POINT":
            yield MapFeature(Point(entity.dxf.location.x, entity.dxf.location.y), tags, place)
        else:
            try:
                yield from list(self._shapes(entity, tags, place))
            except (TypeError, ValueError, DXFError) as error:
                if isinstance(error, BlastEnvError):
                    raise
                kind = "references to other files, or to blocks that are not there"
                if not isinstance(entity, Insert):
                    kind = f"entities of the type {_kind(entity)}"
                yield MapFeature(_NOWHERE, tags, place, kind)

    def _shapes(self, entity: DXFEntity, tags: Tags, place: str) -> Iterator[MapFeature]:
        """Yield the outlines, the line or the body of an entity.

        Raises:
            TypeError: If it has none.
        """
        if _is_mesh(entity):
            mesh = make_primitive(entity).mesh
            vertices = np.array([tuple(vertex) for vertex in mesh.vertices] if mesh else [])
            self._check(vertices, place)
            faces = [vertices[list(face)] for face in mesh.faces] if mesh else []
            yield from self._body(faces, tags, place)
            return
        if isinstance(entity, Polygonal):
            entity.paths.paths = [
                path for path in entity.paths if not path.path_type_flags & _AROUND_TEXT
            ]
            rings = [self._places(line, place) for line in from_hatch(entity)]
            lines = [LineString([*ring[:, :2], ring[0, :2]]) for ring in rings if len(ring) > 2]
            yield _shown(shapely.build_area(shapely.GeometryCollection(lines)), tags, place)
            return
        if entity.dxftype() in _FRAMES:
            raise TypeError
        points = self._places(make_path(entity), place)
        if len(points) < 2:
            yield _shown(_NOWHERE, tags, place)
            return
        rise = _rise(entity)
        if np.hypot(*rise[:2]) > _ROUNDING * float(np.abs(rise).max()):  # swept aside
            yield from self._body(_swept(points, rise), tags, place)
            return
        is_area = len(points) > 3 and _closes(points[:, :2])
        geometry = (Polygon if is_area else LineString)(points[:, :2])
        ends = [points[:, 2].min(), points[:, 2].max()]
        heights_m = self.site_map.unit_m * np.array([*ends, *(ends + rise[2])])
        extent_m = (float(heights_m.min()), float(heights_m.max())) if rise[2] else None
        yield _shown(geometry, tags, place, extent_m)

    def _body(self, corners: Sequence[FloatArray], tags: Tags, place: str) -> Iterator[MapFeature]:
        """Yield the parts of a body with these faces, each (k, 3)."""
        unit_m = self.site_map.unit_m
        faces = Faces.of([unit_m * part for part in corners if len(part) > 2])
        shadow = faces.shadow if len(faces.plans) else _NOWHERE
        if shadow.is_empty:
            yield _shown(_NOWHERE, tags, place)
            return
        low_m, high_m = float(faces.low_m.min()), float(faces.high_m.max())
        if low_m == high_m:
            yield _shown(_in_units(shadow, unit_m), tags, place)
            return
        feet = list(faces.plans[faces.low_m <= low_m + LEAST_STOREY_M])
        parts = faces.parts(low_m, feet, self.site_map.options.least_area_m2, 0.0)
        for part in parts or [BodyPart(shadow, low_m, high_m)]:
            part_of = place if len(parts) > 1 else ""
            extent_m = part.base_m, part.top_m
            outline = _in_units(part.outline, unit_m)
            yield MapFeature(outline, tags, place, extent_m=extent_m, part_of=part_of)

    def _of_faces(
        self, faces: Sequence[tuple[str, FloatArray]], layer: str
    ) -> Iterator[MapFeature]:
        """Yield the bodies that 3DFACEs of a layer make, each at the place of its first face."""
        tags: Tags = {"layer": layer}
        size = max(float(np.abs(corners).max()) for _, corners in faces)
        vertices = np.concatenate([corners for _, corners in faces])
        owners = np.repeat(np.arange(len(faces)), [len(corners) for _, corners in faces])
        near = cKDTree(vertices).query_pairs(
            max(_MEET_M / self.site_map.unit_m, _ROUNDING * size), output_type="ndarray"
        )
        links = coo_array((np.ones(len(near)), owners[near.T]), shape=(len(faces), len(faces)))
        _, body = connected_components(links, directed=False)
        for number in range(body.max() + 1):
            own = [faces[k] for k in np.flatnonzero(body == number).tolist()]
            first = own[0][0]
            yield from self._body([corners for _, corners in own], tags, first)
            for place, _ in own[1:]:
                kind, detail = "faces of a body", f"of {first}"
                self.site_map.ledger.add(Fate.MERGED, kind, place, detail=detail)

    def _places(self, line: DrawnPath, place: str) -> FloatArray:
        """Return the points of a line (n, 3), arcs as chords."""
        held = np.array([tuple(point) for point in line.control_vertices()]).reshape(-1, 3)
        self._check(held, place)
        largest = float(np.abs(held).max(initial=0.0))
        straight = line.flattening(max(_SAG_M / self.site_map.unit_m, _LEAST_SAG * largest))
        points = np.array([tuple(vertex) for vertex in islice(straight, MOST_POINTS + 1)])
        check_count(self.site_map.path, self.site_map.points + len(points), MOST_POINTS, "points")
        return points.reshape(-1, 3)

    def _check(self, points: FloatArray, place: str) -> None:
        largest = float(np.abs(points).max(initial=0.0))
        if not largest <= MOST_COORDINATE:
            raise BlastEnvError(
                f"{self.site_map.path}: {place}: has, or its arcs have, the coordinate "
                f"{largest:g}, must be within {MOST_COORDINATE:g}"
            )


def _is_mesh(entity: DXFEntity) -> bool:
    """Return whether an entity has faces in space."""
    if isinstance(entity, Polyline):
        return entity.is_poly_face_mesh or entity.is_polygon_mesh
    return isinstance(entity, Mesh)


def _is_hidden(entity: DXFEntity) -> bool:
    """Return whether an entity is not shown, as those of another state of a dynamic block."""
    return bool(entity.dxf.get("invisible", 0)) or (
        isinstance(entity, Attrib) and entity.is_invisible
    )


def _own_data(entity: DXFEntity) -> dict[str, str]:
    """Return what a drawing of blast-env says of a place of a charge, or of a structure."""
    if not entity.has_xdata(APPLICATION):
        return {}
    pairs = (str(value).partition("=") for _, value in entity.get_xdata(APPLICATION))
    return {key: value for key, _, value in pairs if key in _OWN_KEYS}


def _rise(entity: DXFEntity) -> FloatArray:
    """Return the way along which an entity with a thickness is extruded; 0 without one."""
    if not entity.dxf.is_supported("thickness"):
        return np.zeros(3)
    up = Vec3(entity.dxf.get("extrusion", (0.0, 0.0, 1.0)))
    thickness = float(entity.dxf.get("thickness", 0.0))
    return np.array(tuple(up.normalize(thickness) if thickness and up else (0.0, 0.0, 0.0)))


def _swept(points: FloatArray, rise: FloatArray) -> list[FloatArray]:
    """Return the faces of a line that is moved, and its two ends if it is an outline."""
    sides = [np.array([a, b, b + rise, a + rise]) for a, b in pairwise(points)]
    return [*sides, points, points + rise] if _closes(points) else sides


def _shown(
    geometry: BaseGeometry, tags: Tags, place: str, extent_m: tuple[float, float] | None = None
) -> MapFeature:
    fault = "entities without an extent in plan" if geometry.is_empty else ""
    ground_m = 0.0 if "ground_m" in tags else None
    return MapFeature(geometry, tags, place, fault, extent_m=extent_m, ground_m=ground_m)


def _in_units(outline: BaseGeometry, unit_m: float) -> BaseGeometry:
    """Return an outline in metres in the unit of the drawing."""
    return shapely.transform(outline, lambda places: places / unit_m)


def _text(entity: Text | MText, tags: Tags, place: str) -> MapFeature:
    """Return the middle of a text as a point."""
    insert = entity.dxf.insert
    if isinstance(entity, MText):
        entity.text = entity.text[:_MOST_TEXT]
    words = entity.plain_text()[:_MOST_TEXT]
    if isinstance(entity, Text):
        _, first, second = entity.get_placement()
        insert = entity.ocs().to_wcs(Vec3(first if second is None else second))
    point = Point(float(insert[0]), float(insert[1]))
    return MapFeature(point, {**tags, "text": " ".join(str(words).split())}, place)


def _closes(places: FloatArray) -> bool:
    """Return whether a line ends at its start, within rounding."""
    size = float(np.abs(places).max()) or 1.0
    return bool(np.abs(places[0] - places[-1]).max() <= _ROUNDING * size)
