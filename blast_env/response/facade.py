"""Bays, the divisions of a building's walls by storeys and axes, and their response.

A bay is one storey high and about one module of the facade wide. It has components: windows, wall
panels, or both side by side. Its load is the mean overpressure over the bay; all its components
share that history.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import cbrt, floor, inf
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle, WallLine
from blast_env.response.buildings import LevelOfProtection, level_of_protection
from blast_env.response.components import Glazing, Wall
from blast_env.response.glass import (
    LEAST_INTERLAYER_MM,
    GlazingCondition,
    GlazingResponses,
    Pane,
    drawn_conditions,
    glazing_responses,
)
from blast_env.response.sdof import check_histories, impulses
from blast_env.response.walls import DamageLevel, Panel, PanelResponses, panel_responses

STOREY_M = 3.5
"""Default height of a storey."""

BAY_M = 3.0
"""Default width of a bay."""

_ROUNDING: Final = 1e-9

_FINER = 4  # refinement of the times of sharpened histories

_CELLS_OF_HALF_A_PEAK: Final = 9.3
"""Cells per m/kg^(1/3) at which peaks are about half of Kingery and Bulmash's."""


@dataclass(frozen=True)
class Bay:
    """A part of a wall.

    Attributes:
        structure: Name of the structure.
        wall: The side that it faces: west, east, south or north.
        storey: Counted from 1 at the ground.
        number: Counted from 1 along the wall, from west to east or from south to north; for a
            polygon around it, over all walls that mostly face this side.
        left_m: Its beginning along the wall: x or y on the site, or the distance from the start of
            the wall of a polygon.
        right_m: Its end along the wall.
        floor_m: Height of its floor above the ground.
        top_m: Height of its upper edge.
        line_number: Index of the wall of a polygon; `None` for a rectangle.
        line: That wall.
    """

    structure: str
    wall: str
    storey: int
    number: int
    left_m: float
    right_m: float
    floor_m: float
    top_m: float
    line_number: int | None = None
    line: WallLine | None = None

    @property
    def name(self) -> str:
        """`office/west/2/5`: structure, wall, storey, number."""
        return f"{self.structure}/{self.wall}/{self.storey}/{self.number}"

    @property
    def width_m(self) -> float:
        """Its width."""
        return self.right_m - self.left_m

    @property
    def height_m(self) -> float:
        """Its height."""
        return self.top_m - self.floor_m

    @property
    def area_m2(self) -> float:
        """Its area."""
        return self.width_m * self.height_m


def floors_m(rise_m: float, storey_m: float = STOREY_M, storeys: int | None = None) -> list[float]:
    """Return the heights of the floors above the base, m, the ground floor's first.

    The ground floor has the remaining height if the storeys do not fill the building.

    Args:
        rise_m: Height of the building above its base.
        storey_m: Height of the other storeys.
        storeys: Number of storeys, which then are equally high.
    """
    if storeys is not None:
        storey_m = rise_m / storeys
    count = max(1, floor(rise_m / storey_m + _ROUNDING))
    ground_m = max(rise_m - storey_m * (count - 1), storey_m)
    return [0.0] + [ground_m + storey_m * number for number in range(count - 1)]


def bays_in(
    ground_m: Rectangle,
    rise_m: float,
    walls: Sequence[str],
    storey_m: float,
    bay_m: float,
    lines: Sequence[WallLine] = (),
    storeys: int | None = None,
) -> int:
    """Return the number of bays that `divide` makes, from the rise between base and top."""
    along = (
        _bays_along(high - low, bay_m)
        for wall in walls
        for *_, low, high in _stretches(ground_m, wall, lines)
    )
    return len(floors_m(rise_m, storey_m, storeys)) * sum(along)


def _bays_along(length_m: float, bay_m: float) -> int:
    return max(1, round(length_m / bay_m))


