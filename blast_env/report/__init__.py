"""A report on a layout, for its decision makers: self-contained HTML, and PDF."""

from blast_env.report.limits import Limit
from blast_env.report.page import write_report
from blast_env.report.study import Study, StudyOptions, final_cells, run_study

__all__ = [
    "Limit",
    "Study",
    "StudyOptions",
    "final_cells",
    "run_study",
    "write_report",
]
