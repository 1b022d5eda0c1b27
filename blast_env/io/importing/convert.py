"""Conversion of a map or drawing to a scenario, or to a sketch of its buildings."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, radians
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import shapely

from blast_env.errors import BlastEnvError, import_extra, quoted
from blast_env.files import read_regular
from blast_env.geometry import Rectangle
from blast_env.io.importing.buildings import prepared
from blast_env.io.importing.dxf import read_dxf
from blast_env.io.importing.fitting import MOST_TITLE, BuildingFit, fit_buildings, plain_name
from blast_env.io.importing.formats import way_of
from blast_env.io.importing.ground import build_zone, charge_sources
from blast_env.io.importing.json_maps import read_json, read_json_lines
from blast_env.io.importing.ledger import CHANGES, MOST_LETTERS, Fate, Ledger
from blast_env.io.importing.options import ImportOptions, PlaceXY
from blast_env.io.importing.osm import SUFFIXES as OSM_SUFFIXES
from blast_env.io.importing.osm import read_osm
from blast_env.io.importing.placing import OUTSIDE, SitePlacement, place_site
from blast_env.io.importing.site_map import MOST_BYTES, SiteMap
from blast_env.io.importing.things import Role, things_of
from blast_env.provenance import package_version
from blast_env.reading import read_apart
from blast_env.response.components import catalogue
from blast_env.site import Scenario, SimulationSection
from blast_env.site.content import MOST_NOTE, MOST_NOTES, SCHEMA_VERSION
from blast_env.site.sources import SegmentSource
from blast_env.values import STEERING, path_of

with import_extra("maps", "maps and drawings"):
    from pyproj import CRS

_PRESET: Final = "collisional"
_CALIBRATION: Final = "collisional_kb"
"""The parameters of particle engines, and the calibration stored for them."""

_MOST_SKETCHED: Final = 3000
_SKETCH_DETAIL: Final = 2e-4  # of the map's extent
_MOST_DESCRIPTION: Final = 2000
_GLASS: Final = "window_annealed_6"
_HASH_DIGITS: Final = 12
_PLAIN_SUFFIXES: Final = (".geojson", ".json", ".cityjson", ".osm", ".dxf", ".ifc")
_READ_HERE_BYTES: Final = 100_000
"""Largest unpacked file that is read in this process: starting another takes half a second."""


@dataclass(frozen=True)
class SiteImport:
    """A site imported from a map or drawing.

    Attributes:
        scenario: The scenario.
        buildings: Its buildings, with the deviations of their modules from their outlines.
        site: The objects of the map in site metres.
    """

    scenario: Scenario
    buildings: tuple[BuildingFit, ...]
    site: SitePlacement

    @property
    def ledger(self) -> Ledger:
        """Fate of every object of the file."""
        return self.site.ledger

    @property
    def notes(self) -> tuple[str, ...]:
        """Changes, guesses, omissions and missing data, one line each."""
        lines = self.ledger.lines(CHANGES, MOST_LETTERS)
        if self.scenario.build_zone is not None:
            ground = shapely.box(*self.scenario.build_zone.rectangle_m)
            streets = [
                shapely.LineString(source.segment_m)
                for source in self.scenario.charge
                if isinstance(source, SegmentSource)
            ]
            over = int(np.sum(shapely.intersects(streets, ground)))
            words = f"the build zone lies over {over} parts of streets: barriers may stand there"
            words += ", unless keep_outs of the file keep them free"
            return (*lines, *([words] if over else []))
        zone = "there is no build zone: say one with --zone, --zone-around or --zone-from"
        return (*lines, zone)

    @property
    def record(self) -> dict[str, Any]:
        """The site's buildings, notes and ledger as plain data."""
        georeference = self.scenario.georeference
        return {
            "scenario": self.scenario.name,
            "scenario_hash": self.scenario.content_hash,
            "georeference": None if georeference is None else georeference.model_dump(),
            "buildings": [building.record for building in self.buildings],
            "charges": len(self.scenario.charge),
            "notes": list(self.notes),
            "ledger": self.ledger.record,
        }


def import_site(path: str | Path, options: ImportOptions | None = None) -> SiteImport:
    """Return the site of a map or drawing.

    The site is turned to the direction of most walls, its grid is aligned with most walls, and the
    buildings are polygons. Large and packed files are read in a separate process with
    limits on time and memory; see `ReadingLimits`.

    Args:
        path: GeoJSON (`.geojson`, `.json`), CityJSON (`.city.json`, `.city.jsonl`), OpenStreetMap
            (`.osm`, `.osm.pbf`), DXF (`.dxf`), IFC (`.ifc`, extra `ifc`), GeoParquet (`.parquet`),
            or GeoPackage, shapefile, FlatGeobuf and KML (`.gpkg`, `.shp`, `.fgb`, `.kml`, extra
            `gis`).
        options: Options of the import.

    Raises:
        BlastEnvError: If the file cannot be read, the site cannot be placed, no building is
            protected, there is no place for a charge, the scenario would be invalid
            (`ScenarioError`), or the import takes too much time or memory (`ReadingError`).
    """
    path, options = path_of(path), options or ImportOptions()
    is_plain = path.suffix.lower() in _PLAIN_SUFFIXES
    if is_plain and path.is_file() and path.stat().st_size <= _READ_HERE_BYTES:
        return _imported(path, options)
    return read_apart(str(path), _imported, path, options)