def divide(
    structure: str,
    ground_m: Rectangle,
    height_m: float,
    walls: Sequence[str],
    storey_m: float = STOREY_M,
    bay_m: float = BAY_M,
    base_m: float = 0.0,
    lines: Sequence[WallLine] = (),
    storeys: int | None = None,
) -> tuple[Bay, ...]:
    """Return the bays of a building, wall by wall, storey by storey.

    The bays of a wall have equal widths, as close as possible to `bay_m`.

    Args:
        structure: Name of the structure.
        ground_m: Its outline on the ground.
        height_m: Height of its top above the ground.
        walls: The walls to divide, of west, east, south, north.
        storey_m: Height of a storey, see `floors_m`.
        bay_m: Intended width of a bay.
        base_m: Height of its base above the ground.
        lines: The walls of a polygon; without them it is a block with four walls.
        storeys: Number of storeys of equal height, in the place of `storey_m`.

    Raises:
        BlastEnvError: If a size is not positive.
    """
    rise_m = height_m - base_m
    for name, value in (("height_m", rise_m), ("storey_m", storey_m), ("bay_m", bay_m)):
        if not value > 0.0:
            raise BlastEnvError(f"facade of {structure!r}: {name} is {value}, must be above 0")
    levels_m = floors_m(rise_m, storey_m, storeys)
    floors = [base_m + level_m for level_m in levels_m] + [height_m]
    bays: list[Bay] = []
    for wall in walls:
        before = 0
        for line_number, line, low, high in _stretches(ground_m, wall, lines):
            # Bays of a polygon's side are counted on over all of its walls.
            count = _bays_along(high - low, bay_m)
            ends = np.linspace(low, high, count + 1).tolist()
            bays += [
                Bay(
                    structure,
                    wall,
                    storey + 1,
                    before + number + 1,
                    ends[number],
                    ends[number + 1],
                    floors[storey],
                    floors[storey + 1],
                    line_number,
                    line,
                )
                for storey in range(len(levels_m))
                for number in range(count)
            ]
            before += count
    return tuple(bays)


def _stretches(
    ground_m: Rectangle, side: str, lines: Sequence[WallLine]
) -> Iterator[tuple[int | None, WallLine | None, float, float]]:
    """Yield number and line of each wall on a side, and its ends; of a block, the side itself."""
    if lines:
        own = ((number, line) for number, line in enumerate(lines) if line.side == side)
        yield from ((number, line, 0.0, line.length_m) for number, line in own)
    elif side in ("west", "east"):
        yield None, None, ground_m.bottom, ground_m.top
    else:
        yield None, None, ground_m.left, ground_m.right


@dataclass(frozen=True)
class FacadeBay:
    """A bay with its components.

    Attributes:
        bay: The bay.
        glazing: Its windows; `None` without.
        wall: Its wall panel; `None` without.
    """

    bay: Bay
    glazing: Glazing | None = None
    wall: Wall | None = None

    def __post_init__(self) -> None:
        """Check that the window fits.

        Raises:
            BlastEnvError: If the bay is empty, or a pane is larger than its bay.
        """
        if self.glazing is None and self.wall is None:
            raise BlastEnvError(f"bay {self.bay.name}: it has neither windows nor a wall")
        if self.glazing is None:
            return
        top_m = self.glazing.sill_m + self.glazing.height_m
        if self.glazing.width_m > self.bay.width_m + 1e-9 or top_m > self.bay.height_m + 1e-9:
            raise BlastEnvError(
                f"bay {self.bay.name}: a pane of {self.glazing.width_m:g} x"
                f" {self.glazing.height_m:g} m over a sill of {self.glazing.sill_m:g} m must fit"
                f" into {self.bay.width_m:g} x {self.bay.height_m:g} m"
            )

    @property
    def panes(self) -> int:
        """Number of panes: as many as fit side by side."""
        if self.glazing is None:
            return 0
        return max(1, int(self.bay.width_m / self.glazing.width_m + 1e-9))

    @property
    def glazed_m2(self) -> float:
        """Area of its panes."""
        return 0.0 if self.glazing is None else self.panes * _pane(self.glazing).area_m2


