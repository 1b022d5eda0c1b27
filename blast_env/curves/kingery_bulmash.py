"""Peaks, impulses and times of a blast wave in the open by Kingery & Bulmash, and by angle."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Final, Literal, get_args, overload

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.values import Numbers, checked_array

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
        # log10 of the quantity is a polynomial in u = a + b log10 Z, segment by segment (Kingery &
        # Bulmash 1984).
        joints = [segment.z_min for segment in self.segments[1:]]
        which = np.searchsorted(joints, z, side="right")
        value = np.empty_like(z)
        for index, segment in enumerate(self.segments):
            own = which == index
            u = segment.a + segment.b * np.log10(z[own])
            value[own] = 10.0 ** np.polynomial.polynomial.polyval(u, segment.c)
        return self.factor_to_si * value


def curve_polynomial(quantity: Quantity) -> tuple[float, float, FloatArray, float]:
    """Return a, b, c and the factor to SI of a hemispherical curve of one segment, for other code.

    The quantity is the factor times 10^(sum c[k] u^k), u = a + b log10 Z, Z of `CURVES_SCALED_M`.
    """
    curve = _curves()["hemispherical", quantity]
    (segment,) = curve.segments
    return segment.a, segment.b, np.array(segment.c), curve.factor_to_si


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
    # A Z beyond an end by rounding alone is taken as the end.
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
    """Return an impulse on a wall by the angle of incidence, in the unit of the curves.

    I_r cos^2 + I_i (1 + cos - 2 cos^2), from the incident value at grazing incidence to the
    normally reflected one. This is the rule of the CONWEP loads in DYNA3D (Randers-Pehrson &
    Bannister, ARL-TR-1310, 1997). A wall that faces away has the incident value. Peaks at 40 to 60
    degrees are 16 to 32 % larger than by this rule; see `blast_env.curves.reflection`.

    Args:
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
    document = json.loads(
        (files("blast_env.curves") / "data" / "kingery_bulmash.json").read_text(encoding="utf-8")
    )
    curves = {}
    for burst, key in _BURST_KEYS.items():
        for quantity, entry in document[key].items():
            segments = tuple(
                _Segment(**(segment | {"c": tuple(segment["c"])})) for segment in entry["segments"]
            )
            curves[burst, quantity] = _Curve(*_TO_SI[entry["unit"]], segments)
    return MappingProxyType(curves)
