"""The standing of a load: how far measurements and other checks cover it.

| standing | meaning |
|---|---|
| measured | in sight of the charge: within 6 % of Kingery and Bulmash's impulse |
| verified | in the shade, where means agree with experiments and first waves with other codes |
| approximate | cells too large for the charge, or an oblique wall |
| outside | a scaled distance without comparison, or an impulse not captured |
"""

from enum import IntEnum
from typing import NamedTuple

from blast_env.gas.settings import CHECKED_CELLS, CHECKED_SCALED_DISTANCE


class Standing(IntEnum):
    """The standing of a load; a lower value is better."""

    MEASURED = 0
    VERIFIED = 1
    APPROXIMATE = 2
    OUTSIDE = 3

    @property
    def label(self) -> str:
        """Name in lower case."""
        return self.name.lower()


class Stood(NamedTuple):
    """A standing with its reason.

    Attributes:
        standing: The standing.
        reason: The reason, in words.
    """

    standing: Standing
    reason: str

    @property
    def words(self) -> str:
        """Both: `approximate (4.1 cells per m/kg^(1/3), checked from 9.2)`."""
        return f"{self.standing.label} ({self.reason})"


def standing_of(
    scaled_m: float, is_seen: bool, cells: float, is_known: bool, is_stepped: bool
) -> Stood:
    """Return the standing of a load.

    Args:
        scaled_m: Scaled distance from the charge, m/kg^(1/3).
        is_seen: Whether the place is in sight of the charge.
        cells: Cells per m/kg^(1/3) of the charge.
        is_known: Whether the impulse was captured.
        is_stepped: Whether the wall is oblique, modelled as a staircase.
    """
    low, high = CHECKED_SCALED_DISTANCE
    if not is_known:
        return Stood(Standing.OUTSIDE, "impulse not yet captured at the end of the run")
    if not low <= scaled_m <= high:
        words = f"scaled distance {scaled_m:.2g} m/kg^(1/3), checked from {low:g} to {high:g}"
        return Stood(Standing.OUTSIDE, words)
    if cells < CHECKED_CELLS:
        words = f"{cells:.2g} cells per m/kg^(1/3), checked from {CHECKED_CELLS:g}"
        return Stood(Standing.APPROXIMATE, words)
    if is_stepped:
        return Stood(Standing.APPROXIMATE, "an oblique wall, modelled in steps")
    if not is_seen:
        return Stood(Standing.VERIFIED, "in the shade: compared with experiments and other codes")
    return Stood(Standing.MEASURED, "in sight: within 6 % of Kingery and Bulmash's impulse")
