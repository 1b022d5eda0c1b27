"""The event-driven engine: the paper's model with hard discs and without a time step."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from blast_env.physics.engine import COLLISION_DTYPE, BallStates, CollisionLog, EndReason
from blast_env.physics.event import loop
from blast_env.physics.event.loop import run_world
from blast_env.physics.event.state import RECORD_COLUMNS, with_walls, world_of
from blast_env.physics.scene import Scene

_RECORD_ROWS: Final = 4096


MOST_RECORDS: Final = 20_000_000
"""Hits on modules after which a run ends as at `most_collisions`: they take some 2 GB."""


_END_REASONS: Final = {
    loop.OUT_OF_REACH: EndReason.OUT_OF_REACH,
    loop.EVENT_LIMIT: EndReason.EVENT_LIMIT,
}


class EventRun:
    """One blast on its way; see `BlastRun` for the attributes. A step is a collision."""

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
        """Pickle the scene and the time: parts of the state share memory, which a copy loses."""
        until_s = self.time_s if self.end_reason is None else np.inf
        return _run_again, (self.scene, self._cell_units, until_s)

    @property
    def crossings(self) -> int:
        """Moves of balls from one cell to the next so far, which cost time as collisions do."""
        return int(self._world.progress["crossings"])

    @property
    def outdated(self) -> int:
        """Collisions foreseen so far that did not happen, a partner having been hit before."""
        return int(self._world.progress["outdated"])

    def advance(self, until_s: float) -> None:
        """Go on until the simulated time is `until_s`, or the run has ended."""
        if self.end_reason is not None or self.time_s >= until_s:
            return
        limit_s = self.scene.parameters.stepping.time_limit_s
        target_s = min(until_s, limit_s)
        answer = loop.RECORD_FULL
        while answer in (loop.RECORD_FULL, loop.MODULE_DESTROYED):
            answer = run_world(self._world, self._record, target_s)
            self._read_record()
            if self._recorded >= MOST_RECORDS:
                answer = loop.EVENT_LIMIT
            elif answer == loop.MODULE_DESTROYED:
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
        """Return the balls that are still there."""
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
        """Move what the compiled loop recorded to the log."""
        rows = self._record[: self._world.progress["records"]]
        self._world.progress["records"] = 0
        self._recorded += len(rows)
        if not len(rows):
            return
        collisions = np.empty(len(rows), dtype=COLLISION_DTYPE)
        for name, column in zip(RECORD_COLUMNS, rows.T, strict=True):
            collisions[name] = column
        ball: Any = collisions["ball"]  # as what it is, it takes mypy seconds to index with
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
    """Return a run of a scene up to a time that another run of it has come to."""
    run = EventRun(scene, cell_units)
    run.advance(until_s)
    return run
