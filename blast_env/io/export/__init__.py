"""Layouts as files for other programs: JSON, CSV, GeoJSON and DXF."""

from blast_env.io.export.bill import LayoutPlan
from blast_env.io.export.files import SUFFIXES, check_target, export_layout, export_to, is_file

__all__ = [
    "SUFFIXES",
    "LayoutPlan",
    "check_target",
    "export_layout",
    "export_to",
    "is_file",
]
