"""Where a digest of results holds to the last bit; elsewhere bounds on the loads hold.

On one machine a run follows from its arguments to the last bit. Between machines the last bit
hangs on three things, each of which is tried here:

- the C library: glibc takes other variants of `sin`, `cos` and `exp` where a processor cannot fuse
  a product and a sum, and those round otherwise in one case of a thousand;
- the architecture: compilers fuse by themselves on others than x86-64, in pymunk's wheel for one;
- Numba's target: the gas engine lets it fuse. Which processor it compiles for matters only for
  that: Haswell and Zen 4 give the same bits, and nothing is reordered for wider vectors.

Neither the BLAS, nor the number of threads, nor the vector instructions of NumPy and torch enter a
blast. Trained weights hang on all of them: tests of what is learnt need a margin, not a digest.
"""

import math
import platform
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from typing import Any, Final, NamedTuple

import numpy as np
import pytest
from numba import njit

from blast_env.gas.state import FUSED


class Condition(NamedTuple):
    """What digests depend on.

    Attributes:
        found: Gives the value on this machine.
        recorded: The value where the digests were made.
    """

    found: Callable[[], Any]
    recorded: Any


@cache
def _digest_of(*names: str) -> str:
    """Return a digest of functions of the C library at 4,096 places."""
    places = np.random.default_rng(0).uniform(0.1, 10.0, 4096).tolist()
    values = [getattr(math, name)(place) for name in names for place in places]
    return sha256(np.array(values).tobytes()).hexdigest()[:16]


@cache
def _fuses() -> bool:
    """Whether Numba fuses a product and a sum: only then the product's last bits are left."""

    @njit(error_model="numpy", fastmath=FUSED)
    def left(a: float, b: float, c: float) -> float:
        return a * b - c

    return bool(left(1.0 + 2.0**-30, 1.0 + 2.0**-30, 1.0 + 2.0**-29) != 0.0)


CONDITIONS: Final = {
    "the architecture": Condition(platform.machine, "x86_64"),
    "sin and cos of the C library": Condition(lambda: _digest_of("sin", "cos"), "fb8b660ec9d6086f"),
    "exp and log of the C library": Condition(
        lambda: _digest_of("exp", "expm1", "log"), "37a55d48fb16cc1d"
    ),
    "fused products and sums": Condition(_fuses, True),
}
"""The digests were made on x86-64 with glibc 2.36, on a processor with FMA."""

_PARTICLES: Final = ("the architecture", "sin and cos of the C library")
_HEEDS: Final = {"pymunk": _PARTICLES, "event": _PARTICLES, "gas": tuple(CONDITIONS)}


def need_the_same_bits(engine: str) -> None:
    """Skip the rest of a test where digests of an engine's results need not hold, and say why.

    What holds everywhere comes before this call.

    Args:
        engine: Name of the engine.
    """
    for name in _HEEDS[engine]:
        found, recorded = CONDITIONS[name].found(), CONDITIONS[name].recorded
        if found != recorded:
            pytest.skip(f"digests depend on {name}: made with {recorded}, here {found}")