def _imported(path: Path, options: ImportOptions) -> SiteImport:
    site_map = read_map(path, options)
    # 1. The objects with a role, in site metres.
    site = prepared(place_site(site_map, things_of(site_map)))
    # 2. Buildings on the module grid; then charges and build zone, which keep clear of them.
    buildings = fit_buildings(site)
    simulation = SimulationSection(preset=_PRESET)
    radius_m = simulation.parameters.charge_radius_m
    sources, streets = charge_sources(site, buildings, radius_m)
    zone = build_zone(site, buildings)
    # 3. The fate of every object of the file, once it is known what became of it.
    site_map.settle(
        {
            **dict.fromkeys(streets, str(Role.CHARGE)),
            **{building.place: str(Role.BUILDING) for building in buildings},
            **_others(site, buildings),
        }
    )
    ledger = site_map.ledger
    if options.strict:
        ledger.check_strict(path)
    # 4. The scenario, which is checked as one from a file.
    notes = ledger.lines(CHANGES, MOST_NOTE)[:MOST_NOTES]
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "name": options.name or plain_name(path.name.split(".")[0]) or "site",
        "description": _description(site_map, site, buildings),
        "import_notes": [STEERING.sub(" ", note) for note in notes],
        "site": {"width_m": site.size_m[0], "height_m": site.size_m[1]},
        "charge": sources,
        "structures": [part for building in buildings for part in _structures(building, buildings)],
        "simulation": {"preset": _PRESET},
        "georeference": site.georeference.model_dump(),
        "calibration": _CALIBRATION,
    }
    if components := _components(buildings):
        document["components"] = components
    if zone is not None:
        document["build_zone"] = zone
    return SiteImport(Scenario.from_document(document, str(path)), buildings, site)


def _others(site: SitePlacement, buildings: tuple[BuildingFit, ...]) -> dict[str, str]:
    """Return the roles of the outlines and texts that are used, by their places in the file."""
    options = site.options
    built = shapely.union_all([building.outline for building in buildings])
    used = {}
    for thing in site.things:
        if thing.role in (Role.BUILDING, Role.CHARGE):
            continue
        if thing.role is Role.NAME:
            is_used, why = bool(shapely.intersects(thing.geometry, built)), "texts beside buildings"
        elif thing.role is Role.ZONE and (options.zone_m or options.zone_around_m):
            is_used, why = False, "zones of the map, for another is asked for"
        else:
            is_used, why = bool(shapely.intersects(thing.geometry, site.box)), OUTSIDE
        if is_used:
            used[thing.place] = str(thing.role)
        else:
            site.ledger.add(Fate.PASSED, why, thing.place, thing.name)
    return used


def _read_ifc(site_map: SiteMap) -> None:
    from blast_env.io.importing.ifc import read_ifc  # here, because it needs the extra `ifc`

    read_ifc(site_map)


def _read_layers(site_map: SiteMap) -> None:
    from blast_env.io.importing.layers import read_layers  # here: it needs the extra `gis`

    read_layers(site_map)


def _read_geoparquet(site_map: SiteMap) -> None:
    from blast_env.io.importing.geoparquet import read_geoparquet  # pyarrow takes long to import

    read_geoparquet(site_map)


_READERS: Final[Mapping[str, Callable[[SiteMap], None]]] = MappingProxyType(
    {
        **dict.fromkeys((".geojson", ".json", ".cityjson"), read_json),
        **dict.fromkeys((".city.jsonl", ".cityjsonl"), read_json_lines),
        ".dxf": read_dxf,
        ".ifc": _read_ifc,
        **dict.fromkeys(OSM_SUFFIXES, read_osm),
        **dict.fromkeys((".gpkg", ".shp", ".fgb", ".kml"), _read_layers),
        **dict.fromkeys((".parquet", ".geoparquet"), _read_geoparquet),
    }
)

SUFFIXES: Final = tuple(_READERS)
"""Suffixes of the formats that are read; the first that ends a file's name counts."""


def read_map(path: Path, options: ImportOptions) -> SiteMap:
    """Return the map of a file, read by its suffix.

    Raises:
        BlastEnvError: If it cannot be read, is too large, or has an unknown suffix.
    """
    reader = next(
        (_READERS[suffix] for suffix in _READERS if path.name.lower().endswith(suffix)), None
    )
    if reader is None:
        known = ", ".join(_READERS)
        raise BlastEnvError(
            f"{path}: suffix is {quoted(path.suffix)}, must be one of {known}{way_of(path)}"
        )
    try:
        content = read_regular(path, MOST_BYTES)
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    site_map = SiteMap(path, content, options)
    reader(site_map)
    site_map.check_coordinates()
    return site_map


