"""Limits of loads that the user gives, and whether a building keeps them.

Damage is for whoever knows the building: there is no model of it here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.reporting.loads import ReportedBuilding, TargetLoad
from blast_env.reporting.units import UnitSystem


@dataclass(frozen=True)
class Limit:
    """What a building may take.

    Attributes:
        target: Name of the building.
        impulse_pa_s: Largest impulse on its most loaded wall; infinite without a limit.
        peak_pa: Largest overpressure on a face of a cell; infinite without a limit.
    """

    target: str
    impulse_pa_s: float = inf
    peak_pa: float = inf

    @classmethod
    def parsed(cls, text: str, units: UnitSystem) -> "Limit":
        """Return the limit that a text such as `school=200,40` stands for.

        Args:
            text: NAME=IMPULSE,PEAK; one of the two may be left out.
            units: The units of both.

        Raises:
            BlastEnvError: If it is anything else.
        """
        name, sign, values = text.partition("=")
        parts = values.split(",")
        try:
            impulse, peak = (float(part) if part.strip() else inf for part in (*parts, "")[:2])
        except ValueError:
            impulse = peak = -1.0
        if not (name and sign) or len(parts) > 2 or not (impulse > 0.0 and peak > 0.0):
            raise BlastEnvError(
                f"--limit is {text!r}, must be NAME=IMPULSE,PEAK with values above 0 in "
                f"{units.impulse} and {units.pressure}; one of them may be left out"
            )
        if not (isfinite(impulse) or isfinite(peak)):
            raise BlastEnvError(f"--limit is {text!r}, which limits nothing")
        return cls(name, impulse * units.pa_s_per_impulse, peak * units.pa_per_pressure)

    def is_kept(self, load: TargetLoad) -> bool:
        """Whether a load is within the limit."""
        return load.wall_impulse_pa_s <= self.impulse_pa_s and load.peak_pa <= self.peak_pa


def check_limits(limits: Sequence[Limit], targets: Sequence[ReportedBuilding]) -> None:
    """Refuse limits of buildings that do not exist, or two of one.

    Raises:
        UnknownNameError: If there is no such building.
        BlastEnvError: If there are two limits of one.
    """
    names = [each.name for each in targets]
    for index, limit in enumerate(limits):
        if limit.target not in names:
            raise UnknownNameError("building", limit.target, names)
        if limit.target in [each.target for each in limits[:index]]:
            raise BlastEnvError(f"--limit is there twice for {limit.target!r}")
