"""The compiled main loop, kept on disk from one process to the next."""

import logging
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any, Final

import numpy as np
from numba import njit
from numba.core import event
from numpy.typing import NDArray

from blast_env.physics.event.arrays import Record, RecordArray
from blast_env.physics.event.layout import World
from blast_env.physics.event.loop import run_until

_LOGGER: Final = logging.getLogger("blast_env")
_FIRST_CALL: Final = Lock()


class _CompilationNotice(event.Listener):
    """Says that Numba compiles, which it does when it finds nothing on disk."""

    def __init__(self) -> None:
        self.given = False

    def on_start(self, _event: Any) -> None:
        if not self.given:
            self.given = True
            _LOGGER.warning("compiling the event engine, once per installation: some 10 s ...")

    def on_end(self, _event: Any) -> None:
        pass


def _source_digest() -> int:
    """Return a number that changes with the source of the compiled code."""
    digest = sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return int.from_bytes(digest.digest()[:6])


def _compiled(source_digest: int) -> Callable[..., int]:
    @njit(cache=True, nogil=True, error_model="numpy")
    def run(
        balls: RecordArray,
        cells: RecordArray,
        heap: RecordArray,
        surfaces: RecordArray,
        modules: NDArray[np.int32],
        loads: RecordArray,
        targets: NDArray[np.float64],
        rules: Record,
        progress: Record,
        record: NDArray[np.float64],
        until_s: float,
    ) -> int:
        # Numba's files are out of date when this file changes, but not when another one does. As
        # a constant of this function the digest of all of them decides too.
        progress.source_digest = source_digest
        return run_until(
            balls,
            cells,
            heap,
            surfaces,
            modules,
            loads,
            targets,
            rules,
            progress,
            record,
            until_s,
        )

    function: Callable[..., int] = run
    return function


_RUN: Final = _compiled(_source_digest())


def run_world(world: World, record: NDArray[np.float64], until_s: float) -> int:
    """Go on until a time, or until something is to be done outside; see `loop.run_until`.

    The first call in a new installation compiles, and says so through the logger `blast_env`.
    Other threads run meanwhile.
    """
    if not _RUN.signatures:  # type: ignore[attr-defined]
        with _FIRST_CALL, event.install_listener("numba:compile", _CompilationNotice()):
            return int(_RUN(*world, record, until_s))
    return int(_RUN(*world, record, until_s))
