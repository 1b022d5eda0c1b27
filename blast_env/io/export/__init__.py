"""Layouts and blasts as files for other programs, such as DXF, IFC and glTF."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.io.export.bill import (
        BILL_COLUMNS,
        PIECE_COLUMNS,
        LayoutPlan,
        bill_of_quantities,
        element_table,
    )
    from blast_env.io.export.blast import (
        BLAST_SUFFIXES,
        HISTORY_COLUMNS,
        blast_recorders,
        check_blast_target,
        export_blast,
        history_table,
    )
    from blast_env.io.export.dxf import clearance_outlines, drawing, key_of, note_lines, texts_of
    from blast_env.io.export.files import (
        SUFFIXES,
        check_target,
        export_layout,
        export_to,
        feature_collection,
        is_file,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "BILL_COLUMNS",
    "BLAST_SUFFIXES",
    "HISTORY_COLUMNS",
    "PIECE_COLUMNS",
    "SUFFIXES",
    "LayoutPlan",
    "bill_of_quantities",
    "blast_recorders",
    "check_blast_target",
    "check_target",
    "clearance_outlines",
    "drawing",
    "element_table",
    "export_blast",
    "export_layout",
    "export_to",
    "feature_collection",
    "history_table",
    "is_file",
    "key_of",
    "note_lines",
    "texts_of",
]
