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
from typing import Final

import numpy as np

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


@dataclass(frozen=True)
class Interlayer:
    """What holds the fragments of laminated glass together.

    The values for blast are an assumption of this project, with no public table behind them: PVB of
    1.52 mm as a membrane with the tension of its cohesion, torn at a share of the short side.

    Attributes:
        tension_n_m: Tension of the broken pane in its plane, N/m.
        tear_share: Deflection at which it tears or leaves the frame, over the short side.
    """

    tension_n_m: float = 16_000.0
    tear_share: float = 0.15


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

    def risk(self, pressure_pa: float, duration_s: float) -> float:
        """Return B of a constant pressure.

        Args:
            pressure_pa: Pressure on the inner pane.
            duration_s: Its duration.
        """
        own = _single(self, self.thickness_m)
        risk = np.interp(
            np.log(pressure_pa / self.kind.type_factor), np.log(own.load_pa), np.log(own.risk_60)
        )
        return float(np.exp(risk) * (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE))

    def load_resistance_pa(self, probability: float = 0.008, duration_s: float = 3.0) -> float:
        """Return the pressure that breaks such a share of panes, Pa (E1300's NFL times its factor).

        Args:
            probability: Share of panes that break.
            duration_s: Duration of the pressure.
        """
        own = _single(self, self.thickness_m)
        shorter = (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE)
        wanted = np.log(-np.log1p(-probability) / shorter)
        load = np.interp(wanted, np.log(own.risk_60), np.log(own.load_pa))
        return float(np.exp(load) * self.kind.type_factor)


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
    def log_rate(self) -> FloatArray:
        """Logarithm of the rate at which a damage that goes to B grows there (points,)."""
        return np.log(self.risk_60) * (STATIC_FATIGUE / WEIBULL_M)

    @cached_property
    def log_deflection(self) -> FloatArray:
        """Logarithm of the deflection (points,)."""
        return np.log(self.deflection_m)


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
    rows, impulse_pa_s = np.zeros((len(panes), 9)), impulses(time_s, pressure_pa)
    for index, pane in enumerate(panes):
        history = pressure_pa[index], impulse_pa_s[index]
        rows[index] = _one(pane, time_s, *history, limit_probability)
    return GlazingResponses(*rows.T)


def _one(
    pane: Pane,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    impulse_pa_s: FloatArray,
    limit: float,
) -> FloatArray:
    from blast_env.response.kernels import bend

    curve = pane.curve
    resistance = curve.resistance
    system = System(pane.mass_kg_m2, curve.load_mass_factor, resistance)
    lasts_s = float(time_s[-1] - time_s[0]) + system.period_s
    step_s = system.period_s / (_STIFFENING * STEPS_PER_PERIOD)
    found = np.zeros(5)
    arguments = (
        system.load_mass_factor * pane.mass_kg_m2,
        resistance.deflection_m,
        resistance.pressure_pa,
        curve.log_deflection,
        curve.log_rate,
        time_s,
        pressure_pa,
        impulse_pa_s,
        step_s,
        int(np.ceil(lasts_s / step_s)),
    )
    bend(*arguments, np.inf, found)
    peak_m, damage = found[0], found[1]
    risk = damage ** (WEIBULL_M / STATIC_FATIGUE)
    probability = float(-np.expm1(-risk))
    # The median of those that break: half of them have broken by then.
    median = -np.log1p(-0.5 * probability)
    bend(*arguments, median ** (STATIC_FATIGUE / WEIBULL_M), found)
    break_s, break_m, break_m_s = found[2], found[3], found[4]
    # The net impulse so far is K_LM m v: broken, the pane flies on with it and what is to come.
    left = _impulse_after(time_s, pressure_pa, break_s)
    thrown_m_s = max(system.load_mass_factor * break_m_s + left / pane.mass_kg_m2, 0.0)
    stretched = _stretched_share(pane, thrown_m_s, break_m)
    retained = stretched <= 1.0
    speed = 0.0 if retained else thrown_m_s
    flight = speed * np.sqrt(2.0 * pane.middle_m / _GRAVITY_M_S2)
    hit = _hit_height_m(pane, speed)
    condition = (
        GlazingCondition.NO_BREAK
        if probability <= limit
        else GlazingCondition.RETAINED
        if retained
        else flight_condition(flight, hit)
    )
    # In each condition: how far it is on the way to the next. Risk goes with the power m of a load.
    shares = {
        GlazingCondition.NO_BREAK: (probability / limit) ** (1.0 / WEIBULL_M),
        GlazingCondition.RETAINED: stretched,
        GlazingCondition.WITHIN_1_M: flight / _NEAR_M,
        GlazingCondition.WITHIN_3_M: (flight - _NEAR_M) / (_PANEL_M - _NEAR_M),
    }
    hazard = min(shares.get(condition, 1.0 - _PANEL_M / max(flight, _PANEL_M)), _BELOW_1)
    hazard += min(condition, GlazingCondition.LOW_ON_PANEL) - GlazingCondition.NO_BREAK
    return np.array(
        [peak_m, probability, break_s, speed, retained, flight, hit, condition, hazard],
        dtype=np.float64,
    )


def flight_condition(flight_m: float, hit_height_m: float) -> GlazingCondition:
    """Return the condition of a pane whose fragments fly so far, or hit the panel so high."""
    if hit_height_m > _PANEL_LOW_M:
        return GlazingCondition.HIGH_ON_PANEL
    if hit_height_m > 0.0:
        return GlazingCondition.LOW_ON_PANEL
    return GlazingCondition.WITHIN_1_M if flight_m <= _NEAR_M else GlazingCondition.WITHIN_3_M


def _hit_height_m(pane: Pane, speed_m_s: float) -> float:
    """Return where the middle hits a panel 3 m behind; -1 if it is on the floor before."""
    if speed_m_s <= 0.0:
        return -1.0
    height = pane.middle_m - 0.5 * _GRAVITY_M_S2 * (_PANEL_M / speed_m_s) ** 2
    return height if height > 0.0 else -1.0


def _stretched_share(pane: Pane, thrown_m_s: float, break_m: float) -> float:
    """Return the motion over what an interlayer takes up before it tears; infinite without one.

    A membrane of tension N over sides a and b resists with N pi^2 (1/a^2 + 1/b^2) a unit of its
    deflection, in a shape of half waves; what moves is all its glass.
    """
    if pane.interlayer is None:
        return np.inf
    sides = 1.0 / pane.width_m**2 + 1.0 / pane.height_m**2
    stiffness = pane.interlayer.tension_n_m * np.pi**2 * sides
    tear_m = pane.interlayer.tear_share * pane.short_m
    if break_m >= tear_m:
        return np.inf
    # mean(phi) = 4 / pi^2 and mean(phi^2) = 1 / 4 of half waves
    middle_m_s = thrown_m_s * (4.0 / np.pi**2) / 0.25
    moving = 0.25 * pane.mass_kg_m2 * middle_m_s**2
    taken = 0.25 * stiffness * (tear_m**2 - break_m**2)
    return float(moving / taken)


def _impulse_after(time_s: FloatArray, pressure_pa: FloatArray, at_s: float) -> float:
    """Return the positive impulse after a time, Pa s."""
    times = np.append(at_s, time_s[time_s > at_s])
    pressure = np.maximum(np.interp(times, time_s, pressure_pa), 0.0)
    return float(np.trapezoid(pressure, times)) if len(times) > 1 else 0.0
