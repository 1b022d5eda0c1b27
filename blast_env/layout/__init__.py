"""Layouts of barriers: legality, and layout files."""

from blast_env.layout.build_site import (
    build_site,
    charge_against,
    draw_charge,
    draw_threat,
    vehicle_drive,
    vehicle_reach,
    worst_places,
)
from blast_env.layout.files import LayoutFile, load_layout, write_layout
from blast_env.layout.placement import LayoutState, check_layout, load_relevant, usable_cells

__all__ = [
    "LayoutFile",
    "LayoutState",
    "build_site",
    "charge_against",
    "check_layout",
    "draw_charge",
    "draw_threat",
    "load_layout",
    "load_relevant",
    "usable_cells",
    "vehicle_drive",
    "vehicle_reach",
    "worst_places",
    "write_layout",
]
