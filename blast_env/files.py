"""Files that are either complete or absent, and a folder that stores results by their keys."""

import errno
import json
import os
import re
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple, TypeVar

from blast_env.errors import BlastEnvError
from blast_env.values import path_of

T = TypeVar("T")


def read_regular(path: str | Path, most_bytes: int) -> bytes:
    """Return the content of a regular file: no pipe, device or folder, whose reading might hang.

    Args:
        path: The file.
        most_bytes: Largest size of the file, holes included.

    Raises:
        BlastEnvError: If it cannot be read, is another kind of file, or is larger; the message has
            the reason, not the file's name.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(path, flags)
    except FileNotFoundError as error:
        raise BlastEnvError("there is no such file") from error
    except OSError as error:
        folder = os.path.isdir(path)  # which Windows does not open
        reason = "is a folder, must be a file" if folder else f"cannot be read: {error.strerror}"
        raise BlastEnvError(reason) from error
    try:
        status = os.fstat(descriptor)
        if S_ISDIR(status.st_mode):
            raise BlastEnvError("is a folder, must be a file")
        if not S_ISREG(status.st_mode):
            raise BlastEnvError("is not a regular file")
        if status.st_size > most_bytes:
            raise BlastEnvError(f"has {status.st_size} bytes, must have at most {most_bytes}")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read(most_bytes)
    except OSError as error:
        raise BlastEnvError(f"cannot be read: {error.strerror or error}") from error
    finally:
        os.close(descriptor)


def make_folder(folder: str | Path) -> None:
    """Make a folder and its parents, unless it exists.

    Raises:
        BlastEnvError: If the path is not a folder, or it cannot be made.
    """
    try:
        path_of(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BlastEnvError(f"{folder}: cannot be a folder: {error.strerror or error}") from error


@contextmanager
def write_atomically(target: str | Path, durable: bool = True) -> Iterator[Path]:
    """Provide a temporary file that becomes `target` when the block ends without an error.

    The temporary file is empty, lies in the folder of `target` and has its suffix. If the block
    raises anything, `KeyboardInterrupt` included, it is deleted and `target` stays as it was. An
    existing `target` keeps its permissions, and a link stays a link. A killed process may leave a
    temporary file behind, see `is_temporary`, and `target` as it was or complete.

    Args:
        target: The file to write.
        durable: Whether to wait until file and folder are on the device, so that a loss of power
            neither removes nor cuts the file. Costs some milliseconds.

    Yields:
        The path to write to.

    Raises:
        BlastEnvError: If the folder does not exist or cannot be written to, if `target` is
            itself a folder or a device, or if the block raises `OSError`: the device is full, for
            example.
    """
    path = Path(os.path.realpath(path_of(target)))
    if os.path.isdir(path):
        raise BlastEnvError(f"{target}: is a folder, must be a file")
    if os.path.exists(path) and not os.path.isfile(path):  # renaming would replace a device
        raise BlastEnvError(f"{target}: is not a regular file")
    if not os.path.isdir(path.parent):
        raise BlastEnvError(f"{target}: there is no folder {str(path.parent)!r} to write it to")
    # A short name: that of `target` may already have the greatest length.
    temporary = path.parent / f".{secrets.token_hex(8)}{path.suffix}"
    try:
        # Not tempfile: its files are private to the user and ignore the umask.
        temporary.open("xb").close()
        yield temporary
        if os.path.exists(path):
            shutil.copymode(path, temporary)
        if durable:
            sync(temporary)
        os.replace(temporary, path)
        if durable:
            sync(path.parent)
    except OSError as error:
        raise _cannot_write(target, error, temporary) from error
    finally:
        with suppress(OSError):  # a failing device
            temporary.unlink(missing_ok=True)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Provide a temporary folder, which is deleted when the block ends.

    Raises:
        BlastEnvError: If it cannot be made, or if the block raises `OSError`: the device is full,
            for example.
    """
    try:
        with TemporaryDirectory() as folder:
            yield Path(folder)
    except OSError as error:
        raise _cannot_write("a scratch folder", error) from error


