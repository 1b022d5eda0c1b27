"""Whether a site keeps its requirements: the level of protection, and limits of loads.

Limits are the user's: judging loads without a facade takes knowledge of the building.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.questions.verdict import Consequences, Verdict
from blast_env.evaluation.record import BuildingLoad
from blast_env.evaluation.validation import ValidationStatus
from blast_env.response.levels import LevelOfProtection
from blast_env.units import PA_PER_KPA
from blast_env.values import count_of, plain_number


@dataclass(frozen=True)
class Limit:
    """The limits of the loads on a building.

    Attributes:
        building: Name of the building.
        impulse_pa_s: Largest impulse on its most loaded wall; infinite without a limit.
        peak_pa: Largest overpressure, see `blast_env.evaluation.engines.walls`; infinite without a
            limit.
    """

    building: str
    impulse_pa_s: float = inf
    peak_pa: float = inf

    @classmethod
    def parsed(cls, text: str) -> "Limit":
        """Return the limit of a text such as `school=200,40`: NAME=IMPULSE,PEAK in Pa s and kPa.

        One of the two may be left out. Other texts, and values not above 0, are refused.
        """
        # An empty number is no limit; a text that is no number becomes -1, which no limit can be.
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
        if limit.building not in buildings:
            raise UnknownNameError("building", limit.building, [*buildings])
        if limit.building in [earlier.building for earlier in limits[:index]]:
            raise BlastEnvError(f"--limit appears twice for {limit.building!r}")


class LoadLimit(NamedTuple):
    """A load with its limit."""

    limit: Limit
    threat: str
    load: BuildingLoad

    @property
    def is_kept(self) -> bool:
        """Whether the load is within the limit."""
        return self.limit.is_kept(self.load)

    @property
    def is_flagged(self) -> bool:
        """Whether there is a note on the load, or it is approximate or outside."""
        status = self.load.validation.status
        return self.load.flagged or status >= ValidationStatus.APPROXIMATE

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return Verdict.of(self.is_kept).word(self.is_flagged).lower()


@dataclass(frozen=True, eq=False)
class SiteVerdict:
    """Whether the buildings of a site reach their level and keep their limits under all threats.

    Attributes:
        found: The response of its buildings.
        target: Required level of protection of those with a facade.
    """

    found: Consequences
    target: LevelOfProtection
    limited: tuple[LoadLimit, ...] = ()

    @property
    def is_asked(self) -> bool:
        """Whether there is any requirement."""
        return bool(self.limited or self.found.buildings)

    @property
    def passes(self) -> bool:
        """Whether all requirements are kept."""
        return self.found.passes(self.target) and all(load.is_kept for load in self.limited)

    @property
    def is_flagged(self) -> bool:
        """Whether a load behind the verdict has a note."""
        return self.found.is_flagged or any(own.is_flagged for own in self.limited)

    @property
    def word(self) -> str:
        """The verdict in a word."""
        return Verdict.of(self.passes).word(self.is_flagged) if self.is_asked else "NO VERDICT"

    @property
    def words(self) -> str:
        """The verdict on each requirement, such as `level of protection below Low`."""
        words = [self.found.level_words_for(self.target)] * bool(self.found.buildings)
        exceeded = [own.threat for own in self.limited if not own.is_kept]
        if exceeded:
            names = dict.fromkeys(exceeded)
            noun = "threat" if len(names) == 1 else "threats"
            limits = count_of("load limit", len(exceeded))
            words.append(f"{limits} exceeded ({noun} {', '.join(names)})")
        elif self.limited:
            words.append(f"{count_of('load limit', len(self.limited))} kept")
        return "; ".join(words)

    @property
    def doubt(self) -> str:
        """Why a fail rests on sharper peaks; empty if it does not."""
        return self.found.doubt(self.target) if self.found.buildings else ""
