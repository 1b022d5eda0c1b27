"""Devices without room, for writers to fail on."""

import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final


@contextmanager
def file_size_limit(most_bytes: int) -> Iterator[None]:
    """Let no file get larger than this, in this process and those that it starts.

    Writing beyond fails with EFBIG here; a program that does not expect it, ffmpeg for one, is
    ended by SIGXFSZ. To a writer that is a full device, and it needs no rights.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


_RESERVE: Final = ".reserve"


@contextmanager
def small_device(folder: Path, size: int) -> Iterator[None]:
    """Mount a device of memory of this many bytes, which the superuser may.

    Raises:
        PermissionError: If it cannot be mounted.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "blast-env-attack", str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        raise PermissionError(f"{folder}: cannot mount a device of memory here")
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def fill(folder: Path, left: int) -> None:
    """Fill the device of a folder but for this many bytes, rounded up to whole pages."""
    reserve = folder / _RESERVE
    with reserve.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(2**16)):
                pass
        except OSError:  # full
            pass
        page = 4096
        file.truncate(max(file.tell() - page * (-(-left // page)), 0))
