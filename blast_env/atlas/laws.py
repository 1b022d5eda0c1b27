"""Laws of the atlas: factors on the impulse and the peak of a bay, with intervals and ranges.

A law is a small network of dimensionless numbers times a gate. The gate is 0 where there is no
obstacle, so that the factor is 1 there, and the interval has no width. Coefficients were fitted to
blasts of gas dynamics and are in `data/laws.json`, which `python -m studies.atlas fit` writes.
"""

import json
from collections.abc import Mapping
from functools import cache, cached_property
from importlib.resources import files
from typing import Annotated, Final, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from blast_env.arrays import BoolArray, FloatArray

LOADS: Final = ("impulse", "peak")
"""Order of the loads in arrays of factors."""

SMALL: Final = 0.02
"""Gate below which an obstacle does nothing, in range or not."""

TOLERATED: Final = 1.15
"""What a load may be above the one that counts."""

_UPPER_ENDS: Final = (TOLERATED, 1.0)
"""What the upper ends of impulse and peak may be above what counts: peaks scatter more."""

LOG_WIDEST: Final = 1.0
"""Logarithm of the widest intervals over those of middling numbers, and of these over the least."""

_BEYOND: Final = 1e-6


class Factors(NamedTuple):
    """Factors on the loads of bays.

    Attributes:
        middle: Best estimate (bays, 2), impulse and peak.
        low: Lower end of the interval of 90 % (bays, 2).
        high: Its upper end.
        in_range: Whether the law knows such surroundings (bays,).
    """

    middle: FloatArray
    low: FloatArray
    high: FloatArray
    in_range: BoolArray

    @classmethod
    def none(cls, bays: int) -> "Factors":
        """Return factors of 1 for a number of bays."""
        one = np.ones((bays, len(LOADS)))
        return cls(one, one, one, np.ones(bays, dtype=bool))

    @property
    def counted(self) -> FloatArray:
        """Factors for the load (bays, 2).

        Of designs left out of the fit, one bay in twenty has over 1.15 times the impulse, and one
        in twenty a larger peak.
        """
        counted: FloatArray = np.maximum(self.middle, self.high / np.array(_UPPER_ENDS))
        return counted

    def times(self, other: "Factors") -> "Factors":
        """Return the products of both; their errors are independent, so their squares add up."""
        middle = self.middle * other.middle
        below, above = (
            np.hypot(np.log(first / self.middle), np.log(second / other.middle))
            for first, second in ((self.low, other.low), (self.high, other.high))
        )
        known = self.in_range & other.in_range
        return Factors(middle, middle * np.exp(-below), middle * np.exp(above), known)

    def where_in_range(self, other: "Factors") -> "Factors":
        """Return these where the law knows the surroundings, others elsewhere."""
        known = self.in_range[:, np.newaxis]
        middle, low, high = (
            np.where(known, own, more) for own, more in zip(self[:3], other[:3], strict=True)
        )
        return Factors(middle, low, high, self.in_range | other.in_range)

    def where_known(self) -> "Factors":
        """Return the same, with 1 where the law does not know the surroundings."""
        known = self.in_range[:, np.newaxis]
        middle, low, high = (np.where(known, own, 1.0) for own in self[:3])
        return Factors(middle, low, high, self.in_range)


