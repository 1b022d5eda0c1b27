"""The event queue: the next collision of every ball, in a heap."""

from typing import Final

from numba import njit

from blast_env.physics.event.state import Record, RecordArray

_MOST_BALLS: Final = 2**31


@njit(error_model="numpy", inline="always")
def schedule(heap: RecordArray, balls: RecordArray, ball: int, time_s: float) -> None:
    """Put a ball into the heap, or move it to another time."""
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
    """Take a ball out of the heap, if it is in it."""
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
    """Whether what happens to a ball comes before an entry of the heap."""
    if time_s != entry.time_s:
        return time_s < entry.time_s
    return _rank(balls, ball) < _rank(balls, entry.ball)


@njit(error_model="numpy")
def _rank(balls: RecordArray, ball: int) -> int:
    """Return the rank among what happens at the same time: moves, walls, pairs of balls."""
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
