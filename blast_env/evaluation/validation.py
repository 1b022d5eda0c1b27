"""The validation status of a load: how far measurements and other checks cover it.

| status | meaning |
|---|---|
| measured | in sight of the charge: within 6 % of Kingery and Bulmash's impulse |
| verified | in the shade, where means agree with experiments and first waves with other codes |
| approximate | cells too large for the charge, a charge above the ground, or an oblique wall |
| outside | a scaled distance without comparison, or an impulse not captured |
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple

NOT_KNOWN: Final = "impulse not yet captured: it was near its largest value when the run ended"
"""Note on a load that is not known; `GasSettings.until` selects the loads a run waits for."""


class ValidationStatus(IntEnum):
    """Validation status of a load; a lower value is better."""

    MEASURED = 0
    VERIFIED = 1
    APPROXIMATE = 2
    OUTSIDE = 3

    @property
    def label(self) -> str:
        """Name in lower case."""
        return self.name.lower()


class Validation(NamedTuple):
    """A validation status with its reason.

    Attributes:
        reason: The reason, in words.
    """

    status: ValidationStatus
    reason: str

    @property
    def words(self) -> str:
        """Both: `approximate (4.1 cells per m/kg^(1/3), checked from 9.2)`."""
        return f"{self.status.label} ({self.reason})"


UNSTATED: Final = Validation(ValidationStatus.OUTSIDE, "the engine states no checks")
"""The status of loads by engines that state none."""


def worst_validation(validations: Iterable[Validation]) -> Validation:
    """Return the worst of some statuses, the first of equal ones; `UNSTATED` of none."""
    return max(validations, key=lambda validation: validation.status, default=UNSTATED)
