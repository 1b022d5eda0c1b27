"""Conversion of a map or drawing to a scenario, with a report on the deviations."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from blast_env.errors import BlastEnvError
from blast_env.importing.dxf import read_dxf
from blast_env.importing.fitting import (
    FittedBuilding,
    fit_buildings,
    plain_name,
    protected_as_asked,
)
from blast_env.importing.geojson import read_geojson
from blast_env.importing.options import CALIBRATIONS, ImportOptions
from blast_env.importing.osm import SUFFIXES as OSM_SUFFIXES
from blast_env.importing.osm import read_osm
from blast_env.importing.placing import PlacedSite, place_site
from blast_env.importing.roles import Role, Selector, Selectors, things_of
from blast_env.importing.site_map import DrawingCoordinates, MapCoordinates, SiteMap
from blast_env.importing.threats import charge_sources
from blast_env.importing.zone import build_zone
from blast_env.provenance import package_version
from blast_env.reading import read_apart
from blast_env.scenario import Scenario, SimulationSection
from blast_env.scenario.checks import charge_radius_m
from blast_env.scenario.models import SCHEMA_VERSION
from blast_env.values import path_of

_MOST_DESCRIPTION: Final = 2000
_HASH_DIGITS: Final = 12
_PLAIN_SUFFIXES: Final = (".geojson", ".json", ".osm", ".dxf")
_READ_HERE_BYTES: Final = 100_000
"""Largest unpacked file that is read in this process: starting another takes half a second."""


@dataclass(frozen=True)
class ImportedSite:
    """A site imported from a map or drawing.

    Attributes:
        scenario: The scenario.
        buildings: Its buildings, with the deviations of their modules from their outlines.
        site: The objects of the map in site metres.
        notes: Omissions and missing data, one sentence each.
    """

    scenario: Scenario
    buildings: tuple[FittedBuilding, ...]
    site: PlacedSite
    notes: tuple[str, ...]


def import_site(path: str | Path, options: ImportOptions | None = None) -> ImportedSite:
    """Return the site of a map or drawing.

    The site is turned to the direction of most walls, its grid is aligned with most walls, and the
    buildings are polygons. Large and packed files are read in a separate process with
    limits on time and memory; see `ReadingLimits`.

    Args:
        path: GeoJSON (`.geojson`, `.json`), OpenStreetMap (`.osm`, `.osm.pbf`) or DXF (`.dxf`).
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


def _imported(path: Path, options: ImportOptions) -> ImportedSite:
    site_map = _read(path, options)
    things, unclear = things_of(
        site_map, _selectors(site_map, options), options.level_height_m, options.height_from
    )
    site = place_site(site_map, things, options)
    fitted, left_out = fit_buildings(site, options)
    buildings = protected_as_asked(fitted, site, options)
    simulation = SimulationSection(preset=options.preset)
    sources = charge_sources(site, buildings, charge_radius_m(simulation.parameters), options)
    zone = build_zone(site, buildings, options)
    notes = (*site_map.notes, *unclear, *left_out)
    if zone is None:
        notes += ("there is no build zone: say one with --zone, --zone-around or --zone-from",)
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "name": options.name or plain_name(path.name.split(".")[0]) or "site",
        "description": _description(path, site, buildings, options),
        "site": {"width_m": site.size_m[0], "height_m": site.size_m[1]},
        "charge": sources,
        "structures": [part for building in buildings for part in _structures(building)],
        "simulation": {"preset": options.preset},
        "georeference": site.georeference.model_dump(),
    }
    if zone is not None:
        document["build_zone"] = zone
    if options.preset in CALIBRATIONS:
        document["calibration"] = CALIBRATIONS[options.preset]
    return ImportedSite(Scenario.from_document(document, str(path)), buildings, site, notes)


def _read_as_geojson(path: Path, options: ImportOptions) -> SiteMap:
    _refuse(options.units, "--units", "GeoJSON, whose coordinates --crs is about")
    return read_geojson(path, options.crs)


