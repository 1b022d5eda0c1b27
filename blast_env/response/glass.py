"""Window panes: breakage, and flight of the fragments.

Until it breaks, a pane is a single-degree-of-freedom system: a plate that stiffens as it bends
(`plate`). The probability of breakage is Beason & Morgan's, as in ASTM E1300, with k, m and E of
weathered glass. A pressure q of duration t breaks a share P of the panes:

    P = 1 - exp(-B)        B = k / (ab)^(m-1) (E h^2)^m R(q) (t / 60 s)^(m/16)

Under a history, Brown's integral of the stress to the power 16 takes the place of the duration,
with the resistance of the bent pane as q:

    B = [ integral of B_60(q)^(16/m) dt / 60 s ]^(m/16)

The resistance of heat-treated glass is larger by its glass type factor. Both panes of double
glazing bend as one: the air between them cannot escape in the milliseconds of a blast.

The fragments of a broken pane fly with its speed at breakage and the largest impulse to come, and
fall freely from its middle, without drag. The place of their impact determines the performance
condition (GSA, Facilities Standards P100, table 8-1). The interlayer of laminated glass retains the
fragments, as a stretched membrane, until it tears.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, lru_cache
from math import ceil
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.response.components import GlassKind, Glazing, Interlayer
from blast_env.response.plate_table import WEIBULL_M, plate_curve
from blast_env.response.sdof import STEPS_PER_PERIOD, Resistance, System, check_histories, impulses

YOUNG_PA: Final = 71.7e9
"""Young's modulus of glass, Pa (ASTM E1300)."""

FLAW_K: Final = 2.86e-53
"""Surface flaw parameter k of weathered window glass, N^-7 m^12 (ASTM E1300)."""

DENSITY_KG_M3: Final = 2500.0
"""Density of soda-lime glass (EN 572-1)."""

STATIC_FATIGUE: Final = 16.0
"""Exponent of the duration of load (ASTM E1300)."""


_MM: Final = 1e-3
_REFERENCE_S: Final = 60.0
_GRAVITY_M_S2: Final = 9.81
_NEAR_M: Final = 1.0
_PANEL_M: Final = 3.0
_PANEL_LOW_M: Final = 0.6
_BELOW_1: Final = 1.0 - 1e-9
_SLOWEST_M_S: Final = 1e-3
_RISK_OF_DAMAGE: Final = WEIBULL_M / STATIC_FATIGUE
"""Exponent of Brown's integral in B."""

_STIFFENING: Final = 3
"""Refinement of the time step, for the shorter period of a pane near breakage than at rest."""


class GlazingCondition(IntEnum):
    """Performance condition of a pane, GSA P100 table 8-1; a lower value is better."""

    NO_BREAK = 1
    RETAINED = 2
    WITHIN_1_M = 3
    WITHIN_3_M = 4
    LOW_ON_PANEL = 5
    HIGH_ON_PANEL = 6

    @property
    def label(self) -> str:
        """GSA's name of the condition: 1, 2, 3a, 3b, 4 or 5."""
        return ("1", "2", "3a", "3b", "4", "5")[self.value - 1]

    @property
    def rating(self) -> str:
        """Hazard rating of ISO 16933, A to F.

        A did not break, B is retained, D within 1 m, E within 3 m, F is farther or hits the panel.
        C, a partial tear, is not modelled: such a pane tears, and has D or worse.
        """
        return ("A", "B", "D", "E", "F", "F")[self.value - 1]

    @property
    def words(self) -> str:
        """Both: `3a, D`."""
        return f"{self.label}, {self.rating}"


@dataclass(frozen=True)
class Pane:
    """A pane of glass in a wall, supported on all four sides.

    Attributes:
        thickness_m: Minimum thickness of the glass by its standard; of laminated glass, the sum of
            all plies, which bend as one at the rate of a blast.
        kind: Heat treatment.
        interlayer: Interlayer of laminated glass; `None` for monolithic.
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

    def on_edges_n_m(self, pressure_pa: float) -> float:
        """Return the mean force per length of edge under a pressure, N/m."""
        return pressure_pa * self.area_m2 / (2.0 * (self.width_m + self.height_m))

    @property
    def frame_n_m(self) -> float:
        """Force per length of edge that ASTM F2248 asks of frames: twice its load resistance."""
        return self.on_edges_n_m(2.0 * self.load_resistance_pa())

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
        """Properties that determine the flight of its fragments, besides the load.

        Load-mass factor, mass per area, height of its middle above the floor; stiffness of the
        interlayer's membrane (0 without one) and deflection at which it tears (-1 without one). A
        membrane of tension N and sides a and b resists with N pi^2 (1/a^2 + 1/b^2) per unit of
        deflection.
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
        """Return B for a constant pressure.

        Args:
            pressure_pa: Pressure on the pane; both panes of double glazing carry it.
        """
        own = self.curve
        risk = np.interp(np.log(pressure_pa), np.log(own.load_pa), np.log(own.risk_60))
        return float(np.exp(risk) * (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE))

    def load_resistance_pa(self, probability: float = 0.008, duration_s: float = 3.0) -> float:
        """Return the pressure that breaks a share of panes, Pa (E1300's NFL times its factor).

        For double glazing, both panes carry the pressure, and the inner one breaks.
        """
        own = self.curve
        shorter = (duration_s / _REFERENCE_S) ** (WEIBULL_M / STATIC_FATIGUE)
        wanted = np.log(-np.log1p(-probability) / shorter)
        load = np.interp(wanted, np.log(own.risk_60), np.log(own.load_pa))
        return float(np.exp(load))


