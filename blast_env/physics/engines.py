"""The engines that come with the package, by name: a new one is a file and a line here."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final

from blast_env.errors import UnknownNameError
from blast_env.physics.engine import Engine

# As text, so that only the engine that runs is imported: Numba alone takes half a second.
_CLASSES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pymunk": "blast_env.physics.pymunk.engine:PymunkEngine",
        "event": "blast_env.physics.event.engine:EventEngine",
    }
)

ENGINE_NAMES: Final = tuple(_CLASSES)
"""The engines that come with the package; the first one is the reference."""


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
