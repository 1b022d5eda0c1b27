"""Sites from maps and drawings: GeoJSON, OpenStreetMap, DXF, IFC."""

from typing import TYPE_CHECKING

from blast_env.io.importing.options import ImportOptions

if TYPE_CHECKING:
    from blast_env.io.importing.convert import ImportedSite, import_site
    from blast_env.io.importing.fitting import FittedBuilding

__all__ = ["FittedBuilding", "ImportOptions", "ImportedSite", "import_site"]


def __getattr__(name: str) -> object:
    """Import the names that need the extra `maps` on first use; the options need no extra."""
    if name in __all__:
        from blast_env.io.importing import convert

        return getattr(convert, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
