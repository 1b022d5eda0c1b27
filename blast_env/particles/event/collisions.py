"""Collisions: which is each ball's next, in a heap of events, and their effects."""

from math import inf, sqrt
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.particles.event.state import (
    BORDER,
    CORNER,
    FACE_X,
    FIRST_SURFACE,
    NOBODY,
    Record,
    RecordArray,
)
from blast_env.units import MODULE_SIDE_UNITS

_MOST_BALLS: Final = 2**31


@njit(error_model="numpy", inline="always")
def schedule(heap: RecordArray, balls: RecordArray, ball: int, time_s: float) -> None:
    """Insert a ball into the heap, or change its time."""
    # A binary heap in an array: the children of k are 2 k and 2 k + 1, entry 0 has the size.
    place = heap[ball].place
    if place == 0:
        heap[0].ball += 1
        _rise(heap, balls, heap[0].ball, ball, time_s)
    elif place > 1 and _is_before(balls, ball, time_s, heap[place >> 1]):
        _rise(heap, balls, place, ball, time_s)
    else:
        _sink(heap, balls, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def unschedule(heap: RecordArray, balls: RecordArray, ball: int) -> None:
    """Remove a ball from the heap, if present."""
    place = heap[ball].place
    if place == 0:
        return
    heap[ball].place = 0
    last = heap[0].ball
    heap[0].ball -= 1
    if place == last:
        return
    moved, time_s = heap[last].ball, heap[last].time_s
    if place > 1 and _is_before(balls, moved, time_s, heap[place >> 1]):
        _rise(heap, balls, place, moved, time_s)
    else:
        _sink(heap, balls, place, moved, time_s)


@njit(error_model="numpy", inline="always")
def _is_before(balls: RecordArray, ball: int, time_s: float, entry: Record) -> bool:
    """Return whether a ball's event at a time comes before an entry of the heap."""
    if time_s != entry.time_s:
        return time_s < entry.time_s
    return _rank(balls, ball) < _rank(balls, entry.ball)


@njit(error_model="numpy")
def _rank(balls: RecordArray, ball: int) -> int:
    """Return the rank among simultaneous events: moves between cells, walls, pairs of balls."""
    partner = balls[ball].partner
    if balls[ball].contact_s > balls[ball].crossing_s:
        return ball - 2 * _MOST_BALLS
    if partner < 0:
        return ball - _MOST_BALLS
    return min(ball, partner) * _MOST_BALLS + max(ball, partner)


@njit(error_model="numpy", inline="always")
def _rise(heap: RecordArray, balls: RecordArray, place: int, ball: int, time_s: float) -> None:
    """Find the place at or above `place` for a ball, and put it there."""
    while place > 1:
        above = place >> 1
        if not _is_before(balls, ball, time_s, heap[above]):
            break
        _put(heap, place, heap[above].ball, heap[above].time_s)
        place = above
    _put(heap, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def _sink(heap: RecordArray, balls: RecordArray, place: int, ball: int, time_s: float) -> None:
    """Find the place at or below `place` for a ball, and put it there."""
    size = heap[0].ball
    while True:
        below = 2 * place
        if below > size:
            break
        if below < size and _is_before(
            balls, heap[below + 1].ball, heap[below + 1].time_s, heap[below]
        ):
            below += 1
        if _is_before(balls, ball, time_s, heap[below]):
            break
        _put(heap, place, heap[below].ball, heap[below].time_s)
        place = below
    _put(heap, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def _put(heap: RecordArray, place: int, ball: int, time_s: float) -> None:
    heap[place].time_s = time_s
    heap[place].ball = ball
    heap[ball].place = place


_GRAZING: Final = 1e-12
"""Share of their speed below which the approach of touching balls is no collision.

The same holds for an approach below `rest_speed`. Rounding determines whether such balls approach
at all, and they could collide without end.
"""


@njit(error_model="numpy", inline="always")
def balls_touch_s(one: Record, other: Record, rules: Record) -> float:
    """Return the time at which two balls touch; inf if never."""
    # Balls are moved only when something happens to them: both to the later of their times.
    start = max(one.since_s, other.since_s)
    before, before_other = start - one.since_s, start - other.since_s
    x = (other.x + other.vx * before_other) - (one.x + one.vx * before)
    y = (other.y + other.vy * before_other) - (one.y + one.vy * before)
    vx, vy = other.vx - one.vx, other.vy - one.vy
    return start + _until_distance(x, y, vx, vy, one.radius + other.radius, rules)


@njit(error_model="numpy", inline="always")
def surface_touch_s(ball: Record, surface: Record, rules: Record) -> float:
    """Return the time at which a ball touches a face or a corner of a wall; inf if never."""
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
    # The face at `surface.b` with the outward normal `surface.a`: the gap closes at the speed of
    # approach, and the ball must then be beside the face, not beyond its ends.
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
    """Return the time at which the edge of a ball reaches the border of the site; inf if never."""
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
    """Return the time until the length of (x, y) + (vx, vy) t has decreased to a distance.

    With r = (x, y), v = (vx, vy), b = r v, c = r^2 - d^2, |r + v t| = d is v^2 t^2 + 2 b t + c = 0;
    the balls touch at its smaller root t = c / (sqrt(b^2 - v^2 c) - b), if b < 0.
    """
    falling = x * vx + y * vy
    if falling >= 0.0:
        return inf
    speed2 = vx * vx + vy * vy
    excess = x * x + y * y - distance * distance
    if excess <= 0.0:
        slow = max(_GRAZING * _GRAZING * speed2, rules.rest_speed * rules.rest_speed)
        return inf if falling * falling < slow * distance * distance else 0.0
    discriminant = falling * falling - speed2 * excess
    if discriminant <= 0.0:  # at 0 they only graze each other
        return inf
    # This form of the root avoids cancellation when the balls almost touch.
    return excess / (sqrt(discriminant) - falling)


@njit(error_model="numpy")
def cell_at(rules: Record, x: float, y: float) -> int:
    """Return the cell of a point on the site."""
    column = int((x - rules.left) / rules.cell_units) + 1
    row = int((y - rules.bottom) / rules.cell_units) + 1
    return row * rules.columns + column


@njit(error_model="numpy")
def enter_cell(balls: RecordArray, cells: RecordArray, ball: int, cell: int) -> None:
    """Insert a ball that is in no list at the head of its list of a cell."""
    if balls[ball].explosive:
        follower = cells[cell].first_explosive
        cells[cell].first_explosive = ball
    else:
        follower = cells[cell].first_air
        cells[cell].first_air = ball
    balls[ball].following = follower
    balls[ball].previous = -1
    balls[ball].cell = cell
    if follower >= 0:
        balls[follower].previous = ball


@njit(error_model="numpy")
def leave_cell(balls: RecordArray, cells: RecordArray, ball: int) -> None:
    """Remove a ball from its list."""
    before, after = balls[ball].previous, balls[ball].following
    if before >= 0:
        balls[before].following = after
    elif balls[ball].explosive:
        cells[balls[ball].cell].first_explosive = after
    else:
        cells[balls[ball].cell].first_air = after
    if after >= 0:
        balls[after].previous = before


@njit(error_model="numpy")
def look_ahead(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
    ball: int,
) -> None:
    """Find a ball's next event among all objects within reach, and schedule it."""
    # 1. The border; 2. faces and corners of walls; 3. balls in the cell and its eight neighbours,
    # which hold all that it can touch before it changes cells; 4. that change. The earliest of them
    # is the ball's event (Alder and Wainwright 1959; one event per ball as Lubachevsky 1991).
    balls[ball].contact_s = border_touch_s(balls[ball], rules)
    balls[ball].partner = BORDER if balls[ball].contact_s < inf else NOBODY
    cell = balls[ball].cell
    _look_at_surfaces(balls, cells, surfaces, rules, ball)
    for row in range(-1, 2):
        middle = cell + row * rules.columns
        for place in range(middle - 1, middle + 2):
            _look_at_balls(balls, cells, rules, ball, place)
    _find_crossing(balls, cells, rules, ball)
    schedule(heap, balls, ball, min(balls[ball].contact_s, balls[ball].crossing_s))


@njit(error_model="numpy")
def cross(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
    ball: int,
) -> None:
    """Move a ball to the next cell, and check the objects new in its neighbourhood."""
    # Only the three cells ahead are new; the others were looked at before.
    step = balls[ball].crossing
    leave_cell(balls, cells, ball)
    cell = balls[ball].cell + step
    enter_cell(balls, cells, ball, cell)
    _look_at_surfaces(balls, cells, surfaces, rules, ball)
    aside = rules.columns if abs(step) == 1 else 1
    for place in range(-1, 2):
        _look_at_balls(balls, cells, rules, ball, cell + step + place * aside)
    _find_crossing(balls, cells, rules, ball)
    schedule(heap, balls, ball, min(balls[ball].contact_s, balls[ball].crossing_s))


@njit(error_model="numpy", inline="always")
def _look_at_surfaces(
    balls: RecordArray, cells: RecordArray, surfaces: RecordArray, rules: Record, ball: int
) -> None:
    cell = cells[balls[ball].cell]
    for surface in range(cell.surfaces_from, cell.surfaces_to):
        time_s = surface_touch_s(balls[ball], surfaces[surface], rules)
        if time_s < balls[ball].contact_s or (
            time_s == balls[ball].contact_s and _wins_tie(surfaces, surface, balls[ball].partner)
        ):
            balls[ball].contact_s = time_s
            balls[ball].partner = FIRST_SURFACE - surface


@njit(error_model="numpy")
def _wins_tie(surfaces: RecordArray, surface: int, partner: int) -> bool:
    """Return whether a surface takes precedence over a partner touched at the same time.

    The order of checks and the numbers of the surfaces depend on the cells and must not decide.
    """
    if partner > FIRST_SURFACE:
        return partner >= 0
    return surfaces[surface].modules_from < surfaces[FIRST_SURFACE - partner].modules_from


@njit(error_model="numpy", inline="always")
def _look_at_balls(
    balls: RecordArray, cells: RecordArray, rules: Record, ball: int, cell: int
) -> None:
    _look_along_list(balls, rules, ball, cells[cell].first_air)
    if rules.charge_collides or not balls[ball].explosive:
        _look_along_list(balls, rules, ball, cells[cell].first_explosive)


@njit(error_model="numpy", inline="always")
def _look_along_list(balls: RecordArray, rules: Record, ball: int, other: int) -> None:
    while other >= 0:
        if other != ball:
            time_s = balls_touch_s(balls[ball], balls[other], rules)
            if time_s < balls[ball].contact_s or (
                time_s == balls[ball].contact_s and other < balls[ball].partner
            ):
                balls[ball].contact_s = time_s
                balls[ball].partner = other
                balls[ball].partner_collisions = balls[other].collisions
        other = balls[other].following


@njit(error_model="numpy", inline="always")
def _find_crossing(balls: RecordArray, cells: RecordArray, rules: Record, ball: int) -> None:
    """Find the time at which a ball's centre leaves its cell, and the next cell."""
    here = cells[balls[ball].cell]
    side, wait, step = rules.cell_units, inf, 0
    vx, vy = balls[ball].vx, balls[ball].vy
    if vx != 0.0:
        edge = here.left + side if vx > 0.0 else here.left
        wait = (edge - balls[ball].x) / vx
        step = 1 if vx > 0.0 else -1
    if vy != 0.0:
        edge = here.bottom + side if vy > 0.0 else here.bottom
        wait_y = (edge - balls[ball].y) / vy
        if wait_y < wait:
            wait = wait_y
            step = rules.columns if vy > 0.0 else -rules.columns
    balls[ball].crossing_s = balls[ball].since_s + wait
    balls[ball].crossing = step


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
