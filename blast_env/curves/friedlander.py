"""The Friedlander waveform: overpressure and impulse over time."""

from dataclasses import dataclass
from math import factorial, isfinite
from typing import Final, overload

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.values import Numbers, checked_array

_SERIES_BELOW: Final = 0.5  # of b, where the closed form loses digits
_SERIES: Final = tuple((-1.0) ** order / factorial(order + 2) for order in range(16))
_BISECTIONS: Final = 64


@dataclass(frozen=True)
class Friedlander:
    """p(t) = p_2 (1 - t / t_2) exp(-b t / t_2), with t from the arrival (equation 1).

    Attributes:
        peak: Peak overpressure p_2, Pa; or the unit of a fitted history.
        positive_duration_s: Duration t_2 of the positive phase.
        decay: The wave parameter b, dimensionless; 0 is a triangle.
        arrival_s: Arrival time of the shock.
    """

    peak: float
    positive_duration_s: float
    decay: float
    arrival_s: float = 0.0

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            BlastEnvError: If peak or duration is not above 0, decay or arrival is below 0, or any
                value is not a finite number.
        """
        for name in ("peak", "positive_duration_s"):
            checked_array(name, getattr(self, name), above=0.0, dimensions=0)
        for name in ("decay", "arrival_s"):
            checked_array(name, getattr(self, name), least=0.0, dimensions=0)

    @classmethod
    def from_impulse(
        cls, peak: float, positive_duration_s: float, impulse: float, arrival_s: float = 0.0
    ) -> "Friedlander":
        """Return the waveform with a given peak, duration and impulse.

        A decaying waveform has an impulse below that of the triangle, peak * duration / 2. For
        larger impulses there is no decay coefficient of at least 0. The waveform is then the
        triangle with this peak and this impulse, so that equation (2) still holds, and its duration
        is 2 impulse / peak, as of UFC 3-340-02's equivalent triangle; see `is_triangular`.

        Args:
            peak: Peak overpressure, Pa.
            positive_duration_s: Duration of the positive phase.
            impulse: Impulse of the positive phase, Pa*s.
            arrival_s: Arrival time of the shock.

        Raises:
            BlastEnvError: If a number is not finite or out of bounds, or the impulse is so far
                below that of the triangle that the decay coefficient is not a finite number.
        """
        for name, value in (
            ("peak", peak),
            ("positive_duration_s", positive_duration_s),
            ("impulse", impulse),
        ):
            checked_array(name, value, above=0.0, dimensions=0)
        # Equation 2 gives the decay; from half of the rectangle on only the triangle has so much.
        share = impulse / peak / positive_duration_s
        if share >= 0.5:
            return cls(peak, 2.0 * impulse / peak, 0.0, arrival_s)
        if share == 0.0 or not isfinite(1.0 / share):
            raise BlastEnvError(
                f"impulse is {impulse:g}, which is too small a share of peak * duration, "
                f"{peak:g} * {positive_duration_s:g}, for a Friedlander waveform"
            )
        return cls(peak, positive_duration_s, _solve_decay(share), arrival_s)

    @property
    def is_triangular(self) -> bool:
        """Whether the waveform is the triangular limit."""
        return self.decay == 0.0

    @overload
    def pressure(self, time_s: float) -> float: ...

    @overload
    def pressure(self, time_s: Numbers) -> FloatArray: ...

    def pressure(self, time_s: float | Numbers) -> float | FloatArray:
        """Return the overpressure of the positive phase, unit of `peak`; 0 before and after it.

        Args:
            time_s: Times, from the detonation.

        Raises:
            BlastEnvError: If a time is not a finite number.
        """
        x = (checked_array("time_s", time_s) - self.arrival_s) / self.positive_duration_s
        inside = np.clip(x, 0.0, 1.0)
        wave = self.peak * (1.0 - inside) * np.exp(-self.decay * inside)
        value = np.where(x >= 0.0, wave, 0.0)
        return float(value) if value.ndim == 0 else value

    def impulse(self) -> float:
        """Return the impulse of the positive phase (equation 2), unit of `peak` times s."""
        return float(self.peak * self.positive_duration_s * _impulse_share(self.decay))

    @overload
    def impulse_until(self, time_s: float) -> float: ...

    @overload
    def impulse_until(self, time_s: Numbers) -> FloatArray: ...

    def impulse_until(self, time_s: float | Numbers) -> float | FloatArray:
        """Return the impulse until each time, unit of `peak` times s.

        Args:
            time_s: Times, from the detonation.

        Raises:
            BlastEnvError: If a time is not a finite number.
        """
        x = (checked_array("time_s", time_s) - self.arrival_s) / self.positive_duration_s
        share = impulse_share_until(np.clip(x, 0.0, 1.0), self.decay)
        value = self.peak * self.positive_duration_s * share
        return float(value) if value.ndim == 0 else value


def impulse_share_until(x: FloatArray, decay: float | FloatArray) -> FloatArray:
    """Return the integral of (1 - s) exp(-b s) from 0 to x.

    Args:
        x: Times since the arrival in positive durations, 0 to 1.
        decay: The coefficient b, at least 0; broadcast against `x`.
    """
    z = np.asarray(decay * x)
    # (1 - s) = (1 - x) + (x - s); the second part is a complete wave of shorter duration.
    level = np.ones_like(z)
    np.divide(-np.expm1(-z), z, out=level, where=z > 0.0)
    share: FloatArray = x * ((1.0 - x) * level + x * _impulse_share(z))
    return share


def _impulse_share(decay: float | FloatArray) -> FloatArray:
    """Return (b - 1 + exp(-b)) / b^2, the integral of (1 - x) exp(-b x) from 0 to 1."""
    b = np.asarray(decay, dtype=np.float64)
    # The closed form cancels for small b, where the series takes its place.
    large = np.maximum(b, _SERIES_BELOW)
    closed = (large + np.expm1(-large)) / large / large
    series = np.polynomial.polynomial.polyval(np.minimum(b, _SERIES_BELOW), _SERIES)
    share: FloatArray = np.where(b < _SERIES_BELOW, series, closed)
    return share


def _solve_decay(share: float) -> float:
    """Return the b > 0 with `_impulse_share(b) == share`, for a share between 0 and 1/2.

    The share decreases with b and lies between 1 / (b + 2) and 1 / b, which bounds b to an interval
    of width 2.
    """
    low, high = max(1.0 / share - 2.0, 0.0), 1.0 / share
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        if _impulse_share(middle) > share:
            low = middle
        else:
            high = middle
    return (low + high) / 2.0
