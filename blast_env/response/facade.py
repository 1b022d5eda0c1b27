"""The response of facades, bay by bay.

A bay has components: windows, wall panels, or both side by side. Its load is the mean overpressure
over the bay; all its components share that history.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import cbrt, ceil, inf
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.response.buildings import level_of_protection
from blast_env.response.components import LEAST_INTERLAYER_MM, FacadeBay
from blast_env.response.glass import (
    GlazingCondition,
    GlazingResponses,
    drawn_conditions,
    glazing_responses,
    pane_of,
)
from blast_env.response.levels import LevelOfProtection
from blast_env.response.sdof import check_histories, impulses
from blast_env.response.wall_sections import DamageLevel
from blast_env.response.walls import PanelResponses, panel_of, panel_responses

_FINER = 4  # least refinement of the times of sharpened histories

_CELLS_OF_HALF_A_PEAK: Final = 9.3
"""Cells per m/kg^(1/3) at which peaks are about half of Kingery and Bulmash's."""


@dataclass(frozen=True, eq=False)
class FacadeResponse:
    """Response of the bays of a facade to one blast.

    Attributes:
        time_s: Times of the histories: (times,), or (bays, times) if they differ.
        pressure_pa: Mean overpressure on each bay (bays, times).
        glazed: Indices of the bays with windows (glazed,).
        glazing: Responses of their panes.
        walled: Indices of the bays with wall panels (walled,).
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

    def each(self) -> Iterator["FacadeResponse"]:
        """Yield the response of each bay alone."""
        pane, panel = 0, 0  # the next ones
        for index, bay in enumerate(self.bays):
            panes, panels = int(bay.glazing is not None), int(bay.wall is not None)
            yield FacadeResponse(
                (bay,),
                self.time_s if self.time_s.ndim == 1 else self.time_s[index],
                self.pressure_pa[index : index + 1],
                np.zeros(panes, dtype=np.int64),
                self.glazing.only(slice(pane, pane + panes)),
                np.zeros(panels, dtype=np.int64),
                self.walls.only(slice(panel, panel + panels)),
            )
            pane, panel = pane + panes, panel + panels

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

    They are those of facades under one charge, in words; a dash without panes or panels, or without
    any facade.
    """
    if not found:
        return "-", "-", "-", "-"
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
        frame = 1e-3 * max(pane_of(pane).frame_n_m for pane in panes)
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
    """
    return 1.0 + _CELLS_OF_HALF_A_PEAK * cell_m / cbrt(tnt_kg)


def cells_of(peak_factor: float) -> float:
    """Return the cells per m/kg^(1/3) of a charge, from the factor on peaks on them."""
    return _CELLS_OF_HALF_A_PEAK / (peak_factor - 1.0) if peak_factor > 1.0 else inf


def slowest_period_s(bays: Sequence[FacadeBay]) -> float:
    """Return the longest natural period of the components of bays, s; 0 without components."""
    panes = (pane_of(bay.glazing).system for bay in bays if bay.glazing is not None)
    panels = (panel_of(bay.wall, bay.bay.height_m).system for bay in bays if bay.wall is not None)
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
    # Pressures times f and times over f: each impulse stays, to the rounding of new times.
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
    finer = max(_FINER, ceil(1.0 / float(durations.min(initial=1.0))))
    steps = np.arange(finer * (len(time_s) - 1) + 1) / finer
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
        time_s: Times of the histories, ascending: (times,), or (bays, times) if they differ.
        pressure_pa: Mean overpressure on each bay, inwards positive (bays, times).

    Raises:
        BlastEnvError: If there is not one history per bay.
    """
    check_histories(len(bays), time_s, pressure_pa)
    # 1. The panes and the panels, each with the history of its bay.
    glazed = [index for index, bay in enumerate(bays) if bay.glazing is not None]
    walled = [index for index, bay in enumerate(bays) if bay.wall is not None]
    panes = [pane_of(bay.glazing) for bay in bays if bay.glazing is not None]
    panels = [panel_of(bay.wall, bay.bay.height_m) for bay in bays if bay.wall is not None]
    times_s = (time_s, time_s) if time_s.ndim == 1 else (time_s[glazed], time_s[walled])
    glazing = glazing_responses(panes, times_s[0], pressure_pa[glazed])
    walls = panel_responses(panels, times_s[1], pressure_pa[walled])
    # 2. Once with suction, above, and once without: the worse counts.
    pushed_pa = pushes(time_s, pressure_pa)
    if not np.array_equal(pushed_pa, pressure_pa):
        glazing = glazing.or_worse(glazing_responses(panes, times_s[0], pushed_pa[glazed]))
        walls = walls.or_worse(panel_responses(panels, times_s[1], pushed_pa[walled]))
    return FacadeResponse(
        bays=tuple(bays),
        time_s=time_s,
        pressure_pa=pressure_pa,
        glazed=np.array(glazed, dtype=np.int64),
        glazing=glazing,
        walled=np.array(walled, dtype=np.int64),
        walls=walls,
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
        is_window: Whether its windows count, or else its wall panel.
        time_s: Times of its history, ascending (times,).
        pressure_pa: Its history, inwards positive (times,).
    """
    history, loads = (time_s, pressure_pa), (draws.peaks, draws.durations)
    if is_window:
        assert filled.glazing is not None
        condition = drawn_conditions(pane_of(filled.glazing), *history, (*loads, draws.weaker))
        levels = np.array([0, *map(level_by_glass, GlazingCondition)])
        return np.asarray(levels[condition.astype(np.int64)])
    assert filled.wall is not None
    panel = panel_of(filled.wall, filled.bay.height_m)
    damage = panel.drawn_damage(*history, (*loads, draws.resistance))
    return np.asarray(4 - np.minimum(damage, 4.0).astype(np.int64))


def pushes(time_s: FloatArray, pressure_pa: FloatArray) -> FloatArray:
    """Return the histories without suction, until the maximum of each one's impulse."""
    last = impulses(time_s, pressure_pa).argmax(axis=-1)
    counts = np.arange(time_s.shape[-1]) <= last[:, np.newaxis]
    return np.where(counts, np.maximum(pressure_pa, 0.0), 0.0)
