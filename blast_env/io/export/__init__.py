"""Layouts as files for other programs: JSON, CSV, GeoJSON and DXF."""

from typing import TYPE_CHECKING, Final

from blast_env.io.export.bill import (
    BILL_COLUMNS,
    PIECE_COLUMNS,
    LayoutPlan,
    bill_of_quantities,
    element_table,
)
from blast_env.io.export.files import (
    SUFFIXES,
    check_target,
    export_layout,
    export_to,
    feature_collection,
    is_file,
)

if TYPE_CHECKING:
    from blast_env.io.export.dxf import clearance_outlines, drawing, key_of, note_lines, texts_of

__all__ = [
    "BILL_COLUMNS",
    "PIECE_COLUMNS",
    "SUFFIXES",
    "LayoutPlan",
    "bill_of_quantities",
    "check_target",
    "clearance_outlines",
    "drawing",
    "element_table",
    "export_layout",
    "export_to",
    "feature_collection",
    "is_file",
    "key_of",
    "note_lines",
    "texts_of",
]

_DXF: Final = frozenset({"clearance_outlines", "drawing", "key_of", "note_lines", "texts_of"})


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _DXF:
        from blast_env.io.export import dxf

        return getattr(dxf, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
