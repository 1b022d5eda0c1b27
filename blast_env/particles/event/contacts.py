"""Effects of collisions on balls and modules."""

from math import sqrt
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.particles.event.state import CORNER, FACE_X, Record, RecordArray
from blast_env.units import MODULE_SIDE_UNITS

_WEDGED: Final = 16
"""Collisions with modules only, within one contact, after which a ball sticks between them.

Balls of the size of a gap between modules are caught at its mouth, where collisions without loss
could continue for millions of times.
"""

_PRESSED: Final = 128
"""Collisions of any kind within one contact after which balls stick to each other and to modules.

A light ball between a heavy one and a wall needs about pi times the root of their mass ratio
collisions to reverse the heavy one. Balls caught by other caught balls never escape.
"""


@njit(error_model="numpy")
def move_to(ball: Record, time_s: float) -> None:
    """Advance the position of a ball to a time."""
    passed = time_s - ball.since_s
    ball.x += ball.vx * passed
    ball.y += ball.vy * passed
    ball.since_s = time_s


@njit(error_model="numpy")
def follows_at_once(ball: Record, time_s: float, rules: Record) -> bool:
    """Return whether a ball's last collision was within the contact time; count such collisions.

    Collisions within one contact lose no energy: otherwise balls pressed together would collide
    infinitely often in a finite time (inelastic collapse; the rule is Luding and McNamara's TC
    model).
    """
    at_once = ball.collisions > 0 and time_s - ball.since_s < rules.contact_time_s
    ball.presses = ball.presses + 1 if at_once else 0
    return at_once


@njit(error_model="numpy")
def _rest_if_slow(ball: Record, rules: Record) -> None:
    """Bring a ball to rest if it is slower than the rest speed.

    Otherwise a motion that decays between touching balls and modules would continue down to the
    smallest floating-point numbers, without end.
    """
    if ball.vx * ball.vx + ball.vy * ball.vy < rules.rest_speed * rules.rest_speed:
        ball.vx, ball.vy = 0.0, 0.0


@njit(error_model="numpy")
def _stay_together(one: Record, other: Record) -> None:
    """Give two balls the velocity of their centre of mass."""
    share = one.mass / (one.mass + other.mass)
    vx = share * one.vx + (1.0 - share) * other.vx
    vy = share * one.vy + (1.0 - share) * other.vy
    one.vx = other.vx = vx
    one.vy = other.vy = vy


@njit(error_model="numpy")
def collide_balls(one: Record, other: Record, time_s: float, rules: Record) -> None:
    """Collide two balls: restitution, friction, base impulse and shrinking."""
    # 1. Restitution: of this pair of kinds, and 1 within one contact (`follows_at_once`).
    explosive = one.explosive + other.explosive
    restitution = rules.restitution[explosive]
    one_at_once = follows_at_once(one, time_s, rules)
    at_once = follows_at_once(other, time_s, rules) or one_at_once
    is_caught = at_once and max(one.presses, other.presses) > _PRESSED and restitution < 1.0
    if at_once:
        restitution = 1.0
    # 2. The normal, from one centre to the other.
    move_to(one, time_s)
    move_to(other, time_s)
    nx, ny = other.x - one.x, other.y - one.y
    distance = sqrt(nx * nx + ny * ny)
    if distance > 0.0:
        nx, ny = nx / distance, ny / distance
    else:
        nx, ny = 1.0, 0.0
    # 3. J = -(1 + e) m1 m2 / (m1 + m2) v_n, with v_n the relative speed along the normal; then
    # friction across it, and the model's base impulse.
    vx, vy = other.vx - one.vx, other.vy - one.vy
    reduced_mass = one.mass * other.mass / (one.mass + other.mass)
    normal = -(1.0 + restitution) * reduced_mass * (vx * nx + vy * ny)
    along = 0.0
    if rules.friction[explosive] > 0.0:
        along = _friction(one, other, vy * nx - vx * ny, rules, rules.friction[explosive] * normal)
    normal += rules.base_impulse
    # 4. Equal and opposite on both, so that momentum holds.
    px, py = normal * nx - along * ny, normal * ny + along * nx
    one.vx -= px / one.mass
    one.vy -= py / one.mass
    other.vx += px / other.mass
    other.vy += py / other.mass
    one.collisions += 1
    other.collisions += 1
    one.rattles = other.rattles = 0
    # 5. Balls that are pressed together stick; 6. an explosive ball shrinks on air.
    if is_caught:
        _stay_together(one, other)
    if at_once:
        _rest_if_slow(one, rules)
        _rest_if_slow(other, rules)
    if explosive == 1:
        shrink(one if one.explosive else other, rules.air_shrink)


@njit(error_model="numpy")
def _friction(one: Record, other: Record, slip: float, rules: Record, most: float) -> float:
    """Return the tangential impulse on the second of two balls, and update their spins.

    The impulse stops the slip of the surfaces within the limit of Coulomb's law.
    """
    # With k = I / (m r^2), a tangential impulse P changes the slip by
    # P (1 / m1 + 1 / (k1 m1) + 1 / m2 + 1 / (k2 m2)); Coulomb: |P| <= mu J.
    slip -= one.spin * one.radius + other.spin * other.radius
    inertia = rules.inertia_factor[one.explosive] * one.mass
    inertia_other = rules.inertia_factor[other.explosive] * other.mass
    yielding = 1.0 / one.mass + 1.0 / inertia + 1.0 / other.mass + 1.0 / inertia_other
    along = min(max(-slip / yielding, -most), most)
    one.spin -= along / (inertia * one.radius)
    other.spin -= along / (inertia_other * other.radius)
    return along


