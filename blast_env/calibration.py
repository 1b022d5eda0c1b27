"""Calibration of the particle model, and the reference curves: the public names."""

from blast_env.curves import Friedlander, kingery_bulmash, scaled_distance
from blast_env.particles.calibration.fits import (
    FewDistancesWarning,
    FitMetrics,
    LeaveOneOut,
    bootstrap_coefficients,
    fit_linear,
    fit_metrics,
    fit_power_law,
    fit_proportional,
    leave_one_out,
    shape_rms_percent,
)
from blast_env.particles.calibration.load_unit import LoadCalibration, LoadUnit
from blast_env.particles.calibration.model import (
    Calibration,
    CalibrationError,
    LinearLaw,
    PowerLaw,
    ProportionalLaw,
    ScalingLaw,
    load_calibration,
    save_calibration,
    stored_calibrations,
)
from blast_env.particles.calibration.paper_table import (
    PAPER_COLUMNS,
    PAPER_UFC_LABEL,
    paper_table,
    paper_ufc_column,
)
from blast_env.results import ScaledImpulse

__all__ = [
    "PAPER_COLUMNS",
    "PAPER_UFC_LABEL",
    "Calibration",
    "CalibrationError",
    "FewDistancesWarning",
    "FitMetrics",
    "Friedlander",
    "LeaveOneOut",
    "LinearLaw",
    "LoadCalibration",
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
