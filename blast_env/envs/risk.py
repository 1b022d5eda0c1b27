"""One number for the impulses of several threats."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.evaluation.statistics import check_cvar_level, conditional_value_at_risk


class Risk(Protocol):
    """Turns the impulses of several threats into the one that counts."""

    def __call__(self, impulses: NDArray[np.float64]) -> float:
        """Return the impulse that counts; `impulses` has one value a threat (n,), n >= 1."""


@dataclass(frozen=True)
class MeanRisk:
    """All threats count alike."""

    def __call__(self, impulses: NDArray[np.float64]) -> float:
        """Return the mean."""
        return float(impulses.mean())


@dataclass(frozen=True)
class ConditionalValueAtRisk:
    """Only the worst threats count; see `conditional_value_at_risk`.

    Attributes:
        level: At least 0 (the mean of all) and below 1 (in the limit, the worst one alone).

    Raises:
        BlastEnvError: If the level is out of bounds.
    """

    level: float

    def __post_init__(self) -> None:
        """Check the level."""
        check_cvar_level(self.level)

    def __call__(self, impulses: NDArray[np.float64]) -> float:
        """Return the mean of the worst share 1 - `level`."""
        return conditional_value_at_risk(impulses, self.level)
