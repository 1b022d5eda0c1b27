"""Writing a file so that it is either complete or not there, and making the folder for it."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
