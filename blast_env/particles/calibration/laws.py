"""The laws that convert simulated impulses into those of a reference (paper, section 3).

A fit takes one impulse per distance: `i_sim` in simulation units and `i_reference` in any unit, for
the paper's column psi*s. The law gives impulses in the unit of `i_reference`.
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Final, Literal, overload

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.values import Numbers, checked_array, first_bad

LawName = Literal["proportional", "linear", "power"]
"""The laws that `blast-env calibrate` fits."""

LEAST_DISTANCES: Final = 4
"""A fit on fewer distances warns: two coefficients then fit almost any data."""

_CONSTANT: Final = 1e-12  # relative spread up to which numbers count as equal


class FewDistancesWarning(BlastEnvWarning):
    """A law was fitted on fewer than `LEAST_DISTANCES` distances."""


@dataclass(frozen=True)
class ScalingLaw(ABC):
    """A law from simulated to reference impulse. Its fields are its coefficients."""

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not np.isfinite(value):
                raise BlastEnvError(
                    f"{type(self).__name__}: {name} is {value}, must be a finite number"
                )

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients by their names in the paper."""
        return asdict(self)

    @overload
    def __call__(self, i_sim: float) -> float: ...

    @overload
    def __call__(self, i_sim: Numbers) -> FloatArray: ...

    def __call__(self, i_sim: float | Numbers) -> float | FloatArray:
        """Return the impulse in the unit of the reference, in the shape of `i_sim`.

        Args:
            i_sim: Impulses, simulation units.

        Raises:
            BlastEnvError: If an impulse is negative or not a finite number.
        """
        return _like_input(self._forward(checked_array("i_sim", i_sim, least=0.0)))

    @overload
    def inverse(self, i_reference: float) -> float: ...

    @overload
    def inverse(self, i_reference: Numbers) -> FloatArray: ...

    def inverse(self, i_reference: float | Numbers) -> float | FloatArray:
        """Return the simulated impulse that the law converts into `i_reference`.

        Args:
            i_reference: Impulses in the unit of the reference.

        Raises:
            BlastEnvError: If an impulse is not a finite number, if no simulated impulse of at
                least 0 gives it, or if the law is a constant.
        """
        slope = list(self.coefficients)[-1]
        if self.coefficients[slope] == 0.0:
            raise BlastEnvError(f"{self} has no inverse: {slope} is 0, so it is a constant")
        reference = checked_array("i_reference", i_reference)
        with np.errstate(all="ignore"):  # values out of reach are rejected below
            simulated = self._backward(reference)
        out_of_reach = ~(np.isfinite(simulated) & (simulated >= 0.0))
        if out_of_reach.any():
            place, value = first_bad("i_reference", reference, out_of_reach)
            raise BlastEnvError(
                f"{place} is {value:g}, which {self} gives for no i_sim of at least 0"
            )
        return _like_input(simulated)

    @abstractmethod
    def _forward(self, i_sim: FloatArray) -> FloatArray:
        """Apply the law to impulses that have been checked."""

    @abstractmethod
    def _backward(self, i_reference: FloatArray) -> FloatArray:
        """Solve the law for i_sim; values out of reach give a negative number, infinity or NaN."""


Fit = Callable[[Numbers, Numbers], ScalingLaw]
"""One of `fit_proportional`, `fit_linear` and `fit_power_law`."""


@dataclass(frozen=True)
class ProportionalLaw(ScalingLaw):
    """i_scaled = k i_sim (equation 5).

    Attributes:
        k: Unit of the reference per simulation unit.
    """

    k: float

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        return self.k * i_sim

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        return i_reference / self.k


@dataclass(frozen=True)
class LinearLaw(ScalingLaw):
    """i_scaled = a + b i_sim (equation 7).

    It is not clipped: with a negative `a`, a small impulse becomes negative, as in the paper.

    Attributes:
        a: Offset, unit of the reference.
        b: Unit of the reference per simulation unit.
    """

    a: float
    b: float

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        return self.a + self.b * i_sim

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        return (i_reference - self.a) / self.b


