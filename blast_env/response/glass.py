"""Window panes: do they break, and how far do the fragments fly?

Before it breaks, a pane is a plate that stiffens as it bends (`plate`): a system of one degree of
freedom. The probability of breakage is Beason & Morgan's, as in ASTM E1300, with k, m and E of
weathered glass. A pressure q of duration t breaks a share P of the panes:

    P = 1 - exp(-B)        B = k / (ab)^(m-1) (E h^2)^m R(q) (t / 60 s)^(m/16)

Under a history, Brown's integral of the stress to the power 16 takes the place of the duration,
with the resistance of the bent pane as q:

    B = [ integral of B_60(q)^(16/m) dt / 60 s ]^(m/16)

Tempered glass carries its glass type factor times as much. Both panes of double glazing bend as
one: the air between them is shut in for the milliseconds of a blast.

Broken, a pane is thrown with the speed that it had and the impulse that is still to come. It
falls freely from its middle, without drag. Where it lands or hits says its performance condition
(GSA, Facilities Standards P100, table 8-1). Laminated glass holds together on its interlayer, as a
stretched membrane, until that tears.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from functools import cached_property
from math import ceil
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictFloat

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.response.plate_table import WEIBULL_M, plate_curve
from blast_env.response.sdof import (
    STEPS_PER_PERIOD,
    Resistance,
    System,
    impulses,
)

YOUNG_PA: Final = 71.7e9
"""Young's modulus of glass, Pa (ASTM E1300)."""

FLAW_K: Final = 2.86e-53
"""Surface flaw parameter k of weathered window glass, N^-7 m^12 (ASTM E1300)."""

DENSITY_KG_M3: Final = 2500.0
"""Density of soda-lime glass (EN 572-1)."""

STATIC_FATIGUE: Final = 16.0
"""Exponent of the duration of load (ASTM E1300)."""

_REFERENCE_S: Final = 60.0
_GRAVITY_M_S2: Final = 9.81
_NEAR_M: Final = 1.0
_PANEL_M: Final = 3.0
_PANEL_LOW_M: Final = 0.6
_BELOW_1: Final = 1.0 - 1e-9
_SLOWEST_M_S: Final = 1e-3
_RISK_OF_DAMAGE: Final = WEIBULL_M / STATIC_FATIGUE
"""B is Brown's integral to this power."""

_STIFFENING: Final = 3
"""A pane bent to breaking is so much quicker than at rest: its steps are for that."""


class GlassKind(StrEnum):
    """Heat treatment of glass."""

    ANNEALED = "annealed"
    HEAT_STRENGTHENED = "heat_strengthened"
    FULLY_TEMPERED = "fully_tempered"

    @property
    def type_factor(self) -> float:
        """Load that it carries, over that of annealed glass (ASTM E1300, table 1)."""
        return {"annealed": 1.0, "heat_strengthened": 2.0, "fully_tempered": 4.0}[self.value]


class GlazingCondition(IntEnum):
    """Performance condition of a pane, GSA P100 table 8-1, the better the smaller."""

    NO_BREAK = 1
    RETAINED = 2
    WITHIN_1_M = 3
    WITHIN_3_M = 4
    LOW_ON_PANEL = 5
    HIGH_ON_PANEL = 6

    @property
    def label(self) -> str:
        """The name that GSA gives it: 1, 2, 3a, 3b, 4 or 5."""
        return ("1", "2", "3a", "3b", "4", "5")[self.value - 1]


