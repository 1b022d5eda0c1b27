"""Conversion of a map or drawing to a scenario, with a report on the deviations."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra
from blast_env.io.importing.buildings import prepared
from blast_env.io.importing.dxf import read_dxf
from blast_env.io.importing.fitting import FittedBuilding, fit_buildings, plain_name
from blast_env.io.importing.geojson import read_geojson
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import CALIBRATIONS, ImportOptions
from blast_env.io.importing.osm import SUFFIXES as OSM_SUFFIXES
from blast_env.io.importing.osm import read_osm
from blast_env.io.importing.placing import OUTSIDE, PlacedSite, place_site
from blast_env.io.importing.protection import protected_as_asked
from blast_env.io.importing.roles import Selector, Selectors, things_of
from blast_env.io.importing.site_map import SiteMap
from blast_env.io.importing.things import Role
from blast_env.io.importing.threats import charge_sources
from blast_env.io.importing.zone import build_zone
from blast_env.provenance import package_version
from blast_env.reading import read_apart
from blast_env.response.components import catalogue
from blast_env.site import Scenario, SimulationSection
from blast_env.site.content import MOST_NOTE, MOST_NOTES, SCHEMA_VERSION
from blast_env.site.sources import SegmentSource
from blast_env.values import STEERING, path_of

with import_extra("maps", "maps and drawings"):
    import shapely

_MOST_DESCRIPTION: Final = 2000
_MOST_TITLE: Final = 100
_GLASS: Final = "window_annealed_6"
_HASH_DIGITS: Final = 12
_PLAIN_SUFFIXES: Final = (".geojson", ".json", ".osm", ".dxf", ".ifc")
_READ_HERE_BYTES: Final = 100_000
"""Largest unpacked file that is read in this process: starting another takes half a second."""


@dataclass(frozen=True)
class ImportedSite:
    """A site imported from a map or drawing.

    Attributes:
        scenario: The scenario.
        buildings: Its buildings, with the deviations of their modules from their outlines.
        site: The objects of the map in site metres.
        ledger: What became of every object of the file.
    """

    scenario: Scenario
    buildings: tuple[FittedBuilding, ...]
    site: PlacedSite
    ledger: Ledger

    @property
    def notes(self) -> tuple[str, ...]:
        """Changes, guesses, omissions and missing data, one line each."""
        if self.scenario.build_zone is not None:
            ground = shapely.box(*self.scenario.build_zone.rectangle_m)
            lines = [
                shapely.LineString(each.segment_m)
                for each in self.scenario.charge
                if isinstance(each, SegmentSource)
            ]
            over = int(np.sum(shapely.intersects(lines, ground)))
            words = f"the build zone lies over {over} parts of streets: barriers may stand there"
            words += ", unless keep_outs of the file keep them free"
            return (*self.ledger.notes, *([words] if over else []))
        zone = "there is no build zone: say one with --zone, --zone-around or --zone-from"
        return (*self.ledger.notes, zone)

    @property
    def record(self) -> dict[str, Any]:
        """The site's buildings, notes and ledger as plain data."""
        georeference = self.scenario.georeference
        return {
            "scenario": self.scenario.name,
            "scenario_hash": self.scenario.content_hash,
            "georeference": None if georeference is None else georeference.model_dump(),
            "buildings": [each.record for each in self.buildings],
            "charges": len(self.scenario.charge),
            "notes": list(self.notes),
            "ledger": self.ledger.record,
        }


