"""Drawing values from ranges, with the same stream on every machine."""

from dataclasses import dataclass
from math import floor

import numpy as np

from blast_env.sites.range_checks import Span, WholeSpan, modules_within
from blast_env.units import MODULE_SIDE_M


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws values; each method takes one number from the stream.

    Attributes:
        rng: The stream.
    """

    rng: np.random.Generator

    def length_m(self, span_m: Span) -> float:
        """Return a multiple of 0.5 m; the lowest one where the range has none."""
        first, last = modules_within(span_m)
        return int(self.rng.integers(first, max(first, last), endpoint=True)) * MODULE_SIDE_M

    def amount(self, span: Span, digits: int) -> float:
        """Return a number, rounded to so many decimal places where the range allows it."""
        low, high = span
        drawn = round(low + (high - low) * float(self.rng.random()), digits)
        return min(max(drawn, low), high)

    def count(self, span: WholeSpan) -> int:
        """Return a whole number."""
        return int(self.rng.integers(*span, endpoint=True))

    def happens(self, probability: float) -> bool:
        """Return true with this probability."""
        return bool(self.rng.random() < probability)


def on_grid(value_m: float) -> float:
    """Return the largest multiple of 0.5 m that is not above a length."""
    return floor(value_m / MODULE_SIDE_M + 1e-9) * MODULE_SIDE_M
