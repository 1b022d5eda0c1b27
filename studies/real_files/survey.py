"""The import of a file whose content is not known: options chosen from what it has."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import shapely

from blast_env.errors import BlastEnvError
from blast_env.io.importing import ImportOptions, SiteImport, import_site
from blast_env.io.importing.convert import read_map
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.site_map import WGS84, SiteMap
from blast_env.io.importing.things import Role, Thing, things_of
from blast_env.reading import ReadingError, ReadingLimits, read_apart

SUFFIXES: Final = (
    *(".geojson", ".json", ".city.jsonl", ".osm", ".osm.gz", ".osm.bz2", ".pbf", ".dxf", ".ifc"),
    *(".gpkg", ".shp", ".fgb", ".kml", ".parquet"),
)

_LIMITS: Final = ReadingLimits(processor_s=60, memory_bytes=1_000_000_000, wall_s=300.0)
_DEGREE_M: Final = 111_000.0
_LARGEST_M: Final = 300.0
_SIZE_M: Final = (200.0, 200.0)
_BESIDE_M: Final = (4.0, 8.0)


@dataclass(frozen=True)
class Survey:
    """The outcome of an import.

    Attributes:
        path: The file.
        refusal: Why it was refused; an empty string if it was not.
        sums: Number of objects by fate and kind.
        buildings: Ground area, m2, underside and top, m, of each building by its place.
    """

    path: Path
    refusal: str
    sums: Counter[tuple[Fate, str]]
    buildings: dict[str, tuple[float, float, float]] = field(default_factory=dict)


def survey(path: Path) -> Survey:
    """Return the outcome of importing a file, in a process with limits."""
    try:
        return read_apart(str(path), _surveyed, path, limits=_LIMITS)
    except (BlastEnvError, ReadingError) as error:
        return Survey(path, str(error).replace(str(path), "").strip(": "), Counter())


def files_of(folder: Path) -> list[Path]:
    """Return the maps and drawings of a folder and those within it."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file() and path.name.lower().endswith(SUFFIXES)
    )


def _surveyed(path: Path) -> Survey:
    """Import a file: its largest building is protected, on a site of 200 m in a large map."""
    site_map = _read(path)
    options = site_map.options
    sound = [thing for thing in things_of(site_map) if not thing.fault]
    outlines = [thing for thing in sound if thing.role is Role.BUILDING]
    if not outlines:
        import_site(path, options)  # says why
    chief = max(outlines, key=lambda outline: float(outline.geometry.area))
    options = _around(site_map, sound, chief, options)
    error = None
    for attempt in _attempts(site_map, chief, options, sound):
        try:
            imported = import_site(path, attempt)
        except BlastEnvError as refusal:
            error = error or refusal
            if "charge" not in str(refusal):
                raise
        else:
            kinds = ((entry.fate, entry.kind) for entry in imported.ledger.entries)
            return Survey(path, "", Counter(kinds), _solids(imported))
    assert error is not None
    raise error


def _solids(site: SiteImport) -> dict[str, tuple[float, float, float]]:
    """Return area, underside and top of the buildings, the parts of one together."""
    found: dict[str, tuple[float, float, float]] = {}
    for building in site.buildings:
        area_m2, base_m, top_m = found.get(building.place, (0.0, building.base_m, 0.0))
        area_m2 = round(area_m2 + building.outline.area, 1)
        found[building.place] = (
            area_m2,
            min(base_m, building.base_m),
            max(top_m, building.height_m or 0.0),
        )
    return found


def _read(path: Path) -> SiteMap:
    """Return a map with the options that it can be read with."""
    layers = ("*",) if path.suffix.lower() == ".dxf" else ()
    options = ImportOptions(buildings_from=layers, repair=True)
    try:
        return read_map(path, options)
    except BlastEnvError as error:
        if "--units" not in str(error):
            raise
    return read_map(path, replace(options, units="m"))


def _unit_m(site_map: SiteMap) -> float:
    """Return the length of a unit of coordinates, m; degrees are as long as on the equator."""
    return _DEGREE_M if site_map.crs == WGS84 else site_map.unit_m


def _around(
    site_map: SiteMap, things: list[Thing], chief: Thing, options: ImportOptions
) -> ImportOptions:
    """Return the options with the building protected, on a site around it if the map is large."""
    point = chief.geometry.representative_point()
    middle = float(point.x), float(point.y)
    options = replace(options, protect_near=middle)
    left, bottom, right, top = shapely.total_bounds([thing.geometry for thing in things])
    if max(right - left, top - bottom) * _unit_m(site_map) > _LARGEST_M:
        return replace(options, centre=middle, size_m=_SIZE_M)
    return options


def _attempts(
    site_map: SiteMap, chief: Thing, options: ImportOptions, things: list[Thing]
) -> Iterator[ImportOptions]:
    """Yield the options, with a charge beside the building if the file has no place for one."""
    if any(thing.role is Role.CHARGE for thing in things):
        yield options
    left, bottom, right, top = chief.geometry.bounds
    for aside_m in _BESIDE_M:
        aside = aside_m / _unit_m(site_map)
        x, y = 0.5 * (left + right), 0.5 * (bottom + top)
        for place in ((right + aside, y), (left - aside, y), (x, top + aside), (x, bottom - aside)):
            yield replace(options, charge_at=(place,))
