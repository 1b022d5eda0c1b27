"""Devices without room, for writers to fail on."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager


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
