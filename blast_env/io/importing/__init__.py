"""Sites from maps, drawings and models: GeoJSON, OpenStreetMap, DXF, IFC, CityJSON and others."""

from typing import TYPE_CHECKING, Final

from blast_env.io.importing.ledger import FATES, MOST_LETTERS, Fate, Ledger, LedgerEntry
from blast_env.io.importing.options import ImportOptions

if TYPE_CHECKING:
    from blast_env.io.importing.convert import (
        SUFFIXES,
        SiteImport,
        import_site,
        read_map,
        sketch_of,
    )
    from blast_env.io.importing.fitting import BuildingFit, Deviation
    from blast_env.io.importing.ground import cells_of, in_blocks
    from blast_env.io.importing.outlines import dominant_direction_deg, grid_offset_m
    from blast_env.io.importing.plane import LocalPlane, rotated, to_map
    from blast_env.io.importing.things import Role

__all__ = [
    "FATES",
    "MOST_LETTERS",
    "SUFFIXES",
    "BuildingFit",
    "Deviation",
    "Fate",
    "ImportOptions",
    "Ledger",
    "LedgerEntry",
    "LocalPlane",
    "Role",
    "SiteImport",
    "cells_of",
    "dominant_direction_deg",
    "grid_offset_m",
    "import_site",
    "in_blocks",
    "read_map",
    "rotated",
    "sketch_of",
    "to_map",
]

_CONVERT: Final = frozenset({"SUFFIXES", "SiteImport", "import_site", "read_map", "sketch_of"})
_FITTING: Final = frozenset({"Deviation", "BuildingFit"})
_GROUND: Final = frozenset({"cells_of", "in_blocks"})
_OUTLINES: Final = frozenset({"dominant_direction_deg", "grid_offset_m"})
_PLANE: Final = frozenset({"LocalPlane", "rotated", "to_map"})
_THINGS: Final = frozenset({"Role"})


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _CONVERT:
        from blast_env.io.importing import convert

        return getattr(convert, name)
    if name in _FITTING:
        from blast_env.io.importing import fitting

        return getattr(fitting, name)
    if name in _GROUND:
        from blast_env.io.importing import ground

        return getattr(ground, name)
    if name in _OUTLINES:
        from blast_env.io.importing import outlines

        return getattr(outlines, name)
    if name in _PLANE:
        from blast_env.io.importing import plane

        return getattr(plane, name)
    if name in _THINGS:
        from blast_env.io.importing import things

        return getattr(things, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
