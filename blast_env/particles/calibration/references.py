"""References for simulated loads: the paper's table, Kingery & Bulmash, Friedlander."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from io import StringIO
from math import factorial, isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, get_args, overload

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.particles.calibration.laws import Numbers, checked_array
from blast_env.tables import Column

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

Quantity = Literal[
    "incident_overpressure",
    "reflected_overpressure",
    "incident_impulse",
    "reflected_impulse",
    "arrival_time",
    "positive_duration",
    "shock_speed",
]
"""A quantity of `kingery_bulmash`."""

Burst = Literal["hemispherical", "spherical"]
"""Hemispherical: the charge lies on rigid ground. Spherical: far from any surface."""

CURVES_SCALED_M: Final = (0.0674, 40.0)
"""Range of scaled distances, m/kg^(1/3), of the peaks and impulses of both bursts."""

SURFACE_BURST_SCALED_M: Final = 0.4
"""Scaled height of a charge, m/kg^(1/3), below which `burst_of` counts it as on the ground."""

PAPER_UFC_LABEL: Final = "the paper's UFC column"
"""Required name of its i_ufc, which matches no curve of UFC 3-340-02 at all distances."""

PAPER_COLUMNS: Final = (
    Column("r_m", "m", "distance R"),
    Column("i_ufc_psi_s", "psi*s", "impulse i_ufc that the paper ascribes to UFC 3-340-02"),
    Column("i_sim", "sim", "impulse i_sim of the paper's simulation"),
    Column("t1_scaled", "psi*s", "Table 1, proportional law: i_scaled as printed"),
    Column("t1_abs", "psi*s", "Table 1: E_abs as printed"),
    Column("t1_pct", "%", "Table 1: E% as printed"),
    Column("t2_scaled", "psi*s", "Table 2, linear law: i_scaled as printed"),
    Column("t2_abs", "psi*s", "Table 2: E_abs as printed"),
    Column("t2_pct", "%", "Table 2: E% as printed"),
    Column("t3_scaled", "psi*s", "Table 3, power law: i_scaled as printed"),
    Column("t3_abs", "psi*s", "Table 3: E_abs as printed"),
    Column("t3_pct", "%", "Table 3: E% as printed"),
)
"""The columns of `paper_table`."""

# A unit of the data file: its factor to SI, and whether W^(1/3) scales the value.
_TO_SI: Final[Mapping[str, tuple[float, bool]]] = MappingProxyType(
    {
        "kPa": (1e3, False),
        "kPa*ms/kg^(1/3)": (1.0, True),
        "ms/kg^(1/3)": (1e-3, True),
        "m/ms": (1e3, False),
    }
)

_BURST_KEYS: Final[Mapping[str, str]] = MappingProxyType(
    {"hemispherical": "hemispherical_surface_burst", "spherical": "spherical_free_air_burst"}
)

_ROUNDING: Final = 1e-9  # relative; of R / W^(1/3) at an end of the range


@dataclass(frozen=True)
class _Segment:
    """log10 Y = sum c[k] U^k, U = a + b log10 Z, for z_min <= Z < z_max."""

    z_min: float
    z_max: float
    a: float
    b: float
    c: tuple[float, ...]


@dataclass(frozen=True)
class _Curve:
    """One quantity over the scaled distance Z, m/kg^(1/3), in ascending segments."""

    factor_to_si: float
    scales_with_charge: bool
    segments: tuple[_Segment, ...]

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest Z."""
        return self.segments[0].z_min, self.segments[-1].z_max

    def at(self, z: FloatArray) -> FloatArray:
        """Return the scaled quantity, SI, at scaled distances within the range."""
        joints = [segment.z_min for segment in self.segments[1:]]
        which = np.searchsorted(joints, z, side="right")
        value = np.empty_like(z)
        for index, segment in enumerate(self.segments):
            own = which == index
            u = segment.a + segment.b * np.log10(z[own])
            value[own] = 10.0 ** np.polynomial.polynomial.polyval(u, segment.c)
        return self.factor_to_si * value


def paper_table() -> "pd.DataFrame":
    """Return Tables 1 to 3 of the paper, one row per distance; see `PAPER_COLUMNS`.

    Every call returns a new frame.
    """
    import pandas as pd

    return pd.read_csv(StringIO(_read("paper_tables.csv")), dtype=np.float64)


