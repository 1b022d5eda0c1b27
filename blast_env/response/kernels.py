"""Compiled loops of the response, in a separate module because Numba takes 0.5 s to import.

The deflections use the leapfrog method, with positions at the ends of steps and speeds at their
middles; each step has the exact impulse of the history.
"""

from typing import Final

import numpy as np
from numba import njit

from blast_env.arrays import FloatArray

_MOST_TIMES: Final = 50
"""Limit of the number of steps, in multiples of those for the load and one period."""


@njit(cache=True)
def end_of_segment(points: FloatArray, at: float, begin: int) -> int:
    """Return the index of the end of a polyline's segment at a place, searched from `begin`."""
    upper = begin
    while upper < len(points) - 1 and points[upper] < at:
        upper += 1
    while upper > 1 and points[upper - 1] >= at:
        upper -= 1
    return upper


@njit(cache=True)
def straight(points: FloatArray, values: FloatArray, at: float, upper: int) -> float:
    """Return the value at a place on the line through a polyline's segment that ends at `upper`."""
    slope = (values[upper] - values[upper - 1]) / (points[upper] - points[upper - 1])
    value: float = values[upper - 1] + slope * (at - points[upper - 1])
    return value


@njit(cache=True)
def polyline(points: FloatArray, values: FloatArray, at: float) -> float:
    """Return a polyline's value, as an odd function, extrapolated linearly beyond its end."""
    size = abs(at)
    value = straight(points, values, size, end_of_segment(points, size, 1))
    return value if at >= 0.0 else -value


@njit(cache=True)
def impulse_until(
    time_s: FloatArray, pressure_pa: FloatArray, impulse_pa_s: FloatArray, begin: int, at_s: float
) -> tuple[float, int]:
    """Return the impulse of a history until a time, and the index of the history's segment.

    `impulse_pa_s` is the impulse until each point of the history, so that a load shorter than a
    step has its exact impulse.
    """
    if at_s <= time_s[0]:
        return 0.0, begin
    if at_s >= time_s[-1]:
        return impulse_pa_s[-1], begin
    place = begin
    while time_s[place + 1] < at_s:
        place += 1
    gone_s = at_s - time_s[place]
    slope = (pressure_pa[place + 1] - pressure_pa[place]) / (time_s[place + 1] - time_s[place])
    return impulse_pa_s[place] + gone_s * (pressure_pa[place] + 0.5 * slope * gone_s), place


@njit(cache=True)
def integrate(
    mass: float,
    points: FloatArray,
    values: FloatArray,
    cap: float,
    growth_points: FloatArray,
    growth: FloatArray,
    rebound_cap: float,
    crack: float,
    cracked_points: FloatArray,
    cracked_values: FloatArray,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    impulse_pa_s: FloatArray,
    step_s: float,
    least_steps: int,
    out: FloatArray,
) -> None:
    """Integrate one system until it rebounds; write the fields of `Responses` to `out`.

    Ends at the first step after `least_steps` at which the system moves back towards 0.
    """
    x, offset, is_cracked = 0.0, 0.0, 0.0
    largest, resistance = 0.0, 0.0
    pushed, place = impulse_until(time_s, pressure_pa, impulse_pa_s, 0, time_s[0] + 0.5 * step_s)
    v = pushed / mass
    for step in range(1, _MOST_TIMES * least_steps):
        x += step_s * v
        if abs(x) > crack:
            is_cracked = 1.0
        if is_cracked:
            resistance = polyline(cracked_points, cracked_values, x)
        else:
            resistance = polyline(points, values, x - offset)
            grown = polyline(growth_points, growth, abs(x))
            if resistance > cap * grown:
                offset += (resistance - cap * grown) / (values[1] / points[1])
                resistance = cap * grown
            elif resistance < -rebound_cap * grown:
                offset += (resistance + rebound_cap * grown) / (values[1] / points[1])
                resistance = -rebound_cap * grown
        now_s = time_s[0] + step * step_s
        until, place = impulse_until(time_s, pressure_pa, impulse_pa_s, place, now_s + 0.5 * step_s)
        v += (until - pushed - step_s * resistance) / mass
        pushed = until
        largest = max(largest, resistance)
        if x > out[0]:
            out[0], out[2] = x, now_s
        out[1] = min(out[1], x)
        if step >= least_steps and v * x <= 0.0:
            break
    out[3], out[4], out[5] = largest, offset, is_cracked