@njit(error_model="numpy")
def shrink(ball: Record, factor: float) -> None:
    """Scale radius and mass of a ball."""
    ball.radius *= factor
    ball.mass *= factor


@njit(error_model="numpy")
def contact_normal(ball: Record, surface: Record) -> tuple[float, float]:
    """Return the outward normal at the contact of a ball with a surface."""
    if surface.kind == CORNER:
        nx, ny = ball.x - surface.a, ball.y - surface.b
        distance = sqrt(nx * nx + ny * ny)
        return nx / distance, ny / distance
    return (surface.a, 0.0) if surface.kind == FACE_X else (0.0, surface.a)


@njit(error_model="numpy")
def touched_module(ball: Record, surface: Record, modules: NDArray[np.int32]) -> int:
    """Return the module of a surface that a ball touches."""
    place = 0
    if surface.kind != CORNER:
        along = ball.y if surface.kind == FACE_X else ball.x
        place = max(int((along - surface.low) / MODULE_SIDE_UNITS), 0)
    return modules[min(surface.modules_from + place, surface.modules_to - 1)]


@njit(error_model="numpy")
def collide_with_module(
    ball: Record,
    surface: Record,
    modules: NDArray[np.int32],
    loads: RecordArray,
    time_s: float,
    rules: Record,
    row: NDArray[np.float64],
) -> int:
    """Collide a ball with a module: C_e, friction, load, record and shrinking.

    Args:
        surface: The face or corner that it touches.
        modules: The modules of the surfaces.
        row: Row for the record of the collision, filled except for the number of the ball.

    Returns:
        The module.
    """
    # 1. Restitution, and whether this is a new contact: only that has a tangential part and
    # shrinks the ball.
    restitution = _module_restitution(ball, time_s, rules)
    is_new = time_s - ball.module_s >= rules.contact_time_s
    move_to(ball, time_s)
    module = touched_module(ball, surface, modules)
    # 2. The momentum that the module takes, (1 + e) m v_n: it does not move.
    nx, ny = contact_normal(ball, surface)
    along = ball.vy * nx - ball.vx * ny
    transferred = -(1.0 + restitution) * ball.mass * (ball.vx * nx + ball.vy * ny)
    # The recorded normal speed is the one that gives the transferred impulse with C_e.
    counted = transferred / ((1.0 + rules.module_restitution) * ball.mass)
    counted_along = along if is_new else 0.0
    speed = sqrt(counted * counted + counted_along * counted_along)
    # 3. The paper's impulse m |v| before the collision, in multiples of a quantum, so that sums do
    # not depend on their order.
    impulse = np.rint(ball.mass * speed / rules.quantum) * rules.quantum
    row[0], row[2], row[3] = time_s, module, ball.mass
    row[4], row[5] = -counted * nx - counted_along * ny, -counted * ny + counted_along * nx
    row[6], row[7], row[8], row[9] = nx, ny, impulse, transferred
    # 4. The load of the module.
    load = loads[module]
    row[10], row[11] = ball.collisions, load.hits == 0
    load.first_hit_s = min(load.first_hit_s, time_s)
    load.hits += 1
    load.impulse += impulse
    load.transferred += transferred
    # 5. The rebound, with friction; 6. a caught ball stops.
    push = _module_friction(ball, transferred, along, rules)
    ball.vx += (transferred * nx - push * ny) / ball.mass
    ball.vy += (transferred * ny + push * nx) / ball.mass
    is_caught = ball.rattles > _WEDGED or ball.presses > _PRESSED
    if is_caught and rules.module_restitution < 1.0:
        ball.vx, ball.vy = 0.0, 0.0
    elif ball.presses > 0:
        _rest_if_slow(ball, rules)
    ball.collisions += 1
    ball.module_s = time_s
    if is_new and ball.explosive:
        shrink(ball, rules.module_shrink)
    return module


@njit(error_model="numpy")
def _module_restitution(ball: Record, time_s: float, rules: Record) -> float:
    """Return the restitution of a ball at a module, and count its repeated collisions."""
    if not follows_at_once(ball, time_s, rules):
        ball.rattles = 0
        return rules.module_restitution
    ball.rattles += 1
    return 1.0


@njit(error_model="numpy")
def _module_friction(ball: Record, normal: float, along: float, rules: Record) -> float:
    """Return the tangential impulse on a ball at a module, and update its spin."""
    most = rules.module_friction[ball.explosive] * normal
    if most <= 0.0:
        return 0.0
    inertia = rules.inertia_factor[ball.explosive] * ball.mass
    slip = along - ball.spin * ball.radius
    push = min(max(-slip / (1.0 / ball.mass + 1.0 / inertia), -most), most)
    ball.spin -= push / (inertia * ball.radius)
    return push
