"""The sources of a site: bundled, generated, or a file by its suffix.

Files are read in a separate process (`blast_env.reading`), so readers are plain functions of a path
that pickle.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeVar

from blast_env.app.edits import snapped
from blast_env.bays import STOREY_M
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutFile
from blast_env.site import SCHEMA_VERSION, Scenario, load_scenario

if TYPE_CHECKING:
    from blast_env.io.importing import ImportOptions, SiteImport
    from blast_env.io.importing.convert import MapSketch

Made = TypeVar("Made")

SITES: Final[Mapping[str, Callable[[Path], Scenario]]] = MappingProxyType({".toml": load_scenario})
"""Readers of site files that need no options, by suffix."""

MAPS: Final = (".geojson", ".json", ".osm", ".pbf", ".dxf", ".ifc")
"""Suffixes of maps and drawings, which take options: `imported_site`."""


def blank_site(width_m: float, height_m: float) -> Scenario:
    """Return a site with only what a site must have: a building to protect, and a charge."""
    x_m, y_m = snapped(0.5 * width_m), snapped(0.5 * height_m)
    house = {"kind": "ModularObstacle", "name": "building", "rows": 8, "columns": 8}
    house |= {"corner_m": [x_m - 2.0, y_m - 2.0], "height_m": STOREY_M, "protected": True}
    document = {
        "schema_version": SCHEMA_VERSION,
        "name": "blank",
        "site": {"width_m": width_m, "height_m": height_m},
        "charge": [{"kind": "point", "position_m": [2.0, 2.0], "tnt_kg": 100.0}],
        "structures": [house],
    }
    return Scenario.from_document(document, "blank site")


def site_of_file(path: Path) -> Scenario:
    """Return the site of a file."""
    return _by_ending(path, SITES, "a site")(path)


def is_map(name: str) -> bool:
    """Return whether a file is a map or a drawing by its suffix."""
    return Path(name).suffix.lower() in MAPS


def imported_site(path: Path, options: "ImportOptions") -> "SiteImport":
    """Return the site of a map or drawing, and its deviations.

    Args:
        options: The user's choices; a build zone in the map overrides one around buildings.
    """
    from blast_env.io.importing import import_site  # here, because it needs the extra `maps`

    read = _by_ending(path, dict.fromkeys(MAPS, import_site), "a map")
    own = read(path, replace(options, zone_around_m=None))
    if options.zone_around_m is None or own.scenario.build_zone is not None:
        return own
    return read(path, options)


def map_sketch(path: Path, options: "ImportOptions") -> "MapSketch":
    """Return the outlines of the buildings of a map or drawing."""
    from blast_env.io.importing.convert import sketch_of  # here, because it needs `maps`

    return sketch_of(path, options)


def layout_of_file(path: Path) -> LayoutFile:
    """Return the layout of a file."""
    return _by_ending(path, {".json": LayoutFile.load}, "a layout")(path)


def _by_ending(path: Path, readers: Mapping[str, Made], what: str) -> Made:
    suffix = path.suffix.lower()
    if suffix not in readers:
        known = ", ".join(readers)
        raise BlastEnvError(f"{path}: has the suffix {suffix!r}, {what} must have {known}")
    return readers[suffix]
