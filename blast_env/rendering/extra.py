"""The packages of the optional extra `render`."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from blast_env.errors import BlastEnvError


@contextmanager
def render_extra() -> Iterator[None]:
    """Import packages of the extra `render` in this block.

    Raises:
        BlastEnvError: If one of them is not installed; the message says how to get it.
    """
    # pygame greets on standard output, which belongs to the program that imports us.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        yield
    except ImportError as error:
        missing = error.name or str(error)
        raise BlastEnvError(
            f"pictures and films need {missing!r}, which is not installed: "
            "pip install blast-env[render]"
        ) from error
