"""The answer of `calibrate`: the three laws with their errors, and the stored one."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from blast_env.answers.document import Line
from blast_env.particles.calibration.fits import shape_rms_percent
from blast_env.particles.calibration.model import Calibration
from blast_env.particles.calibration.paper_table import paper_table

if TYPE_CHECKING:  # takes a third of a second to import
    from blast_env.particles.calibration.free_field import CalibrationReport


def calibration_answer(report: "CalibrationReport", stored: Calibration) -> Iterator[Line]:
    """Yield the laws with their errors, and the stored one with its intervals."""
    yield Line.of(
        f"{stored.name}: {len(stored.seeds)} seeds at each distance, reference "
        f"{stored.reference.source}, {stored.reference.quantity.replace('_', ' ')}"
    )
    for name, metrics in report.metrics.items():
        coefficients = ", ".join(
            f"{k} = {v:.5g}" for k, v in report.laws[name].coefficients.items()
        )
        yield Line.of(
            f"{name}: {coefficients}; MAPE {metrics.mape_percent:.2f} %, RMSE {metrics.rmse:.4f} "
            f"psi s, integral error {metrics.integral_error_percent:.2f} %"
        )
    intervals = ", ".join(
        f"{k} {low:.4g} to {high:.4g}" for k, (low, high) in stored.coefficient_intervals.items()
    )
    yield Line.of(
        f"stored: {stored.law}; 95 % intervals over seeds: {intervals}; leave-one-distance-out "
        f"MAPE {stored.metrics.leave_one_out_mape_percent:.2f} %"
    )
    if stored.reference.source == "paper UFC column":
        own = paper_table().set_index("r_m").i_sim.loc[list(stored.distances_m)].to_numpy()
        rms = shape_rms_percent(stored.i_sim, own)
        yield Line.of(f"against the paper's own i_sim: {rms:.1f} % rms after one common factor")
