"""Caches of blast loads, in memory and in a folder for other processes and later runs."""

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

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastLoads, Engine, ParticleLoad, StructureLoad
from blast_env.files import FolderStore
from blast_env.geometry import Layout
from blast_env.particles.calibration.model import Calibration
from blast_env.response.damage import BayDamage
from blast_env.site.scene import Charge


class BlastKey(NamedTuple):
    """All inputs that determine the loads of a blast.

    Attributes:
        scenario_hash: Content hash of the scenario.
        layout: The layout's cells, sorted.
        charge: The charge at its place.
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
    """The interface of caches of blast loads.

    A cache may drop loads, but must return them unchanged.
    """

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not cached."""

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Cache the loads of a blast, which may displace others."""


class LoadsCache:
    """Keeps the most recently used loads in the memory of this process.

    Args:
        size: Maximum number of loads; 0 for none. Each takes 8 bytes per module plus about a
            kilobyte.

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
        """Return the loads of a blast, or `None` if they are not cached."""
        loads = self._loads.get(key)
        if loads is not None:
            self._loads.move_to_end(key)
        return loads

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Cache the loads of a blast, which may displace the least recently used ones."""
        self._loads[key] = loads
        self._loads.move_to_end(key)
        if len(self._loads) > self.size:
            self._loads.popitem(last=False)


def engine_text(engine: Engine) -> str:
    """Return the text of an engine in a key: class, name, version and any dataclass fields.

    Engines of one class, name and version that are not dataclasses count as equal.
    """
    kind = f"{type(engine).__module__}.{type(engine).__qualname__}"
    fields = repr(engine) if dataclasses.is_dataclass(engine) else ""
    return f"{kind} {engine.name} {engine.version} {fields}".rstrip()


def calibration_digest(calibration: Calibration) -> str:
    """Return the SHA-256 of a calibration, which distinguishes versions of the same name."""
    return sha256(calibration.model_dump_json().encode()).hexdigest()


SUFFIX: Final = ".loads"
"""Suffix of the files of the cache, which touches no others."""

MOST_BYTES: Final = 256_000_000
"""Default maximum size of a cache; a blast in the courtyard takes 2 kB."""


class DiskCache:
    """Keeps loads in the files of a folder, for other processes and later runs; see `FolderStore`.

    If the folder becomes unusable, a warning is issued and the work continues. A loss of power may
    lose the last blasts, which are then simulated again. Files are not flushed to the device after
    each blast, because that takes as long as a blast of the particle model.

    Args:
        folder: The folder; created if necessary.
        most_bytes: Maximum total size of the files.

    Raises:
        BlastEnvError: If the folder cannot be created, or `most_bytes` is negative.
    """

    def __init__(self, folder: str | Path, most_bytes: int = MOST_BYTES) -> None:
        self._store = FolderStore(folder, SUFFIX, most_bytes, durable=False)

    @property
    def folder(self) -> Path:
        """The folder, as an absolute path."""
        return self._store.folder

    @property
    def damaged(self) -> int:
        """Number of damaged files found by this object."""
        return self._store.damaged

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are missing or damaged."""
        return self._store.read(json.dumps(key), _decoded)

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Cache the loads of a blast, which may displace the least recently used ones."""
        try:
            self._store.put(json.dumps(key), _encoded(loads))
        except BlastEnvError as error:
            warnings.warn(f"a blast is not kept: {error}", RuntimeWarning, stacklevel=2)

    def items(self) -> Iterator[tuple[BlastKey, BlastLoads]]:
        """Yield all undamaged blasts, always in the same order."""
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
        BlastEnvError: If the folder cannot be created, or the object is not a cache.
    """
    if isinstance(value, str | Path):
        return DiskCache(value)
    if value is not None and not (hasattr(value, "get") and hasattr(value, "add")):
        raise BlastEnvError(f"cache is {value!r}, must be a folder or have the methods get and add")
    return value


_KEY: Final = TypeAdapter(BlastKey)


def _encoded(loads: BlastLoads) -> bytes:
    """Encode loads as a line of JSON, followed by the impulses on the modules."""
    has_particles = any(isinstance(load, ParticleLoad) for load in loads.structures)
    header = {
        "particles" if has_particles else "structures": [asdict(load) for load in loads.structures],
        "bays": [asdict(bay) for bay in loads.bays],
    }
    return json.dumps(header).encode() + b"\n" + loads.module_impulse_sim.astype("<f8").tobytes()


@dataclass(frozen=True)
class _Header:
    bays: tuple[BayDamage, ...]
    structures: tuple[StructureLoad, ...] = ()
    particles: tuple[ParticleLoad, ...] = ()


_HEADER: Final = TypeAdapter(_Header)


def _decoded(content: bytes) -> BlastLoads:
    """Decode the result of `_encoded`."""
    line, _, impulses = content.partition(b"\n")
    header = _HEADER.validate_json(line)
    modules = np.frombuffer(impulses, dtype="<f8").astype(np.float64)
    return BlastLoads(header.particles or header.structures, modules, header.bays)