def is_temporary(name: str) -> bool:
    """Return whether a name is that of a temporary file of `write_atomically`."""
    return re.fullmatch(r"\.[0-9a-f]{16}(\..*)?", name) is not None


_NO_SYNC: Final = (errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EPERM)
"""Errors of systems that sync no folders, or none without the permission to read them."""


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the device.

    Raises:
        OSError: If that fails; folders that the system cannot sync are ignored.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _NO_SYNC or not path.is_dir():
            raise


def _cannot_write(
    target: str | Path, error: OSError, temporary: Path | None = None
) -> BlastEnvError:
    """Return an error with the reason why `target` cannot be written."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.filename not in (None, str(target), str(temporary)):
        reason += f": {str(error.filename)!r}"
    return BlastEnvError(f"{target}: cannot be written: {reason}")


_CHECKSUM_BYTES: Final = 32
_MOST_ENTRY_BYTES: Final = 2**28
_KEPT_SHARE: Final = 0.9  # of the bound, after deleting: not every addition tidies up again
_UNSEEN_SHARE: Final = 1.0 / 32.0


class _Entry(NamedTuple):
    """A file of a store: time of its last use, size in bytes, and path."""

    used_ns: int
    size: int
    path: str


class FolderStore:
    """Stores contents in files of a folder, by a key: everything on which a content depends.

    Each content has one file, written under a temporary name and renamed. Its name is the hash of
    the key; key and checksum are inside. So no file is ever incomplete, no process waits for
    another, damage is limited to one file, and network folders suffice. A database would need
    locks, and a connection that neither pickles nor survives a fork. A damaged file, or one whose
    key does not match its name, is deleted and counts as absent.

    Any number of processes may use one folder at once. The store can be pickled; the copy uses the
    same folder.

    Args:
        folder: The folder; it is made if need be.
        suffix: Files with this suffix belong to the store; it touches no others.
        most_bytes: Largest total size of the files; the least recently used are deleted first.
            Each process checks it whenever it has written a 32nd part of it, so several processes
            may briefly exceed it by that much each. Without it, nothing is ever deleted.
        durable: Whether stored contents survive a loss of power; see `write_atomically`.

    Attributes:
        folder: The folder, as an absolute path.
        suffix: As given.
        most_bytes: As given.
        durable: As given.
        damaged: Number of damaged files that this object has found.

    Raises:
        BlastEnvError: If the folder cannot be made, or `most_bytes` is negative.
    """

    def __init__(
        self,
        folder: str | Path,
        suffix: str,
        most_bytes: int | None = None,
        durable: bool = True,
    ) -> None:
        if most_bytes is not None and most_bytes < 0:
            raise BlastEnvError(f"most_bytes is {most_bytes}, must be at least 0")
        self.folder = Path(folder).absolute()
        self.suffix = suffix
        self.most_bytes = most_bytes
        self.durable = durable
        self.damaged = 0
        self._unseen_bytes = most_bytes or 0  # the size is not known yet
        make_folder(self.folder)

    def get(self, key: str) -> bytes | None:
        """Return the content of a key, or `None` if it is absent or damaged."""
        path = self._path(key)
        stored = self._stored(path)
        if stored is None:
            return None
        content = _unpacked(stored, key)
        if content is None:
            self.discard(key)
        else:
            with suppress(OSError):
                os.utime(path)
        return content

    def read(self, key: str, decode: Callable[[bytes], T]) -> T | None:
        """Return the decoded content of a key, or `None` if it is absent or damaged.

        Args:
            key: The key.
            decode: Decodes the content. It raises `ValueError` for content that passes the
                checksum but is not valid; such content counts as damaged.
        """
        content = self.get(key)
        try:
            return None if content is None else decode(content)
        except ValueError:
            self.discard(key)
            return None

    def put(self, key: str, content: bytes) -> None:
        """Store the content of a key; the least recently used ones may be deleted for it.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        path, packed = self._path(key), _packed(content, key)
        if len(packed) > _MOST_ENTRY_BYTES:
            raise BlastEnvError(
                f"{path}: would have {len(packed)} bytes, must have at most {_MOST_ENTRY_BYTES}"
            )
        with suppress(OSError):  # a link would lead elsewhere
            if path.is_symlink() or (path.exists() and not path.is_file()):
                path.unlink()
        with write_atomically(path, self.durable) as temporary:
            temporary.write_bytes(packed)
        if self.most_bytes is None:
            return
        self._unseen_bytes += len(packed)
        if self._unseen_bytes > _UNSEEN_SHARE * self.most_bytes:
            self._unseen_bytes = 0
            try:
                self._tidy_up(self.most_bytes)
            except OSError as error:  # no permission to list the folder
                raise _cannot_write(self.folder, error) from error

    def items(self) -> Iterator[tuple[str, bytes]]:
        """Yield keys and contents in the order of the files' names, without damaged ones."""
        for path in sorted(entry.path for entry in self._finished()):
            stored = self._stored(Path(path))
            try:
                key = json.loads((stored or b"")[_CHECKSUM_BYTES:].partition(b"\n")[0])
            except ValueError:
                continue
            content = _unpacked(stored or b"", key) if isinstance(key, str) else None
            if content is not None:
                yield key, content

    def _stored(self, path: Path) -> bytes | None:
        """Return the content of a file, or `None` if it is absent; warn of any other reason."""
        try:
            return read_regular(path, _MOST_ENTRY_BYTES)
        except BlastEnvError as error:
            if not isinstance(error.__cause__, FileNotFoundError):
                message = f"{path}: {error}; counts as absent"
                warnings.warn(message, RuntimeWarning, stacklevel=3)
            return None

    def discard(self, key: str) -> None:
        """Count the content of a key as damaged, and delete it if permitted."""
        self.damaged += 1
        with suppress(OSError):  # a read-only folder
            self._path(key).unlink(missing_ok=True)

    def __len__(self) -> int:
        return sum(1 for _ in self._finished())

    def _path(self, key: str) -> Path:
        return self.folder / f"{sha256(key.encode()).hexdigest()}{self.suffix}"

    def _entries(self) -> Iterator[_Entry]:
        """Yield the files, including unfinished ones of killed processes."""
        with os.scandir(self.folder) as listed:
            for item in listed:
                if item.name.endswith(self.suffix):
                    try:
                        status = item.stat()
                    except OSError:  # another process has deleted it
                        continue
                    if not S_ISREG(status.st_mode):
                        continue
                    yield _Entry(status.st_mtime_ns, status.st_size, item.path)

    def _finished(self) -> Iterator[_Entry]:
        """Yield the files without temporary ones, in which a content may occur a second time."""
        return (entry for entry in self._entries() if not is_temporary(Path(entry.path).name))

    def _tidy_up(self, most_bytes: int) -> None:
        """Delete the least recently used files, if all together exceed the bound."""
        entries = sorted(self._entries())
        size = sum(entry.size for entry in entries)
        if size <= most_bytes:
            return
        for entry in entries:
            if size <= _KEPT_SHARE * most_bytes:
                return
            try:
                Path(entry.path).unlink(missing_ok=True)
            except PermissionError:  # another user's file in a shared folder
                continue
            size -= entry.size


def _packed(content: bytes, key: str) -> bytes:
    """Return the bytes of a file: checksum, a line with the key, the content."""
    body = json.dumps(key).encode() + b"\n" + content
    return sha256(body).digest() + body


def _unpacked(stored: bytes, key: str) -> bytes | None:
    """Return the content of a file, or `None` if it is damaged or of another key."""
    checksum, body = stored[:_CHECKSUM_BYTES], stored[_CHECKSUM_BYTES:]
    if sha256(body).digest() != checksum:
        return None
    line, _, content = body.partition(b"\n")
    return content if line == json.dumps(key).encode() else None
