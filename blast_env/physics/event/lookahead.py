"""Finding out what happens to a ball next: a collision, or that it leaves its cell."""

from math import inf

from numba import njit

from blast_env.physics.event.arrays import (
    BORDER,
    FIRST_SURFACE,
    NOBODY,
    Record,
    RecordArray,
)
from blast_env.physics.event.contact_times import (
    balls_touch_s,
    border_touch_s,
    surface_touch_s,
)
from blast_env.physics.event.heap import schedule


@njit(error_model="numpy")
def cell_at(rules: Record, x: float, y: float) -> int:
    """Return the cell of a point on the site."""
    column = int((x - rules.left) / rules.cell_units) + 1
    row = int((y - rules.bottom) / rules.cell_units) + 1
    return row * rules.columns + column


@njit(error_model="numpy")
def enter_cell(balls: RecordArray, cells: RecordArray, ball: int, cell: int) -> None:
    """Put a ball, which is in no list, at the head of its list of a cell."""
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
    """Take a ball out of the list that it is in."""
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
    """Find a ball's next event among all that it can touch, and schedule it."""
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
    """Move a ball on to the next cell, and look at what has come into its neighbourhood."""
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
    """Whether a surface goes before the partner that is touched at the same time.

    Neither the order in which they were found nor the numbers of the surfaces, which both depend
    on the cells, may decide.
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
    """Find when a ball's centre leaves its cell, and into which one."""
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