def _structures(building: BuildingFit, buildings: tuple[BuildingFit, ...]) -> list[dict[str, Any]]:
    """Return the structures of a building; with its parts they have a total weight of 1."""
    # Weights by the area of walls: together the parts of a building count once.
    group = [other for other in buildings if other.group == building.group]
    walls = [(other, part.polygon.length) for other in group for part in other.polygons]
    whole = sum(length_m * other.wall_height_m for other, length_m in walls)
    parts = []
    for name, polygon in zip(building.part_names, building.polygons, strict=True):
        outline, *courtyards = ([list(place) for place in ring] for ring in polygon.rings)
        part: dict[str, Any] = {
            "kind": "polygon",
            "name": name,
            "outline_m": outline,
            "protected": building.protected,
        }
        if courtyards:
            part["courtyards_m"] = courtyards
        if building.title and building.title != name:
            part["title"] = STEERING.sub(" ", building.title)[:MOST_TITLE]
        if len(walls) > 1:
            part["building"] = group[0].name
            part["weight"] = round(polygon.polygon.length * building.wall_height_m / whole, 6)
        if building.height_m is not None:
            part["height_m"] = building.height_m
        if building.base_m:
            part["base_m"] = building.base_m
        if building.carries:
            part["carries"] = True
        if building.facade:
            part["facade"] = {
                "storeys": int(building.facade["storeys"]),
                "bay_m": building.facade["bay"],
                "glazing": _window_of(building),
            }
        parts.append(part)
    return parts


def _window_of(building: BuildingFit) -> str:
    return f"window_of_{building.name}"


def _components(buildings: tuple[BuildingFit, ...]) -> dict[str, Any]:
    """Return the windows of a model, with panes of a common glass."""
    glass = catalogue()[_GLASS].model_dump(mode="json", exclude_none=True)
    return {
        _window_of(building): {
            **glass,
            "title": f"window of {building.title or building.name}"[:MOST_TITLE],
            "width_m": building.facade["width"],
            "height_m": building.facade["height"],
            "sill_m": building.facade["sill"],
        }
        for building in buildings
        if building.facade
    }


def _description(site_map: SiteMap, site: SitePlacement, buildings: tuple[BuildingFit, ...]) -> str:
    """Return the description of the site: source, buildings, rotation and deviations."""
    digest = hashlib.sha256(site_map.content).hexdigest()[:_HASH_DIGITS]
    worst = max(buildings, key=lambda building: building.deviation.area_share)
    farthest = max(buildings, key=lambda building: building.deviation.outline_m)
    protected = ", ".join(building.name for building in buildings if building.protected)
    text = (
        f"Imported from {site.path.name} (SHA-256 {digest}...) by blast-env {package_version()}: "
        f"{len(buildings)} buildings, protected: {protected}. The site's x "
        f"axis is turned by {site.rotation_deg:.2f} degrees from the map's. Modules miss at most "
        f"{worst.deviation.area_share:.1%} of a building's area ({worst.name}) and "
        f"{farthest.deviation.outline_m:.2f} m of its outline ({farthest.name}). Charges of "
        f"{site.options.tnt_kg:g} kg TNT unless the file says another mass."
    )
    return text[:_MOST_DESCRIPTION]


@dataclass(frozen=True)
class MapSketch:
    """The outlines of the buildings of a map.

    Attributes:
        outlines: The corners of each, in the coordinates of the file; the largest first.
        stretch: Length of a unit along x over that of one along y.
    """

    outlines: tuple[tuple[PlaceXY, ...], ...]
    stretch: float

    @property
    def bounds(self) -> Rectangle:
        """The rectangle around all outlines."""
        return Rectangle(*shapely.total_bounds(shapely.multipoints(sum(self.outlines, ()))))


def sketch_of(path: Path, options: ImportOptions) -> MapSketch:
    """Return the outlines of the buildings of a map: the largest, if there are very many.

    Raises:
        BlastEnvError: If it cannot be read, or has no building.
    """
    site_map = read_map(path, options)
    things = [thing for thing in things_of(site_map) if thing.role is Role.BUILDING]
    areas = [thing.geometry for thing in things if not thing.fault]
    parts = [part for part in shapely.get_parts(areas) if part.geom_type == "Polygon"]
    if not parts:
        raise BlastEnvError(f"{path}: has no building; define them with --buildings-from")
    left, bottom, right, top = shapely.total_bounds(parts)
    parts.sort(key=lambda part: -float(part.area))
    detail = _SKETCH_DETAIL * max(right - left, top - bottom)
    rings = [shapely.simplify(part.exterior, detail).coords[:-1] for part in parts[:_MOST_SKETCHED]]
    is_map = site_map.crs is not None and CRS(site_map.crs).is_geographic
    stretch = cos(radians(0.5 * (bottom + top))) if is_map else 1.0
    return MapSketch(tuple(tuple((x, y) for x, y in ring) for ring in rings), stretch)