@dataclass(frozen=True, eq=False)
class FacadeResponse:
    """Response of the bays of a facade to one blast.

    Attributes:
        bays: The bays.
        time_s: Times of the histories (times,).
        pressure_pa: Mean overpressure on each bay (bays, times).
        glazed: Indices of the bays with windows (glazed,).
        glazing: Responses of their panes.
        walled: Indices of the bays with wall panels (walled,).
        walls: Responses of the panels.
    """

    bays: tuple[FacadeBay, ...]
    time_s: FloatArray
    pressure_pa: FloatArray
    glazed: FloatArray
    glazing: GlazingResponses
    walled: FloatArray
    walls: PanelResponses

    def or_worse(self, other: "FacadeResponse") -> "FacadeResponse":
        """Return the worse of two responses for each pane and panel of the same bays."""
        return replace(
            self,
            glazing=self.glazing.or_worse(other.glazing),
            walls=self.walls.or_worse(other.walls),
        )

    @property
    def broken_panes(self) -> float:
        """Expected number of broken panes."""
        counts = np.array([self.bays[index].panes for index in self.glazed.tolist()])
        return float(counts @ self.glazing.break_probability) if len(counts) else 0.0

    @property
    def panes(self) -> int:
        """Number of panes."""
        return sum(bay.panes for bay in self.bays)

    @property
    def worst_condition(self) -> GlazingCondition:
        """Performance condition of the worst pane."""
        return GlazingCondition(int(self.glazing.condition.max(initial=1.0)))

    @property
    def worst_damage(self) -> DamageLevel:
        """Damage of the worst wall panel; superficial if there are none."""
        return max(self.walls.levels, default=DamageLevel.SUPERFICIAL)

    @property
    def worst_number(self) -> float:
        """The worst of all damage as a number, see `blast_env.response.damage`."""
        return float(max(self.glazing.hazard.max(initial=0.0), self.walls.damage.max(initial=0.0)))

    @property
    def total_damage(self) -> float:
        """Sum of the damage of all components."""
        return float(self.glazing.hazard.sum() + self.walls.damage.sum())

    @property
    def thin_interlayers(self) -> tuple[float, ...]:
        """Thicknesses of interlayers thinner than that of arena tests, mm."""
        held = (bay.glazing.interlayer for bay in self.bays if bay.glazing is not None)
        return tuple(
            sorted(
                {
                    interlayer.thickness_mm
                    for interlayer in held
                    if interlayer is not None
                    and interlayer.material == "pvb"
                    and interlayer.thickness_mm < LEAST_INTERLAYER_MM
                }
            )
        )

    @property
    def level_of_protection(self) -> LevelOfProtection:
        """Level of protection of the building, that of its worst component."""
        return min(level_by_glass(self.worst_condition), level_of_protection(self.worst_damage))

    def grounds(self, target: LevelOfProtection) -> Iterator[tuple[str, bool, bool]]:
        """Yield each component's title, whether it allows a level, and whether that is assumed.

        A wall panel rests on an assumption if the limits of damage between its own and that level
        are assumed, a broken pane if tension and tearing of its interlayer are.
        """
        for index, level in self.glass_levels.items():
            glazing = self.bays[index].glazing
            assert glazing is not None
            tears = level < LevelOfProtection.HIGH and target < LevelOfProtection.HIGH
            is_assumed = glazing.interlayer is not None and glazing.interlayer.is_assumed
            yield glazing.title, level >= target, tears and is_assumed
        most = 4 - target
        for index, level in self.wall_levels.items():
            wall = self.bays[index].wall
            assert wall is not None
            own = 4 - level
            between = range(own, most + 1) if own <= most else range(most, own)
            yield wall.title, own <= most, wall.section.limits.assumed >= {*between}

    @cached_property
    def glass_levels(self) -> dict[int, LevelOfProtection]:
        """Level of protection by the panes of each bay, by its index."""
        conditions = map(GlazingCondition, map(int, self.glazing.condition.tolist()))
        return dict(zip(self.glazed.tolist(), map(level_by_glass, conditions), strict=True))

    @cached_property
    def wall_levels(self) -> dict[int, LevelOfProtection]:
        """Level of protection by the wall panel of each bay, by its index."""
        levels = map(level_of_protection, self.walls.levels)
        return dict(zip(self.walled.tolist(), levels, strict=True))


