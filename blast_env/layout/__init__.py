"""Layouts of barriers: legality, and layout files."""

from blast_env.layout.files import LayoutFile, load_layout, write_layout
from blast_env.layout.placement import LayoutState, check_layout, usable_cells

__all__ = [
    "LayoutFile",
    "LayoutState",
    "check_layout",
    "load_layout",
    "usable_cells",
    "write_layout",
]
