"""Prediction of each ball's next collision, and the queue of these events in a heap."""

from math import inf, sqrt
from typing import Final

from numba import njit

from blast_env.particles.event.state import (
    BORDER,
    CORNER,
    FACE_X,
    FIRST_SURFACE,
    NOBODY,
    Record,
    RecordArray,
)

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
