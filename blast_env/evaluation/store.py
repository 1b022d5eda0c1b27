"""The store of blast loads, in memory and in a file for other processes and later runs."""

import dataclasses
import json
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

import numpy as np
from pydantic import TypeAdapter

from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation.engines import BlastLoads, Engine, StructureLoad
from blast_env.geometry import Layout
from blast_env.particles.calibration.model import Calibration
from blast_env.response.damage import BayDamage
from blast_env.site import AnyScenario, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.store import Store

T = TypeVar("T")


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


MOST_BYTES: Final = 256_000_000
"""Default maximum size of the file of a store; a blast in the courtyard takes 2 kB."""

_FILE: Final = "blasts.sqlite"
_MOST_CONTENTS: Final = 64  # in memory, without a file; one with histories takes up to a megabyte


class BlastStore:
    """The loads of blasts: the most recently used in memory and, with a folder, all in a file.

    The file serves other processes and later runs; see `Store`. If it becomes unusable, a warning
    is issued and the work continues without it. A store can be pickled, with the loads in memory.

    Args:
        folder: Folder of the file; created if necessary. Without one, loads are only in memory.
        size: Maximum number of loads in memory; 0 for none. Each takes 8 bytes per module plus
            about a kilobyte.
        most_bytes: Maximum total size of the loads in the file.

    Raises:
        BlastEnvError: If a bound is negative, or the file is damaged or cannot be made.
    """

    def __init__(
        self, folder: str | Path | None = None, size: int = 4096, most_bytes: int = MOST_BYTES
    ) -> None:
        if size < 0:
            raise BlastEnvError(f"cache_size is {size}, must be at least 0")
        self.size = size
        self._loads: OrderedDict[BlastKey, BlastLoads] = OrderedDict()
        self._contents: OrderedDict[str, bytes] = OrderedDict()
        self._file = None if folder is None else Store(Path(folder) / _FILE, most_bytes)

    @classmethod
    def of(cls, value: "str | Path | BlastStore | None", size: int = 4096) -> "BlastStore":
        """Return the store for an argument `cache`: a folder, a store, or `None`."""
        if isinstance(value, BlastStore):
            return value
        if value is not None and not isinstance(value, str | Path):
            raise BlastEnvError(f"cache is {value_text(value)}, must be a folder or a BlastStore")
        return cls(value, size)

    @property
    def damaged(self) -> int:
        """Number of damaged blasts found in the file by this object."""
        return 0 if self._file is None else self._file.damaged

    def get(self, key: BlastKey, scenario: AnyScenario | None = None) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are missing or damaged.

        Loads in the file that cannot be those of `scenario` count as missing: anybody may write to
        it.
        """
        loads = self._loads.get(key)
        if loads is not None:
            with suppress(KeyError):  # another thread has displaced it
                self._loads.move_to_end(key)
            return loads
        if self._file is None:
            return None
        loads = self.read(json.dumps(key), _decoded)
        if loads is None or not (scenario is None or loads.are_for(find_scenario(scenario))):
            return None
        self.remember(key, loads)
        return loads

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast, which may displace others."""
        self.remember(key, loads)
        if self._file is not None:
            self.put(json.dumps(key), _encoded(loads))

    def read(self, key: str, decode: Callable[[bytes], T]) -> T | None:
        """Return a content as `Store.read`; `None` if it is missing or damaged."""
        if self._file is None:
            content = self._contents.get(key)
            return None if content is None else decode(content)
        try:
            return self._file.read(key, decode)
        except BlastEnvError as error:
            warnings.warn(f"a blast counts as missing: {error}", RuntimeWarning, stacklevel=3)
            return None

    def put(self, key: str, content: bytes) -> None:
        """Keep a content in the file; in memory without one, the most recent ones."""
        if self._file is None:
            self._contents[key] = content
            if len(self._contents) > _MOST_CONTENTS:
                self._contents.popitem(last=False)
            return
        try:
            self._file.put(key, content)
        except BlastEnvError as error:
            warnings.warn(f"a blast is not kept: {error}", RuntimeWarning, stacklevel=3)

    def remember(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast in memory only."""
        loads.module_impulse.flags.writeable = False  # shared by several callers
        self._loads.pop(key, None)
        self._loads[key] = loads
        with suppress(KeyError):  # another thread has displaced it
            if len(self._loads) > self.size:
                self._loads.popitem(last=False)

    def items(self) -> Iterator[tuple[BlastKey, BlastLoads]]:
        """Yield all undamaged blasts of the file, always in the same order; else those in memory.

        Raises:
            BlastEnvError: If the file cannot be read.
        """
        if self._file is None:
            yield from self._loads.items()
            return
        for text, content in self._file.items():
            with suppress(ValueError):
                yield _KEY.validate_python(json.loads(text)), _decoded(content)

    def __len__(self) -> int:
        return len(self._loads) if self._file is None else len(self._file)


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


_KEY: Final = TypeAdapter(BlastKey)


def _encoded(loads: BlastLoads) -> bytes:
    """Encode loads as a line of JSON, followed by the impulses on the modules."""
    header = {
        "structures": [asdict(load) for load in loads.structures],
        "bays": [asdict(bay) for bay in loads.bays],
    }
    return json.dumps(header).encode() + b"\n" + loads.module_impulse.astype("<f8").tobytes()


@dataclass(frozen=True)
class _Header:
    bays: tuple[BayDamage, ...]
    structures: tuple[StructureLoad, ...]


_HEADER: Final = TypeAdapter(_Header)


def _decoded(content: bytes) -> BlastLoads:
    """Decode the result of `_encoded`."""
    line, _, impulses = content.partition(b"\n")
    header = _HEADER.validate_json(line)
    modules = np.frombuffer(impulses, dtype="<f8").astype(np.float64)
    return BlastLoads(header.structures, modules, header.bays)
