"""Reading of DXF drawings."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, suggestion, value_text
from blast_env.importing.site_map import (
    MOST_COORDINATE,
    MOST_FEATURES,
    MOST_POINTS,
    DrawingCoordinates,
    MapFeature,
    SiteMap,
    checked_file,
    errors_of,
    too_many,
    too_many_points,
)

with import_extra("maps", "maps and drawings"):
    from ezdxf import units
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfentity import DXFEntity
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.entities.mtext import MText
    from ezdxf.entities.polyline import Polyline
    from ezdxf.entities.spline import Spline
    from ezdxf.entities.text import Text
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError
    from ezdxf.math import Vec2, Vec3
    from ezdxf.path import make_path
    from shapely.geometry import LineString, Point, Polygon

UNITS_M: Final[Mapping[str, float]] = MappingProxyType(
    {"m": 1.0, "mm": 0.001, "cm": 0.01, "dm": 0.1, "km": 1000.0, "in": 0.0254, "ft": 0.3048}
)
"""Lengths of units in metres, by the names that `--units` takes."""

_CODES: Final = {
    units.IN: "in",
    units.FT: "ft",
    units.MM: "mm",
    units.CM: "cm",
    units.M: "m",
    units.KM: "km",
    units.DM: "dm",
}
MOST_LINES: Final = 2_000_000
"""Most lines of a file: each number of an entity takes one line, and its group code another."""

MOST_ENTITIES: Final = 50_000
"""Most entities of a drawing with all blocks expanded."""

_MOST_NESTED: Final = 50
_MOST_TEXT: Final = 1000
_SAG_M: Final = 0.02  # largest deviation of the chords of an arc
_LEAST_SAG: Final = 1e-9  # of the largest coordinate: rounding must not add ever more points


def read_dxf(path: Path, unit: str | None = None) -> SiteMap:
    """Return the content of the model space of a DXF file, blocks expanded.

    Closed lines are outlines, texts are points. All have the tag `layer`, texts `text`, and
    entities with a thickness `height`, m: elevation plus thickness.

    Args:
        path: The file.
        unit: One of `UNITS_M`; the unit of the file unless given.

    Raises:
        BlastEnvError: If the file cannot be read or exceeds a limit, or its unit is unknown.
    """
    skipped: Counter[str] = Counter()
    lines = checked_file(path).read_bytes().count(b"\n")
    if lines > MOST_LINES:
        raise BlastEnvError(f"{path}: has {lines:,} lines, must have at most {MOST_LINES:,}")
    with errors_of("ezdxf", path, "DXF"):
        document = readfile(path)
        _Unfolded(path, document).check()
        metres = _metres_per_unit(path, document, unit)
        features = tuple(
            islice(_features(path, document, _SAG_M / metres, metres, skipped), MOST_FEATURES + 1)
        )
    if len(features) > MOST_FEATURES:
        raise too_many(path)
    notes = tuple(
        f"entities of the type {kind}, which were left out: {count}"
        for kind, count in skipped.items()
    )
    return SiteMap(path, DrawingCoordinates(metres), features, notes)


@dataclass(frozen=True)
class _Unfolded:
    """Counter of the entities of a drawing with all blocks expanded, without expanding them.

    Attributes:
        path: The file.
        document: The drawing.
        counts: Entities of the blocks counted so far, by their names in lower case.
    """

    path: Path
    document: Drawing
    counts: dict[str, int] = field(default_factory=dict)

    def check(self) -> None:
        """Refuse a drawing with too many entities or a number out of bounds.

        Raises:
            BlastEnvError: If there are more than `MOST_ENTITIES` entities, a number is beyond
                `MOST_COORDINATE`, or a block is nested too deeply or in itself.
        """
        count = self._count(self.document.modelspace(), ())
        if count > MOST_ENTITIES:
            raise BlastEnvError(
                f"{self.path}: has {count:,} entities once its blocks are taken apart, must have "
                f"at most {MOST_ENTITIES:,}"
            )

    def _count(self, entities: Iterable[DXFEntity], above: tuple[str, ...]) -> int:
        """Return the number of entities, including those of the blocks that they insert."""
        total = 0
        for entity in entities:
            self._check_numbers(entity)
            total += 1
            name, times = _block_of(entity)
            block = self.document.blocks.get(name) if name else None
            if block is None:
                continue
            if name in above or len(above) == _MOST_NESTED:
                raise BlastEnvError(
                    f"{self.path}: the block {value_text(name)} lies in itself, or in more than "
                    f"{_MOST_NESTED} others, must do neither"
                )
            if name not in self.counts:
                self.counts[name] = self._count(block, (*above, name))
            total += times * (1 + self.counts[name])
        return total

    def _check_numbers(self, entity: DXFEntity) -> None:
        for number in _numbers(entity):
            if not abs(number) <= MOST_COORDINATE:
                raise BlastEnvError(
                    f"{self.path}: {entity.dxftype()} {entity.dxf.get('handle')}: has the number "
                    f"{number:g}, must be within {MOST_COORDINATE:g}"
                )


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
            yield from (float(each) for each in value)
    if isinstance(entity, LWPolyline):
        yield from np.ravel(entity.lwpoints.values).tolist()
    elif isinstance(entity, Polyline):
        for vertex in entity.vertices:
            yield from _numbers(vertex)
    elif isinstance(entity, Spline):
        yield from (*entity.knots, *entity.weights)


def _metres_per_unit(path: Path, document: Drawing, unit: str | None) -> float:
    if unit is None:
        code = int(document.units)
        if code == 0:
            raise BlastEnvError(
                f"{path}: does not say its unit ($INSUNITS is 0); say it with --units, one of "
                f"{', '.join(UNITS_M)}"
            )
        if code not in _CODES:
            raise BlastEnvError(
                f"{path}: $INSUNITS is {code}, which is none of {', '.join(UNITS_M)}; say --units"
            )
        unit = _CODES[code]
    if unit not in UNITS_M:
        raise BlastEnvError(
            f"units is {unit!r}{suggestion(unit, UNITS_M)}, must be one of {', '.join(UNITS_M)}"
        )
    return UNITS_M[unit]


def _features(
    path: Path, document: Drawing, sag: float, metres: float, skipped: Counter[str]
) -> Iterator[MapFeature]:
    """Yield the features; `skipped` counts entities without a line by type."""
    left = MOST_POINTS
    for number, entity in enumerate(recursive_decompose(document.modelspace())):
        tags: dict[str, str | float | bool] = {"layer": str(entity.dxf.get("layer", "0"))}
        handle = entity.dxf.get("handle") or f"no. {number}"
        place = f"{entity.dxftype()} {handle} on the layer {tags['layer']}"
        if isinstance(entity, Text | MText):
            yield _text(entity, tags, place)
            continue
        if entity.dxftype() == "POINT":
            yield MapFeature(Point(entity.dxf.location.x, entity.dxf.location.y), tags, place)
            continue
        has_thickness = entity.dxf.is_supported("thickness")
        thickness_m = metres * abs(entity.dxf.get("thickness", 0.0)) if has_thickness else 0.0
        if thickness_m > 0.0:
            is_level = entity.dxftype() == "LWPOLYLINE"
            base_m = metres * max(entity.dxf.get("elevation", 0.0), 0.0) if is_level else 0.0
            tags["height"] = base_m + thickness_m
            if base_m > 0.0:
                tags["min_height"] = base_m
        places = _places(path, place, entity, sag, skipped, left)
        if places is not None:
            left -= len(places)
            is_outline = len(places) > 3 and _closes(places)
            geometry = Polygon(places) if is_outline else LineString(places)
            yield MapFeature(geometry, tags, place)


def _text(entity: Text | MText, tags: dict[str, str | float | bool], place: str) -> MapFeature:
    """Return the middle of a text as a point."""
    insert = entity.dxf.insert
    if isinstance(entity, MText):
        entity.text = entity.text[:_MOST_TEXT]
    words = entity.plain_text()[:_MOST_TEXT]
    if isinstance(entity, Text):
        _, first, second = entity.get_placement()
        insert = first if second is None else second
    point = Point(float(insert[0]), float(insert[1]))
    return MapFeature(point, {**tags, "text": " ".join(str(words).split())}, place)


def _places(
    path: Path, place: str, entity: DXFEntity, sag: float, skipped: Counter[str], most: int
) -> list[tuple[float, float]] | None:
    """Return the points of a line, arcs as chords; `None` for an entity without a line.

    Raises:
        BlastEnvError: If there are more than `most` points, or a coordinate is too large.
    """
    try:
        line = make_path(entity)
    except (TypeError, ValueError, DXFError):
        skipped[entity.dxftype()] += 1
        return None
    held = np.array([tuple(point) for point in line.control_vertices()])
    largest = float(np.abs(held).max(initial=0.0))
    if not largest <= MOST_COORDINATE:
        raise BlastEnvError(
            f"{path}: {place}: has, or its arcs have, the coordinate {largest:g}, "
            f"must be within {MOST_COORDINATE:g}"
        )
    straight = line.flattening(max(sag, _LEAST_SAG * largest))
    points: list[Any] = list(islice(straight, most + 1))
    if len(points) > most:
        raise too_many_points(path)
    return [(float(point.x), float(point.y)) for point in points] if len(points) > 1 else None


def _closes(places: list[tuple[float, float]]) -> bool:
    """Return whether a line ends at its start, within rounding."""
    size = max(abs(value) for place in places for value in place) or 1.0
    return all(
        isclose(first, last, rel_tol=0.0, abs_tol=1e-9 * size)
        for first, last in zip(places[0], places[-1], strict=True)
    )
