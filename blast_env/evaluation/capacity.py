"""The largest charge at a place, and the least stand-off of a charge, that keep a level.

Blasts are run on a ladder of charges, each 1.69 times as severe as the one before; between them,
histories are scaled by at most a factor of 1.3 in mass (`blast_env.evaluation.scaling`). A charge
nearer to the building is as severe as a larger one of the same scaled distance. The blasts serve
all levels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import log
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation.consequences import Consequences, consequences
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.probability import Uncertainty, level_probability
from blast_env.evaluation.scaling import MASS_RANGE, scaled_to
from blast_env.geometry import Element
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import Scenario
from blast_env.site.scene import Charge
from blast_env.site.worst_places import nearest_point_m, stand_off_m

RUNGS: Final = 5
"""Number of rungs of a ladder above and below the charge of the scenario."""

CURVE_DRAWS: Final = 200
"""Default number of draws of the uncertain quantities for a point of a curve."""

_STEP: Final = MASS_RANGE**2
_BISECTIONS: Final = 6
_SHARES: Final = (-0.4, -0.2, 0.0, 0.2, 0.4)  # of a step, on both sides of a rung


@dataclass(frozen=True)
class Edge:
    """The most severe charge that keeps a level.

    Attributes:
        charge: The charge.
        stand_off_m: Its distance from the nearest protected wall.
        is_kept: Whether it keeps the level; else not even the least severe charge tried does.
        is_end: Whether it is an end of the ladder.
    """

    charge: Charge
    stand_off_m: float
    is_kept: bool = True
    is_end: bool = False

    @property
    def mass_text(self) -> str:
        """The mass in kg, with the sign of a bound at an end of the ladder."""
        sign = (">= " if self.is_kept else "< ") if self.is_end else ""
        return f"{sign}{self.charge.tnt_kg:.3g}"

    @property
    def stand_off_text(self) -> str:
        """The stand-off in m, with the sign of a bound at an end of the ladder."""
        sign = ("<= " if self.is_kept else "> ") if self.is_end else ""
        return f"{sign}{self.stand_off_m:.1f}"


def mass_near(judged: Consequences, level: LevelOfProtection) -> tuple[float, bool]:
    """Return the largest mass near that of a charge that keeps a level, kg, without a blast.

    Args:
        judged: The consequences of the charge.
        level: The level.

    Returns:
        The mass, and whether it is within the range of scaled histories; else it is an end of that
        range: the largest mass examined if the level is kept, or the least one if it is not.
    """
    charge = judged.responses[0].charge

    def keeps(share: float) -> bool:
        return scaled_to(judged, charge._replace(tnt_kg=share * charge.tnt_kg)).passes(level)

    kept, lost = 1.0 / MASS_RANGE, MASS_RANGE
    if keeps(lost) or not keeps(kept):
        return charge.tnt_kg * (lost if keeps(lost) else kept), False
    for _ in range(_BISECTIONS):
        middle = (kept * lost) ** 0.5
        kept, lost = (middle, lost) if keeps(middle) else (kept, middle)
    return charge.tnt_kg * kept, True


@dataclass(frozen=True, eq=False)
class Ladder:
    """Charges of rising severity behind a layout: of more mass, or nearer to the building.

    Attributes:
        scenario: The scenario.
        layout: The layout.
        charge: The charge of the scenario at its place.
        engine: The engine of the blasts.
    """

    scenario: Scenario
    layout: Sequence[Element]
    charge: Charge
    engine: Engine
    _blasts: dict[tuple[bool, int], Consequences | None] = field(default_factory=dict, init=False)

    @property
    def blasts(self) -> int:
        """Number of blasts so far."""
        return sum(each is not None for each in self._blasts.values())

    def charge_at(self, severity: float, nearer: bool) -> Charge:
        """Return the charge that is as severe as a multiple of the mass at the same place.

        Args:
            severity: The multiple.
            nearer: Whether its distance changes in place of its mass, to the same scaled distance.
        """
        if not nearer:
            return self.charge._replace(tnt_kg=self.charge.tnt_kg * severity)
        there = self.charge.position_m
        x, y = nearest_point_m(self.scenario.structures, there)
        farther = severity ** (-1.0 / 3.0)
        place = (x + farther * (there[0] - x), y + farther * (there[1] - y))
        return self.charge._replace(position_m=place)

    def edge(self, level: LevelOfProtection, nearer: bool = False) -> Edge:
        """Return the most severe charge on the ladder that keeps a level.

        Args:
            level: The level.
            nearer: Whether distances change in place of masses.
        """

        def keeps(number: int) -> bool | None:
            found = self._rung(number, nearer)
            return None if found is None else found.passes(level)

        def edge(severity: float, is_kept: bool = True, is_end: bool = False) -> Edge:
            charge = self.charge_at(severity, nearer)
            off_m = stand_off_m(self.scenario.structures, charge.position_m)
            return Edge(charge, off_m, is_kept, is_end)

        low = 0
        while keeps(low) is False:
            low -= 1
        high = low + 1
        if keeps(low) is None:
            return edge(_STEP**high, is_kept=False, is_end=True)
        while keeps(high):
            low, high = high, high + 1
        if keeps(high) is None:
            return edge(_STEP**low, is_end=True)
        kept, lost = _STEP**low, _STEP**high
        for _ in range(_BISECTIONS):
            middle = (kept * lost) ** 0.5
            if self._near(middle, nearer).passes(level):
                kept = middle
            else:
                lost = middle
        return edge(kept)

    def curve(
        self, level: LevelOfProtection, uncertainty: Uncertainty, draws: int = CURVE_DRAWS
    ) -> list[tuple[float, float]]:
        """Return masses and the probability of a level, over all masses with blasts so far.

        Args:
            level: The level.
            uncertainty: The uncertain quantities.
            draws: Draws for each point.
        """
        points = []
        for nearer, number in sorted(key for key, each in self._blasts.items() if each is not None):
            for share in () if nearer else _SHARES:
                severity = _STEP ** (number + share)
                likely = level_probability(self._near(severity, nearer), uncertainty, draws)
                points.append((self.charge_at(severity, nearer).tnt_kg, likely.of(level)))
        return points

    def _rung(self, number: int, nearer: bool) -> Consequences | None:
        """Return the consequences on a rung by a blast; `None` beyond an end of the ladder."""
        key = nearer and number != 0, number
        if key not in self._blasts:
            charge = self.charge_at(_STEP**number, nearer)
            self._blasts[key] = self._blast(charge, number) if abs(number) <= RUNGS else None
        return self._blasts[key]

    def _blast(self, charge: Charge, number: int) -> Consequences | None:
        try:
            return consequences(self.scenario, self.layout, [charge], self.engine)
        except BlastEnvError:
            if number == 0:
                raise
            return None  # off the site, in a structure, or too large a blast

    def _near(self, severity: float, nearer: bool) -> Consequences:
        """Return the consequences of a severity, scaled from the nearest rung with a blast."""
        at = log(severity) / log(_STEP)
        known = {
            number: each
            for (by_distance, number), each in self._blasts.items()
            if each is not None and (number == 0 or by_distance is nearer)
        }
        nearest = known[min(known, key=lambda number: abs(number - at))]
        return scaled_to(nearest, self.charge_at(severity, nearer))
