"""Reading drawings: what is drawn on each layer of a DXF file."""

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import islice
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, suggestion
from blast_env.importing.site_map import (
    MOST_COORDINATE,
    MOST_FEATURES,
    DrawingCoordinates,
    MapFeature,
    SiteMap,
    checked_file,
    errors_of,
    too_many,
)

with import_extra("maps", "maps and drawings"):
    from ezdxf import units
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.document import Drawing
    from ezdxf.entities.dxfentity import DXFEntity
    from ezdxf.entities.mtext import MText
    from ezdxf.entities.text import Text
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError
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
_SAG_M: Final = 0.02  # of arcs made straight
_LEAST_SAG: Final = 1e-9  # of the largest coordinate: rounding must not ask for ever more points


def read_dxf(path: Path, unit: str | None = None) -> SiteMap:
    """Return what is drawn in the model space of a DXF file, blocks taken apart.

    Closed lines are outlines, texts are points; each has its `layer` as a tag, a text its `text`,
    and what has a thickness that as its `height`, in metres.

    Args:
        path: The file.
        unit: One of `UNITS_M`; without it, what the file says.

    Raises:
        BlastEnvError: If it cannot be read, or nobody says its unit.
    """
    skipped: Counter[str] = Counter()
    with errors_of("ezdxf", path, "DXF"):
        document = readfile(checked_file(path))
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
    """Yield what is drawn; `skipped` counts what has no line."""
    entities = recursive_decompose(document.modelspace())
    for number, entity in enumerate(islice(entities, 10 * MOST_FEATURES)):
        tags: dict[str, str | float | bool] = {"layer": str(entity.dxf.get("layer", "0"))}
        handle = entity.dxf.get("handle") or f"no. {number}"
        place = f"{entity.dxftype()} {handle} on the layer {tags['layer']}"
        if isinstance(entity, Text | MText):
            yield _text(entity, tags, place)
            continue
        if entity.dxftype() == "POINT":
            yield MapFeature(Point(entity.dxf.location.x, entity.dxf.location.y), tags, place)
            continue
        thickness_m = metres * abs(entity.dxf.get("thickness", 0.0) or 0.0)
        if thickness_m > 0.0:
            tags["height"] = thickness_m
        places = _places(path, place, entity, sag, skipped)
        if places is not None:
            is_outline = len(places) > 3 and _closes(places)
            geometry = Polygon(places) if is_outline else LineString(places)
            yield MapFeature(geometry, tags, place)


def _text(entity: Text | MText, tags: dict[str, str | float | bool], place: str) -> MapFeature:
    """Return the middle of a text as a point."""
    words = entity.plain_text()
    insert = entity.dxf.insert
    if isinstance(entity, Text):
        _, first, second = entity.get_placement()
        insert = first if second is None else second
    point = Point(float(insert[0]), float(insert[1]))
    return MapFeature(point, {**tags, "text": " ".join(str(words).split())}, place)


def _places(
    path: Path, place: str, entity: DXFEntity, sag: float, skipped: Counter[str]
) -> list[tuple[float, float]] | None:
    """Return the points of a line, its arcs made straight; `None` for what has no line."""
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
    points: list[Any] = list(line.flattening(max(sag, _LEAST_SAG * largest)))
    return [(float(point.x), float(point.y)) for point in points] if len(points) > 1 else None


def _closes(places: list[tuple[float, float]]) -> bool:
    """Whether a line ends where it starts, but for rounding."""
    size = max(abs(value) for place in places for value in place) or 1.0
    return all(
        isclose(first, last, rel_tol=0.0, abs_tol=1e-9 * size)
        for first, last in zip(places[0], places[-1], strict=True)
    )