def level_by_glass(condition: GlazingCondition) -> LevelOfProtection:
    """Return the level of protection that corresponds to a building's worst pane.

    By the hazards of GSA's table 8-1: none and unbroken is high, none and broken medium, very low
    (3a) low, low (3b) very low, and more is below standards. This correspondence with the levels of
    UFC 4-010-01 is a conservative assumption.
    """
    return {
        GlazingCondition.NO_BREAK: LevelOfProtection.HIGH,
        GlazingCondition.RETAINED: LevelOfProtection.MEDIUM,
        GlazingCondition.WITHIN_1_M: LevelOfProtection.LOW,
        GlazingCondition.WITHIN_3_M: LevelOfProtection.VERY_LOW,
    }.get(condition, LevelOfProtection.BELOW_STANDARDS)


def response_words(found: Sequence[FacadeResponse]) -> tuple[str, str, str, str]:
    """Return the level of protection, the broken panes, the worst pane and the worst panel.

    They are those of facades under one charge, in words; a dash without panes or panels.
    """
    panes = sum(facade_response.panes for facade_response in found)
    conditions = [
        facade_response.worst_condition for facade_response in found if facade_response.panes
    ]
    damage = [
        facade_response.worst_damage for facade_response in found if len(facade_response.walled)
    ]
    return (
        min(facade_response.level_of_protection for facade_response in found).label,
        f"{sum(facade_response.broken_panes for facade_response in found):.1f} of {panes}",
        max(conditions).words if conditions else "-",
        max(damage).name.lower() if damage else "-",
    )


def assumption_words(found: Iterable[FacadeResponse], target: LevelOfProtection) -> str:
    """Return on which assumptions it rests whether facades have a level; empty without any.

    If every component allows the level, all of them decide; else those that do not, and only if
    each of these rests on an assumption.
    """
    every = [ground for facade_response in found for ground in facade_response.grounds(target)]
    failing = [ground for ground in every if not ground[1]]
    if failing and not all(is_assumed for *_, is_assumed in failing):
        return ""
    titles = dict.fromkeys(title for title, _, is_assumed in failing or every if is_assumed)
    return f"rests on assumed properties of: {'; '.join(titles)}" if titles else ""


def force_words(found: Iterable[FacadeResponse]) -> str:
    """Return the largest forces that frames and connections have to carry, in a sentence.

    Beside that of pane edges stands the design load of frames of ASTM F2248.
    """
    facades = [*found]
    edges, supports = (
        np.concatenate(forces).max(initial=-1.0) * 1e-3
        for forces in (
            [facade.glazing.edge_force_n_m for facade in facades],
            [facade.walls.support_force_n_m for facade in facades],
        )
    )
    carried = []
    if edges >= 0.0:
        panes = {bay.glazing for facade in facades for bay in facade.bays if bay.glazing}
        frame = 1e-3 * max(_pane(pane).frame_n_m for pane in panes)
        carried.append(f"{edges:.1f} kN/m at pane edges (ASTM F2248: {frame:.1f})")
    if supports >= 0.0:
        carried.append(f"{supports:.1f} kN/m at the supports of wall panels")
    return f"frames and connections are not assessed; they have to carry {', '.join(carried)}"


