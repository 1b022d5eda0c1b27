"""Reference loads, the laws that scale simulated impulses to them, and their agreement."""

from typing import TYPE_CHECKING, Final

from blast_env.particles.calibration.laws import Fit
from blast_env.particles.calibration.model import (
    CalibrationError,
    calibrated_engines,
    load_calibration,
    save_calibration,
    seen_width_m,
    stored_calibrations,
)

if TYPE_CHECKING:
    from blast_env.particles.calibration.free_field import (
        CalibrationReport,
        FreeFieldStudy,
        calibrate,
        impulse_by_seed,
        kingery_bulmash_reference,
        paper_reference,
        summarise,
    )

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

_FREE_FIELD: Final = frozenset(
    {
        "CalibrationReport",
        "FreeFieldStudy",
        "calibrate",
        "impulse_by_seed",
        "kingery_bulmash_reference",
        "paper_reference",
        "summarise",
    }
)


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _FREE_FIELD:
        from blast_env.particles.calibration import free_field

        return getattr(free_field, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