class Interlayer(BaseModel):
    """What holds the fragments of laminated glass together.

    The values for blast are an assumption of this project, with no public table behind them: PVB of
    1.52 mm as a membrane with the tension of its cohesion, torn at a share of the short side.

    Attributes:
        tension_n_m: Tension of the broken pane in its plane, N/m.
        tear_share: Deflection at which it tears or leaves the frame, over the short side.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    tension_n_m: Annotated[StrictFloat, Field(gt=0.0)] = 16_000.0
    tear_share: Annotated[StrictFloat, Field(gt=0.0, le=1.0)] = 0.15


@dataclass(frozen=True)
class Pane:
    """A pane of glass in a wall, on all four sides.

    Attributes:
        width_m: Width.
        height_m: Height.
        thickness_m: Thickness of the glass, at least that of its norm; of laminated glass, of all
            plies together: at the speed of a blast they bend as one.
        kind: Heat treatment.
        interlayer: Of laminated glass; `None` for monolithic.
        outer_thickness_m: Thickness of the outer pane of double glazing; 0 for single.
        sill_m: Height of its lower edge above the floor.
    """

    width_m: float
    height_m: float
    thickness_m: float
    kind: GlassKind = GlassKind.ANNEALED
    interlayer: Interlayer | None = None
    outer_thickness_m: float = 0.0
    sill_m: float = 0.9

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            BlastEnvError: If a size is not positive, or one side is more than five times the other.
        """
        for name in ("width_m", "height_m", "thickness_m"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise BlastEnvError(f"pane: {name} is {value}, must be above 0")
        if not 0.0 <= self.outer_thickness_m < np.inf:
            raise BlastEnvError(
                f"pane: outer_thickness_m is {self.outer_thickness_m}, must be at least 0"
            )
        if self.aspect_ratio > 5.0:
            raise BlastEnvError(
                f"pane: sides are {self.width_m} and {self.height_m} m, must be at most 5 to 1"
            )

    @property
    def short_m(self) -> float:
        """Short side, m."""
        return min(self.width_m, self.height_m)

    @property
    def area_m2(self) -> float:
        """Area, m2."""
        return self.width_m * self.height_m

    @property
    def aspect_ratio(self) -> float:
        """Long over short side."""
        return max(self.width_m, self.height_m) / self.short_m

    @property
    def mass_kg_m2(self) -> float:
        """Mass per area, both panes."""
        return DENSITY_KG_M3 * (self.thickness_m + self.outer_thickness_m)

    @property
    def middle_m(self) -> float:
        """Height of its middle above the floor, m."""
        return self.sill_m + 0.5 * self.height_m

    @cached_property
    def curve(self) -> "PaneCurve":
        """Resistance and risk over the deflection of its middle."""
        return PaneCurve.of(self)

    @cached_property
    def system(self) -> System:
        """The pane before it breaks, as a single-degree-of-freedom system."""
        return System(self.mass_kg_m2, self.curve.load_mass_factor, self.curve.resistance)

    @cached_property
    def thrown_by(self) -> tuple[float, float, float, float, float]:
        """What the flight of its fragments depends on, beside the load.

        Load-mass factor, mass per area, height of its middle above the floor; stiffness of the
        interlayer's membrane and deflection at which it tears, or -1 without one. A membrane of
        tension N over sides a and b resists with N pi^2 (1/a^2 + 1/b^2) a unit of its deflection.
        """
        holds = self.interlayer
        sides = 1.0 / self.width_m**2 + 1.0 / self.height_m**2
        return (
            self.system.load_mass_factor,
            self.mass_kg_m2,
            self.middle_m,
            0.0 if holds is None else holds.tension_n_m * np.pi**2 * sides,
            -1.0 if holds is None else holds.tear_share * self.short_m,
        )

    def risk(self, pressure_pa: float, duration_s: float) -> float:
        """Return B of a constant pressure.

        Args:
            pressure_pa: Pressure on the pane; double glazing bears it with both panes.
            duration_s: Its duration.
        """
        own = self.curve
        risk = np.interp(np.log(pressure_pa), np.log(own.load_pa), np.log(own.risk_60))
        return float(np.exp(risk) * (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE))

    def load_resistance_pa(self, probability: float = 0.008, duration_s: float = 3.0) -> float:
        """Return the pressure that breaks such a share of panes, Pa (E1300's NFL times its factor).

        Of double glazing it is borne by both panes, and breaks the inner one.

        Args:
            probability: Share of panes that break.
            duration_s: Duration of the pressure.
        """
        own = self.curve
        shorter = (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE)
        wanted = np.log(-np.log1p(-probability) / shorter)
        load = np.interp(wanted, np.log(own.risk_60), np.log(own.load_pa))
        return float(np.exp(load))


@dataclass(frozen=True, eq=False)
class PaneCurve:
    """What a pane does over the deflection of its middle.

    Attributes:
        deflection_m: Ascending (points,).
        load_pa: Static pressure that bends it so far, both panes (points,).
        risk_60: B of the inner pane after 60 s there (points,).
        load_mass_factor: K_LM where it breaks, about.
    """

    deflection_m: FloatArray
    load_pa: FloatArray
    risk_60: FloatArray
    load_mass_factor: float

    @classmethod
    def of(cls, pane: Pane) -> "PaneCurve":
        """Return the curve of a pane, or of both panes of double glazing bending as one."""
        own = _single(pane, pane.thickness_m)
        weaker = own.load_pa / pane.kind.type_factor
        risk = np.exp(np.interp(np.log(weaker), np.log(own.load_pa), np.log(own.risk_60)))
        below = weaker < own.load_pa[0]  # risk goes with the power m of the load there
        risk[below] = own.risk_60[0] * (weaker[below] / own.load_pa[0]) ** WEIBULL_M
        load = own.load_pa
        if pane.outer_thickness_m:
            outer = _single(pane, pane.outer_thickness_m)
            load = load + np.exp(
                np.interp(
                    np.log(own.deflection_m), np.log(outer.deflection_m), np.log(outer.load_pa)
                )
            )
        return cls(own.deflection_m, load, risk, own.load_mass_factor)

    @cached_property
    def resistance(self) -> Resistance:
        """The static pressure over the deflection, as a resistance without yield."""
        return Resistance(np.append(0.0, self.deflection_m), np.append(0.0, self.load_pa))

    @cached_property
    def bending(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Deflection, resistance, and its slope before each point (points + 1,)."""
        found = self.resistance
        return found.deflection_m, found.pressure_pa, _slopes(found.deflection_m, found.pressure_pa)

    @cached_property
    def wear(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Logarithms of the deflection and of the rate of a damage, and the slope (points,).

        Damage that grows at that rate becomes B.
        """
        log_m, log_rate = np.log(self.deflection_m), np.log(self.risk_60) / _RISK_OF_DAMAGE
        return log_m, log_rate, _slopes(log_m, log_rate)


def _slopes(points: FloatArray, values: FloatArray) -> FloatArray:
    """Return the slopes of a polyline's segments, each at its end; 0 at the first point."""
    return np.append(0.0, np.diff(values) / np.diff(points))


def _single(pane: Pane, thickness_m: float) -> PaneCurve:
    curve = plate_curve(pane.aspect_ratio)
    load = curve.load * YOUNG_PA * (thickness_m / pane.short_m) ** 4
    scale = FLAW_K / pane.area_m2 ** (WEIBULL_M - 1.0) * (YOUNG_PA * thickness_m**2) ** WEIBULL_M
    risk = scale * curve.risk
    breaks = int(np.clip(np.searchsorted(risk, np.log(2.0)), 0, len(risk) - 1))
    return PaneCurve(
        curve.deflection * thickness_m, load, risk, float(curve.load_mass_factor[breaks])
    )


@dataclass(frozen=True, eq=False)
class GlazingResponses:
    """What panes did under their histories.

    Attributes:
        peak_m: Largest deflection of a pane that does not break, m (panes,).
        break_probability: Share of such panes that break (panes,).
        break_time_s: When the median of those that break does, s (panes,).
        speed_m_s: Speed of the fragments of those that break, m/s (panes,); 0 if they are retained.
        retained: Whether an interlayer holds the fragments (panes,).
        flight_m: How far they fly before they are on the floor, m (panes,).
        hit_height_m: Where they hit a panel 3 m behind, above the floor (panes,); below 0 if not.
        condition: `GlazingCondition` of those that break, or `NO_BREAK` where fewer break than the
            limit (panes,).
        hazard: The condition as a number that grows within it: below 1 no break, from 1 retained,
            from 2 within 1 m, from 3 within 3 m, from 4 to 5 farther (panes,).
    """

    peak_m: FloatArray
    break_probability: FloatArray
    break_time_s: FloatArray
    speed_m_s: FloatArray
    retained: FloatArray
    flight_m: FloatArray
    hit_height_m: FloatArray
    condition: FloatArray
    hazard: FloatArray

    def or_worse(self, other: "GlazingResponses") -> "GlazingResponses":
        """Return for each pane what it did here or there, where its hazard is larger."""
        worse = other.hazard > self.hazard
        return GlazingResponses(
            *(np.where(worse, getattr(other, name), own) for name, own in vars(self).items())
        )


def glazing_responses(
    panes: Sequence[Pane],
    time_s: FloatArray,
    pressure_pa: FloatArray,
    limit_probability: float = 0.008,
) -> GlazingResponses:
    """Return what each pane does under its own history.

    Args:
        panes: The panes.
        time_s: Times of the histories, ascending (times,).
        pressure_pa: A history a pane, inwards positive (panes, times).
        limit_probability: Share of panes that may break and the verdict is still "no break".

    Raises:
        BlastEnvError: If the histories are not one a pane.
    """
    if pressure_pa.shape != (len(panes), len(time_s)):
        raise BlastEnvError(
            f"pressure_pa has shape {pressure_pa.shape}, must be ({len(panes)}, {len(time_s)})"
        )
    from blast_env.response.kernels import bend

    rows, impulse_pa_s = np.zeros((len(panes), 6)), impulses(time_s, pressure_pa)
    span_s = float(time_s[-1] - time_s[0])
    for index, pane in enumerate(panes):
        curve, system = pane.curve, pane.system
        step_s = system.period_s / (_STIFFENING * STEPS_PER_PERIOD)
        bend(
            system.load_mass_factor * system.mass_kg_m2,
            *curve.bending,
            *curve.wear,
            _RISK_OF_DAMAGE,
            time_s,
            pressure_pa[index],
            impulse_pa_s[index],
            step_s,
            ceil((span_s + system.period_s) / step_s),
            rows[index],
        )
    peak_m, probability, break_s, break_m, break_m_s, left_pa_s = rows.T
    klm, mass, middle_m, stiffness, tear_m = np.reshape(
        [each.thrown_by for each in panes], (len(panes), 5)
    ).T
    # The net impulse so far is K_LM m v: broken, the pane flies on with it and what is to come.
    thrown_m_s = np.maximum(klm * break_m_s + left_pa_s / mass, 0.0)
    stretched = _stretched_share(thrown_m_s, break_m, mass, stiffness, tear_m)
    retained = stretched <= 1.0
    speed = np.where(retained, 0.0, thrown_m_s)
    flight = speed * np.sqrt(2.0 * middle_m / _GRAVITY_M_S2)
    hit = _hit_height_m(middle_m, speed)
    condition = np.where(
        probability <= limit_probability,
        GlazingCondition.NO_BREAK,
        np.where(retained, GlazingCondition.RETAINED, flight_condition(flight, hit)),
    )
    # In each condition: how far it is on the way to the next. Risk goes with the power m of a load.
    shares = (
        (probability / limit_probability) ** (1.0 / WEIBULL_M),
        stretched,
        flight / _NEAR_M,
        (flight - _NEAR_M) / (_PANEL_M - _NEAR_M),
        1.0 - _PANEL_M / np.maximum(flight, _PANEL_M),
    )
    level = np.minimum(condition, GlazingCondition.LOW_ON_PANEL) - GlazingCondition.NO_BREAK
    hazard = level + np.minimum(np.choose(level, shares), _BELOW_1)
    return GlazingResponses(
        peak_m,
        probability,
        break_s,
        speed,
        retained.astype(np.float64),
        flight,
        hit,
        condition.astype(np.float64),
        hazard,
    )


def flight_condition(flight_m: FloatArray, hit_height_m: FloatArray) -> FloatArray:
    """Return the conditions of panes whose fragments fly so far, or hit the panel so high."""
    near = np.where(
        np.asarray(flight_m) <= _NEAR_M, GlazingCondition.WITHIN_1_M, GlazingCondition.WITHIN_3_M
    )
    hit = np.asarray(hit_height_m)
    low = np.where(hit > 0.0, GlazingCondition.LOW_ON_PANEL, near)
    return np.where(hit > _PANEL_LOW_M, GlazingCondition.HIGH_ON_PANEL, low)


def _hit_height_m(middle_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Return where the middle hits a panel 3 m behind; -1 if it is on the floor before."""
    falls_s = _PANEL_M / np.maximum(speed_m_s, _SLOWEST_M_S)
    height = middle_m - 0.5 * _GRAVITY_M_S2 * falls_s**2
    return np.where(height > 0.0, height, -1.0)


def _stretched_share(
    thrown_m_s: FloatArray,
    break_m: FloatArray,
    mass_kg_m2: FloatArray,
    stiffness_pa_m: FloatArray,
    tear_m: FloatArray,
) -> FloatArray:
    """Return the motion over what interlayers take up before they tear; infinite without one.

    They move in a shape of half waves, and what moves is all the glass.
    """
    # mean(phi) = 4 / pi^2 and mean(phi^2) = 1 / 4 of half waves
    middle_m_s = thrown_m_s * (4.0 / np.pi**2) / 0.25
    moving = 0.25 * mass_kg_m2 * middle_m_s**2
    holds = break_m < tear_m
    taken = 0.25 * stiffness_pa_m * (tear_m**2 - break_m**2)
    return np.where(holds, moving / np.where(holds, taken, 1.0), np.inf)
