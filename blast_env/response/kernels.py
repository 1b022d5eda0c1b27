"""Compiled loops of the response, in a separate module because Numba takes 0.5 s to import.

The deflections use the leapfrog method, with positions at the ends of steps and speeds at their
middles; each step has the exact impulse of the history.
"""

from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.compilation import compiled

_STRONGEST: Final = -np.log(0.01)
"""The risk B at which 99 of 100 panes have broken."""

_MOST_TIMES: Final = 50
"""Limit of the number of steps, in multiples of those for the load and one period."""


@compiled()
def end_of_segment(points: FloatArray, at: float, begin: int) -> int:
    """Return the index of the end of a polyline's segment at a place, searched from `begin`."""
    # Neighbouring steps lie on the same or the next segment: a walk from the last one is shorter
    # than a bisection.
    upper = begin
    while upper < len(points) - 1 and points[upper] < at:
        upper += 1
    while upper > 1 and points[upper - 1] >= at:
        upper -= 1
    return upper


@compiled()
def straight(points: FloatArray, values: FloatArray, at: float, upper: int) -> float:
    """Return the value at a place on the line through a polyline's segment that ends at `upper`."""
    slope = (values[upper] - values[upper - 1]) / (points[upper] - points[upper - 1])
    value: float = values[upper - 1] + slope * (at - points[upper - 1])
    return value


@compiled()
def polyline(points: FloatArray, values: FloatArray, at: float) -> float:
    """Return a polyline's value, as an odd function, extrapolated linearly beyond its end."""
    size = abs(at)
    value = straight(points, values, size, end_of_segment(points, size, 1))
    return value if at >= 0.0 else -value


@compiled()
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
    # I(t) = I_k + p_k s + slope s^2 / 2, with s the time since point k.
    gone_s = at_s - time_s[place]
    slope = (pressure_pa[place + 1] - pressure_pa[place]) / (time_s[place + 1] - time_s[place])
    return impulse_pa_s[place] + gone_s * (pressure_pa[place] + 0.5 * slope * gone_s), place


@compiled()
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

    Ends at the first step after `least_steps` at which the system moves back towards 0. A step n of
    m x'' + r(x) = p(t), with speeds at the middles of steps and I the impulse of the load:

    1. x_n = x_(n-1) + dt v_(n-1/2);
    2. r(x_n): on the second polyline after cracking; else on the first one from the plastic
       deflection on, which grows as far as r exceeds the yield resistance;
    3. v_(n+1/2) = v_(n-1/2) + (I(t_n + dt / 2) - I(t_n - dt / 2) - dt r) / m;
    4. the extremes, and the end.
    """
    # Leapfrog: the first speed is that at the middle of the first step, from the impulse until
    # then.
    x, offset, is_cracked = 0.0, 0.0, 0.0
    largest, resistance = 0.0, 0.0
    pushed, place = impulse_until(time_s, pressure_pa, impulse_pa_s, 0, time_s[0] + 0.5 * step_s)
    v = pushed / mass
    for step in range(1, _MOST_TIMES * least_steps):
        x += step_s * v  # 1.
        # 2. The resistance.
        if abs(x) > crack:
            is_cracked = 1.0
        if is_cracked:
            resistance = polyline(cracked_points, cracked_values, x)
        else:
            resistance = polyline(points, values, x - offset)
            grown = polyline(growth_points, growth, abs(x))
            if resistance > cap * grown:
                # The plastic deflection grows by what exceeds the yield resistance over the first
                # slope, so that unloading is parallel to it.
                offset += (resistance - cap * grown) / (values[1] / points[1])
                resistance = cap * grown
            elif resistance < -rebound_cap * grown:
                offset += (resistance + rebound_cap * grown) / (values[1] / points[1])
                resistance = -rebound_cap * grown
        now_s = time_s[0] + step * step_s
        until, place = impulse_until(time_s, pressure_pa, impulse_pa_s, place, now_s + 0.5 * step_s)
        v += (until - pushed - step_s * resistance) / mass  # 3.
        pushed = until
        # 4. The extremes, and the end.
        largest = max(largest, resistance)
        if x > out[0]:
            out[0], out[2] = x, now_s
        out[1] = min(out[1], x)
        if step >= least_steps and v * x <= 0.0:
            break
    out[3], out[4], out[5] = largest, offset, is_cracked


@compiled()
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
    deflection, the speed and the largest impulse still to come at breakage, and the largest
    deflection of the strongest of a hundred panes until it breaks. Slopes are those of the
    segments before the points; the damage to the power `exponent` is the risk B. The pane breaks at
    the risk `strength`; if that is 0, as the median of the panes that break.

    1. Each step: deflection and speed as in `integrate`, without plasticity.
    2. Its damage: duration times the rate at that deflection, linear in logarithms; the sum is D.
    3. The risk B = D^exponent; the share of panes that break is 1 - exp(-B).
    4. Breakage: the first step at which B reaches the strength, and the impulse still to come.
    """
    x, damage, peak = 0.0, 0.0, 0.0
    pushed, place = impulse_until(time_s, pressure_pa, impulse_pa_s, 0, time_s[0] + 0.5 * step_s)
    v = pushed / mass
    # The history is kept, because the strength of the median broken pane follows from the whole
    # damage and is looked up afterwards. Durations are in units of 60 s, as E1300's risk.
    track, per_step = np.empty((3, steps)), step_s / 60.0
    bent, worn = 1, 1  # segments of the two polylines, which change little between steps
    for step in range(steps):
        # 1. Deflection and speed.
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
        # 2. Damage.
        if x != 0.0:
            log_x = np.log(abs(x))
            worn = end_of_segment(log_points, log_x, worn)
            # A power law between points: linear in logarithms.
            rate = log_rate[worn] + log_slopes[worn] * (log_x - log_points[worn])
            damage += per_step * np.exp(rate)
        track[0, step], track[1, step], track[2, step] = damage, x, v
    # 3. and 4. The share that breaks, and when.
    share = -np.expm1(-(damage**exponent))
    # The median of those that break: half of the share, as a risk B = -ln(1 - share / 2).
    risk = strength if strength > 0.0 else -np.log1p(-0.5 * share)
    broken = min(np.searchsorted(track[0], risk ** (1.0 / exponent)), steps - 1)
    break_s = time_s[0] + (broken + 1) * step_s
    out[0], out[1], out[2] = peak, share, break_s
    out[3], out[4] = track[1, broken], track[2, broken]
    out[5] = _impulse_to_come(time_s, pressure_pa, break_s)
    # Frames have to hold until nearly all panes have broken.
    last = np.searchsorted(track[0], _STRONGEST ** (1.0 / exponent))
    out[6] = max(0.0, track[1, : last + 1].max())


