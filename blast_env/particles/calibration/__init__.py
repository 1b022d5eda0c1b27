"""Reference loads, the laws that scale simulated impulses to them, and their agreement."""

from typing import TYPE_CHECKING

from blast_env.lazy import on_first_use

if TYPE_CHECKING:
    from blast_env.particles.calibration.fits import Fit
    from blast_env.particles.calibration.free_field import (
        CalibrationReport,
        FreeFieldStudy,
        calibrate,
        impulse_by_seed,
        kingery_bulmash_reference,
        paper_reference,
        summarise,
    )
    from blast_env.particles.calibration.model import (
        CalibrationError,
        calibrated_engines,
        load_calibration,
        save_calibration,
        seen_width_m,
        stored_calibrations,
    )
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "CalibrationError",
    "CalibrationReport",
    "Fit",
    "FreeFieldStudy",
    "calibrate",
    "calibrated_engines",
    "impulse_by_seed",
    "kingery_bulmash_reference",
    "load_calibration",
    "paper_reference",
    "save_calibration",
    "seen_width_m",
    "stored_calibrations",
    "summarise",
]
