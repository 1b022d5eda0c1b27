"""The event-driven engine: the paper's model with hard discs and without time steps.

It consists of a compiled loop from collision to collision, and the run that calls it.
"""

from collections.abc import Callable
from math import inf, sqrt
from threading import Lock
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.compilation import compilation_notice, compiled
from blast_env.particles.event.collisions import (
    cell_at,
    collide_balls,
    collide_with_module,
    cross,
    enter_cell,
    leave_cell,
    look_ahead,
    unschedule,
)
from blast_env.particles.event.state import (
    BORDER,
    CHANGED,
    FIRST_SURFACE,
    NEW,
    RECORD_COLUMNS,
    RUNNING,
    Record,
    RecordArray,
    World,
    with_walls,
    world_of,
)
from blast_env.particles.run import COLLISION_DTYPE, BallStates, CollisionLog, Scene
from blast_env.results import EndReason

# Reasons why the loop returns.
UNTIL: Final = 0
RECORD_FULL: Final = 1
OUT_OF_REACH: Final = 2
EVENT_LIMIT: Final = 3
MODULE_DESTROYED: Final = 4
PAUSED: Final = 5
_COLLISIONS_BETWEEN_CHECKS: Final = 512

_EVENTS_PER_CALL: Final = 10_000
"""Events after which the loop returns, to respond to Ctrl-C: an event takes 1 to 10 us."""

_NUMBER: Final[Any] = np.int64
"""Type of a ball's number, as in loops over them: a second integer type would compile twice."""


@compiled(nogil=True, error_model="numpy")
def run_until(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    modules: NDArray[np.int32],
    loads: RecordArray,
    targets: NDArray[np.float64],
    rules: Record,
    progress: Record,
    record: NDArray[np.float64],
    until_s: float,
) -> int:
    """Continue until a time, or until the caller has to act.

    Event-driven dynamics of hard discs (Alder & Wainwright, J. Chem. Phys. 31 (1959) 459): between
    events all balls move straight, and each keeps its position at its own last event. An event:

    1. stop, if a bound is reached or no moving ball can reach a structure;
    2. take the earliest event from the heap;
    3. at the border of a cell, change the cell and predict again;
    4. a partner that has collided since the prediction makes it stale: predict again;
    5. apply the rules of the contact, and record it if it loads a module;
    6. predict the next events of the balls concerned; all others stay valid.

    Returns:
        The reason, one of the constants above.
    """
    if progress.stage == NEW:
        _begin(balls, cells, heap, surfaces, rules)
    elif progress.stage == CHANGED and not _look_again(
        balls, cells, heap, surfaces, rules, progress
    ):
        return PAUSED
    progress.stage = RUNNING
    events = 0
    while True:
        # 1. Bounds.
        if events == _EVENTS_PER_CALL:
            return PAUSED
        events += 1
        reason = _bound(balls, heap, targets, rules, progress, len(record), until_s)
        if reason >= 0:
            return reason
        # 2. The earliest event, the root of the heap.
        ball, time_s = _NUMBER(heap[1].ball), heap[1].time_s
        # 3. A change of cell.
        if balls[ball].contact_s > time_s:
            cross(balls, cells, heap, surfaces, rules, ball)
            continue
        partner = _NUMBER(balls[ball].partner)
        # 4. A stale prediction.
        if partner >= 0 and balls[partner].collisions != balls[ball].partner_collisions:
            look_ahead(balls, cells, heap, surfaces, rules, ball)
            continue
        # 5. and 6. The contact, and the next events of those that it changed.
        progress.collisions += 1
        progress.time_s = time_s
        if partner >= 0:
            one, other = min(ball, partner), max(ball, partner)  # for a fixed order
            collide_balls(balls[one], balls[other], time_s, rules)
            _go_on(balls, cells, heap, surfaces, rules, ball)
            _go_on(balls, cells, heap, surfaces, rules, partner)
        elif partner == BORDER:
            _remove(balls, cells, heap, ball)
        else:
            row = record[progress.records]
            progress.records += 1
            row[1] = ball
            surface = surfaces[FIRST_SURFACE - partner]
            module = collide_with_module(balls[ball], surface, modules, loads, time_s, rules, row)
            _go_on(balls, cells, heap, surfaces, rules, ball)
            if loads[module].impulse > loads[module].capacity:
                progress.stage = CHANGED
                return MODULE_DESTROYED


