"""Bounds of the values of a dataclass, written as annotations beside them, and their checks."""

from dataclasses import dataclass, fields
from math import ceil, floor
from typing import Any, ClassVar, Final, TypeGuard, get_type_hints

from blast_env.errors import BlastEnvError
from blast_env.units import MODULE_SIDE_M

Span = tuple[float, float]
"""Lowest and highest value, both possible."""

WholeSpan = tuple[int, int]
"""Lowest and highest whole number, both possible."""

_TOLERANCE: Final = 1e-9  # of a module


@dataclass(frozen=True)
class Bounds:
    """A number within bounds.

    Attributes:
        least: The least value that is allowed.
        most: The largest one.
    """

    least: float
    most: float

    words: ClassVar[str] = "a number"

    def __str__(self) -> str:
        return f"{self.words} from {self.least:.10g} to {self.most:.10g}"

    def allow(self, value: object) -> bool:
        """Return whether a value is what it should be."""
        return self._is_within(value)

    def _is_within(self, value: object) -> TypeGuard[float]:
        if not isinstance(value, int | float) or isinstance(value, bool):
            return False
        return self.least <= value <= self.most


class PairBounds(Bounds):
    """A pair (lowest, highest) of numbers within bounds."""

    words = "a pair (lowest, highest) of numbers"

    def allow(self, value: object) -> bool:
        """Return whether a value is what it should be."""
        return self._is_pair(value)

    def _is_pair(self, value: object) -> TypeGuard[Span]:
        if not (isinstance(value, tuple) and len(value) == 2):
            return False
        return all(map(self._is_within, value)) and value[0] <= value[1]


class CountsBounds(PairBounds):
    """A pair of whole numbers within bounds."""

    words = "a pair (lowest, highest) of whole numbers"

    def allow(self, value: object) -> bool:
        """Return whether a value is what it should be."""
        return self._is_pair(value) and all(isinstance(each, int) for each in value)


class LengthBounds(Bounds):
    """A length of whole modules within bounds, m."""

    words = f"a multiple of {MODULE_SIDE_M:g} m"

    def allow(self, value: object) -> bool:
        """Return whether a value is what it should be."""
        return self._is_within(value) and _has_grid((value, value))


class LengthsBounds(PairBounds):
    """A pair of lengths within bounds, m, with whole modules between them."""

    words = f"a pair (lowest, highest) with a multiple of {MODULE_SIDE_M:g} m between,"

    def allow(self, value: object) -> bool:
        """Return whether a value is what it should be."""
        return self._is_pair(value) and _has_grid(value)


def check_bounds(instance: Any) -> None:
    """Check the fields of a dataclass that are annotated with bounds.

    Raises:
        BlastEnvError: If a value is out of bounds; the message names field, value and bound.
    """
    hints = get_type_hints(type(instance), include_extras=True)
    for each in fields(instance):
        value = getattr(instance, each.name)
        for bounds in getattr(hints[each.name], "__metadata__", ()):
            if not bounds.allow(value):
                owner = type(instance).__name__
                raise BlastEnvError(f"{owner}: {each.name} is {value!r}, must be {bounds}")


def modules_within(span_m: Span) -> tuple[int, int]:
    """Return the least and the largest multiple of 0.5 m in a range, in modules."""
    low_m, high_m = span_m
    return ceil(low_m / MODULE_SIDE_M - _TOLERANCE), floor(high_m / MODULE_SIDE_M + _TOLERANCE)


def _has_grid(span_m: Span) -> bool:
    first, last = modules_within(span_m)
    return first <= last
