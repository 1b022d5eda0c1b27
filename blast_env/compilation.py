"""A notice when Numba compiles, which it does once per installation and takes many seconds."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, Final

from numba.core import event

_LOGGER: Final = logging.getLogger("blast_env")


class _Listener(event.Listener):
    def __init__(self, compiled: str) -> None:
        self.compiled = compiled

    def on_start(self, _event: Any) -> None:
        _announce(self.compiled)

    def on_end(self, _event: Any) -> None:
        pass


@cache
def _announce(compiled: str) -> None:
    """Log the notice; the cache lets each one pass once per process."""
    _LOGGER.warning("compiling %s, once per installation ...", compiled)


@contextmanager
def compilation_notice(compiled: str) -> Iterator[None]:
    """Warn by the logger `blast_env` if Numba compiles inside the block.

    Args:
        compiled: Name of the compiled code and the time that it takes; announced once per process.
    """
    with event.install_listener("numba:compile", _Listener(compiled)):
        yield
