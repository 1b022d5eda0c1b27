"""The store of blasts, in memory and in a file for other processes and later runs."""

import json
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.errors import BlastEnvError, BlastEnvWarning, value_text
from blast_env.evaluation.record import KEY, BlastKey, BlastLoads, BlastRecord
from blast_env.site import AnyScenario, find_scenario

if TYPE_CHECKING:
    from blast_env.store import Store

MOST_BYTES: Final = 256_000_000
"""Default maximum size of the file of a store; a blast in the courtyard takes 2 kB."""

_FILE: Final = "blasts.sqlite"
_MOST_COMPLETE: Final = 256  # in memory, without a file; one with histories takes up to a megabyte


class BlastStore:
    """The records of blasts: the most recently used in memory and, with a folder, all in a file.

    The file serves other processes and later runs; see `Store`. If it becomes unusable, a warning
    is issued and the work continues without it. A store can be pickled, with what is in memory.
    With a file, loads alone stay in memory.

    Args:
        folder: Folder of the file; created if necessary. Without one, records are only in memory.
        size: Maximum number of loads in memory; 0 for none. Each takes 8 bytes per module plus
            about a kilobyte.
        most_bytes: Maximum total size of the records in the file.

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
        self._complete: OrderedDict[BlastKey, BlastRecord] = OrderedDict()
        self._file = None if folder is None else _opened(Path(folder) / _FILE, most_bytes)

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
        # 1. In memory; 2. in the file; 3. what was found there stays in memory.
        loads = self._loads.get(key)
        if loads is not None:
            with suppress(KeyError):  # another thread has displaced it
                self._loads.move_to_end(key)
            return loads
        found = self._read(key, scenario)
        if found is None:
            return None
        self.remember(key, found.loads)
        return found.loads

    def record(self, key: BlastKey, scenario: AnyScenario | None = None) -> BlastRecord | None:
        """Return the complete record of a blast; `None` if it is missing, damaged, or loads alone.

        As for `get`, it must be able to be that of `scenario`.
        """
        found = self._complete.get(key) or self._read(key, scenario)
        return None if found is None or found.details is None else found

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast, which may displace others."""
        if self._file is None:
            self.remember(key, loads)
        else:
            self.keep(key, BlastRecord(loads))

    def keep(self, key: BlastKey, record: BlastRecord) -> None:
        """Keep the record of a blast, which may displace others."""
        self.remember(key, record.loads)
        if self._file is None:
            if record.details is not None and self.size:
                self._complete[key] = record
                if len(self._complete) > _MOST_COMPLETE:
                    self._complete.popitem(last=False)
            return
        try:
            self._file.put(key.text, record.encoded())
        except BlastEnvError as error:
            warnings.warn(f"a blast is not kept: {error}", BlastEnvWarning, stacklevel=3)

    def remember(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast in memory only."""
        for on_modules in (loads.module_impulse_n_s, loads.module_impulse_sim):
            on_modules.flags.writeable = False  # shared by several callers
        self._loads.pop(key, None)
        self._loads[key] = loads
        with suppress(KeyError):  # another thread has displaced it
            if len(self._loads) > self.size:
                self._loads.popitem(last=False)

    def _read(self, key: BlastKey, scenario: AnyScenario | None) -> BlastRecord | None:
        """Return a record of the file."""
        if self._file is None:
            return None
        try:
            found = self._file.read(key.text, BlastRecord.decoded)
        except BlastEnvError as error:
            warnings.warn(f"a blast counts as missing: {error}", BlastEnvWarning, stacklevel=3)
            return None
        # A file can hold anything: loads must have the structures and modules of the site.
        is_known = found is not None and (
            scenario is None or found.loads.are_for(find_scenario(scenario))
        )
        return found if is_known else None

    def items(self) -> Iterator[tuple[BlastKey, BlastLoads]]:
        """Yield the loads of all undamaged blasts of the file, always in the same order.

        Without a file, those in memory.

        Raises:
            BlastEnvError: If the file cannot be read.
        """
        if self._file is None:
            yield from self._loads.items()
            return
        for text, content in self._file.items():
            with suppress(ValueError):
                yield KEY.validate_python(json.loads(text)), BlastRecord.decoded(content).loads

    def __len__(self) -> int:
        return len(self._loads) if self._file is None else len(self._file)


def _opened(path: Path, most_bytes: int) -> "Store":
    from blast_env.store import Store  # only where blasts go to a file

    return Store(path, most_bytes)