def peak_factor(cell_m: float, tnt_kg: float) -> float:
    """Return the factor on peaks on cells that makes them as sharp as Kingery and Bulmash's.

    A conservative rule: 2 with 9.3 cells per m/kg^(1/3), 1.5 with twice as many
    (`python -m studies.response cells`).

    Args:
        cell_m: Side of the cells.
        tnt_kg: Mass of the charge.
    """
    return 1.0 + _CELLS_OF_HALF_A_PEAK * cell_m / cbrt(tnt_kg)


def cells_of(peak_factor: float) -> float:
    """Return the cells per m/kg^(1/3) of a charge, from the factor on peaks on them."""
    return _CELLS_OF_HALF_A_PEAK / (peak_factor - 1.0) if peak_factor > 1.0 else inf


def slowest_period_s(bays: Sequence[FacadeBay]) -> float:
    """Return the longest natural period of the components of bays, s; 0 without components."""
    panes = (_pane(bay.glazing).system for bay in bays if bay.glazing is not None)
    panels = (_panel(bay.wall, bay.bay.height_m).system for bay in bays if bay.wall is not None)
    return max((pane.period_s for pane in (*panes, *panels)), default=0.0)


def peak_corrected(
    time_s: FloatArray, pressure_pa: FloatArray, factor: float
) -> tuple[FloatArray, FloatArray]:
    """Return histories with higher peaks and shorter durations, of the same impulse.

    Cells smear a front and clip its peak, but preserve its impulse. Each history is compressed in
    time about its first rise to half of its peak.

    Args:
        time_s: Times of the histories, ascending (times,).
        pressure_pa: The histories (bays, times).
        factor: Factor on pressures, and divisor of the times from that rise.

    Returns:
        Times (finer than before), and histories (bays, times).
    """
    factors = np.full(len(pressure_pa), factor)
    return rescaled(time_s, pressure_pa, factors, 1.0 / factors)


