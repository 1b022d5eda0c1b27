"""Sites from maps and drawings: GeoJSON, OpenStreetMap, DXF, IFC."""

from typing import TYPE_CHECKING

from blast_env.io.importing.options import ImportOptions

if TYPE_CHECKING:
    from blast_env.io.importing.convert import ImportedSite, import_site
    from blast_env.io.importing.fitting import FittedBuilding

__all__ = ["FittedBuilding", "ImportOptions", "ImportedSite", "import_site"]


def __getattr__(name: str) -> object:
    """Import the names that need the extra `maps` on first use; the options need no extra."""
    if name in ("ImportedSite", "import_site"):
        from blast_env.io.importing import convert

        return getattr(convert, name)
    if name == "FittedBuilding":
        from blast_env.io.importing.fitting import FittedBuilding

        return FittedBuilding
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