def import_site(path: str | Path, options: ImportOptions | None = None) -> ImportedSite:
    """Return the site of a map or drawing.

    The site is turned to the direction of most walls, its grid is aligned with most walls, and the
    buildings are polygons. Large and packed files are read in a separate process with
    limits on time and memory; see `ReadingLimits`.

    Args:
        path: GeoJSON (`.geojson`, `.json`), OpenStreetMap (`.osm`, `.osm.pbf`), DXF (`.dxf`) or
            IFC (`.ifc`, extra `ifc`).
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
    ledger = Ledger()
    site_map = read_map(path, options)
    things = things_of(site_map, selectors_of(site_map, options), options, ledger)
    site = prepared(place_site(site_map, things, options, ledger), options, ledger)
    fitted, left_out = fit_buildings(site, options, ledger)
    left_out = (*left_out, *site.faulty)
    buildings = protected_as_asked(fitted, left_out, site, options, ledger)
    simulation = SimulationSection(preset=options.preset)
    radius_m = simulation.parameters.charge_radius_m
    sources, streets = charge_sources(site, buildings, radius_m, options, ledger)
    zone = build_zone(site, buildings, options)
    used = {
        **dict.fromkeys(streets, str(Role.CHARGE)),
        **{each.place: str(Role.BUILDING) for each in buildings},
        **_others(site, buildings, options, ledger),
    }
    ledger.settle((*site_map.features, *site_map.lost), used)
    if options.strict:
        ledger.check_strict(path)
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "name": options.name or plain_name(path.name.split(".")[0]) or "site",
        "description": _description(path, site, buildings, options),
        "import_notes": [
            STEERING.sub(" ", each) for each in ledger.notes_within(MOST_NOTE)[:MOST_NOTES]
        ],
        "site": {"width_m": site.size_m[0], "height_m": site.size_m[1]},
        "charge": sources,
        "structures": [part for building in buildings for part in _structures(building, buildings)],
        "simulation": {"preset": options.preset},
        "georeference": site.georeference.model_dump(),
    }
    if components := _components(buildings):
        document["components"] = components
    if zone is not None:
        document["build_zone"] = zone
    if options.preset in CALIBRATIONS:
        document["calibration"] = CALIBRATIONS[options.preset]
    scenario = Scenario.from_document(document, str(path))
    return ImportedSite(scenario, buildings, site, ledger)


def _others(
    site: PlacedSite,
    buildings: tuple[FittedBuilding, ...],
    options: ImportOptions,
    ledger: Ledger,
) -> dict[str, str]:
    """Return the roles of the outlines and texts that are used, by their places in the file."""
    built = shapely.union_all([each.outline for each in buildings])
    used = {}
    for each in site.things:
        if each.role in (Role.BUILDING, Role.CHARGE):
            continue
        if each.role is Role.NAME:
            is_used, why = bool(shapely.intersects(each.geometry, built)), "texts beside buildings"
        elif each.role is Role.ZONE and (options.zone_m or options.zone_around_m):
            is_used, why = False, "zones of the map, for another is asked for"
        else:
            is_used, why = bool(shapely.intersects(each.geometry, site.box)), OUTSIDE
        if is_used:
            used[each.place] = str(each.role)
        else:
            ledger.add(Deed.PASSED, why, each.place, each.name)
    return used


def _read_ifc(path: Path, options: ImportOptions) -> SiteMap:
    from blast_env.io.importing.ifc import read_ifc  # here, because it needs the extra `ifc`

    return read_ifc(path, options)


_READERS: Final[Mapping[str, Callable[[Path, ImportOptions], SiteMap]]] = MappingProxyType(
    {
        ".geojson": read_geojson,
        ".json": read_geojson,
        ".dxf": read_dxf,
        ".ifc": _read_ifc,
        **dict.fromkeys(OSM_SUFFIXES, read_osm),
    }
)


def read_map(path: Path, options: ImportOptions) -> SiteMap:
    """Return the map of a file, read by its suffix."""
    name = path.name.lower()
    for suffix, reader in _READERS.items():
        if name.endswith(suffix):
            return reader(path, options)
    raise BlastEnvError(f"{path}: suffix is {path.suffix!r}, must be one of {', '.join(_READERS)}")


def selectors_of(site_map: SiteMap, options: ImportOptions) -> Selectors:
    """Return the selectors of the user; roles without any follow the usual tags."""
    chosen = {
        Role.ZONE: options.zone_from,
        Role.KEEP_OUT: options.keep_outs_from,
        Role.CHARGE: options.charges_from,
        Role.BUILDING: options.buildings_from,
    }
    return {
        role: tuple(Selector.parsed(text, site_map.is_drawing) for text in texts)
        for role, texts in chosen.items()
        if texts
    }


def _structures(
    building: FittedBuilding, buildings: tuple[FittedBuilding, ...]
) -> list[dict[str, Any]]:
    """Return the structures of a building; with its parts they have a total weight of 1."""
    group = [each for each in buildings if each.group == building.group]
    walls = [(each, part.polygon.length) for each in group for part in each.polygons]
    whole = sum(length_m * each.wall_height_m for each, length_m in walls)
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
        if building.title and building.title != name:
            part["title"] = STEERING.sub(" ", building.title)[:_MOST_TITLE]
        if len(walls) > 1:
            part["building"] = group[0].name
            part["weight"] = round(each.polygon.length * building.wall_height_m / whole, 6)
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


def _window_of(building: FittedBuilding) -> str:
    return f"window_of_{building.name}"


def _components(buildings: tuple[FittedBuilding, ...]) -> dict[str, Any]:
    """Return the windows of a model, with panes of a common glass."""
    glass = catalogue()[_GLASS].model_dump(mode="json", exclude_none=True)
    return {
        _window_of(each): {
            **glass,
            "title": f"window of {each.title or each.name}"[:_MOST_TITLE],
            "width_m": each.facade["width"],
            "height_m": each.facade["height"],
            "sill_m": each.facade["sill"],
        }
        for each in buildings
        if each.facade
    }


def _description(
    path: Path,
    site: PlacedSite,
    buildings: tuple[FittedBuilding, ...],
    options: ImportOptions,
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
