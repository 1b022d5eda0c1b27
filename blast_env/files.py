"""Files that are either complete or absent."""

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from tempfile import TemporaryDirectory
from time import time
from typing import Final, TypeVar

from blast_env.errors import BlastEnvError
from blast_env.values import path_of

T = TypeVar("T")

_OF_TARGET: Final = 8  # digits of the name of a temporary file that tell its target
_YOUNG_S: Final = 1.0  # a file may not be locked yet just after it was made


def read_regular(path: str | Path, most_bytes: int) -> bytes:
    """Return the content of a regular file: no pipe, device or folder, whose reading might hang.

    Args:
        most_bytes: Largest size of the file, holes included.
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
            # Not `most_bytes` at once, which would be set aside for the smallest file, too. A file
            # of the system may hold more than it says.
            content = file.read(min(status.st_size + 1, most_bytes))
            if len(content) > status.st_size:
                content += file.read(most_bytes - len(content))
            return content
    except OSError as error:
        raise BlastEnvError(f"cannot be read: {error.strerror or error}") from error
    finally:
        os.close(descriptor)


def make_folder(folder: str | Path) -> None:
    """Make a folder and its parents, unless it exists."""
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
    temporary file behind, see `is_temporary`, and `target` as it was or complete; the next writer
    of `target` removes it.

    Args:
        durable: Whether to wait until file and folder are on the device, so that a loss of power
            neither removes nor cuts the file. Costs some milliseconds.

    Yields:
        The path to write to.
    """
    path = Path(os.path.realpath(path_of(target)))
    if os.path.isdir(path):
        raise BlastEnvError(f"{target}: is a folder, must be a file")
    if os.path.exists(path) and not os.path.isfile(path):  # renaming would replace a device
        raise BlastEnvError(f"{target}: is not a regular file")
    if not os.path.isdir(path.parent):
        raise BlastEnvError(f"{target}: there is no folder {str(path.parent)!r} to write it to")
    # A short name: that of `target` may already have the greatest length.
    own = f".{sha256(os.fsencode(path.name)).hexdigest()[:_OF_TARGET]}"
    temporary = path.parent / f"{own}{secrets.token_hex(4)}{path.suffix}"
    try:
        _remove_left(path.parent, own)
        # Not tempfile: its files are private to the user and ignore the umask.
        with temporary.open("xb") as file:
            _lock(file.fileno())
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


def write_text(path: str | Path, text: str) -> Path:
    """Write a text in UTF-8, whole or not at all; return its path."""
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return path_of(path)


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


def _lock(descriptor: int) -> bool:
    """Lock an open file until it is closed; return `False` if it is locked, or cannot be."""
    try:
        import fcntl
    except ImportError:  # Windows
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_left(folder: Path, own: str) -> None:
    """Remove the temporary files of a target whose writers were killed: they have no lock."""
    with suppress(OSError):
        left = [name for name in os.listdir(folder) if name.startswith(own) and is_temporary(name)]
        for name in left:
            path = folder / name
            with suppress(OSError), path.open("rb") as file:
                is_young = time() - os.fstat(file.fileno()).st_mtime < _YOUNG_S
                if not is_young and _lock(file.fileno()):
                    path.unlink()


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