def _read_as_osm(path: Path, options: ImportOptions) -> SiteMap:
    _refuse(options.units, "--units", "OpenStreetMap, which is in longitude and latitude")
    _refuse(options.crs, "--crs", "OpenStreetMap, which is in longitude and latitude")
    return read_osm(path)


def _read_as_dxf(path: Path, options: ImportOptions) -> SiteMap:
    site_map = read_dxf(path, options.units)
    if options.crs is None:
        return site_map
    coordinates = site_map.coordinates
    if isinstance(coordinates, DrawingCoordinates) and coordinates.metres_per_unit != 1.0:
        raise BlastEnvError(f"{path}: --crs needs a drawing in metres: say --units m if it is")
    return SiteMap(path, MapCoordinates(options.crs), site_map.features, site_map.notes)


_READERS: Final[Mapping[str, Callable[[Path, ImportOptions], SiteMap]]] = MappingProxyType(
    {
        ".geojson": _read_as_geojson,
        ".json": _read_as_geojson,
        ".dxf": _read_as_dxf,
        **dict.fromkeys(OSM_SUFFIXES, _read_as_osm),
    }
)


def _read(path: Path, options: ImportOptions) -> SiteMap:
    """Return the map of a file, read by its suffix."""
    name = path.name.lower()
    for suffix, reader in _READERS.items():
        if name.endswith(suffix):
            return reader(path, options)
    raise BlastEnvError(f"{path}: suffix is {path.suffix!r}, must be one of {', '.join(_READERS)}")


def _refuse(value: object, option: str, what: str) -> None:
    if value is not None:
        raise BlastEnvError(f"{option} is not for {what}")


def _selectors(site_map: SiteMap, options: ImportOptions) -> Selectors:
    """Return the selectors of the user; roles without any follow the usual tags."""
    is_drawing = any("layer" in each.tags for each in site_map.features)
    chosen = {
        Role.ZONE: options.zone_from,
        Role.KEEP_OUT: options.keep_outs_from,
        Role.CHARGE: options.charges_from,
        Role.BUILDING: options.buildings_from,
    }
    return {
        role: tuple(Selector.parsed(text, is_drawing) for text in texts)
        for role, texts in chosen.items()
        if texts
    }


def _structures(building: FittedBuilding) -> list[dict[str, Any]]:
    """Return the structures of a building, with a total weight of 1."""
    length_m = sum(each.polygon.length for each in building.polygons)
    parts = []
    for name, each in zip(building.part_names, building.polygons, strict=True):
        outline, *courtyards = ([list(place) for place in ring] for ring in each.rings)
        part: dict[str, Any] = {
            "kind": "polygon",
            "name": name,
            "outline_m": outline,
            "protected": building.protected,
        }
        if courtyards:
            part["courtyards_m"] = courtyards
        if len(building.polygons) > 1:
            part["building"] = building.name
            part["weight"] = round(each.polygon.length / length_m, 6)
        if building.height_m is not None:
            part["height_m"] = building.height_m
        if building.base_m:
            part["base_m"] = building.base_m
        if building.carries:
            part["carries"] = True
        parts.append(part)
    return parts


def _description(
    path: Path, site: PlacedSite, buildings: tuple[FittedBuilding, ...], options: ImportOptions
) -> str:
    """Return the description of the site: source, buildings, rotation and deviations."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:_HASH_DIGITS]
    worst = max(buildings, key=lambda each: each.deviation.area_share)
    farthest = max(buildings, key=lambda each: each.deviation.outline_m)
    protected = ", ".join(each.name for each in buildings if each.protected)
    text = (
        f"Imported from {path.name} (SHA-256 {digest}...) by blast-env {package_version()}: "
        f"{len(buildings)} buildings, protected: {protected}. The site's x "
        f"axis is turned by {site.rotation_deg:.2f} degrees from the map's. Modules miss at most "
        f"{worst.deviation.area_share:.1%} of a building's area ({worst.name}) and "
        f"{farthest.deviation.outline_m:.2f} m of its outline ({farthest.name}). Charges of "
        f"{options.tnt_kg:g} kg TNT unless the file says another mass."
    )
    return text[:_MOST_DESCRIPTION]
