"""When a ball next touches another ball, a wall or the border.

Every time follows from the states of the balls at their last collisions alone, never from the
moment at which it is looked up. So the cells, which decide when that is, do not change a run.
"""

from math import inf, sqrt
from typing import Final

from numba import njit

from blast_env.physics.event.arrays import CORNER, FACE_X, Record

_GRAZING: Final = 1e-12
"""Balls in touch that approach each other by less than this share of their speed do not collide.

Nor do they below `rest_speed`. Rounding decides whether such balls approach at all, and they could
collide without end.
"""


@njit(error_model="numpy", inline="always")
def balls_touch_s(one: Record, other: Record, rules: Record) -> float:
    """Return when two balls touch; inf if never."""
    start = max(one.since_s, other.since_s)
    before, before_other = start - one.since_s, start - other.since_s
    x = (other.x + other.vx * before_other) - (one.x + one.vx * before)
    y = (other.y + other.vy * before_other) - (one.y + one.vy * before)
    vx, vy = other.vx - one.vx, other.vy - one.vy
    return start + _until_distance(x, y, vx, vy, one.radius + other.radius, rules)


@njit(error_model="numpy", inline="always")
def surface_touch_s(ball: Record, surface: Record, rules: Record) -> float:
    """Return when a ball touches a face or a corner of a wall; inf if never."""
    if surface.kind == CORNER:
        to_x, to_y = surface.a - ball.x, surface.b - ball.y
        return ball.since_s + _until_distance(to_x, to_y, -ball.vx, -ball.vy, ball.radius, rules)
    if surface.kind == FACE_X:
        distance, approach = surface.a * (ball.x - surface.b), -surface.a * ball.vx
        along, speed_along = ball.y, ball.vy
    else:
        distance, approach = surface.a * (ball.y - surface.b), -surface.a * ball.vy
        along, speed_along = ball.x, ball.vx
    if approach <= 0.0 or distance <= 0.0:
        return inf
    gap = distance - ball.radius
    if gap <= 0.0:
        if approach < max(_GRAZING * (approach + abs(speed_along)), rules.rest_speed):
            return inf
        gap = 0.0
    wait = gap / approach
    at = along + speed_along * wait
    if at < surface.low or at > surface.high:
        return inf
    return ball.since_s + wait


@njit(error_model="numpy", inline="always")
def border_touch_s(ball: Record, rules: Record) -> float:
    """Return when the edge of a ball reaches the border of the site; inf if never."""
    wait = inf
    if ball.vx > 0.0:
        wait = (rules.right - ball.radius - ball.x) / ball.vx
    elif ball.vx < 0.0:
        wait = (rules.left + ball.radius - ball.x) / ball.vx
    if ball.vy > 0.0:
        wait = min(wait, (rules.top - ball.radius - ball.y) / ball.vy)
    elif ball.vy < 0.0:
        wait = min(wait, (rules.bottom + ball.radius - ball.y) / ball.vy)
    return ball.since_s + max(wait, 0.0)


@njit(error_model="numpy", inline="always")
def _until_distance(
    x: float, y: float, vx: float, vy: float, distance: float, rules: Record
) -> float:
    """Return how long until the length of (x, y) + (vx, vy) t has fallen to a distance."""
    falling = x * vx + y * vy
    if falling >= 0.0:
        return inf
    speed2 = vx * vx + vy * vy
    excess = x * x + y * y - distance * distance
    if excess <= 0.0:
        slow = max(_GRAZING * _GRAZING * speed2, rules.rest_speed * rules.rest_speed)
        return inf if falling * falling < slow * distance * distance else 0.0
    discriminant = falling * falling - speed2 * excess
    if discriminant <= 0.0:  # 0: it touches in passing, and nothing happens
        return inf
    # This form of the root does not cancel when the balls almost touch.
    return excess / (sqrt(discriminant) - falling)
