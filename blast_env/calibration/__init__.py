"""References, the laws that scale simulated impulses to them, and how well they agree."""

from blast_env.calibration.laws import (
    FewDistancesWarning,
    LinearLaw,
    PowerLaw,
    ProportionalLaw,
    ScalingLaw,
    fit_linear,
    fit_power_law,
    fit_proportional,
)
from blast_env.calibration.load_unit import CalibratedLoad, LoadUnit
from blast_env.calibration.metrics import (
    FitMetrics,
    Interval,
    LeaveOneOut,
    bootstrap_coefficients,
    fit_metrics,
    leave_one_out,
    shape_rms_percent,
)
from blast_env.calibration.model import (
    Calibration,
    CalibrationError,
    ScaledImpulse,
    load_calibration,
    save_calibration,
    stored_calibrations,
)
from blast_env.calibration.references import (
    PAPER_COLUMNS,
    PAPER_UFC_LABEL,
    Friedlander,
    kingery_bulmash,
    paper_table,
    paper_ufc_column,
    scaled_distance,
)

__all__ = [
    "PAPER_COLUMNS",
    "PAPER_UFC_LABEL",
    "CalibratedLoad",
    "Calibration",
    "CalibrationError",
    "FewDistancesWarning",
    "FitMetrics",
    "Friedlander",
    "Interval",
    "LeaveOneOut",
    "LinearLaw",
    "LoadUnit",
    "PowerLaw",
    "ProportionalLaw",
    "ScaledImpulse",
    "ScalingLaw",
    "bootstrap_coefficients",
    "fit_linear",
    "fit_metrics",
    "fit_power_law",
    "fit_proportional",
    "kingery_bulmash",
    "leave_one_out",
    "load_calibration",
    "paper_table",
    "paper_ufc_column",
    "save_calibration",
    "scaled_distance",
    "shape_rms_percent",
    "stored_calibrations",
]
