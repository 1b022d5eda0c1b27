"""A binary heap of balls by the time of what happens to them next."""

from numba import njit

from blast_env.physics.event.arrays import RecordArray


@njit(error_model="numpy", inline="always")
def schedule(heap: RecordArray, balls: RecordArray, ball: int, time_s: float) -> None:
    """Put a ball into the heap, or move it to another time."""
    place = balls[ball].place
    if place == 0:
        heap[0].ball += 1
        _rise(heap, balls, heap[0].ball, ball, time_s)
    elif time_s < heap[place].time_s:
        _rise(heap, balls, place, ball, time_s)
    else:
        _sink(heap, balls, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def unschedule(heap: RecordArray, balls: RecordArray, ball: int) -> None:
    """Take a ball out of the heap, if it is in it."""
    place = balls[ball].place
    if place == 0:
        return
    balls[ball].place = 0
    last = heap[0].ball
    heap[0].ball -= 1
    if place == last:
        return
    moved, time_s = heap[last].ball, heap[last].time_s
    if time_s < heap[place].time_s:
        _rise(heap, balls, place, moved, time_s)
    else:
        _sink(heap, balls, place, moved, time_s)


@njit(error_model="numpy", inline="always")
def _rise(heap: RecordArray, balls: RecordArray, place: int, ball: int, time_s: float) -> None:
    """Find the place at or above `place` for a ball, and put it there."""
    while place > 1:
        above = place >> 1
        if heap[above].time_s <= time_s:
            break
        _put(heap, balls, place, heap[above].ball, heap[above].time_s)
        place = above
    _put(heap, balls, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def _sink(heap: RecordArray, balls: RecordArray, place: int, ball: int, time_s: float) -> None:
    """Find the place at or below `place` for a ball, and put it there."""
    size = heap[0].ball
    while True:
        below = 2 * place
        if below > size:
            break
        if below < size and heap[below + 1].time_s < heap[below].time_s:
            below += 1
        if heap[below].time_s >= time_s:
            break
        _put(heap, balls, place, heap[below].ball, heap[below].time_s)
        place = below
    _put(heap, balls, place, ball, time_s)


@njit(error_model="numpy", inline="always")
def _put(heap: RecordArray, balls: RecordArray, place: int, ball: int, time_s: float) -> None:
    heap[place].time_s = time_s
    heap[place].ball = ball
    balls[ball].place = place
