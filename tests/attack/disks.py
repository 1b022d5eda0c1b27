"""Devices without room, for writers to fail on."""

import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from tests.attack.kills import JOBS, REFUSED, in_process, outcome_of_going_on


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


def size_of(folder: Path) -> int:
    """Return how many bytes the files in a folder take."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def outcome_after_full_device(name: str, device: Path, size: int, left: int) -> Any:
    """Do a job on a device without room for all of it, make room, and begin it again.

    Args:
        name: The job.
        device: Where the device of memory is mounted.
        size: What the job takes, in bytes.
        left: The room that the job has at first.

    Returns:
        What came of it.

    Raises:
        RuntimeError: If it failed with anything but the documented error, or could not go on.
        PermissionError: If no device can be mounted.
    """
    folder = device / "job"
    with small_device(device, 4 * size + 2**24):
        fill(device, left)
        ending = in_process(JOBS[name].run, folder)
        if ending.code not in (0, REFUSED):
            raise RuntimeError(f"ended with exit code {ending.code}")
        if ending.code == REFUSED and "cannot be" not in ending.said:
            raise RuntimeError(f"says of a full device: {ending.said}")
        (device / _RESERVE).unlink()
        return outcome_of_going_on(name, folder)