@njit(error_model="numpy")
def _bound(
    balls: RecordArray,
    heap: RecordArray,
    targets: NDArray[np.float64],
    rules: Record,
    progress: Record,
    most_records: int,
    until_s: float,
) -> int:
    """Return the reason to stop before the next event, -1 if there is none."""
    if progress.collisions >= progress.next_check:
        progress.next_check = progress.collisions + _COLLISIONS_BETWEEN_CHECKS
        if not _can_reach(balls, heap, targets, rules.time_limit_s, progress.time_s):
            return OUT_OF_REACH
    if progress.collisions >= rules.most_collisions:
        return EVENT_LIMIT
    if progress.records == most_records:
        return RECORD_FULL
    if heap[0].ball == 0 or heap[1].time_s == inf:
        return OUT_OF_REACH  # no further event
    return UNTIL if heap[1].time_s > until_s else -1


@njit(error_model="numpy")
def _begin(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
) -> None:
    """Put every ball into its cell, and predict the next events of moving balls."""
    for ball in range(len(balls)):
        enter_cell(balls, cells, ball, cell_at(rules, balls[ball].x, balls[ball].y))
    for ball in range(len(balls)):
        if balls[ball].vx != 0.0 or balls[ball].vy != 0.0:
            look_ahead(balls, cells, heap, surfaces, rules, ball)


@njit(error_model="numpy")
def _look_again(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
    progress: Record,
) -> bool:
    """Predict the next events of scheduled balls again; return whether all are done."""
    looked = 0
    for ball in range(progress.looked_again, len(balls)):
        if looked == _EVENTS_PER_CALL:
            progress.looked_again = ball
            return False
        if heap[ball].place > 0:
            look_ahead(balls, cells, heap, surfaces, rules, ball)
            looked += 1
    progress.looked_again = 0
    return True


@njit(error_model="numpy")
def _go_on(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
    ball: int,
) -> None:
    """Predict the next event of a ball after a collision, or remove it if it is too small."""
    if balls[ball].explosive and balls[ball].radius < rules.minimum_radius:
        _remove(balls, cells, heap, ball)
    else:
        look_ahead(balls, cells, heap, surfaces, rules, ball)


@njit(error_model="numpy")
def _remove(balls: RecordArray, cells: RecordArray, heap: RecordArray, ball: int) -> None:
    leave_cell(balls, cells, ball)
    unschedule(heap, balls, ball)
    balls[ball].alive = 0
    balls[ball].collisions += 1  # invalidates events with it


@njit(error_model="numpy")
def _can_reach(
    balls: RecordArray,
    heap: RecordArray,
    targets: NDArray[np.float64],
    time_limit_s: float,
    time_s: float,
) -> bool:
    """Return whether a moving ball can still act on a structure, as `run.can_reach` does.

    All moving balls are in the heap, so that air at rest takes no time here.
    """
    for place in range(1, heap[0].ball + 1):
        ball = balls[heap[place].ball]
        if ball.vx == 0.0 and ball.vy == 0.0:
            continue
        passed = time_s - ball.since_s
        x, y = ball.x + ball.vx * passed, ball.y + ball.vy * passed
        speed = sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
        reach = 2.0 * speed * (time_limit_s - time_s) + ball.radius
        for target in range(len(targets)):
            dx = max(targets[target, 0] - x, x - targets[target, 2], 0.0)
            dy = max(targets[target, 1] - y, y - targets[target, 3], 0.0)
            if dx * dx + dy * dy <= reach * reach:
                return True
    return False


_FIRST_CALL: Final = Lock()


def run_world(world: World, record: NDArray[np.float64], until_s: float) -> int:
    """Continue until a time, or until the caller has to act; see `run_until`.

    The first call in a new installation compiles, with a warning of the logger `blast_env`. Other
    threads can run meanwhile, and Ctrl-C takes effect within half a second.
    """
    answer = PAUSED
    while answer == PAUSED:
        if run_until.signatures:
            answer = int(run_until(*world, record, until_s))
        else:
            with _FIRST_CALL, compilation_notice("the event engine (some 10 s)"):
                answer = int(run_until(*world, record, until_s))
    return answer


