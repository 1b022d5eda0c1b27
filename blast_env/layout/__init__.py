"""Layouts of barriers: legality, and layout files."""

from typing import TYPE_CHECKING

from blast_env.layout.build_site import (
    build_site,
    charge_against,
    draw_charge,
    draw_threat,
    vehicle_drive,
    vehicle_reach,
    worst_places,
)
from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.layout.files import LayoutFile, load_layout, write_layout
    from blast_env.layout.placement import (
        ById,
        LayoutState,
        check_layout,
        kept_clear,
        load_relevant,
        usable_cells,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "ById",
    "LayoutFile",
    "LayoutState",
    "build_site",
    "charge_against",
    "check_layout",
    "draw_charge",
    "draw_threat",
    "kept_clear",
    "load_layout",
    "load_relevant",
    "usable_cells",
    "vehicle_drive",
    "vehicle_reach",
    "worst_places",
    "write_layout",
]
