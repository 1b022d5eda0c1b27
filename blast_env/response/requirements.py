"""Requirements on a building: a level of protection, a rating of its panes, limits of loads."""

from dataclasses import dataclass
from math import inf
from typing import Final

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.response.facade import FacadeResponse, level_by_glass
from blast_env.response.glass import GlazingCondition
from blast_env.response.levels import LevelOfProtection, level_of
from blast_env.response.sdof import impulses
from blast_env.units import PA_PER_KPA
from blast_env.values import plain_number

_CONDITIONS: Final = {
    condition.label: condition
    for condition in GlazingCondition
    if condition <= GlazingCondition.WITHIN_3_M
}
_RATINGS: Final = {condition.rating: condition for condition in _CONDITIONS.values()} | {
    "C": GlazingCondition.RETAINED
}


@dataclass(frozen=True)
class Requirement:
    """A requirement on panes, wall panels and loads.

    Attributes:
        level: Level of protection that panes allow, and wall panels unless `glass_only`.
        glass_only: Whether wall panels do not count.
        peak_pa: Largest peak on a bay; infinite without a limit.
        impulse_pa_s: Largest impulse on a bay; infinite without a limit.
    """

    words: str
    level: LevelOfProtection = LevelOfProtection.BELOW_STANDARDS
    glass_only: bool = False
    peak_pa: float = inf
    impulse_pa_s: float = inf

    def kept_by(self, found: FacadeResponse) -> bool:
        """Return whether every bay of a facade keeps it."""
        # The worst pane and the worst panel of all bays, and the largest loads.
        glass, walls = found.glazing.hazard.max(initial=0.0), found.walls.damage.max(initial=0.0)
        impulse_pa_s = impulses(found.time_s, found.pressure_pa).max(initial=0.0)
        return bool(
            level_of(float(glass if self.glass_only else max(glass, walls))) >= self.level
            and found.pressure_pa.max(initial=0.0) <= self.peak_pa
            and impulse_pa_s <= self.impulse_pa_s
        )

    @classmethod
    def of_level(cls, level: LevelOfProtection) -> "Requirement":
        """Return the requirement of a level of protection, UFC 4-010-01."""
        return cls(f"level of protection {level.label!r}", level)

    @classmethod
    def parsed(cls, text: str) -> "Requirement":
        """Return the requirement of a text: `low`, `gsa 3a`, `iso D`, `peak 10`, `impulse 200`.

        Rating C of ISO 16933 is not modelled; it needs a pane that is retained.

        Raises:
            BlastEnvError: If a limit is not above 0.
            UnknownNameError: If there is no such level, condition or rating.
        """
        kind, _, rest = text.strip().partition(" ")
        rest = rest.strip()
        if kind in ("gsa", "iso"):
            known = _CONDITIONS if kind == "gsa" else _RATINGS
            name = rest.lower() if kind == "gsa" else rest.upper()
            if name not in known:
                raise UnknownNameError(f"{kind.upper()} condition", rest, known)
            words = f"GSA condition {name}" if kind == "gsa" else f"ISO 16933 rating {name}"
            return cls(words, level_by_glass(known[name]), glass_only=True)
        if kind not in ("peak", "impulse"):
            return cls.of_level(LevelOfProtection.named(text.strip()))
        limit = plain_number("--require", rest)
        if not limit > 0.0:
            raise BlastEnvError(f"--require is {text!r}, must be a limit above 0")
        if kind == "peak":
            return cls(f"peak of at most {limit:g} kPa", peak_pa=PA_PER_KPA * limit)
        return cls(f"impulse of at most {limit:g} Pa s", impulse_pa_s=limit)
