"""Where a site comes from: bundled, generated, or a file by its ending.

What reads files runs in a process of its own (`blast_env.reading`), so it is plain functions of a
path that pickle.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeVar

from blast_env.errors import BlastEnvError
from blast_env.scenario import LayoutFile, Scenario, load_scenario

if TYPE_CHECKING:
    from blast_env.importing import ImportedSite, ImportOptions

Made = TypeVar("Made")

SITES: Final[Mapping[str, Callable[[Path], Scenario]]] = MappingProxyType({".toml": load_scenario})
"""What makes a site of a file as it is, by its ending."""

MAPS: Final = (".geojson", ".json", ".osm", ".pbf", ".dxf")
"""Endings of maps and drawings, which take options: `imported_site`."""


def site_of_file(path: Path) -> Scenario:
    """Return the site of a file.

    Raises:
        BlastEnvError: If it is no site; the message says all that is wrong with it.
    """
    return _by_ending(path, SITES, "a site")(path)


def is_map(name: str) -> bool:
    """Return whether a file is a map or a drawing by its name."""
    return Path(name).suffix.lower() in MAPS


def imported_site(path: Path, options: "ImportOptions") -> "ImportedSite":
    """Return the site that a map or drawing shows, and by how much it deviates.

    Args:
        path: The file.
        options: What the user decides; a build zone of the map comes before one around buildings.

    Raises:
        BlastEnvError: If it cannot be imported, or a package that this needs is not installed.
    """
    from blast_env.importing import import_site  # here, because it needs the extra `maps`

    read = _by_ending(path, dict.fromkeys(MAPS, import_site), "a map")
    own = read(path, replace(options, zone_around_m=None))
    if options.zone_around_m is None or own.scenario.build_zone is not None:
        return own
    return read(path, options)


def layout_of_file(path: Path) -> LayoutFile:
    """Return the layout of a file.

    Raises:
        BlastEnvError: If it is no layout.
    """
    return _by_ending(path, {".json": LayoutFile.load}, "a layout")(path)


def _by_ending(path: Path, readers: Mapping[str, Made], what: str) -> Made:
    suffix = path.suffix.lower()
    if suffix not in readers:
        known = ", ".join(readers)
        raise BlastEnvError(f"{path}: has the suffix {suffix!r}, {what} must have {known}")
    return readers[suffix]
