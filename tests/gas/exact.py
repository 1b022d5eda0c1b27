"""Exact solutions of the Euler equations to hold the gas against."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

GAMMA = 1.4
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """Density, velocity, pressure."""

    r: float
    u: float
    p: float

    @property
    def sound(self) -> float:
        return sqrt(GAMMA * self.p / self.r)


def riemann(left: State, right: State, speeds: Floats) -> tuple[Floats, Floats, Floats]:
    """Return density, velocity and pressure on the rays x / t of a Riemann problem."""

    def change(p: float, side: State) -> float:
        """Change of velocity across the wave from a side to pressure p."""
        if p > side.p:
            a = 2.0 / ((GAMMA + 1.0) * side.r)
            b = (GAMMA - 1.0) / (GAMMA + 1.0) * side.p
            return (p - side.p) * sqrt(a / (p + b))
        ratio = (p / side.p) ** ((GAMMA - 1.0) / (2.0 * GAMMA))
        return 2.0 * side.sound / (GAMMA - 1.0) * (ratio - 1.0)

    def miss(p: float) -> float:
        return change(p, left) + change(p, right) + right.u - left.u

    p = float(brentq(miss, 1e-12, 1e3 * (left.p + right.p)))
    u = left.u + 0.5 * (right.u - left.u + change(p, right) - change(p, left))
    r, v, q = (np.empty_like(speeds) for _ in range(3))
    for k, speed in enumerate(speeds):
        on_left = speed < u
        side, sign = (left, -1.0) if on_left else (right, 1.0)
        # Mirrored, so that the wave runs to the right.
        ray, own, middle = sign * speed, sign * side.u, sign * u
        if p > side.p:
            front = own + side.sound * sqrt(
                (GAMMA + 1.0) / (2.0 * GAMMA) * p / side.p + (GAMMA - 1.0) / (2.0 * GAMMA)
            )
            share = (GAMMA - 1.0) / (GAMMA + 1.0)
            behind = side.r * (p / side.p + share) / (share * p / side.p + 1.0)
            values = (behind, middle, p) if ray < front else (side.r, own, side.p)
        else:
            behind = side.r * (p / side.p) ** (1.0 / GAMMA)
            head, tail = own + side.sound, middle + sqrt(GAMMA * p / behind)
            if ray >= head:
                values = (side.r, own, side.p)
            elif ray <= tail:
                values = (behind, middle, p)
            else:
                c = 2.0 / (GAMMA + 1.0) * (side.sound + (GAMMA - 1.0) / 2.0 * (ray - own))
                inside = side.r * (c / side.sound) ** (2.0 / (GAMMA - 1.0))
                values = (inside, ray - c, side.p * (c / side.sound) ** (2 * GAMMA / (GAMMA - 1)))
        r[k], v[k], q[k] = values[0], sign * values[1], values[2]
    return r, v, q


def behind_shock(ahead: State, mach: float) -> State:
    """Return the state behind a shock that runs to the right into gas at rest."""
    m2 = mach * mach
    return State(
        r=ahead.r * (GAMMA + 1.0) * m2 / ((GAMMA - 1.0) * m2 + 2.0),
        u=2.0 * ahead.sound / (GAMMA + 1.0) * (mach - 1.0 / mach),
        p=ahead.p * (1.0 + 2.0 * GAMMA / (GAMMA + 1.0) * (m2 - 1.0)),
    )


def reflected_pressure(ahead: float, incident: float) -> float:
    """Return the pressure behind the reflection of a shock from a rigid wall."""
    ratio = incident / ahead
    return (
        incident
        * ((3.0 * GAMMA - 1.0) * ratio - (GAMMA - 1.0))
        / ((GAMMA - 1.0) * ratio + (GAMMA + 1.0))
    )


def sedov_energy(dimensions: int) -> float:
    """Return E t^2 / (density R^(n + 2)) of a point, line or plane explosion.

    By integrating the equations of similarity inwards from the strong shock.
    """
    n = dimensions
    power = 2.0 / (n + 2.0)
    decay = (power - 1.0) / power

    def slopes(x: float, values: Floats) -> Floats:
        u, g, p = values
        rows = [[g, u - x, 0.0], [u - x, 0.0, 1.0 / g], [0.0, -GAMMA * (u - x) / g, (u - x) / p]]
        rest = [-(n - 1) * g * u / x, -decay * u, -2.0 * decay]
        return np.asarray(np.linalg.solve(rows, rest))

    start = [2.0 / (GAMMA + 1.0), (GAMMA + 1.0) / (GAMMA - 1.0), 2.0 / (GAMMA + 1.0)]
    solution = solve_ivp(slopes, (1.0, 0.02), start, dense_output=True, rtol=1e-8, atol=1e-12)

    inner = solution.sol
    assert inner is not None

    def energy(x: float) -> float:
        u, g, p = inner(x)
        return float((0.5 * g * u * u + p / (GAMMA - 1.0)) * x ** (n - 1))

    inside = inner(0.02)[2] / (GAMMA - 1.0) * 0.02**n / n
    area = {1: 2.0, 2: 2.0 * pi, 3: 4.0 * pi}[n]
    return float(area * power**2 * (quad(energy, 0.02, 1.0, limit=200)[0] + inside))


def simple_wave(still: State, start: Floats, x: Floats, time: float) -> Floats:
    """Return the velocity of a wave that runs to the right, from points and their velocities.

    Each point (the first column of `start`) carries its velocity (the second one) along at the sum
    of velocity and sound, as long as no shock has formed.
    """
    u = start[1]
    sound = still.sound + (GAMMA - 1.0) / 2.0 * u
    return np.interp(x, start[0] + (u + sound) * time, u)
