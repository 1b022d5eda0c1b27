"""The smooth curve of load over path length that stands for the free field."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_ITERATIONS: Final = 30
_LONGEST_STEP: Final = 2.0  # in log load, which keeps Newton's method from running away
_RIDGE: Final = 1e-9  # of the mean diagonal; only matters where the loads do not fix the curve


@dataclass(frozen=True, eq=False)
class LogQuadratic:
    """log load = c0 + c1 u + c2 u^2 with u = log path - origin.

    Attributes:
        coefficients: c0, c1, c2 of each curve (..., 3).
        origin: Mean log path of the fit.
    """

    coefficients: FloatArray
    origin: float

    def __call__(self, path_m: FloatArray) -> FloatArray:
        """Return the loads (..., n) at path lengths (n,)."""
        load: FloatArray = np.exp(self.coefficients @ _powers(path_m, self.origin).T)
        return load


def fit_log_quadratic(path_m: FloatArray, load: FloatArray) -> LogQuadratic:
    """Fit a quadratic in the logarithms to loads that may be noisy, or 0 in places.

    Quasi-likelihood with a logarithmic link and a variance that grows with the mean (quasi-Poisson
    regression): loads are sums over collisions. Unlike least squares of log load, it takes a
    module that was not hit as what it is, and does not lie below noisy means; the fitted loads
    add up to the loads.

    Args:
        path_m: Path lengths (n,).
        load: Mean loads of one curve or of many (..., n), each with a positive sum.
    """
    origin = float(np.log(path_m).mean())
    powers = _powers(path_m, origin)  # (n, 3)
    relative = load / load.mean(axis=-1, keepdims=True)
    coefficients = np.zeros((*load.shape[:-1], 3))
    for _ in range(_ITERATIONS):
        mean = np.exp(coefficients @ powers.T)
        gradient = (relative - mean) @ powers
        curvature = np.einsum("...n,ni,nj->...ij", mean, powers, powers)
        ridge = _RIDGE * np.trace(curvature, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
        step = np.linalg.solve(curvature + ridge, gradient[..., None])[..., 0]
        longest = np.abs(step @ powers.T).max(axis=-1, keepdims=True)
        coefficients = coefficients + step * _LONGEST_STEP / np.maximum(longest, _LONGEST_STEP)
    coefficients[..., 0] += np.log(load.mean(axis=-1))
    return LogQuadratic(coefficients, origin)


def _powers(path_m: FloatArray, origin: float) -> FloatArray:
    """Return 1, u, u^2 for each path (n, 3)."""
    u = np.log(path_m) - origin
    return np.stack((np.ones_like(u), u, u * u), axis=-1)
