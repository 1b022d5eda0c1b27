"""What is remembered of blasts: in memory, and in a folder for others and for later."""

import dataclasses
import json
import os
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from blast_env.calibration.model import Calibration
from blast_env.errors import BlastEnvError
from blast_env.evaluation.loads import BlastLoads, StructureLoad
from blast_env.files import make_folder, write_atomically
from blast_env.geometry import Cell
from blast_env.physics.engine import Engine
from blast_env.physics.scene import Charge


class BlastKey(NamedTuple):
    """All that the loads of a blast depend on.

    Attributes:
        scenario_hash: Content hash of the scenario.
        layout: The layout's cells, sorted.
        charge: The charge.
        seed: Seed of fan and air.
        engine: The engine with its version; see `engine_text`.
        calibration: Digest of the calibration, for the loads in psi*s.
        code: Version of the package; see `provenance.code_version`.
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


SUFFIX: Final = ".loads"
"""Files with this suffix belong to the cache; it touches no others."""


MOST_BYTES: Final = 256_000_000
"""Size of a cache unless an argument says otherwise; a blast in the courtyard takes 2 kB."""


_CHECKSUM_BYTES: Final = 32


_KEPT_SHARE: Final = 0.9  # when something has to go, so that not every blast tidies up


_UNSEEN_SHARE: Final = 1.0 / 32.0


class _Entry(NamedTuple):
    """A file of the cache: when it was last used, its size in bytes, and where it is."""

    used_ns: int
    size: int
    path: str


class DiskCache:
    """Keeps loads in files of a folder; what was not asked for longest goes first.

    Any number of processes may use one folder at once. A file that was damaged, or is not what
    its name says, is deleted and counts as not there. Where the folder cannot be written (any
    more), a warning says so and the work goes on.

    It can be pickled; the copy uses the same folder.

    Args:
        folder: The folder; it is made if need be.
        most_bytes: Most that the files take together. Each process looks after every 32nd part of
            it that it has written, so several may exceed it by as much for a moment.

    Attributes:
        folder: The folder, as an absolute path.
        most_bytes: As given.
        damaged: Number of damaged files that this object has found.

    Raises:
        BlastEnvError: If the folder cannot be made, or `most_bytes` is negative.
    """

    def __init__(self, folder: str | Path, most_bytes: int = MOST_BYTES) -> None:
        if most_bytes < 0:
            raise BlastEnvError(f"most_bytes is {most_bytes}, must be at least 0")
        self.folder = Path(folder).absolute()
        self.most_bytes = most_bytes
        self.damaged = 0
        self._unseen_bytes = most_bytes  # nobody has looked yet
        make_folder(self.folder)

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not there in one piece."""
        path = self._path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        loads = _decoded(content, key)
        try:
            if loads is None:
                self.damaged += 1
                path.unlink(missing_ok=True)
            else:
                os.utime(path)
        except OSError:  # a folder that may only be read
            pass
        return loads

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast; the ones that were asked for longest ago may have to go."""
        content = _encoded(key, loads)
        try:
            with write_atomically(self._path(key)) as temporary:
                temporary.write_bytes(content)
        except (BlastEnvError, OSError) as error:
            warnings.warn(f"a blast is not kept: {error}", RuntimeWarning, stacklevel=2)
            return
        self._unseen_bytes += len(content)
        if self._unseen_bytes > _UNSEEN_SHARE * self.most_bytes:
            self._unseen_bytes = 0
            self._tidy_up()

    def __len__(self) -> int:
        return sum(1 for _ in self._entries())

    def _path(self, key: BlastKey) -> Path:
        return self.folder / f"{sha256(_key_text(key).encode()).hexdigest()}{SUFFIX}"

    def _entries(self) -> Iterator[_Entry]:
        """Yield the files, those that a killed process left unfinished among them."""
        with os.scandir(self.folder) as listed:
            for item in listed:
                if item.name.endswith(SUFFIX):
                    try:
                        status = item.stat()
                    except OSError:  # another process has deleted it
                        continue
                    yield _Entry(status.st_mtime_ns, status.st_size, item.path)

    def _tidy_up(self) -> None:
        """Delete files until the rest is small enough, if all together are too large."""
        entries = sorted(self._entries())
        size = sum(entry.size for entry in entries)
        if size <= self.most_bytes:
            return
        for entry in entries:
            if size <= _KEPT_SHARE * self.most_bytes:
                return
            Path(entry.path).unlink(missing_ok=True)
            size -= entry.size


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


def _key_text(key: BlastKey) -> str:
    return json.dumps(key)


def _encoded(key: BlastKey, loads: BlastLoads) -> bytes:
    """Return the content of a file: checksum, a line of JSON, the impulses on the modules."""
    header = {"key": _key_text(key), "structures": [asdict(load) for load in loads.structures]}
    impulses = loads.module_impulse_sim.astype("<f8").tobytes()
    body = json.dumps(header).encode() + b"\n" + impulses
    return sha256(body).digest() + body


def _decoded(content: bytes, key: BlastKey) -> BlastLoads | None:
    """Return the loads that a file holds, or `None` if it is damaged or of another blast."""
    checksum, body = content[:_CHECKSUM_BYTES], content[_CHECKSUM_BYTES:]
    if sha256(body).digest() != checksum:
        return None
    line, _, impulses = body.partition(b"\n")
    header: dict[str, Any] = json.loads(line)
    if header["key"] != _key_text(key):
        return None
    structures = tuple(
        StructureLoad(**{**each, "notes": tuple(each["notes"])}) for each in header["structures"]
    )
    return BlastLoads(structures, np.frombuffer(impulses, dtype="<f8").astype(np.float64))
