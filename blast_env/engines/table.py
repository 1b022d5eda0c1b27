"""The engines that come with the package, by name: a new one is a file and a line here."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final

from blast_env.engines.contract import Engine
from blast_env.errors import BlastEnvError, UnknownNameError, import_extra, value_text


@dataclass(frozen=True)
class _Row:
    """Where an engine is, and what must be known of it before it is imported.

    Attributes:
        place: "module:Class", as text: only the engine that runs is imported, for Numba alone
            takes half a second.
        needs_calibration: As of the class.
        extra: The extra that it needs; empty for none.
    """

    place: str
    needs_calibration: bool = False
    extra: str = ""


_TABLE: Final[Mapping[str, _Row]] = MappingProxyType(
    {
        "pymunk": _Row("blast_env.engines.particles:PymunkEngine", needs_calibration=True),
        "event": _Row("blast_env.engines.particles:EventEngine", needs_calibration=True),
        "gas": _Row("blast_env.engines.gas:GasEngine"),
        "surrogate": _Row("blast_agents.surrogate.engine:SurrogateEngine", extra="agents"),
    }
)

ENGINE_NAMES: Final = tuple(_TABLE)
"""The engines that come with the package; the first one is the reference of the paper's model."""

CALIBRATED_ENGINES: Final = tuple(name for name, row in _TABLE.items() if row.needs_calibration)
"""Those whose loads a calibration turns into Pa s."""

JUDGE: Final = "gas"
"""The engine whose word counts about protection."""


def find_engine(engine: str | Engine, cell_m: float | None = None) -> Engine:
    """Return an engine by its name, or the engine itself.

    Args:
        engine: The name, or the engine.
        cell_m: Side of the cells of gas dynamics; that of the engine unless given.

    Raises:
        UnknownNameError: If there is no engine of that name.
        BlastEnvError: If `cell_m` does not divide the side of a module, or is given for an engine
            that has no cells; or an extra is missing.
    """
    found = _made(engine) if isinstance(engine, str) else engine
    if not isinstance(found, Engine):
        raise BlastEnvError(f"engine is {value_text(engine)}, must be a name or an engine")
    return found.configured(cell_m=cell_m)


def _made(name: str) -> Engine:
    if name not in _TABLE:
        raise UnknownNameError("engine", name, ENGINE_NAMES)
    row = _TABLE[name]
    module, _, kind = row.place.partition(":")
    if not row.extra:
        made: Engine = getattr(import_module(module), kind)()
        return made
    with import_extra(row.extra, f"engine {name!r}"):
        guessing: Engine = getattr(import_module(module), kind)()
    return guessing


def load_plugin(place: str) -> Any:
    """Return what a "module:name" stands for; see `Engine.unfolding`."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
