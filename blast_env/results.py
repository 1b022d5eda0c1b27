"""Values that results of all engines have: the end of a run, and an impulse per area."""

from enum import StrEnum
from typing import NamedTuple

from blast_env.units import PA_PER_PSI


class EndReason(StrEnum):
    """Reason for the end of a run."""

    OUT_OF_REACH = "no moving ball can reach a structure before the time limit"
    TIME_LIMIT = "the time limit was reached"
    TIME_ASKED = "the requested time was reached"
    LOADS_KNOWN = "all required loads are known"
    EVENT_LIMIT = "the limit of collisions was reached before the end"


class ScaledImpulse(NamedTuple):
    """A simulated impulse in the units of the reference.

    Attributes:
        pa_s: Impulse per area, Pa*s.
        in_range: Whether distance and charge are within the calibration's range.
        notes: Reasons why not, one sentence each.
    """

    pa_s: float
    in_range: bool
    notes: tuple[str, ...]

    @property
    def psi_s(self) -> float:
        """Impulse per area in the paper's unit, psi*s."""
        return self.pa_s / PA_PER_PSI