def paper_ufc_column() -> "pd.Series":
    """Return the paper's UFC column, psi*s, by the distance in metres.

    The paper ascribes it to UFC 3-340-02, but it differs from the standard: at 30 to 120 m it is
    within 8 % of Kingery and Bulmash's incident impulse of about 10 t TNT on the ground, at 15 m
    1.9 times as large. For the standard's curves use `kingery_bulmash`.
    """
    import pandas as pd

    table = paper_table()
    index = pd.Index(table["r_m"], name="distance_m")
    return pd.Series(table["i_ufc_psi_s"].to_numpy(), index=index, name=PAPER_UFC_LABEL)


@overload
def kingery_bulmash(
    quantity: Quantity, distance_m: float, charge_kg: float, burst: Burst = ...
) -> float: ...


@overload
def kingery_bulmash(
    quantity: Quantity, distance_m: Numbers, charge_kg: float | Numbers, burst: Burst = ...
) -> FloatArray: ...


@overload
def kingery_bulmash(
    quantity: Quantity, distance_m: float, charge_kg: Numbers, burst: Burst = ...
) -> FloatArray: ...


def kingery_bulmash(
    quantity: Quantity,
    distance_m: float | Numbers,
    charge_kg: float | Numbers,
    burst: Burst = "hemispherical",
) -> float | FloatArray:
    """Return an airblast parameter of TNT at sea level (Kingery & Bulmash 1984), SI units.

    Hopkinson-Cranz scaling: the curves hold over Z = R / W^(1/3), and impulses and times grow
    with W^(1/3). Distance and mass are broadcast against each other.

    Args:
        quantity: The parameter: overpressures in Pa, impulses in Pa*s, times in s, the shock speed
            in m/s. Reflected values are for normal incidence on an infinite rigid wall.
        distance_m: Distance R from the charge, above 0.
        charge_kg: TNT-equivalent mass W, above 0.
        burst: `"hemispherical"`, a charge on rigid ground, or `"spherical"`, in free air.

    Raises:
        UnknownNameError: If there is no such quantity or burst; the message suggests the nearest.
        BlastEnvError: If a number is not above 0, if distance and mass cannot be broadcast, or if
            Z is outside the range of the curve; the message gives Z and the range.
    """
    if quantity not in get_args(Quantity):
        raise UnknownNameError("quantity", quantity, get_args(Quantity))
    if burst not in get_args(Burst):
        raise UnknownNameError("burst", burst, get_args(Burst))
    curve = _curves()[burst, quantity]
    charge = checked_array("charge_kg", charge_kg, above=0.0)
    z = scaled_distance(distance_m, charge_kg)
    low, high = curve.range
    bad = (z < low * (1.0 - _ROUNDING)) | (z > high * (1.0 + _ROUNDING))
    if bad.any():
        index = tuple(np.argwhere(bad)[0].tolist())
        place = f" at [{', '.join(map(str, index))}]" if index else ""
        raise BlastEnvError(
            f"scaled distance Z{place} is {z[index]:.6g} m/kg^(1/3), must be {low:g} to {high:g}: "
            f"the range of Kingery and Bulmash's {burst} {quantity}"
        )
    value = curve.at(np.clip(z, low, high))
    if curve.scales_with_charge:
        value = value * np.cbrt(charge)
    return float(value) if value.ndim == 0 else value


def burst_of(height_m: float, charge_kg: float) -> Burst:
    """Return the type of burst whose curves apply to a charge over rigid ground.

    UFC 3-340-02 (formerly TM 5-1300), chapter 2, divides unconfined explosions into free-air, air
    and surface bursts. On or very near the ground the reflected wave merges with the incident one
    at once, which is a surface burst. The charts of air bursts, those of the triple point, begin at
    a scaled height of 1 ft/lb^(1/3), 0.4 m/kg^(1/3): lower charges are surface bursts.

    Args:
        height_m: Height of the charge's centre above the ground.
        charge_kg: TNT-equivalent mass, above 0.
    """
    low = height_m < SURFACE_BURST_SCALED_M * np.cbrt(charge_kg)
    return "hemispherical" if low else "spherical"