_RECORD_ROWS: Final = 4096

MOST_RECORDS: Final = 20_000_000
"""Hits on modules after which a run ends, as at `most_collisions`: they take some 2 GB."""

_END_REASONS: Final = {
    OUT_OF_REACH: EndReason.OUT_OF_REACH,
    EVENT_LIMIT: EndReason.EVENT_LIMIT,
}


class EventRun:
    """One blast in progress; see `BlastRun` for the attributes. A step is a collision."""

    def __init__(self, scene: Scene, cell_units: float | None = None) -> None:
        self.scene, self._cell_units = scene, cell_units
        self.obstacles = scene.obstacles()
        self.log = CollisionLog()
        self.time_s = 0.0
        self.steps = 0
        self.end_reason: EndReason | None = None
        self._parts = [part for obstacle in self.obstacles for part in obstacle.parts]
        self._world = world_of(scene, self._parts, cell_units)
        self._record = np.empty((_RECORD_ROWS, len(RECORD_COLUMNS)))
        self._recorded = 0

    def __reduce__(
        self,
    ) -> tuple[Callable[..., "EventRun"], tuple[Scene, float | None, float]]:
        """Pickle the scene and the time, because parts of the state share memory."""
        until_s = self.time_s if self.end_reason is None else np.inf
        return _run_again, (self.scene, self._cell_units, until_s)

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is `until_s`, or the run has ended."""
        if self.end_reason is not None or self.time_s >= until_s:
            return
        limit_s = self.scene.parameters.stepping.time_limit_s
        target_s = min(until_s, limit_s)
        answer = RECORD_FULL
        while answer in (RECORD_FULL, MODULE_DESTROYED):
            answer = run_world(self._world, self._record, target_s)
            self._read_record()
            if self._recorded >= MOST_RECORDS:
                answer = EVENT_LIMIT
            elif answer == MODULE_DESTROYED:
                self._world = with_walls(self._world, self.scene, self._parts)
        self.time_s = target_s
        if answer in _END_REASONS:
            self.end_reason = _END_REASONS[answer]
            self.time_s = float(self._world.progress["time_s"])
        elif target_s >= limit_s:
            self.end_reason = EndReason.TIME_LIMIT
        self.steps = int(self._world.progress["collisions"])
        self._load_parts()

    def balls(self) -> BallStates:
        """Return the remaining balls."""
        balls = self._world.balls
        index = np.flatnonzero(balls["alive"])
        balls = balls[index]
        velocity = np.stack((balls["vx"], balls["vy"]), axis=1)
        passed = self.time_s - balls["since_s"]
        position = np.stack((balls["x"], balls["y"]), axis=1) + velocity * passed[:, None]
        return BallStates(
            index=index,
            kind=self.scene.balls.kind[index],
            position=position,
            velocity=velocity,
            mass=balls["mass"].copy(),
            radius=balls["radius"].copy(),
        )

    def _read_record(self) -> None:
        """Move the records of the compiled loop to the log."""
        rows = self._record[: self._world.progress["records"]]
        self._world.progress["records"] = 0
        self._recorded += len(rows)
        if not len(rows):
            return
        collisions = np.empty(len(rows), dtype=COLLISION_DTYPE)
        for name, column in zip(RECORD_COLUMNS, rows.T, strict=True):
            collisions[name] = column
        ball: Any = collisions["ball"]  # with its true type, mypy takes seconds to index with it
        collisions["kind"] = self.scene.balls.kind[ball]
        self.log.extend(collisions)

    def _load_parts(self) -> None:
        """Copy the loads of the modules to the parts."""
        for part, (hits, impulse, transferred, first_hit_s, _) in zip(
            self._parts, self._world.loads.tolist(), strict=True
        ):
            if hits:
                part.hits, part.impulse, part.transferred_impulse = hits, impulse, transferred
                part.first_hit_s = first_hit_s


def _run_again(scene: Scene, cell_units: float | None, until_s: float) -> EventRun:
    """Return a run of a scene up to the time of another run of it."""
    run = EventRun(scene, cell_units)
    run.advance(until_s)
    return run
