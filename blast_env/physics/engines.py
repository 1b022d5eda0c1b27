"""The engines that come with the package, by name: a new one is a file and a line here."""

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from blast_env.errors import BlastEnvError, UnknownNameError, value_text
from blast_env.physics.engine import Engine, ParticleEngine

if TYPE_CHECKING:
    from typing_extensions import TypeIs

    from blast_env.physics.gas.engine import GasEngine

# As text, so that only the engine that runs is imported: Numba alone takes half a second.
_CLASSES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pymunk": "blast_env.physics.pymunk.engine:PymunkEngine",
        "event": "blast_env.physics.event.engine:EventEngine",
        "gas": "blast_env.physics.gas.engine:GasEngine",
    }
)

ENGINE_NAMES: Final = tuple(_CLASSES)
"""The engines that come with the package; the first one is the reference."""

GAS: Final = "gas"
"""Gas dynamics: no particles, no seed, no calibration."""

STEP_NAMES: Final[Mapping[str, str]] = MappingProxyType({"event": "events"})
"""What an engine's steps are, for those that do not go by steps of time."""

PARTICLE_ENGINES: Final = tuple(name for name in ENGINE_NAMES if name != GAS)
"""The engines of the particle model; the first one is the reference."""


def find_engine(engine: str | Engine, cell_m: float | None = None) -> Engine:
    """Return an engine by its name, or the engine itself.

    Args:
        engine: The name, or the engine.
        cell_m: Side of the cells of gas dynamics; that of the engine unless given.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If `cell_m` does not divide the side of a module, or is given for an engine
            that has no cells.
    """
    found = engine if not isinstance(engine, str) else _made(engine)
    if not hasattr(found, "version") or not hasattr(found, "name"):
        raise BlastEnvError(f"engine is {value_text(engine)}, must be a name or an engine")
    if cell_m is None:
        return found
    if not is_gas(found):
        raise BlastEnvError(
            f"cell_m is {value_text(cell_m)}, but engine {found.name!r} has no cells"
        )
    return replace(found, cell_m=cell_m)


def _made(name: str) -> Engine:
    if name not in _CLASSES:
        raise UnknownNameError("engine", name, ENGINE_NAMES)
    module, _, kind = _CLASSES[name].partition(":")
    made: Engine = getattr(import_module(module), kind)()
    return made


def find_particle_engine(engine: str | Engine) -> ParticleEngine:
    """Return an engine of particles by its name, or the engine itself.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If it is no engine of particles.
    """
    found = find_engine(engine)
    if not has_particles(found):
        raise BlastEnvError(
            f"engine {found.name!r} has no particles: this is for the particle engines"
        )
    return found


def has_particles(engine: Engine) -> "TypeIs[ParticleEngine]":
    """Return whether an engine runs scenes of balls: with noise, and a calibration for loads."""
    return hasattr(engine, "start")


def is_gas(engine: Engine) -> "TypeIs[GasEngine]":
    """Return whether an engine is gas dynamics, without importing it to see."""
    return engine.name == GAS
