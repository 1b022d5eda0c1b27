"""Layouts as files for other programs: JSON, CSV, GeoJSON and DXF."""

from blast_env.export.bill import LayoutPlan
from blast_env.export.files import SUFFIXES, check_target, export_layout, export_layouts, is_file
from blast_env.plan import Feature, FeatureKind

__all__ = [
    "SUFFIXES",
    "Feature",
    "FeatureKind",
    "LayoutPlan",
    "check_target",
    "export_layout",
    "export_layouts",
    "is_file",
]
