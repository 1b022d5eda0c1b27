"""The largest charge at a place, and the least stand-off of a charge, that keep a level.

Blasts are run on a ladder of charges, each 1.69 times as severe as the one before; between them,
histories are scaled by at most a factor of 1.3 in mass (`scaled_to`). A charge nearer to the
building is as severe as a larger one of the same scaled distance. The blasts serve all levels.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import log
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.questions.probability import MASS_RANGE, scaled_to
from blast_env.evaluation.questions.verdict import Consequences, check_facades, consequences_of
from blast_env.geometry import Layout
from blast_env.layout.build_site import charge_against
from blast_env.response.levels import LevelOfProtection
from blast_env.runner import ProgressCallback
from blast_env.site import AnyCharge, Scenario
from blast_env.site.blast_site import Charge
from blast_env.vehicles.worst_places import nearest_point_m, stand_off_m

RUNGS: Final = 5
"""Number of rungs of a ladder above and below the charge of the scenario."""

MOST_BLASTS: Final = 4 * RUNGS + 1
"""Most blasts of a ladder for masses and stand-offs."""

LEVELS: Final = tuple(LevelOfProtection)[1:]
"""The levels of protection that a charge may keep, the lowest first."""

_STEP: Final = MASS_RANGE**2
_BISECTIONS: Final = 6
_NOTHING: Final = Consequences(())


@dataclass(frozen=True)
class Edge:
    """The most severe charge that keeps a level.

    Attributes:
        stand_off_m: Its distance from the nearest protected wall.
        is_kept: Whether it keeps the level; else not even the least severe charge tried does.
        is_end: Whether it is an end of the ladder.
    """

    charge: Charge
    stand_off_m: float
    is_kept: bool = True
    is_end: bool = False


def mass_near(judged: Consequences, level: LevelOfProtection) -> tuple[float, bool]:
    """Return the largest mass near that of a charge that keeps a level, kg, without a blast.

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
    return charge.tnt_kg * _most_kept(keeps, kept, lost), True


def _most_kept(keeps: Callable[[float], bool], kept: float, lost: float) -> float:
    """Return about the largest of the values that are kept, between one that is and one not."""
    # The geometric mean, because severities are ratios.
    for _ in range(_BISECTIONS):
        middle = (kept * lost) ** 0.5
        kept, lost = (middle, lost) if keeps(middle) else (kept, middle)
    return kept