@njit(cache=True)
def bend(
    mass: float,
    points: FloatArray,
    values: FloatArray,
    slopes: FloatArray,
    log_points: FloatArray,
    log_rate: FloatArray,
    log_slopes: FloatArray,
    exponent: float,
    time_s: FloatArray,
    pressure_pa: FloatArray,
    impulse_pa_s: FloatArray,
    step_s: float,
    steps: int,
    strength: float,
    out: FloatArray,
) -> None:
    """Integrate the bending of an unbroken pane, and find its breakage.

    Writes to `out` the largest deflection and the share of panes that break, then the time, the
    deflection, the speed and the largest impulse still to come at breakage. Slopes are those of the
    segments before the points; the damage to the power `exponent` is the risk B. The pane breaks at
    the risk `strength`; if that is 0, as the median of the panes that break.
    """
    x, damage, peak = 0.0, 0.0, 0.0
    pushed, place = impulse_until(time_s, pressure_pa, impulse_pa_s, 0, time_s[0] + 0.5 * step_s)
    v = pushed / mass
    track, per_step = np.empty((3, steps)), step_s / 60.0
    bent, worn = 1, 1  # segments of the two polylines, which change little between steps
    for step in range(steps):
        x += step_s * v
        at_s = time_s[0] + (step + 1) * step_s
        now, place = impulse_until(time_s, pressure_pa, impulse_pa_s, place, at_s + 0.5 * step_s)
        bent = end_of_segment(points, abs(x), bent)
        resistance = values[bent] + slopes[bent] * (abs(x) - points[bent])
        if x < 0.0:
            resistance = -resistance
        v += (now - pushed - step_s * resistance) / mass
        pushed = now
        peak = max(peak, x)
        if x != 0.0:
            log_x = np.log(abs(x))
            worn = end_of_segment(log_points, log_x, worn)
            rate = log_rate[worn] + log_slopes[worn] * (log_x - log_points[worn])
            damage += per_step * np.exp(rate)
        track[0, step], track[1, step], track[2, step] = damage, x, v
    share = -np.expm1(-(damage**exponent))
    risk = strength if strength > 0.0 else -np.log1p(-0.5 * share)
    broken = min(np.searchsorted(track[0], risk ** (1.0 / exponent)), steps - 1)
    break_s = time_s[0] + (broken + 1) * step_s
    left = 0.0
    if break_s < time_s[-1]:
        after = np.searchsorted(time_s, break_s, side="right")
        gone = (break_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1])
        there = pressure_pa[after - 1] + gone * (pressure_pa[after] - pressure_pa[after - 1])
        come = 0.5 * (there + pressure_pa[after]) * (time_s[after] - break_s)
        left = max(come, 0.0)
        for upper in range(after + 1, len(time_s)):
            rest = pressure_pa[upper - 1] + pressure_pa[upper]
            come += 0.5 * rest * (time_s[upper] - time_s[upper - 1])
            left = max(left, come)
    out[0], out[1], out[2] = peak, share, break_s
    out[3], out[4], out[5] = track[1, broken], track[2, broken], left


@njit(cache=True)
def slide(force: FloatArray, mass: float, friction: float, step_s: float) -> float:
    """Return the largest sliding displacement; force, mass and friction are per metre of length."""
    x, v, most = 0.0, 0.0, 0.0
    for push in force:
        if v == 0.0:
            net = max(abs(push) - friction, 0.0) * (1.0 if push >= 0.0 else -1.0)
        else:
            net = push - friction * (1.0 if v > 0.0 else -1.0)
        new_v = v + net / mass * step_s
        if v != 0.0 and new_v * v < 0.0:
            new_v = 0.0  # friction stops it, but does not reverse it
        x += 0.5 * (v + new_v) * step_s
        v = new_v
        most = max(most, abs(x))
    return most


@njit(cache=True)
def rock(
    force: FloatArray, mass: float, height: float, base: float, step_s: float
) -> tuple[float, float]:
    """Return the largest tilt over the tilt of overturning, and the time of overturning in s.

    The time counts from the first step and is infinite if the piece does not overturn.
    """
    inertia = mass * (height * height + base * base) / 3.0
    limit = np.arctan(base / height)
    angle, speed, most = 0.0, 0.0, 0.0
    for step, push in enumerate(force):
        side = 1.0 if angle > 0.0 or (angle == 0.0 and push >= 0.0) else -1.0
        size = abs(angle)
        weight = 0.5 * mass * 9.81 * (base * np.cos(size) - height * np.sin(size))
        moment = 0.5 * height * push * np.cos(size) - side * weight
        if angle == 0.0 and side * moment <= 0.0:
            speed = 0.0
            continue
        speed += moment / inertia * step_s
        new_angle = angle + speed * step_s
        if angle != 0.0 and new_angle * angle < 0.0:
            new_angle, speed = 0.0, 0.0  # it lands on its base without bouncing
        angle = new_angle
        most = max(most, abs(angle))
        if most >= limit:
            return most / limit, step * step_s
    return most / limit, np.inf
