"""Peaks of a shock on a rigid wall by the angle of incidence, in air as an ideal gas.

Up to a limit, the incident shock and the reflected one meet on the wall (regular reflection): the
reflected shock turns the flow back along the wall, so both follow from the equations of oblique
shocks ("two-shock theory"; R. Courant & K. O. Friedrichs, Supersonic flow and shock waves, 1948,
part IV.B). Beyond it a third shock, the Mach stem, stands on the wall.

No theory gives its peak for spherical waves. It takes over from the last regular one, and falls to
that of the incident shock at grazing incidence: here with the square root of the angle that is left
to 90 degrees, which agrees with gas dynamics (`python -m studies.response peaks`).
"""

from functools import cache
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray

AMBIENT_PA: Final = 101_325.0
"""Pressure of still air at sea level."""

_NORMAL_RAD: Final = 0.1  # up to it, the peak is that of normal incidence within a hundredth
_LEAST_SHOCK: Final = 1e-3  # incident overpressure over the ambient pressure
_MOST_SHOCK: Final = 1e3
_BISECTIONS: Final = 40


def reflected_pa(incident_pa: FloatArray, cosine: FloatArray) -> FloatArray:
    """Return the peak overpressure on a wall by the angle of incidence, Pa.

    Args:
        incident_pa: Peak of the incident shock, above 0.
        cosine: Cosine of the angle between the wall's normal and the way to the charge; a wall
            that faces away has the incident peak.
    """
    shock, angle = np.broadcast_arrays(
        np.clip(np.asarray(incident_pa) / AMBIENT_PA, _LEAST_SHOCK, _MOST_SHOCK),
        np.arccos(np.clip(cosine, 0.0, 1.0)),
    )
    # (1) The angle at which the Mach stem begins; (2) the regular peak at the angle or, beyond, at
    # that limit; (3) from there to the incident peak with the square root of the angle that is
    # left.
    limit = _limit_rad(shock)
    regular = _regular(shock, np.minimum(angle, limit))
    left = np.clip((0.5 * np.pi - angle) / (0.5 * np.pi - limit), 0.0, 1.0)
    value: FloatArray = shock + np.sqrt(left) * (regular - shock)
    return value * AMBIENT_PA


def normally_reflected_pa(incident_pa: FloatArray) -> FloatArray:
    """Return the peak overpressure at normal incidence, Pa: 2 P (7 P_0 + 4 P) / (7 P_0 + P)."""
    incident = np.asarray(incident_pa, dtype=np.float64)
    value: FloatArray = 2.0 * incident * (7.0 * AMBIENT_PA + 4.0 * incident)
    return value / (7.0 * AMBIENT_PA + incident)


def _regular(shock: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the overpressure of a regular reflection over the ambient pressure; NaN without one.

    In the frame of the point at which the shocks meet, the flow runs along the wall:

    1. ahead of the incident shock its Mach number is m1 = ms / sin(angle), ms the shock's own;
    2. the shock turns it by theta towards the wall, behind it the Mach number is m2;
    3. the reflected shock turns it back by theta: its angle beta is the weak solution of the
       equation of oblique shocks, in closed form (G. Emanuel, Analytical fluid dynamics, 1994);
    4. the pressure behind it follows from m2 sin(beta).

    Beyond the angle at which the flow behind both shocks is as slow as sound (sonic criterion), the
    reflection is not regular: what happens behind it overtakes the point. Detachment, where no
    solution is left, is up to a degree later.
    """
    ahead = np.maximum(angle, _NORMAL_RAD)
    # 1. Rankine and Hugoniot for gamma = 1.4: ms^2 = 1 + 6/7 P / P_0; ahead of it the flow is at
    # rest.
    ms2 = 1.0 + 6.0 / 7.0 * shock
    m1_2 = ms2 / np.sin(ahead) ** 2
    # 2. The theta-beta-M relation of oblique shocks, with beta the angle of incidence.
    turn = 2.0 / np.tan(ahead) * (ms2 - 1.0) / (m1_2 * (1.4 + np.cos(2.0 * ahead)) + 2.0)
    theta = np.arctan(turn)
    # The Mach number behind a normal shock, over the sine of the angle that is left.
    m2_2 = (ms2 + 5.0) / (7.0 * ms2 - 1.0) / np.sin(ahead - theta) ** 2
    # 3. The weak solution for the same turn back; NaN where no attached shock turns the flow so
    # far.
    root, share = _weak_shock(m2_2, turn)
    with np.errstate(invalid="ignore"):
        cosine = np.cos((4.0 * np.pi + np.arccos(share)) / 3.0)
        beta = np.arctan((m2_2 - 1.0 + 2.0 * root * cosine) / (3.0 * (1.0 + 0.2 * m2_2) * turn))
    # 4. Normal-shock relations across the reflected shock.
    across = m2_2 * np.sin(beta) ** 2
    m3_2 = (across + 5.0) / (7.0 * across - 1.0) / np.sin(beta - theta) ** 2
    behind = 1.0 + 7.0 / 6.0 * (across - 1.0)
    # The sonic criterion: regular only while the flow behind both shocks is supersonic.
    return np.where(m3_2 >= 1.0, (1.0 + shock) * behind - 1.0, np.nan)


def _weak_shock(mach_2: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lambda and chi of Emanuel's solution; NaN where no attached shock turns so far."""
    a, b = 1.0 + 0.2 * mach_2, 1.0 + 1.2 * mach_2
    square = (mach_2 - 1.0) ** 2 - 3.0 * a * b * turn**2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(np.where((square > 0.0) & (mach_2 > 1.0), square, np.nan))
        share = (mach_2 - 1.0) ** 3 - 9.0 * a * (a + 0.6 * mach_2**2) * turn**2
        share = share / root**3
        share = np.where(np.abs(share) <= 1.0, share, np.nan)
    return root, share


def _limit_rad(shock: FloatArray) -> FloatArray:
    """Return the largest angle of regular reflection."""
    shocks, limits = _limits()
    return np.asarray(np.interp(np.log(shock), shocks, limits))


@cache
def _limits() -> tuple[FloatArray, FloatArray]:
    """Return logarithms of shocks, and the largest angles of regular reflection, by bisection."""
    shocks = np.geomspace(_LEAST_SHOCK, _MOST_SHOCK, 400)
    low, high = np.full_like(shocks, 0.5), np.full_like(shocks, 0.5 * np.pi - 1e-6)
    # Below the limit the reflection is regular and above it is not: the sign of the bisection.
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        is_regular = np.isfinite(_regular(shocks, middle))
        low, high = np.where(is_regular, middle, low), np.where(is_regular, high, middle)
    return np.log(shocks), low - 2e-5  # within, between the points of the table too