@dataclass(frozen=True, eq=False)
class PaneCurve:
    """Load and risk of a pane over the deflection of its middle.

    Attributes:
        deflection_m: Deflections, ascending (points,).
        load_pa: Static pressure for that deflection, both panes (points,).
        risk_60: B of the inner pane after 60 s at that deflection (points,).
        load_mass_factor: Approximate K_LM at breakage.
    """

    deflection_m: FloatArray
    load_pa: FloatArray
    risk_60: FloatArray
    load_mass_factor: float

    @classmethod
    def of(cls, pane: Pane) -> "PaneCurve":
        """Return the curve of a pane, or of both panes of double glazing bending as one."""
        own = _single(pane, pane.thickness_m)
        # Treated glass bends as annealed glass and breaks as annealed glass at a load that is
        # smaller by the type factor of E1300.
        weaker = own.load_pa / pane.kind.type_factor
        risk = np.exp(np.interp(np.log(weaker), np.log(own.load_pa), np.log(own.risk_60)))
        below = weaker < own.load_pa[0]  # there, the risk is proportional to the load to the m
        risk[below] = own.risk_60[0] * (weaker[below] / own.load_pa[0]) ** WEIBULL_M
        load = own.load_pa
        if pane.outer_thickness_m:
            outer = _single(pane, pane.outer_thickness_m)
            # Both panes of double glazing have the same deflection, and share the load.
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
        """Logarithms of the deflection and the rate of Brown's integral, and slopes (points,).

        The integral of that rate over time in units of 60 s, to the power m / 16, is B.
        """
        log_m, log_rate = np.log(self.deflection_m), np.log(self.risk_60) / _RISK_OF_DAMAGE
        return log_m, log_rate, _slopes(log_m, log_rate)


def _slopes(points: FloatArray, values: FloatArray) -> FloatArray:
    """Return the slopes of a polyline's segments, each at its end point; 0 at the first point."""
    return np.append(0.0, np.diff(values) / np.diff(points))


def _single(pane: Pane, thickness_m: float) -> PaneCurve:
    curve = plate_curve(pane.aspect_ratio)
    # The plate table is dimensionless: deflection over thickness, load in E (t / a)^4, and stresses
    # in E (t / a)^2.
    load = curve.load * YOUNG_PA * (thickness_m / pane.short_m) ** 4
    # Risk of E1300: B = k / A^(m - 1) (E t^2)^m exp(J); the table has the last factor.
    scale = FLAW_K / pane.area_m2 ** (WEIBULL_M - 1.0) * (YOUNG_PA * thickness_m**2) ** WEIBULL_M
    risk = scale * curve.risk
    # K_LM changes with the shape: that at the median breakage, B = ln 2, stands for all.
    breaks = int(np.clip(np.searchsorted(risk, np.log(2.0)), 0, len(risk) - 1))
    return PaneCurve(
        curve.deflection * thickness_m, load, risk, float(curve.load_mass_factor[breaks])
    )


