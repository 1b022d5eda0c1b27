"""The engines that come with the package, by name: a new one is a file and a line here."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, cast

from blast_env.errors import BlastEnvError, UnknownNameError
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


def find_engine(engine: str | Engine) -> Engine:
    """Return an engine by its name, or the engine itself.

    Raises:
        UnknownNameError: If there is no engine of that name.
    """
    if not isinstance(engine, str):
        return engine
    if engine not in _CLASSES:
        raise UnknownNameError("engine", engine, ENGINE_NAMES)
    module, _, name = _CLASSES[engine].partition(":")
    found: Engine = getattr(import_module(module), name)()
    return found


def find_particle_engine(engine: str | Engine) -> ParticleEngine:
    """Return an engine of particles by its name, or the engine itself.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If it is no engine of particles.
    """
    found = find_engine(engine)
    if is_gas(found):
        raise BlastEnvError(f"engine {GAS!r} has no particles: this is for the particle engines")
    return cast(ParticleEngine, found)


def is_gas(engine: Engine) -> "TypeIs[GasEngine]":
    """Return whether an engine is gas dynamics, without importing it to see."""
    return engine.name == GAS
