"""The event-driven engine: hard discs without time steps, compiled with Numba."""

from importlib.metadata import version
from typing import TYPE_CHECKING, Final

from blast_env.lazy import on_first_use

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.particles.event.engine import EventRun, run_world
    from blast_env.particles.event.state import RECORD_COLUMNS, RecordArray, World, world_of
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = ["RECORD_COLUMNS", "EventRun", "RecordArray", "World", "run_world", "world_of"]

VERSION: Final = f"event 1 (numba {version('numba')})"
"""Version of the code that does the physics."""