def oblique(reflected: FloatArray, incident: FloatArray, cosine: FloatArray) -> FloatArray:
    """Return a peak or an impulse on a wall by the angle of incidence, in the unit of the curves.

    I_r cos^2 + I_i (1 + cos - 2 cos^2), from the incident value at grazing incidence to the
    normally reflected one. This is the rule of the CONWEP loads in DYNA3D (Randers-Pehrson &
    Bannister, ARL-TR-1310, 1997). A wall that faces away has the incident value.

    Args:
        reflected: The value at normal incidence.
        incident: The value side-on.
        cosine: Cosine of the angle between the wall's normal and the way to the charge.
    """
    facing = np.clip(cosine, 0.0, 1.0)
    value: FloatArray = reflected * facing**2 + incident * (1.0 + facing - 2.0 * facing**2)
    return value


def within_curves(
    quantity: Quantity, distance_m: FloatArray, charge_kg: float | FloatArray, burst: Burst
) -> FloatArray:
    """Return `kingery_bulmash`, outside `CURVES_SCALED_M` with the value at the nearer end."""
    low_m, high_m = (scaled * np.cbrt(charge_kg) for scaled in CURVES_SCALED_M)
    return kingery_bulmash(quantity, np.clip(distance_m, low_m, high_m), charge_kg, burst)


def in_the_open(
    quantity: Literal["overpressure", "impulse"],
    distance_m: FloatArray,
    cosine: FloatArray,
    seen: BoolArray,
    charge_kg: float,
    burst: Burst,
) -> FloatArray:
    """Return peaks or impulses on walls without obstacles, Pa or Pa s.

    In sight of the charge they go by the angle of incidence (`oblique`); elsewhere they are those
    of the incident wave at the same distance.

    Args:
        quantity: Peaks or impulses.
        distance_m: Distances from the charge.
        cosine: As for `oblique`.
        seen: Whether the charge sees the place.
        charge_kg: TNT-equivalent mass, above 0.
        burst: As for `kingery_bulmash`.
    """
    names: tuple[Quantity, Quantity] = ("reflected_impulse", "incident_impulse")
    if quantity == "overpressure":
        names = "reflected_overpressure", "incident_overpressure"
    reflected, incident = (within_curves(each, distance_m, charge_kg, burst) for each in names)
    return np.where(seen, oblique(reflected, incident, cosine), incident)


def largest_reflected_peak_pa(distance_m: FloatArray, charge_kg: float) -> FloatArray:
    """Return the reflected peak at normal incidence in the open, for a hemispherical burst, Pa.

    The hemispherical burst has the larger peaks. Outside the range of the curve, the value at its
    end is used, which is too high at larger and too low at smaller distances; see
    `CURVES_SCALED_M`.

    Args:
        distance_m: Distances from the charge, above 0.
        charge_kg: TNT-equivalent mass, above 0.
    """
    return within_curves("reflected_overpressure", distance_m, charge_kg, "hemispherical")


def scaled_distance(distance_m: float | Numbers, charge_kg: float | Numbers) -> FloatArray:
    """Return Z = R / W^(1/3), m/kg^(1/3) (Hopkinson-Cranz).

    Args:
        distance_m: Distance R, above 0.
        charge_kg: TNT-equivalent mass W, above 0.

    Raises:
        BlastEnvError: If a number is not above 0, or if the shapes cannot be broadcast.
    """
    distance = checked_array("distance_m", distance_m, above=0.0)
    charge = checked_array("charge_kg", charge_kg, above=0.0)
    try:
        np.broadcast_shapes(distance.shape, charge.shape)
    except ValueError as error:
        raise BlastEnvError(
            f"distance_m has the shape {distance.shape} and charge_kg {charge.shape}, "
            "must be broadcastable"
        ) from error
    return np.asarray(distance / np.cbrt(charge))


@cache
def _curves() -> Mapping[tuple[str, str], _Curve]:
    """Return all curves by burst and quantity."""
    document = json.loads(_read("kingery_bulmash.json"))
    curves = {}
    for burst, key in _BURST_KEYS.items():
        for quantity, entry in document[key].items():
            segments = tuple(
                _Segment(**(segment | {"c": tuple(segment["c"])})) for segment in entry["segments"]
            )
            curves[burst, quantity] = _Curve(*_TO_SI[entry["unit"]], segments)
    return MappingProxyType(curves)


def _read(name: str) -> str:
    """Return the text of a file of the package's data."""
    return (files("blast_env.particles.calibration") / "data" / name).read_text(encoding="utf-8")


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