class FamilyError(BaseModel):
    """Errors of a law on the designs of one family that were left out of its fit.

    Attributes:
        title: The family, for readers.
        blasts: Number of blasts with an obstacle.
        bays: Number of their bays.
        before: Spread (root mean square) of ln(factor) of impulse and peak.
        error: The same of what the law leaves.
        inside: Share of the bays in the interval.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    blasts: int
    bays: int
    before: tuple[float, float]
    error: tuple[float, float]
    inside: tuple[float, float]


class Law(BaseModel):
    """One law.

    Attributes:
        numbers: Names of its numbers.
        gates: Share of each number in the gate.
        widths: Weights of the numbers in the logarithm of the intervals' width, which is
            bounded (numbers, loads).
        least: Least value of each number in the blasts.
        most: Largest one.
        centre: Values taken off each number.
        scale: Divisors of the rest.
        inner: Weights of the hidden layer (numbers, hidden).
        inner_shift: Its offsets (hidden,).
        outer: Weights of the output (hidden, loads).
        outer_shift: Its offsets (loads,).
        below: Ends of the intervals below ln(factor), over their width (loads,).
        above: Ends above it.
        families: Errors by family.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    numbers: tuple[str, ...]
    gates: tuple[float, ...]
    widths: tuple[tuple[float, float], ...]
    least: tuple[float, ...]
    most: tuple[float, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    inner: tuple[tuple[float, ...], ...]
    inner_shift: tuple[float, ...]
    outer: tuple[tuple[float, ...], ...]
    outer_shift: tuple[float, ...]
    below: tuple[float, float]
    above: tuple[float, float]
    families: Mapping[str, FamilyError]

    @cached_property
    def _arrays(self) -> "_Arrays":
        """The coefficients as arrays: a law is asked thousands of times for a site."""
        return _Arrays(*(np.array(getattr(self, name)) for name in _Arrays._fields))

    def gate(self, numbers: FloatArray) -> FloatArray:
        """Return how much of an obstacle there is, 0 for none (bays,)."""
        return np.asarray((numbers @ self._arrays.gates).clip(0.0, 2.0))

    def width(self, numbers: FloatArray) -> FloatArray:
        """Return the widths of intervals in units of their ends, 0 without an obstacle.

        One for each load (bays, loads).
        """
        return self._width(self._scaled(numbers), self.gate(numbers))

    def log_factors(self, numbers: FloatArray) -> FloatArray:
        """Return the logarithms of the factors, in range or not (bays, loads)."""
        return self._log_factors(self._scaled(numbers), self.gate(numbers))

    def in_range(self, numbers: FloatArray) -> BoolArray:
        """Return whether all numbers lie between those of the blasts (bays,)."""
        own = self._arrays
        inside = (numbers >= own.least - _BEYOND) & (numbers <= own.most + _BEYOND)
        return np.asarray(inside.all(axis=1) | (self.gate(numbers) < SMALL))

    def factors(self, numbers: FloatArray) -> Factors:
        """Return the factors on the loads of bays, given their numbers (bays, numbers).

        Outside the range they are those of the nearest numbers in it.
        """
        own = self._arrays
        inside = self.in_range(numbers)
        numbers = np.minimum(np.maximum(numbers, own.least), own.most)
        gate = self.gate(numbers)
        scaled = self._scaled(numbers)
        middle, width = self._log_factors(scaled, gate), self._width(scaled, gate)
        low, high = middle - width * own.below, middle + width * own.above
        return Factors(np.exp(middle), np.exp(low), np.exp(high), inside)

    def _scaled(self, numbers: FloatArray) -> FloatArray:
        return np.asarray((numbers - self._arrays.centre) / self._arrays.scale)

    def _width(self, scaled: FloatArray, gate: FloatArray) -> FloatArray:
        wider = bounded_width(scaled @ self._arrays.widths)
        return np.asarray(np.sqrt(gate)[:, np.newaxis] * wider)

    def _log_factors(self, scaled: FloatArray, gate: FloatArray) -> FloatArray:
        own = self._arrays
        hidden = np.tanh(scaled @ own.inner + own.inner_shift)
        return np.asarray(gate[:, np.newaxis] * (hidden @ own.outer + own.outer_shift))


def bounded_width(log_width: FloatArray) -> FloatArray:
    """Return a width of intervals from its logarithm, kept between its bounds."""
    return np.asarray(np.exp(LOG_WIDEST * np.tanh(log_width / LOG_WIDEST)))


class _Arrays(NamedTuple):
    """Coefficients of a law."""

    gates: FloatArray
    widths: FloatArray
    least: FloatArray
    most: FloatArray
    centre: FloatArray
    scale: FloatArray
    inner: FloatArray
    inner_shift: FloatArray
    outer: FloatArray
    outer_shift: FloatArray
    below: FloatArray
    above: FloatArray


class Laws(BaseModel):
    """The laws of the atlas.

    Attributes:
        edges: Of walls in the open that face the charge, relative to the curves.
        between: Of obstacles between charge and bay.
        opposite: Of fronts opposite a bay that throw the wave back: streets, a front behind the
            charge.
        beside: Of walls beside it: courts, re-entrant corners, the end of a street.
        attached: Of what adjoins a wall under or over a bay: canopies, projecting storeys, podiums.
        shadow: Of walls that face away, relative to the side-on load.
        about: Origin: command, versions, engine, blasts.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    edges: Law
    between: Law
    opposite: Law
    beside: Law
    attached: Law
    shadow: Law
    about: Annotated[Mapping[str, str], Field(default_factory=dict)]


@cache
def packaged_laws() -> Laws:
    """Return the packaged laws."""
    text = files("blast_env.atlas").joinpath("data", "laws.json").read_text("utf-8")
    return Laws.model_validate(json.loads(text))
