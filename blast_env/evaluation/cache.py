"""What is remembered of blasts, and by what it is found again."""

import dataclasses
from collections import OrderedDict
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from blast_env.calibration.model import Calibration
from blast_env.errors import BlastEnvError
from blast_env.evaluation.loads import BlastLoads
from blast_env.physics.engine import Engine
from blast_env.scenario import Cell, Charge

_NO_INFLUENCE: Final = frozenset({"cli", "envs", "export", "recording", "rendering", "sites"})
"""Parts of the package that cannot change the loads of a blast."""


class BlastKey(NamedTuple):
    """All that the loads of a blast depend on.

    Attributes:
        scenario_hash: Content hash of the scenario.
        layout: The layout's cells, sorted.
        charge: The charge.
        seed: Seed of fan and air.
        engine: The engine with its version; see `engine_text`.
        calibration: Digest of the calibration, for the loads in psi*s.
        code: Version of the package; see `code_version`.
    """

    scenario_hash: str
    layout: tuple[Cell, ...]
    charge: Charge
    seed: int
    engine: str
    calibration: str
    code: str


class BlastCache(Protocol):
    """Remembers the loads of blasts.

    It may forget, but what it gives is what was added.
    """

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not there (any more)."""

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Remember the loads of a blast; others may have to go for them."""


class LoadsCache:
    """Keeps the loads that were asked for last, in the memory of this process.

    Args:
        size: Most loads that are kept; 0 keeps none. One takes 8 bytes a module and about a
            kilobyte beside.

    Raises:
        BlastEnvError: If the size is negative.
    """

    def __init__(self, size: int) -> None:
        if size < 0:
            raise BlastEnvError(f"cache_size is {size}, must be at least 0")
        self.size = size
        self._loads: OrderedDict[BlastKey, BlastLoads] = OrderedDict()

    def __len__(self) -> int:
        return len(self._loads)

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not there (any more)."""
        loads = self._loads.get(key)
        if loads is not None:
            self._loads.move_to_end(key)
        return loads

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast; the ones that were asked for longest ago may have to go."""
        self._loads[key] = loads
        self._loads.move_to_end(key)
        if len(self._loads) > self.size:
            self._loads.popitem(last=False)


def engine_text(engine: Engine) -> str:
    """Return an engine for a key: its class, name and version, and its fields if it has some.

    Two engines of one class, name and version without fields (dataclass) count as the same.
    """
    kind = f"{type(engine).__module__}.{type(engine).__qualname__}"
    fields = repr(engine) if dataclasses.is_dataclass(engine) else ""
    return f"{kind} {engine.name} {engine.version} {fields}".rstrip()


def calibration_digest(calibration: Calibration) -> str:
    """Return the SHA-256 of a calibration: one of the same name may be made anew."""
    return sha256(calibration.model_dump_json().encode()).hexdigest()


@cache
def code_version() -> str:
    """Return the version of the package, with a digest of the code that loads depend on.

    The digest, because whoever changes the model does not change the version at once.
    """
    folder = Path(__file__).resolve().parents[1]
    digest = sha256()
    for path in sorted(folder.rglob("*.py")):
        name = path.relative_to(folder)
        if name.parts[0] not in _NO_INFLUENCE:
            digest.update(f"{name.as_posix()}\n".encode() + path.read_bytes())
    return f"{version('blast-env')}+{digest.hexdigest()[:16]}"
