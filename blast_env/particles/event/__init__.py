"""The event-driven engine: hard discs without time steps, compiled with Numba."""

from blast_env.particles.event.engine import EventRun, run_world
from blast_env.particles.event.state import RECORD_COLUMNS, RecordArray, World, world_of

__all__ = ["RECORD_COLUMNS", "EventRun", "RecordArray", "World", "run_world", "world_of"]