@dataclass(frozen=True, eq=False)
class GlazingResponses:
    """Responses of panes to their histories.

    Attributes:
        peak_m: Largest deflection of an unbroken pane, m (panes,).
        break_probability: Share of such panes that break (panes,).
        speed_m_s: Speed of their fragments, m/s; 0 if retained (panes,).
        retained: 1 if an interlayer retains the fragments, else 0 (panes,).
        flight_m: Distance of flight to the floor, m (panes,).
        hit_height_m: Height of impact on a panel 3 m behind, above the floor, m; below 0 if the
            fragments land before it (panes,).
        condition: `GlazingCondition` of broken panes; `NO_BREAK` if no larger share than the limit
            breaks (panes,).
        edge_force_n_m: Largest mean force per length of edge, N/m, which frame and joint have to
            carry: the resistance of the pane over its edges until it breaks, or the tension of the
            interlayer of a broken one (panes,). 99 of 100 panes break before the one that counts.
        hazard: The condition as a number that increases within it: below 1 no break, from 1
            retained, from 2 within 1 m, from 3 within 3 m, from 4 to 5 farther (panes,).
    """

    peak_m: FloatArray
    break_probability: FloatArray
    speed_m_s: FloatArray
    retained: FloatArray
    flight_m: FloatArray
    hit_height_m: FloatArray
    condition: FloatArray
    edge_force_n_m: FloatArray
    hazard: FloatArray

    def only(self, panes: slice) -> "GlazingResponses":
        """Return those of some of the panes."""
        return GlazingResponses(*(own[panes] for own in vars(self).values()))

    def or_worse(self, other: "GlazingResponses") -> "GlazingResponses":
        """Return for each pane the response with the larger hazard.

        Deflection, share of broken panes and force on the edges are the larger ones of both: a load
        under which fewer panes break may throw them farther.
        """
        worse = other.hazard > self.hazard
        found = {
            name: np.where(worse, getattr(other, name), own) for name, own in vars(self).items()
        }
        for name in ("peak_m", "break_probability", "edge_force_n_m"):
            found[name] = np.maximum(getattr(self, name), getattr(other, name))
        return GlazingResponses(**found)


@lru_cache(maxsize=256)
def pane_of(glazing: Glazing) -> Pane:
    """Return a pane of some windows; equal ones share one object and its costly curve."""
    return Pane(
        glazing.width_m,
        glazing.height_m,
        glazing.thickness_mm * _MM,
        glazing.glass,
        glazing.interlayer,
        glazing.outer_thickness_mm * _MM,
        glazing.sill_m,
    )


def glazing_responses(
    panes: Sequence[Pane],
    time_s: FloatArray,
    pressure_pa: FloatArray,
    limit_probability: float = 0.008,
) -> GlazingResponses:
    """Return the response of each pane to its history.

    Args:
        time_s: Times of the histories, ascending: (times,), or (panes, times) if they differ.
        pressure_pa: One history per pane, inwards positive (panes, times).
        limit_probability: Largest share of broken panes for the condition `NO_BREAK`.

    Raises:
        BlastEnvError: If there is not one history per pane.
    """
    check_histories(len(panes), time_s, pressure_pa)
    # 1. Bending until breakage, and the flight of what the rest of the impulse throws.
    rows, impulse_pa_s = np.zeros((len(panes), 7)), impulses(time_s, pressure_pa)
    for index, pane in enumerate(panes):
        own_s = time_s if time_s.ndim == 1 else time_s[index]
        _bend(pane, own_s, pressure_pa[index], impulse_pa_s[index], 0.0, rows[index])
    peak_m, probability, *_ = rows.T
    thrown_by = np.reshape([pane.thrown_by for pane in panes], (len(panes), 5))
    stretched, speed, flight, hit = _thrown(rows, thrown_by)
    retained = stretched <= 1.0
    # 2. The condition in GSA's order: unbroken, retained by the interlayer, then by how far the
    # fragments fly.
    condition = np.where(
        probability <= limit_probability,
        GlazingCondition.NO_BREAK,
        np.where(retained, GlazingCondition.RETAINED, flight_condition(flight, hit)),
    )
    # 3. The hazard: progress within each condition to the next. The risk of breakage is
    # proportional to the load to the m.
    shares = (
        (probability / limit_probability) ** (1.0 / WEIBULL_M),
        stretched,
        flight / _NEAR_M,
        (flight - _NEAR_M) / (_PANEL_M - _NEAR_M),
        1.0 - _PANEL_M / np.maximum(flight, _PANEL_M),
    )
    # Both conditions on the panel have one scale, from 4 to 5: the farther, the higher.
    level = np.minimum(condition, GlazingCondition.LOW_ON_PANEL) - GlazingCondition.NO_BREAK
    hazard = level + np.minimum(np.choose(level, shares), _BELOW_1)
    return GlazingResponses(
        peak_m,
        probability,
        speed,
        retained.astype(np.float64),
        flight,
        hit,
        condition.astype(np.float64),
        _edge_forces_n_m(panes, rows[:, 6], probability > limit_probability),
        hazard,
    )


