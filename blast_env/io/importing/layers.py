"""Reading of layers of GeoPackage, shapefile, FlatGeobuf and KML by pyogrio, which has GDAL."""

import glob
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import shapely

from blast_env.errors import BlastEnvError, import_extra, named
from blast_env.io.importing.geojson import LOCAL
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.properties import tags_of
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MapFeature,
    SiteMap,
    check_count,
    code_of,
    errors_of,
)

_TAG_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        **dict.fromkeys(("building:l", "building_l"), "building:levels"),
        **dict.fromkeys(("building:h", "building_h"), "building:height"),
        **dict.fromkeys(("building:p", "building_p"), "building:part"),
        **dict.fromkeys(("measuredHe", "measured_h"), "measuredHeight"),
        **dict.fromkeys(("roof:heigh", "roof_heigh"), "roof:height"),
        **dict.fromkeys(("roof:level", "roof_level"), "roof:levels"),
        "Name": "name",
    }
)
"""Tags by other names: a shapefile cuts names after ten letters, KML has a capital."""

_LEVELS: Final = "building:levels"
_NUMBERED: Final = re.compile(r"building[:_]?\d")
_TWINS: Final = "storeys by a name that a shapefile has cut, maybe those below the ground"

_COMPANIONS: Final = (".dbf", ".shx")
"""Files that a shapefile cannot do without; its `.prj` is missed where it is needed."""

_LAYER: Final = "Layer"
"""Tag with the name of the layer in a file of several; OpenStreetMap's `layer` is a height."""


def read_layers(site_map: SiteMap) -> None:
    """Read all layers of a file into a map; of several, each object has its own as `Layer`.

    Its coordinates are in the reference system of the options, `local` for metres without a place
    on the Earth; that of the layers unless given.
    """
    site_map.options.refuse("geographic data, whose coordinates --crs is about", "units")
    path, systems = site_map.path, dict[str, str | None]()
    _check_companions(path)
    with import_extra("gis", "geographic data"):
        import pyogrio
    with _errors_of_gdal(path):
        names = [str(name) for name, *_ in pyogrio.list_layers(path)]
    for name in names:
        with _errors_of_gdal(path):
            count = int(pyogrio.read_info(path, layer=name, force_feature_count=True)["features"])
            check_count(path, count, MOST_FEATURES, "outlines and lines")
            meta, _, geometries, columns = pyogrio.raw.read(path, layer=name, force_2d=True)
        if geometries is None or not len(geometries):
            continue  # a table without places, or an empty layer
        systems[name] = meta["crs"]
        _check_names(site_map, meta)
        for feature in _features(name if len(names) > 1 else "", meta, geometries, columns):
            site_map.add(feature)
    if site_map.features:
        crs = _system(site_map, systems)
        site_map.crs = None if crs == LOCAL else crs


@contextmanager
def _errors_of_gdal(path: Path) -> Iterator[None]:
    """Convert errors of pyogrio, without the advice on GDAL's drivers, which nobody here names."""
    try:
        with errors_of("pyogrio", path, "geographic data"):
            yield
    except BlastEnvError as error:
        raise BlastEnvError(str(error).partition("; It might help")[0]) from error


def _check_companions(path: Path) -> None:
    """Refuse a shapefile that came alone: GDAL reads one without its table, and says nothing."""
    if path.suffix.lower() != ".shp":
        return
    beside = {file.suffix.lower() for file in path.parent.glob(f"{glob.escape(path.stem)}.*")}
    missing = [suffix for suffix in _COMPANIONS if suffix not in beside]
    if missing:
        raise BlastEnvError(
            f"{path}: a shapefile is several files, of which {' and '.join(missing)} must lie "
            "beside it: .dbf has the names and heights, .shx where each outline begins"
        )


def _features(
    layer: str, meta: Mapping[str, Any], geometries: Any, columns: Any
) -> Iterator[MapFeature]:
    """Yield the features of a layer; one without a geometry is lost."""
    fields = _tags_of_fields(meta)
    for number, (given, *values) in enumerate(zip(geometries, *columns, strict=True)):
        place = f"{layer or 'features'}[{number}]"
        properties = {
            name: plain
            for name, value in zip(fields, values, strict=True)
            if (plain := _plain(value)) is not None
        }
        if layer:
            properties.setdefault(_LAYER, layer)
        tags = tags_of({"properties": properties})
        if given is None or (geometry := shapely.from_wkb(given)).is_empty:
            yield MapFeature(shapely.Point(), tags, place, "features without a geometry")
        else:
            yield MapFeature(geometry, tags, place)


def _tags_of_fields(meta: Mapping[str, Any]) -> list[str]:
    return [_TAG_NAMES.get(str(name), str(name)) for name in meta["fields"]]


def _check_names(site_map: SiteMap, meta: Mapping[str, Any]) -> None:
    """Enter storeys of a shapefile with several names that are equal when cut.

    GDAL cuts `building:levels` and `building:levels:underground` to `building_l`, in the order of
    the fields, and numbers the second: `building_1`.
    """
    names = [str(name) for name in meta["fields"]]
    twins = [name for name in names if _NUMBERED.fullmatch(name)]
    if twins and _LEVELS not in names and _LEVELS in _tags_of_fields(meta):
        detail = f"beside {', '.join(map(named, twins))}"
        site_map.ledger.add(Fate.GUESSED, _TWINS, site_map.path.name, detail=detail)


def _plain(value: Any) -> str | int | float | bool | None:
    """Return a value of a column as a tag has it; `None` for what is missing, and for dates."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and np.isnan(value):
        return None
    return value if isinstance(value, str | int | float | bool) else None


def _system(site_map: SiteMap, systems: Mapping[str, str | None]) -> str:
    """Return the reference system of the options, or that of all layers."""
    known = {system for system in systems.values() if system is not None}
    if len(known) > 1:
        listed = ", ".join(f"{name}: {(system or 'none')[:60]}" for name, system in systems.items())
        raise BlastEnvError(
            f"{site_map.path}: its layers have {len(known)} reference systems, must have one: "
            f"{listed}; convert it: ogr2ogr -t_srs EPSG:25832 one.gpkg FILE, or another system"
        )
    if site_map.options.crs is not None:
        return site_map.options.crs
    if not known or None in systems.values():
        beside = "; that of a shapefile is in the .prj beside it"
        raise BlastEnvError(
            f"{site_map.path}: has no reference system: say --crs, local for plain metres"
            f"{beside if site_map.path.suffix.lower() == '.shp' else ''}"
        )
    return code_of(site_map.path, known.pop())