@dataclass(frozen=True, eq=False)
class Ladder:
    """Charges of rising severity behind a layout: of more mass, or nearer to the building.

    Attributes:
        evaluator: Its scenario, its engine, and its store of blasts.
        charge: The charge of the scenario at its place.
    """

    evaluator: BlastEvaluator
    layout: Layout
    charge: Charge
    _blasts: dict[tuple[bool, int], Consequences | None] = field(default_factory=dict, init=False)

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.evaluator.scenario

    @property
    def blasts(self) -> int:
        """Number of blasts so far."""
        return len(self._found)

    @property
    def judged(self) -> Consequences:
        """The consequences of all blasts so far."""
        return Consequences.together(self._found)

    @property
    def _found(self) -> list[Consequences]:
        return [blast for blast in self._blasts.values() if blast is not None]

    def charge_at(self, severity: float, nearer: bool) -> Charge:
        """Return the charge that is as severe as a multiple of the mass at the same place.

        With `nearer` its distance changes in place of its mass, to the same scaled distance.
        """
        if not nearer:
            return self.charge._replace(tnt_kg=self.charge.tnt_kg * severity)
        there = self.charge.position_m
        x, y = nearest_point_m(self.scenario.loaded_walls, there)
        # Equal scaled distances: R / W^(1/3) is the same for a mass s W at R and for W at R
        # s^(-1/3).
        farther = severity ** (-1.0 / 3.0)
        place = (x + farther * (there[0] - x), y + farther * (there[1] - y))
        return self.charge._replace(position_m=place)

    def edge(self, level: LevelOfProtection, nearer: bool = False) -> Edge:
        """Return the most severe charge on the ladder that keeps a level.

        With `nearer` distances change in place of masses.
        """

        def keeps(number: int) -> bool | None:
            found = self._rung(number, nearer)
            return None if found is None else found.passes(level)

        def edge(severity: float, is_kept: bool = True, is_end: bool = False) -> Edge:
            charge = self.charge_at(severity, nearer)
            off_m = stand_off_m(self.scenario.loaded_walls, charge.position_m)
            return Edge(charge, off_m, is_kept, is_end)

        # 1. By blasts: the highest rung that keeps the level, and the next one, which loses it.
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

        # 2. Between the two, histories of the nearest blast are scaled, which takes no blast.
        def between(severity: float) -> bool:
            return self._near(severity, nearer).passes(level)

        return edge(_most_kept(between, _STEP**low, _STEP**high))

    def _rung(self, number: int, nearer: bool) -> Consequences | None:
        """Return the consequences on a rung by a blast; `None` beyond an end of the ladder."""
        key = nearer and number != 0, number
        if key not in self._blasts:
            charge = self.charge_at(_STEP**number, nearer)
            self._blasts[key] = self._blast(charge, number) if abs(number) <= RUNGS else None
        return self._blasts[key]

    def _blast(self, charge: Charge, number: int) -> Consequences | None:
        try:
            case = LoadCaseSet(self.scenario, (LoadCase(charge),))
            found = consequences_of(Campaign(case, {"": self.layout}, self.evaluator).run())
            found.check_judged()
            return found
        except BlastEnvError:
            if number == 0:
                raise
            return None  # off the site, in a structure, or too large a blast

    def _near(self, severity: float, nearer: bool) -> Consequences:
        """Return the consequences of a severity, scaled from the nearest rung with a blast."""
        at = log(severity) / log(_STEP)
        known = {
            number: blast
            for (by_distance, number), blast in self._blasts.items()
            if blast is not None and (number == 0 or by_distance is nearer)
        }
        # Scaling holds for small steps only, so the nearest rung in the logarithm.
        nearest = known[min(known, key=lambda number: abs(number - at))]
        return scaled_to(nearest, self.charge_at(severity, nearer))


@dataclass(frozen=True)
class PlaceCapacity:
    """The most severe charges at one place that keep the levels of protection.

    Attributes:
        charge: The charge of the scenario at the place.
        stand_off_m: Its distance from the nearest protected wall.
        heavier: The largest mass for each level, the lowest first.
        nearer: The least stand-off for each level.
        blasts: Number of blasts that ran for it.
        judged: Their consequences.
    """

    layout: str
    charge: Charge
    stand_off_m: float
    heavier: tuple[Edge, ...]
    nearer: tuple[Edge, ...]
    blasts: int
    judged: Consequences = _NOTHING


def capacity(
    evaluator: BlastEvaluator,
    layouts: Mapping[str, Layout],
    charges: Sequence[AnyCharge],
    progress: ProgressCallback | None = None,
) -> tuple[PlaceCapacity, ...]:
    """Return the largest masses and the least stand-offs that keep each level of protection.

    A few blasts run at each place. The stand-off changes along the line from the nearest protected
    wall to the charge.

    Args:
        evaluator: Its scenario, its engine, and its store of blasts.
        charges: The charges; their places count.
        progress: Called with the finished share of the places.

    Raises:
        BlastEnvError: If no building can be judged.
    """
    check_facades(evaluator.scenario, evaluator.engine)
    found = []
    pairs = [(name, charge) for name in layouts for charge in charges]
    for done, (name, charge) in enumerate(pairs, start=1):
        there = charge_against(evaluator.scenario, layouts[name], charge)
        ladder = Ladder(evaluator, layouts[name], there)
        heavier = tuple(ladder.edge(level) for level in LEVELS)
        nearer = tuple(ladder.edge(level, nearer=True) for level in LEVELS)
        off_m = stand_off_m(evaluator.scenario.loaded_walls, there.position_m)
        ran = ladder.blasts, ladder.judged
        found.append(PlaceCapacity(name, there, off_m, heavier, nearer, *ran))
        if progress is not None:
            progress(done / len(pairs))
    return tuple(found)
