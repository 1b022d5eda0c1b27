"""Results of long work by their keys, in a database that several processes and threads may use."""

import os
import shutil
import sqlite3
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from threading import RLock
from time import monotonic, sleep
from typing import Any, Final, TypeVar

from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.files import make_folder

T = TypeVar("T")

_FORMAT: Final = 0x62_6C_73_31
"""Application number in the file ("bls1"); a later format takes another one."""

_PATIENCE_S: Final = 60.0
_MOST_CONTENT_BYTES: Final = 2**28
_HEADER_BYTES: Final = 100  # of an SQLite database
_LOOKS: Final = 10
_FULL_BYTES: Final = 2**16
_KEPT_SHARE: Final = 0.9  # of the bound, after deleting: not every addition tidies up again
_UNSEEN_SHARE: Final = 1.0 / 32.0


class Store:
    """Entries by their keys: everything on which an entry depends, as text.

    The file is an SQLite database with a write-ahead log: after a crash or on a full device, an
    entry is either whole or absent. An entry whose checksum differs is deleted and counts as
    absent. A loss of power may lose the last entries. Processes on one machine may share a file;
    network folders have no such locks.

    A store can be pickled; the copy uses the same file.

    Args:
        path: The file; it and its folder are made if need be.
        most_bytes: Largest total size of the entries; the oldest are deleted first. Each process
            checks it whenever it has written a 32nd part of it. Without it, nothing is deleted.

    Attributes:
        path: The file, as an absolute path.
        most_bytes: As given.
        damaged: Number of damaged entries that this object has found.
    """

    def __init__(self, path: str | Path, most_bytes: int | None = None) -> None:
        self._begin()
        if most_bytes is not None and most_bytes < 0:
            raise BlastEnvError(f"most_bytes is {most_bytes}, must be at least 0")
        self.path = Path(path).absolute()
        self.most_bytes = most_bytes
        self.damaged = 0
        self._unseen_bytes = most_bytes or 0  # the size is not known yet
        make_folder(self.path.parent)
        is_cut = _is_cut(self.path)
        self._run("SELECT 1")
        if is_cut:
            self._note("has lost its content: all of it counts as missing")

    def _begin(self) -> None:
        self._lock, self._process = RLock(), 0
        self._connection: sqlite3.Connection | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the connection, which belongs to one process."""
        own = ("_lock", "_process", "_connection")
        return {name: value for name, value in vars(self).items() if name not in own}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state; the file is opened when it is used."""
        vars(self).update(state)
        self._begin()

    def __del__(self) -> None:
        """Close the connection, unless it is that of a parent process."""
        if self._connection is not None and self._process == os.getpid():
            self._connection.close()

    def get(self, key: str) -> bytes | None:
        """Return the entry of a key, or `None` if it is absent or damaged."""
        found = self._run("SELECT checksum, content FROM contents WHERE key = ?", key)
        if not found:
            return None
        checksum, content = found[0]
        if isinstance(content, bytes) and checksum == _checksum(key, content):
            return content
        self.discard(key)
        return None

    def read(self, key: str, decode: Callable[[bytes], T]) -> T | None:
        """Return the decoded content of a key, or `None` if it is absent or damaged.

        Args:
            decode: Decodes the entry. It raises `ValueError` for an entry that passes the
                checksum but is not valid; such an entry counts as damaged.
        """
        content = self.get(key)
        try:
            return None if content is None else decode(content)
        except ValueError:
            self.discard(key)
            return None

    def put(self, key: str, content: bytes) -> None:
        """Store the entry of a key; the oldest ones may be deleted for it."""
        insert = "INSERT OR REPLACE INTO contents (key, checksum, content) VALUES (?, ?, ?)"
        self._run(insert, key, _checksum(key, content), content)
        if self.most_bytes is None:
            return
        self._unseen_bytes += len(content)
        if self._unseen_bytes > _UNSEEN_SHARE * self.most_bytes:
            self._unseen_bytes = 0
            self._tidy_up(self.most_bytes)

    def items(self) -> Iterator[tuple[str, bytes]]:
        """Yield keys and entries in the order of the keys, without damaged ones."""
        for (key,) in self._run("SELECT key FROM contents ORDER BY key"):
            content = self.get(key)
            if content is not None:
                yield key, content

    def discard(self, key: str) -> None:
        """Count the entry of a key as damaged, and delete it."""
        self.damaged += 1
        self._run("DELETE FROM contents WHERE key = ?", key)
        if self.damaged == 1:
            self._note("has a damaged entry, which counts as missing and is deleted")

    def __len__(self) -> int:
        count: int = self._run("SELECT COUNT(*) FROM contents")[0][0]
        return count

    def _note(self, words: str) -> None:
        warnings.warn(f"{self.path}: {words}", BlastEnvWarning, stacklevel=4)

    def _tidy_up(self, most_bytes: int) -> None:
        """Delete the oldest entries, if all together exceed the bound."""
        (size,) = self._run("SELECT TOTAL(LENGTH(content)) FROM contents")[0]
        if size > most_bytes:
            self._run(
                "DELETE FROM contents WHERE number IN (SELECT number FROM (SELECT number,"
                " SUM(LENGTH(content)) OVER (ORDER BY number DESC) AS size FROM contents)"
                " WHERE size > ?)",
                _KEPT_SHARE * most_bytes,
            )

    def _run(self, command: str, *values: object) -> list[Any]:
        try:
            with self._lock:
                if self._connection is None or self._process != os.getpid():
                    self._connection, self._process = self._opened(), os.getpid()
                return self._connection.execute(command, values).fetchall()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            # SQLite quotes a damaged schema, whose bytes Python may be unable to decode.
            damaged = type(error) in (sqlite3.DatabaseError, UnicodeDecodeError)
            words = "is damaged, or no store of results: delete it" if damaged else "cannot be used"
            if not damaged and _is_full(self.path.parent):
                words = "cannot be written: the device is full"
            raise BlastEnvError(f"{self.path}: {words} ({error})") from error

    def _opened(self) -> sqlite3.Connection:
        connection = sqlite3.connect(
            self.path, _PATIENCE_S, isolation_level=None, check_same_thread=False
        )
        try:
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _MOST_CONTENT_BYTES)
            connection.execute("PRAGMA trusted_schema = OFF")  # nothing in a file is run
            connection.execute("PRAGMA synchronous = NORMAL")
            kind = "SELECT application_id, (SELECT COUNT(*) FROM sqlite_master) FROM"
            number, tables = connection.execute(f"{kind} pragma_application_id").fetchone()
            if number != _FORMAT and (number or tables):
                raise sqlite3.DatabaseError("it has another format")
            if not number:
                _use_log(connection)
                connection.execute(f"PRAGMA application_id = {_FORMAT}")
            connection.execute(
                "CREATE TABLE IF NOT EXISTS contents"
                " (number INTEGER PRIMARY KEY, key TEXT UNIQUE, checksum BLOB, content BLOB)"
            )
        except BaseException:
            connection.close()
            raise
        return connection


def _is_cut(path: Path) -> bool:
    """Return whether a file is too short for a database, and nobody is just making one."""
    for _ in range(_LOOKS):
        with suppress(OSError):
            if path.stat().st_size >= _HEADER_BYTES:
                return False
        if not path.exists() or any(path.parent.glob(f"{path.name}-*")):
            return False
        sleep(0.01)
    return True


def _is_full(folder: Path) -> bool:
    with suppress(OSError):
        return shutil.disk_usage(folder).free < _FULL_BYTES
    return False


def _use_log(connection: sqlite3.Connection) -> None:
    """Set the write-ahead log of a new file, which other processes may be setting just now.

    SQLite does not wait for them here.
    """
    until_s = monotonic() + _PATIENCE_S
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or monotonic() > until_s:
                raise
            sleep(0.01)
        else:
            return


def _checksum(key: str, content: bytes) -> bytes:
    return sha256(key.encode() + b"\n" + content).digest()
