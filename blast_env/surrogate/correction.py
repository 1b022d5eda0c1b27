"""Correction of the surrogate's predictions by the blasts of a search on similar layouts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray

_OWN_SHARE: Final = 0.05
"""Variance of the error of a single layout, relative to the shared variance."""

_LEAST_SPREAD: Final = 0.01
"""Lower bound on the standard deviation of the errors."""


@dataclass(frozen=True, eq=False)
class Correction:
    """A Gaussian process of the logarithmic errors of predictions.

    The covariance of two layouts falls exponentially with the volume that only one of them fills
    (`apart_m3`), in units of the mean volume of a layout.

    Attributes:
        barriers: Pieces of each simulated layout (layouts, pieces, 5).
        mean: Mean of the errors.
        spread: Standard deviation of the errors.
        length_m3: Volume over which the covariance falls by a factor of e.
        weights: Inverse of the covariance, times the errors less their mean (layouts,).
        inverse: Inverse of the covariance (layouts, layouts).
    """

    barriers: FloatArray
    mean: float
    spread: float
    length_m3: float
    weights: FloatArray
    inverse: FloatArray

    @classmethod
    def of(cls, barriers: Sequence[FloatArray], errors: FloatArray) -> "Correction":
        """Fit the correction to simulated layouts.

        Args:
            barriers: Pieces of each layout, from `SurrogateSite.barrier`.
            errors: Logarithm of the simulated over the predicted load (layouts,).
        """
        # Simple kriging of errors e less their mean (Rasmussen & Williams, Gaussian Processes for
        # Machine Learning, 2006, section 2.2). (1) The covariance K of all pairs, with the variance
        # of single layouts on its diagonal; (2) the weights K^-1 e.
        met = stacked(barriers)
        length_m3 = max(float(np.mean(_volume_m3(met))), 1.0)
        covariance = np.exp(-_all_apart_m3(met, met) / length_m3)
        covariance += _OWN_SHARE * np.eye(len(barriers))
        inverse = np.linalg.inv(covariance)
        mean = float(errors.mean())
        spread = max(float(errors.std()), _LEAST_SPREAD)
        return cls(met, mean, spread, length_m3, inverse @ (errors - mean), inverse)

    def expected(self, barriers: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of the error for each layout (layouts,)."""
        # Equations 2.25 and 2.26: mean k^T K^-1 e, variance 1 - k^T K^-1 k in units of the spread,
        # where k are the covariances with the simulated layouts.
        alike = np.exp(-_all_apart_m3(stacked(barriers), self.barriers) / self.length_m3)
        known = np.einsum("ln,nm,lm->l", alike, self.inverse, alike)
        left = np.sqrt(np.maximum(1.0 - known, 0.0))
        return self.mean + alike @ self.weights, self.spread * left


def apart_m3(one: FloatArray, others: FloatArray) -> FloatArray:
    """Return the volume that only one of two barriers fills (others,).

    Args:
        one: Left, bottom, right, top and height of each piece, m (pieces, 5).
        others: The same of each other barrier (others, pieces, 5).
    """
    # |A| + |B| - 2 |A and B|. Pieces of one layout do not overlap, so that the volumes which each
    # piece shares with the others add up.
    low = np.maximum(one[:, np.newaxis, :2], others[:, np.newaxis, :, :2])
    high = np.minimum(one[:, np.newaxis, 2:4], others[:, np.newaxis, :, 2:4])
    sides_m = np.maximum(high - low, 0.0)
    heights_m = np.minimum(one[:, np.newaxis, 4], others[:, np.newaxis, :, 4])
    both_m3 = (sides_m[..., 0] * sides_m[..., 1] * heights_m).sum(axis=(1, 2))
    return np.asarray(_volume_m3(one) + _volume_m3(others) - 2.0 * both_m3)


def stacked(barriers: Sequence[FloatArray]) -> FloatArray:
    """Return barriers as one array (barriers, pieces, 5), padded with pieces of no volume."""
    most = max((len(barrier) for barrier in barriers), default=0)
    found = np.zeros((len(barriers), most, 5))
    for own, barrier in zip(found, barriers, strict=True):
        own[: len(barrier)] = barrier
    return found


def _volume_m3(barriers: FloatArray) -> FloatArray:
    sides_m = barriers[..., 2:4] - barriers[..., :2]
    volumes_m3 = sides_m[..., 0] * sides_m[..., 1] * barriers[..., 4]
    return np.asarray(volumes_m3.sum(axis=-1))


def _all_apart_m3(some: FloatArray, others: FloatArray) -> FloatArray:
    """Return `apart_m3` of each pair (some, others)."""
    return np.array([apart_m3(item, others) for item in some]).reshape(len(some), len(others))
