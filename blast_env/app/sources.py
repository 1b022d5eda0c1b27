"""Where a site comes from: bundled, generated, or a file by its ending."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeVar

from blast_env.errors import BlastEnvError
from blast_env.files import scratch_folder, write_atomically
from blast_env.scenario import LayoutFile, Scenario, load_scenario
from blast_env.sites import generate_site

if TYPE_CHECKING:
    from blast_env.importing import ImportedSite, ImportOptions

MOST_BYTES: Final = 200_000_000
"""Larger files are refused before they are read."""

Made = TypeVar("Made")

Importer = Callable[[Path], Scenario]

IMPORTERS: Final[Mapping[str, Importer]] = MappingProxyType({".toml": load_scenario})
"""What makes a site of a file as it is, by its ending."""

MAPS: Final = (".geojson", ".json", ".osm", ".pbf", ".dxf")
"""Endings of maps and drawings, which take options: `imported_site`."""


def site_of_file(name: str, content: bytes) -> Scenario:
    """Return the site of a file that was handed over.

    Args:
        name: Its name; the ending decides what it is.
        content: What is in it.

    Raises:
        BlastEnvError: If it is no site; the message says all that is wrong with it.
    """
    return _from_file(name, content, IMPORTERS, "a site")


def is_map(name: str) -> bool:
    """Return whether a file is a map or a drawing by its name."""
    return Path(name).suffix.lower() in MAPS


def imported_site(name: str, content: bytes, options: "ImportOptions") -> "ImportedSite":
    """Return the site that a map or drawing shows, and by how much it deviates.

    Args:
        name: Name of the file.
        content: What is in it.
        options: What the user decides; a build zone of the map comes before one around buildings.

    Raises:
        BlastEnvError: If it cannot be imported, or a package that this needs is not installed.
    """
    from blast_env.importing import import_site  # here, because it needs the extra `maps`

    def read(path: Path) -> "ImportedSite":
        own = import_site(path, replace(options, zone_around_m=None))
        if options.zone_around_m is None or own.scenario.build_zone is not None:
            return own
        return import_site(path, options)

    return _from_file(name, content, dict.fromkeys(MAPS, read), "a map")


def layout_of_file(name: str, content: bytes) -> LayoutFile:
    """Return the layout of a file that was handed over.

    Raises:
        BlastEnvError: If it is no layout.
    """
    return _from_file(name, content, {".json": LayoutFile.load}, "a layout")


def generated_site(seed: int) -> Scenario:
    """Return the generated site of a seed.

    Raises:
        BlastEnvError: If the seed is out of bounds.
    """
    return generate_site(seed)


def _from_file(
    name: str, content: bytes, readers: Mapping[str, Callable[[Path], Made]], what: str
) -> Made:
    suffix = Path(name).suffix.lower()
    if suffix not in readers:
        known = ", ".join(readers)
        raise BlastEnvError(f"{name}: has the suffix {suffix!r}, {what} must have {known}")
    with scratch_folder() as folder:
        # The name stands in messages; nothing of it but its last part leads anywhere.
        path = folder / Path(name.replace("\\", "/")).name
        try:
            with write_atomically(path, durable=False) as temporary:
                temporary.write_bytes(content)
            return readers[suffix](path)
        except BlastEnvError as error:
            raise BlastEnvError(str(error).replace(f"{folder}/", "")) from error