def drawn_conditions(
    pane: Pane,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    draws: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Return the `GlazingCondition` of a pane in draws of its load and strength (draws,).

    Args:
        time_s: Times of its history, ascending (times,).
        pressure_pa: Its history, inwards positive (times,).
        draws: Factors on pressures, factors on times, and the share of panes that are weaker, above
            0 and below 1 (draws,).
    """
    rows, impulse_pa_s = np.zeros((len(draws[0]), 7)), impulses(time_s, pressure_pa)
    for row, (peak, duration, weaker) in zip(rows, np.transpose(draws).tolist(), strict=True):
        # A pane stronger than the share `weaker` of all panes breaks at the risk B = -ln(1 -
        # weaker).
        loads = duration * time_s, peak * pressure_pa, peak * duration * impulse_pa_s
        _bend(pane, *loads, -np.log1p(-weaker), row)
    stretched, _, flight, hit = _thrown(rows, np.tile(pane.thrown_by, (len(rows), 1)))
    broken = np.where(stretched <= 1.0, GlazingCondition.RETAINED, flight_condition(flight, hit))
    return np.where(draws[2] >= rows[:, 1], GlazingCondition.NO_BREAK, broken)


def _bend(
    pane: Pane,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    impulse_pa_s: FloatArray,
    strength: float,
    row: FloatArray,
) -> None:
    """Write the bending of a pane to a row; see `blast_env.response.kernels.bend`."""
    from blast_env.response.kernels import bend

    curve, system = pane.curve, pane.system
    step_s = system.period_s / (_STIFFENING * STEPS_PER_PERIOD)
    bend(
        system.load_mass_factor * system.mass_kg_m2,
        *curve.bending,
        *curve.wear,
        _RISK_OF_DAMAGE,
        time_s,
        pressure_pa,
        impulse_pa_s,
        step_s,
        ceil((float(time_s[-1] - time_s[0]) + system.period_s) / step_s),
        strength,
        row,
    )


def _thrown(
    rows: FloatArray, thrown_by: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the stretched share, and speed, flight and height of impact of fragments (panes,).

    Args:
        rows: The bending, as `blast_env.response.kernels.bend` writes it (panes, 7).
        thrown_by: `Pane.thrown_by` of each (panes, 5).
    """
    _, _, _, break_m, break_m_s, left_pa_s, _ = rows.T
    klm, mass, middle_m, stiffness, tear_m = thrown_by.T
    # The net impulse so far is K_LM m v: fragments fly on with it and the remaining impulse.
    thrown_m_s = np.maximum(klm * break_m_s + left_pa_s / mass, 0.0)
    stretched = _stretched_share(thrown_m_s, break_m, mass, stiffness, tear_m)
    speed = np.where(stretched <= 1.0, 0.0, thrown_m_s)
    # Thrown horizontally from the middle of the pane, without drag: free fall to the floor.
    flight = speed * np.sqrt(2.0 * middle_m / _GRAVITY_M_S2)
    return stretched, speed, flight, _hit_height_m(middle_m, speed)


def _edge_forces_n_m(panes: Sequence[Pane], whole_m: FloatArray, broken: BoolArray) -> FloatArray:
    """Return the mean force on the edges of panes with a deflection until breakage (panes,)."""
    forces = []
    for pane, deflection_m, is_broken in zip(panes, whole_m, broken, strict=True):
        reached_m, pressure_pa, _ = pane.curve.bending
        # The edges carry the resistance, not the load: inertia takes the difference.
        force = pane.on_edges_n_m(float(np.interp(deflection_m, reached_m, pressure_pa)))
        holds = pane.interlayer
        forces.append(max(force, holds.tension_n_m) if is_broken and holds else force)
    return np.array(forces)


def flight_condition(flight_m: FloatArray, hit_height_m: FloatArray) -> FloatArray:
    """Return the conditions of broken panes by distance of flight and height of impact, in m."""
    near = np.where(
        np.asarray(flight_m) <= _NEAR_M, GlazingCondition.WITHIN_1_M, GlazingCondition.WITHIN_3_M
    )
    hit = np.asarray(hit_height_m)
    low = np.where(hit > 0.0, GlazingCondition.LOW_ON_PANEL, near)
    return np.where(hit > _PANEL_LOW_M, GlazingCondition.HIGH_ON_PANEL, low)


def _hit_height_m(middle_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Return the height at which the middle hits a panel 3 m behind; -1 if it lands before."""
    # The fall during the flight to the witness panel of GSA's test, 3 m behind the window.
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
    """Return the kinetic energy over the energy that an interlayer absorbs until it tears.

    Infinite without an interlayer. The shape of the motion is a half wave in each direction; the
    mass is that of all the glass.
    """
    # mean(phi) = 4 / pi^2 and mean(phi^2) = 1 / 4 of half waves
    middle_m_s = thrown_m_s * (4.0 / np.pi**2) / 0.25
    moving = 0.25 * mass_kg_m2 * middle_m_s**2
    holds = break_m < tear_m
    taken = 0.25 * stiffness_pa_m * (tear_m**2 - break_m**2)
    return np.where(holds, moving / np.where(holds, taken, 1.0), np.inf)