@compiled()
def _impulse_to_come(time_s: FloatArray, pressure_pa: FloatArray, from_s: float) -> float:
    """Return the largest impulse from a time on, Pa s; 0 after the history.

    The largest, not all of it: later suction does not call fragments back.
    """
    if from_s >= time_s[-1]:
        return 0.0
    after = np.searchsorted(time_s, from_s, side="right")
    gone = (from_s - time_s[after - 1]) / (time_s[after] - time_s[after - 1])
    there = pressure_pa[after - 1] + gone * (pressure_pa[after] - pressure_pa[after - 1])
    come = 0.5 * (there + pressure_pa[after]) * (time_s[after] - from_s)
    largest = max(come, 0.0)
    for upper in range(after + 1, len(time_s)):
        rest = pressure_pa[upper - 1] + pressure_pa[upper]
        come += 0.5 * rest * (time_s[upper] - time_s[upper - 1])
        largest = max(largest, come)
    return largest


@compiled()
def move_piece(
    force: FloatArray, mass: float, height: float, base: float, friction: float, step_s: float
) -> tuple[float, float, float]:
    """Return how far a rigid piece slides, its largest tilt, and when it overturns.

    The force acts on the side of the piece at half its height; it and the mass are per metre of
    length. The tilt is over that of overturning. The time in s counts from the first step, and is
    infinite if the piece does not overturn.

    A step, for a piece on the edge towards which it tips (`blast_env.response.barriers`):

    1. the edge holds: angular acceleration about it, and the friction and weight that it takes;
    2. if that friction is more than the edge has, or the piece slides already: the edge slides,
       with its friction as the only moment that lifts the piece;
    3. flat on the ground without a moment that lifts it, it slides alone;
    4. friction stops a sliding piece, but does not reverse it; it lands without bouncing.
    """
    # A rectangular block about its centre; it overturns when its centre is above the edge.
    inertia = mass * (height * height + base * base) / 12.0
    limit = np.arctan(base / height)
    x, v, angle, speed, far, most = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for step, push in enumerate(force):
        if angle == 0.0:
            side = 1.0 if v > 0.0 or (v == 0.0 and push >= 0.0) else -1.0
        else:
            side = 1.0 if angle > 0.0 else -1.0
        # from here on in the direction of the edge
        own, own_v, tilt, turning = side * push, side * v, abs(angle), side * speed
        # Horizontal and vertical distance of the centre from the edge; the force acts on the middle
        # of the tilted side.
        arm = 0.5 * (base * np.cos(tilt) - height * np.sin(tilt))
        rise = 0.5 * (height * np.cos(tilt) + base * np.sin(tilt))
        tipping = 0.5 * own * height * np.cos(tilt)
        # 1. About the edge that holds: moment over the inertia about it (Steiner).
        turns = (tipping - mass * 9.81 * arm) / (inertia + mass * (arm * arm + rise * rise))
        if tilt == 0.0 and turns <= 0.0:
            turns = 0.0
        # Friction and weight at the edge from the acceleration of the centre, tangential and
        # centripetal.
        slides, held = 0.0, own - mass * (turns * rise + turning * turning * arm)
        weight = max(mass * (9.81 + turns * arm - turning * turning * rise), 0.0)
        if own_v != 0.0 or abs(held) > friction * weight:
            # 2. The edge slides: Coulomb friction opposes the motion, or the force that starts it.
            against = friction if own_v > 0.0 or (own_v == 0.0 and held > 0.0) else -friction
            lever = against * rise - arm
            off = 0.5 * own * base * np.sin(tilt)
            turns = mass * (9.81 - turning * turning * rise) * lever - off
            turns /= inertia - mass * arm * lever
            # 3. Flat on the ground, without a moment that lifts it.
            if tilt == 0.0 and turns <= 0.0:
                turns = 0.0
            weight = max(mass * (9.81 + turns * arm - turning * turning * rise), 0.0)
            slides = (own - against * weight) / mass - turns * rise - turning * turning * arm
        # 4. Friction stops a sliding piece within the step, and the piece lands without a bounce.
        new_v = own_v + slides * step_s
        if own_v * new_v < 0.0:
            new_v = 0.0
        x += side * 0.5 * (own_v + new_v) * step_s
        turning += turns * step_s
        tilt += turning * step_s
        if tilt <= 0.0:
            tilt, turning = 0.0, 0.0
        v, speed, angle = side * new_v, side * turning, side * tilt
        far, most = max(far, abs(x)), max(most, tilt)
        if most >= limit:
            return far, most / limit, step * step_s
    return far, most / limit, np.inf
