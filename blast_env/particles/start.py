"""The two engines of the particle model: their versions, and runs of a scene on them."""

from collections.abc import Callable, Mapping
from importlib.metadata import version
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from blast_env.particles.event.engine import EventRun
    from blast_env.particles.pymunk.engine import PymunkRun
    from blast_env.particles.run import BlastRun
    from blast_env.particles.scene import Scene

VERSIONS: Final[Mapping[str, str]] = MappingProxyType(
    {"pymunk": f"pymunk {version('pymunk')}", "event": f"event 1 (numba {version('numba')})"}
)
"""Version of the code that does the physics, by the name of the engine."""


def start_pymunk(scene: "Scene") -> "PymunkRun":
    """Return a run at time 0 in a new space."""
    from blast_env.particles.pymunk.engine import PymunkRun  # loads a compiled library

    return PymunkRun(scene)


def start_event(scene: "Scene", cell_units: float | None = None) -> "EventRun":
    """Return a run at time 0 from one collision to the next.

    Args:
        cell_units: Side of the cells of the neighbour search; see `world_of`.
    """
    from blast_env.particles.event.engine import EventRun  # Numba takes half a second to import

    return EventRun(scene, cell_units)


STARTS: Final[Mapping[str, Callable[["Scene"], "BlastRun"]]] = MappingProxyType(
    {"pymunk": start_pymunk, "event": start_event}
)
"""The start of a run, by the name of the engine."""