def rescaled(
    time_s: FloatArray, pressure_pa: FloatArray, peaks: FloatArray, durations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return histories with other peaks and durations.

    Each history is stretched in time about its first rise to half of its peak.

    Args:
        time_s: Times of the histories, ascending (times,).
        pressure_pa: The histories (bays, times).
        peaks: Factors on the pressures (bays,).
        durations: Factors on the times from that rise (bays,).

    Returns:
        Times (finer than before), and histories (bays, times).
    """
    # (1) Finer times, since a compressed history has its points closer together; (2) longer ones
    # for stretched histories; (3) each history about its own arrival.
    steps = np.arange(_FINER * (len(time_s) - 1) + 1) / _FINER
    times_s = np.interp(steps, np.arange(len(time_s)), time_s)
    if (longest := float(durations.max(initial=1.0))) > 1.0:
        times_s = time_s[0] + longest * (times_s - time_s[0])
    found = np.zeros((len(pressure_pa), len(times_s)))
    for index, history in enumerate(pressure_pa):
        # Half of the peak is where a front smeared over cells arrives.
        arrival_s = time_s[np.argmax(history >= 0.5 * history.max())]
        before_s = arrival_s + (times_s - arrival_s) / durations[index]
        found[index] = peaks[index] * np.interp(before_s, time_s, history, left=0.0, right=0.0)
    return times_s, found


def respond(
    bays: Sequence[FacadeBay], time_s: FloatArray, pressure_pa: FloatArray
) -> FacadeResponse:
    """Return the response of bays to their histories; no blast is run.

    The suction that follows a blast can reduce the deflection inwards. To be conservative, each
    component is computed with and without suction, and the worse response counts. This agrees with
    the practice of neglecting the negative phase unless it worsens the rebound. Without suction, a
    history ends at the maximum of its impulse: the positive phases of later echoes would add up for
    as long as the run lasts.

    Args:
        bays: The bays.
        time_s: Times of the histories, ascending (times,).
        pressure_pa: Mean overpressure on each bay, inwards positive (bays, times).

    Raises:
        BlastEnvError: If there is not one history per bay.
    """
    check_histories(len(bays), time_s, pressure_pa)
    glazed = [index for index, bay in enumerate(bays) if bay.glazing is not None]
    walled = [index for index, bay in enumerate(bays) if bay.wall is not None]
    panes = _panes(bays)
    panels = _panels(bays)
    # Once with suction and once without: see above for the reason.
    pushed_pa = pushes(time_s, pressure_pa)
    return FacadeResponse(
        bays=tuple(bays),
        time_s=time_s,
        pressure_pa=pressure_pa,
        glazed=np.array(glazed, dtype=np.int64),
        glazing=glazing_responses(panes, time_s, pressure_pa[glazed]).or_worse(
            glazing_responses(panes, time_s, pushed_pa[glazed])
        ),
        walled=np.array(walled, dtype=np.int64),
        walls=panel_responses(panels, time_s, pressure_pa[walled]).or_worse(
            panel_responses(panels, time_s, pushed_pa[walled])
        ),
    )


@dataclass(frozen=True, eq=False)
class LoadDraws:
    """Draws of the load on a bay and of the strength of its components.

    Attributes:
        peaks: Factors on the pressures (draws,).
        durations: Factors on the times (draws,).
        weaker: Share of panes that are weaker than the pane, above 0 and below 1 (draws,).
        resistance: Factors on the resistance of wall panels (draws,).
    """

    peaks: FloatArray
    durations: FloatArray
    weaker: FloatArray
    resistance: FloatArray

    def sharper(self, factor: float, chosen: IntArray) -> "LoadDraws":
        """Return some of the draws, with higher peaks and the same impulses.

        Args:
            factor: Factor on the pressures, by which times are divided.
            chosen: Numbers of the draws.
        """
        return LoadDraws(
            factor * self.peaks[chosen],
            self.durations[chosen] / factor,
            self.weaker[chosen],
            self.resistance[chosen],
        )


def drawn_levels(
    filled: FacadeBay,
    is_window: bool,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    draws: LoadDraws,
) -> FloatArray:
    """Return the level of protection by a component of a bay in each draw (draws,).

    Args:
        filled: The bay.
        is_window: Whether its windows count, or else its wall panel.
        time_s: Times of its history, ascending (times,).
        pressure_pa: Its history, inwards positive (times,).
        draws: The draws.
    """
    history, loads = (time_s, pressure_pa), (draws.peaks, draws.durations)
    if is_window:
        assert filled.glazing is not None
        condition = drawn_conditions(_pane(filled.glazing), *history, (*loads, draws.weaker))
        levels = np.array([0, *map(level_by_glass, GlazingCondition)])
        return np.asarray(levels[condition.astype(np.int64)])
    assert filled.wall is not None
    panel = _panel(filled.wall, filled.bay.height_m)
    damage = panel.drawn_damage(*history, (*loads, draws.resistance))
    return np.asarray(4 - np.minimum(damage, 4.0).astype(np.int64))


def pushes(time_s: FloatArray, pressure_pa: FloatArray) -> FloatArray:
    """Return the histories without suction, until the maximum of each one's impulse."""
    last = impulses(time_s, pressure_pa).argmax(axis=-1)
    counts = np.arange(len(time_s)) <= last[:, np.newaxis]
    return np.where(counts, np.maximum(pressure_pa, 0.0), 0.0)


def _panes(bays: Sequence[FacadeBay]) -> list[Pane]:
    """Return a pane of each bay with windows; equal panes share one object and its costly curve."""
    return [_pane(bay.glazing) for bay in bays if bay.glazing is not None]


def _panels(bays: Sequence[FacadeBay]) -> list[Panel]:
    """Return the panel of each bay with a wall; equal panels share one object."""
    return [_panel(bay.wall, bay.bay.height_m) for bay in bays if bay.wall is not None]


@lru_cache(maxsize=256)
def _pane(glazing: Glazing) -> Pane:
    return glazing.pane


@lru_cache(maxsize=256)
def _panel(wall: Wall, height_m: float) -> Panel:
    return wall.panel(height_m)
