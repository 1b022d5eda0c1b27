"""Single-degree-of-freedom systems under a pressure history.

A component of mass m per area deflects with a shape phi; x is the largest deflection:

    K_LM m x'' + r(x) = p(t)        K_LM = mean(phi^2) / mean(phi)

(Biggs, Introduction to Structural Dynamics, chapter 5; UFC 3-340-02, section 3-13). The resistance
follows a polyline up to a cap, at which the component yields; it unloads parallel to the first
segment. After the component has cracked, the resistance follows a second polyline instead.

The equation is integrated by the leapfrog method with steps of 1/100 of the shortest period, which
gives the peak of an elastic system to 0.1 %. The pressure is linear between the points of its
history, and each step has its exact impulse, however short the load.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError

STEPS_PER_PERIOD: Final = 100
"""Least number of steps in the shortest natural period of a system."""

_PERIODS_AFTER_LOAD: Final = 1.0
_NO_CRACK: Final = np.inf


@dataclass(frozen=True, eq=False)
class Resistance:
    """Resistance of a component over its deflection, per loaded area.

    Attributes:
        deflection_m: Deflections, ascending from 0 (points,).
        pressure_pa: Resistance from 0 (points,); extrapolated with the last slope.
        cap_pa: Yield resistance; infinite without yield.
        rebound_cap_pa: Yield resistance in rebound.
        growth_m: Deflections of `growth`, ascending from 0 (points,).
        growth: Factors on both yield resistances at these deflections, extrapolated (points,).
        crack_m: Deflection at which it cracks; infinite without cracking.
        cracked_deflection_m: Deflections after cracking, ascending from 0 (points,).
        cracked_pressure_pa: Resistance after cracking (points,).

    Raises:
        BlastEnvError: If deflections do not ascend from 0, or a first slope is not positive.
    """

    deflection_m: FloatArray
    pressure_pa: FloatArray
    cap_pa: float = np.inf
    rebound_cap_pa: float = np.inf
    growth_m: FloatArray = field(default_factory=lambda: np.array([0.0, 1.0]))
    growth: FloatArray = field(default_factory=lambda: np.array([1.0, 1.0]))
    crack_m: float = _NO_CRACK
    cracked_deflection_m: FloatArray = field(default_factory=lambda: np.array([0.0, 1.0]))
    cracked_pressure_pa: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0]))

    def __post_init__(self) -> None:
        """Check the polylines."""
        for name, deflection in (
            ("deflection_m", self.deflection_m),
            ("cracked_deflection_m", self.cracked_deflection_m),
            ("growth_m", self.growth_m),
        ):
            if len(deflection) < 2 or deflection[0] != 0.0 or not (np.diff(deflection) > 0.0).all():
                raise BlastEnvError(f"{name} is {deflection}, must ascend from 0")
        if not self.stiffness_pa_m > 0.0:
            raise BlastEnvError(f"first slope is {self.stiffness_pa_m} Pa/m, must be above 0")

    @property
    def stiffness_pa_m(self) -> float:
        """Initial slope, Pa/m."""
        return float(self.pressure_pa[1] / self.deflection_m[1])

    @property
    def yield_m(self) -> float:
        """Deflection at which it yields or cracks, m; infinite if it does neither."""
        if np.isinf(self.cap_pa):
            return self.crack_m
        return float(np.interp(self.cap_pa, self.pressure_pa, self.deflection_m))

    @classmethod
    def elastic_plastic(cls, stiffness_pa_m: float, cap_pa: float) -> "Resistance":
        """Return a bilinear resistance: elastic, then perfectly plastic."""
        # Elastic to the cap, perfectly plastic beyond it.
        yield_m = cap_pa / stiffness_pa_m
        return cls(np.array([0.0, yield_m]), np.array([0.0, cap_pa]), cap_pa, cap_pa)


@dataclass(frozen=True, eq=False)
class System:
    """A single-degree-of-freedom system, per loaded area.

    Attributes:
        load_mass_factor: K_LM.
    """

    mass_kg_m2: float
    load_mass_factor: float
    resistance: Resistance

    @cached_property
    def period_s(self) -> float:
        """Natural period at zero deflection, s."""
        return 2.0 * np.pi * self._time_scale_s(self.resistance.stiffness_pa_m)

    @cached_property
    def shortest_period_s(self) -> float:
        """Natural period at the largest stiffness, s."""
        slopes = np.diff(self.resistance.pressure_pa) / np.diff(self.resistance.deflection_m)
        return 2.0 * np.pi * self._time_scale_s(float(slopes.max()))

    def _time_scale_s(self, stiffness_pa_m: float) -> float:
        return float(np.sqrt(self.load_mass_factor * self.mass_kg_m2 / stiffness_pa_m))


@dataclass(frozen=True, eq=False)
class Responses:
    """Responses of systems to their histories.

    Attributes:
        peak_m: Largest deflection inwards, m (systems,).
        rebound_m: Largest deflection outwards, m, 0 or below (systems,).
        peak_time_s: Time of the largest deflection inwards, s (systems,).
        largest_resistance_pa: Largest resistance inwards, Pa (systems,).
        permanent_m: Permanent deflection, m (systems,).
        cracked: 1 if it cracked, else 0 (systems,).
    """

    peak_m: FloatArray
    rebound_m: FloatArray
    peak_time_s: FloatArray
    largest_resistance_pa: FloatArray
    permanent_m: FloatArray
    cracked: FloatArray


def check_histories(count: int, time_s: FloatArray, pressure_pa: FloatArray) -> None:
    """Refuse pressures (count, times) of another shape."""
    expected = (count, time_s.shape[-1])
    if pressure_pa.shape != expected:
        raise BlastEnvError(f"pressure_pa has shape {pressure_pa.shape}, must be {expected}")


def responses(
    systems: Sequence[System],
    time_s: FloatArray,
    pressure_pa: FloatArray,
    steps_per_period: int = STEPS_PER_PERIOD,
) -> Responses:
    """Return the response of each system to its history.

    Args:
        time_s: Times of the histories, ascending: (times,), or (systems, times) if they differ.
        pressure_pa: One history per system, inwards positive (systems, times).
        steps_per_period: Least number of steps in the shortest period of a system.

    Raises:
        BlastEnvError: If there is not one history per system, or times do not ascend.
    """
    check_histories(len(systems), time_s, pressure_pa)
    if time_s.shape[-1] < 2 or not (np.diff(time_s) > 0.0).all():
        raise BlastEnvError("time_s must ascend, and have at least two times")
    # The impulse until each point is summed once; the kernel interpolates in it, so that a load
    # shorter than a step is not missed.
    rows, impulse_pa_s = np.zeros((len(systems), 6)), impulses(time_s, pressure_pa)
    for index, system in enumerate(systems):
        own_s = time_s if time_s.ndim == 1 else time_s[index]
        history = own_s, pressure_pa[index], impulse_pa_s[index]
        _integrate(system, history, 1.0, steps_per_period, rows[index])
    return Responses(*rows.T)


def drawn_responses(
    system: System,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    draws: tuple[FloatArray, FloatArray, FloatArray],
) -> Responses:
    """Return the response of a system in draws of its load and strength.

    Args:
        time_s: Times of its history, ascending (times,).
        pressure_pa: Its history, inwards positive (times,).
        draws: Factors on pressures, on times, and on the resistance (draws,).
    """
    rows, impulse_pa_s = np.zeros((len(draws[0]), 6)), impulses(time_s, pressure_pa)
    for row, (peak, duration, strength) in zip(rows, np.transpose(draws).tolist(), strict=True):
        # A factor on pressures and one on times multiply the impulse together.
        history = duration * time_s, peak * pressure_pa, peak * duration * impulse_pa_s
        _integrate(system, history, strength, STEPS_PER_PERIOD, row)
    return Responses(*rows.T)


def _integrate(
    system: System,
    history: tuple[FloatArray, FloatArray, FloatArray],
    strength: float,
    steps_per_period: int,
    row: FloatArray,
) -> None:
    """Write the motion of a system to a row; see `blast_env.response.kernels.integrate`.

    Args:
        history: Times, pressures and impulses until them (times,).
        strength: Factor on its resistance.
        steps_per_period: Least number of steps in its shortest period.
        row: Receives the fields of `Responses`.
    """
    from blast_env.response.kernels import integrate

    resistance, time_s = system.resistance, history[0]
    # Strength multiplies the stiffness too, so a period goes with 1 / sqrt(strength).
    step_s = system.shortest_period_s / (steps_per_period * sqrt(strength))
    # The largest deflection may come after the load: one more period has it in free vibration.
    lasts_s = float(time_s[-1] - time_s[0]) + _PERIODS_AFTER_LOAD * system.period_s / sqrt(strength)
    integrate(
        system.load_mass_factor * system.mass_kg_m2,
        resistance.deflection_m,
        strength * resistance.pressure_pa,
        strength * resistance.cap_pa,
        resistance.growth_m,
        resistance.growth,
        strength * resistance.rebound_cap_pa,
        resistance.crack_m,
        resistance.cracked_deflection_m,
        strength * resistance.cracked_pressure_pa,
        *history,
        step_s,
        int(np.ceil(lasts_s / step_s)),
        row,
    )


def impulses(time_s: FloatArray, pressure_pa: FloatArray) -> FloatArray:
    """Return the impulse of histories until each point, Pa s, in the shape of the pressures."""
    # Trapezia are exact, since the pressure is linear between the points of a history.
    steps = 0.5 * (pressure_pa[..., 1:] + pressure_pa[..., :-1]) * np.diff(time_s)
    impulse_pa_s = np.zeros(pressure_pa.shape)
    np.cumsum(steps, axis=-1, out=impulse_pa_s[..., 1:])
    return impulse_pa_s
