"""The event-driven engine: hard discs without time steps, compiled with Numba."""

from typing import TYPE_CHECKING, Final

from blast_env.particles.event.state import RECORD_COLUMNS, RecordArray, World, world_of

if TYPE_CHECKING:
    from blast_env.particles.event.engine import EventRun, run_world

__all__ = ["RECORD_COLUMNS", "EventRun", "RecordArray", "World", "run_world", "world_of"]

_ENGINE: Final = frozenset({"EventRun", "run_world"})


def __getattr__(name: str) -> object:
    """Import a module on the first use of its names: its libraries take long to import."""
    if name in _ENGINE:
        from blast_env.particles.event import engine

        return getattr(engine, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