@dataclass(frozen=True)
class PowerLaw(ScalingLaw):
    """i_scaled = A i_sim^B (section 3.3).

    Attributes:
        A: Impulse for i_sim = 1, unit of the reference, above 0.
        B: Exponent, dimensionless.
    """

    A: float
    B: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.A <= 0.0:
            raise BlastEnvError(f"PowerLaw: A is {self.A}, must be above 0")

    def _forward(self, i_sim: FloatArray) -> FloatArray:
        if self.B < 0.0:
            checked_array("i_sim", i_sim, above=0.0)
        return self.A * i_sim**self.B

    def _backward(self, i_reference: FloatArray) -> FloatArray:
        solved: FloatArray = (i_reference / self.A) ** (1.0 / self.B)
        return solved


def fit_proportional(i_sim: Numbers, i_reference: Numbers) -> ProportionalLaw:
    """Fit i_scaled = k i_sim by least squares (equation 6).

    Args:
        i_sim: Simulated impulse at each distance, simulation units, at least 0 (n,).
        i_reference: Reference impulse at each distance, above 0 (n,).

    Raises:
        BlastEnvError: If there are no numbers to fit, if they are out of bounds, or if `i_sim` is
            the same everywhere.

    Warns:
        FewDistancesWarning: If n is below four.
    """
    x, y = _checked_pair(i_sim, i_reference)
    return ProportionalLaw(k=float(x @ y / (x @ x)))


def fit_linear(i_sim: Numbers, i_reference: Numbers) -> LinearLaw:
    """Fit i_scaled = a + b i_sim by least squares (equation 8).

    Arguments, errors and warning as in `fit_proportional`.
    """
    return LinearLaw(*_line(*_checked_pair(i_sim, i_reference)))


def fit_power_law(i_sim: Numbers, i_reference: Numbers) -> PowerLaw:
    """Fit i_scaled = A i_sim^B by least squares of the logarithms (section 3.3).

    Arguments, errors and warning as in `fit_proportional`, but `i_sim` must be above 0.
    """
    x, y = _checked_pair(i_sim, i_reference)
    checked_array("i_sim", x, above=0.0)
    # ln i = ln A + B ln i_sim is a line.
    intercept, exponent = _line(np.log(x), np.log(y))
    return PowerLaw(A=float(np.exp(intercept)), B=exponent)


def _like_input(array: FloatArray) -> float | FloatArray:
    return float(array) if array.ndim == 0 else array


def _checked_pair(i_sim: Numbers, i_reference: Numbers) -> tuple[FloatArray, FloatArray]:
    """Check the impulses of a fit and return them as arrays (n,)."""
    x = checked_array("i_sim", i_sim, least=0.0, dimensions=1)
    y = checked_array("i_reference", i_reference, above=0.0, dimensions=1)
    if len(x) != len(y):
        raise BlastEnvError(
            f"i_sim has {len(x)} values and i_reference {len(y)}, must be one per distance each"
        )
    if not len(x):
        raise BlastEnvError("i_sim is empty, must have one value a distance")
    if np.ptp(x) <= _CONSTANT * x.max():
        raise BlastEnvError(
            f"i_sim is {x[0]:g} at every distance ({len(x)}), must differ for a fit"
        )
    if len(x) < LEAST_DISTANCES:
        warnings.warn(
            f"the fit rests on {len(x)} distances, should be at least {LEAST_DISTANCES}",
            FewDistancesWarning,
            stacklevel=3,
        )
    return x, y


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return offset and slope of the least-squares line.

    Equation (8) with deviations from the means, which is equal but has smaller rounding errors.
    """
    from_mean = x - x.mean()
    slope = float(from_mean @ (y - y.mean()) / (from_mean @ from_mean))
    return float(y.mean() - slope * x.mean()), slope
