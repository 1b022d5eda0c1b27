"""Results of the blasts of a report, and the user's limits of loads on buildings.

This module has no model of damage: judging loads takes knowledge of the building.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import LoadCase
from blast_env.evaluation.grid_error import convergence_index
from blast_env.gas.settings import Cells
from blast_env.geometry import Rectangle
from blast_env.report.loads import ReportedBuilding, TargetLoad
from blast_env.statistics import reductions
from blast_env.units import PA_PER_KPA
from blast_env.values import plain_number


@dataclass(frozen=True)
class Limit:
    """The limits of the loads on a building.

    Attributes:
        target: Name of the building.
        impulse_pa_s: Largest impulse on its most loaded wall; infinite without a limit.
        peak_pa: Largest overpressure, see `blast_env.report.peaks`; infinite without a limit.
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

    def is_kept(self, load: TargetLoad) -> bool:
        """Return whether a load is within the limit."""
        return load.wall_impulse_pa_s <= self.impulse_pa_s and load.counted.pa <= self.peak_pa


def check_limits(limits: Sequence[Limit], targets: Sequence[ReportedBuilding]) -> None:
    """Refuse limits of unknown buildings, and two limits of one building."""
    names = [each.name for each in targets]
    for index, limit in enumerate(limits):
        if limit.target not in names:
            raise UnknownNameError("building", limit.target, names)
        if limit.target in [each.target for each in limits[:index]]:
            raise BlastEnvError(f"--limit appears twice for {limit.target!r}")


@dataclass(frozen=True)
class LoadPair:
    """Loads on a building under a threat, without and with the layout.

    Attributes:
        target: The building.
        threat: The threat.
        cells: The cells.
        unprotected: Without the layout.
        protected: With it.
        coarse: The same on coarser cells, for the errors of the cells; `None` without.
        ratio: Side of those cells over that of these.
    """

    target: ReportedBuilding
    threat: LoadCase
    cells: Cells
    unprotected: TargetLoad
    protected: TargetLoad
    coarse: "LoadPair | None" = None
    ratio: float = 1.0

    @property
    def reduction(self) -> float:
        """Share of the impulse that is gone; NaN if there is none."""
        return reductions(self.protected.impulse_pa_s, self.unprotected.impulse_pa_s).item()

    @property
    def reduction_error(self) -> float:
        """Error of the cells of the reduction, an absolute share; NaN with one size."""
        return self._error(lambda pair: pair.reduction)

    @property
    def unprotected_error_pa_s(self) -> float:
        """Error of the cells of the impulse without the layout; NaN with one size."""
        return self._error(lambda pair: pair.unprotected.impulse_pa_s)

    @property
    def protected_error_pa_s(self) -> float:
        """Error of the cells of the impulse with the layout; NaN with one size."""
        return self._error(lambda pair: pair.protected.impulse_pa_s)

    def _error(self, number_of: Callable[["LoadPair"], float]) -> float:
        if self.coarse is None:
            return nan
        return convergence_index(number_of(self), number_of(self.coarse), self.ratio)


@dataclass(frozen=True)
class ItemWorth:
    """The worth of one module or piece of the layout.

    Attributes:
        name: Its row and column, and its item if it is a piece.
        rectangle_m: The ground that it covers.
        worth: Growth of the impulse if it is left out, as a share of the impulse without a barrier,
            mean over the threats; below 0 if the layout is better without it.
    """

    name: str
    rectangle_m: Rectangle
    worth: float
