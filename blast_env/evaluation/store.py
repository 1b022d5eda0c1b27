"""What is remembered of blasts: in memory, and in a folder for others and for later."""

import dataclasses
import json
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np
from pydantic import TypeAdapter

from blast_env.calibration.model import Calibration
from blast_env.engines import BlastLoads, Engine, StructureLoad
from blast_env.errors import BlastEnvError
from blast_env.files import FolderStore
from blast_env.geometry import Layout
from blast_env.physics.scene import Charge
from blast_env.response.damage import BayDamage


class BlastKey(NamedTuple):
    """All that the loads of a blast depend on.

    Attributes:
        scenario_hash: Content hash of the scenario.
        layout: The layout's cells, sorted.
        charge: The charge, at the place where it goes off.
        seed: Seed of fan and air.
        engine: The engine with its version; see `engine_text`.
        calibration: Digest of the calibration, for the loads in psi*s.
        code: Version of the package; see `provenance.code_version`.
    """

    scenario_hash: str
    layout: Layout
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


SUFFIX: Final = ".loads"
"""Files with this suffix belong to the cache; it touches no others."""

MOST_BYTES: Final = 256_000_000
"""Size of a cache unless an argument says otherwise; a blast in the courtyard takes 2 kB."""


class DiskCache:
    """Keeps loads in files of a folder, for other processes and the next run; see `FolderStore`.

    Where the folder cannot be used (any more), a warning says so and the work goes on. A loss of
    power may cost the last blasts, which would be simulated again: to wait for the device after
    each would take as long as a blast of the particle model does.

    Args:
        folder: The folder; it is made if need be.
        most_bytes: Most that the files take together.

    Raises:
        BlastEnvError: If the folder cannot be made, or `most_bytes` is negative.
    """

    def __init__(self, folder: str | Path, most_bytes: int = MOST_BYTES) -> None:
        self._store = FolderStore(folder, SUFFIX, most_bytes, durable=False)

    @property
    def folder(self) -> Path:
        """The folder, as an absolute path."""
        return self._store.folder

    @property
    def damaged(self) -> int:
        """Number of damaged files that this object has found."""
        return self._store.damaged

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not there in one piece."""
        return self._store.read(json.dumps(key), _decoded)

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast; the ones that were asked for longest ago may have to go."""
        try:
            self._store.put(json.dumps(key), _encoded(loads))
        except BlastEnvError as error:
            warnings.warn(f"a blast is not kept: {error}", RuntimeWarning, stacklevel=2)

    def items(self) -> Iterator[tuple[BlastKey, BlastLoads]]:
        """Yield all blasts that are there in one piece, always in the same order."""
        for text, content in self._store.items():
            with suppress(ValueError):
                yield _KEY.validate_python(json.loads(text)), _decoded(content)

    def __len__(self) -> int:
        return len(self._store)


def find_cache(value: str | Path | BlastCache | None) -> BlastCache | None:
    """Return the cache for an argument `cache`.

    Args:
        value: A folder for a `DiskCache`, a cache, or `None` for none.

    Raises:
        BlastEnvError: If the folder cannot be made, or the object is no cache.
    """
    if isinstance(value, str | Path):
        return DiskCache(value)
    if value is not None and not (hasattr(value, "get") and hasattr(value, "add")):
        raise BlastEnvError(f"cache is {value!r}, must be a folder or have the methods get and add")
    return value


_KEY: Final = TypeAdapter(BlastKey)


def _encoded(loads: BlastLoads) -> bytes:
    """Return a line of JSON, and the impulses on the modules."""
    header = {
        "structures": [asdict(load) for load in loads.structures],
        "bays": [asdict(bay) for bay in loads.bays],
    }
    return json.dumps(header).encode() + b"\n" + loads.module_impulse_sim.astype("<f8").tobytes()


@dataclass(frozen=True)
class _Header:
    structures: tuple[StructureLoad, ...]
    bays: tuple[BayDamage, ...]


_HEADER: Final = TypeAdapter(_Header)


def _decoded(content: bytes) -> BlastLoads:
    """Return the loads."""
    line, _, impulses = content.partition(b"\n")
    header = _HEADER.validate_json(line)
    modules = np.frombuffer(impulses, dtype="<f8").astype(np.float64)
    return BlastLoads(header.structures, modules, header.bays)
