"""The user's limits of loads on buildings; judging loads takes knowledge of the building."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.record import BuildingLoad
from blast_env.units import PA_PER_KPA
from blast_env.values import plain_number


@dataclass(frozen=True)
class Limit:
    """The limits of the loads on a building.

    Attributes:
        target: Name of the building.
        impulse_pa_s: Largest impulse on its most loaded wall; infinite without a limit.
        peak_pa: Largest overpressure, see `blast_env.evaluation.engines.peaks`; infinite without a
            limit.
    """

    target: str
    impulse_pa_s: float = inf
    peak_pa: float = inf

    @classmethod
    def parsed(cls, text: str) -> "Limit":
        """Return the limit of a text such as `school=200,40`: NAME=IMPULSE,PEAK in Pa s and kPa.

        One of the two may be left out. Other texts, and values not above 0, are refused.
        """
        name, sign, values = text.partition("=")
        parts = values.split(",")
        try:
            impulse, peak = (
                plain_number("--limit", part.strip()) if part.strip() else inf
                for part in (*parts, "")[:2]
            )
        except BlastEnvError:
            impulse = peak = -1.0
        if not (name and sign) or len(parts) > 2 or not (impulse > 0.0 and peak > 0.0):
            raise BlastEnvError(
                f"--limit is {text!r}, must be NAME=IMPULSE,PEAK with values above 0 in Pa s "
                "and kPa; one of them may be left out"
            )
        if not (isfinite(impulse) or isfinite(peak)):
            raise BlastEnvError(f"--limit is {text!r}, without any limit")
        return cls(name, impulse, peak * PA_PER_KPA)

    def is_kept(self, load: BuildingLoad) -> bool:
        """Return whether a load is within the limit."""
        return load.wall_impulse_pa_s <= self.impulse_pa_s and load.counted_pa <= self.peak_pa


def check_limits(limits: Sequence[Limit], buildings: Sequence[str]) -> None:
    """Refuse limits of unknown buildings, and two limits of one building."""
    for index, limit in enumerate(limits):
        if limit.target not in buildings:
            raise UnknownNameError("building", limit.target, [*buildings])
        if limit.target in [each.target for each in limits[:index]]:
            raise BlastEnvError(f"--limit appears twice for {limit.target!r}")
