"""Files that are either complete or not there, and a folder that keeps results by their keys."""

import json
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple

from blast_env.errors import BlastEnvError


def make_folder(folder: str | Path) -> None:
    """Make a folder, and those above it, unless it is there.

    Raises:
        BlastEnvError: If something else is there, or it cannot be made.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BlastEnvError(f"{folder}: cannot be a folder: {error.strerror or error}") from error


@contextmanager
def write_atomically(target: str | Path) -> Iterator[Path]:
    """Give a temporary file to write to, which becomes `target` when the block ends well.

    The temporary file is empty, lies in the folder of `target` and has its suffix. If the block
    raises anything, `KeyboardInterrupt` included, it is deleted and `target` stays as it was. An
    existing `target` keeps its permissions, and a link stays a link.

    Args:
        target: The file to write.

    Yields:
        The path to write to.

    Raises:
        BlastEnvError: If the folder does not exist or cannot be written to, or if `target` is
            itself a folder.
    """
    path = Path(os.path.realpath(target))
    if os.path.isdir(path):
        raise BlastEnvError(f"{target}: is a folder, must be a file")
    if not os.path.isdir(path.parent):
        raise BlastEnvError(f"{target}: there is no folder {str(path.parent)!r} to write it to")
    # Short, because a name that is nearly too long must not become too long here.
    temporary = path.parent / f".{secrets.token_hex(8)}{path.suffix}"
    try:
        # Not tempfile: its files are private to the user, whatever the umask says.
        temporary.open("xb").close()
    except OSError as error:
        raise _cannot_write(target, error) from error
    try:
        yield temporary
        _replace(temporary, path, target)
    finally:
        temporary.unlink(missing_ok=True)


def _replace(temporary: Path, path: Path, target: str | Path) -> None:
    """Put the temporary file in the place of `path`."""
    try:
        if os.path.exists(path):
            shutil.copymode(path, temporary)
        os.replace(temporary, path)
    except OSError as error:
        raise _cannot_write(target, error) from error


def _cannot_write(target: str | Path, error: OSError) -> BlastEnvError:
    """Return the error that says why `target` cannot be written."""
    return BlastEnvError(f"{target}: cannot be written: {error.strerror or error}")


_CHECKSUM_BYTES: Final = 32
_KEPT_SHARE: Final = 0.9  # when something has to go, so that not every addition tidies up
_UNSEEN_SHARE: Final = 1.0 / 32.0


class _Entry(NamedTuple):
    """A file of a store: when it was last used, its size in bytes, and where it is."""

    used_ns: int
    size: int
    path: str


class FolderStore:
    """Keeps contents in files of a folder, each found again by all that it depends on, its key.

    One file a content, written beside its place and renamed, named by the hash of the key and
    with key and checksum inside: nothing is ever half there, no process waits for another, damage
    stays in one file, and network folders will do; a database would need locks, and a connection
    that neither pickles nor survives a fork. A file that was damaged, or is not what its name
    says, is deleted and counts as not there.

    Any number of processes may use one folder at once. It can be pickled; the copy uses the same
    folder.

    Args:
        folder: The folder; it is made if need be.
        suffix: Files with this suffix belong to the store; it touches no others.
        most_bytes: Most that the files take together; what was not asked for longest goes first.
            Each process looks after every 32nd part of it that it has written, so several may
            exceed it by as much for a moment. Without it, nothing ever goes.

    Attributes:
        folder: The folder, as an absolute path.
        suffix: As given.
        most_bytes: As given.
        damaged: Number of damaged files that this object has found.

    Raises:
        BlastEnvError: If the folder cannot be made, or `most_bytes` is negative.
    """

    def __init__(self, folder: str | Path, suffix: str, most_bytes: int | None = None) -> None:
        if most_bytes is not None and most_bytes < 0:
            raise BlastEnvError(f"most_bytes is {most_bytes}, must be at least 0")
        self.folder = Path(folder).absolute()
        self.suffix = suffix
        self.most_bytes = most_bytes
        self.damaged = 0
        self._unseen_bytes = most_bytes or 0  # nobody has looked yet
        make_folder(self.folder)

    def get(self, key: str) -> bytes | None:
        """Return the content of a key, or `None` if it is not there in one piece."""
        path = self._path(key)
        try:
            stored = path.read_bytes()
        except OSError:
            return None
        content = _unpacked(stored, key)
        try:
            if content is None:
                self.damaged += 1
                path.unlink(missing_ok=True)
            else:
                os.utime(path)
        except OSError:  # a folder that may only be read
            pass
        return content

    def put(self, key: str, content: bytes) -> None:
        """Keep the content of a key; the ones that were asked for longest ago may have to go.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        path, packed = self._path(key), _packed(content, key)
        try:
            with write_atomically(path) as temporary:
                temporary.write_bytes(packed)
        except OSError as error:
            raise _cannot_write(path, error) from error
        if self.most_bytes is None:
            return
        self._unseen_bytes += len(packed)
        if self._unseen_bytes > _UNSEEN_SHARE * self.most_bytes:
            self._unseen_bytes = 0
            self._tidy_up(self.most_bytes)

    def __len__(self) -> int:
        return sum(1 for _ in self._entries())

    def _path(self, key: str) -> Path:
        return self.folder / f"{sha256(key.encode()).hexdigest()}{self.suffix}"

    def _entries(self) -> Iterator[_Entry]:
        """Yield the files, those that a killed process left unfinished among them."""
        with os.scandir(self.folder) as listed:
            for item in listed:
                if item.name.endswith(self.suffix):
                    try:
                        status = item.stat()
                    except OSError:  # another process has deleted it
                        continue
                    yield _Entry(status.st_mtime_ns, status.st_size, item.path)

    def _tidy_up(self, most_bytes: int) -> None:
        """Delete files until the rest is small enough, if all together are too large."""
        entries = sorted(self._entries())
        size = sum(entry.size for entry in entries)
        if size <= most_bytes:
            return
        for entry in entries:
            if size <= _KEPT_SHARE * most_bytes:
                return
            Path(entry.path).unlink(missing_ok=True)
            size -= entry.size


def _packed(content: bytes, key: str) -> bytes:
    """Return what a file holds: checksum, a line with the key, the content."""
    body = json.dumps(key).encode() + b"\n" + content
    return sha256(body).digest() + body


def _unpacked(stored: bytes, key: str) -> bytes | None:
    """Return the content of a file, or `None` if it is damaged or of another key."""
    checksum, body = stored[:_CHECKSUM_BYTES], stored[_CHECKSUM_BYTES:]
    if sha256(body).digest() != checksum:
        return None
    line, _, content = body.partition(b"\n")
    return content if json.loads(line) == key else None
