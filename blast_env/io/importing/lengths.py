"""Lengths as maps write them: numbers and texts with or without a unit."""

import re
from collections.abc import Mapping
from math import isfinite
from types import MappingProxyType
from typing import Final

from blast_env.errors import MAX_TEXT, BlastEnvError
from blast_env.values import typed_number

FOOT_M: Final = 0.3048
"""Length of the international foot; that of the American survey foot differs by 2e-6."""

UNITS_M: Final[Mapping[str, float]] = MappingProxyType(
    {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "in": 0.0254, "ft": FOOT_M}
)
"""Lengths of units in metres, by the names that options take."""

_WORDS: Final[Mapping[str, float]] = MappingProxyType(
    {
        **UNITS_M,
        **dict.fromkeys(("metre", "metres", "meter", "meters"), 1.0),
        **dict.fromkeys(("'", "foot", "feet"), FOOT_M),
        **dict.fromkeys(('"', "inch", "inches"), UNITS_M["in"]),
    }
)
_PRIMES: Final = str.maketrans({"\u2032": "'", "\u2019": "'", "\u2033": '"', "\u201d": '"'})
_LENGTH: Final = re.compile(r"([0-9]+(?:[.,][0-9]*)?)\s*([a-z'\"]*)\.?")
_FEET_AND_INCHES: Final = re.compile(r"([0-9]+)\s*(?:'|ft)\s*([0-9]+(?:\.[0-9]*)?)\s*(?:\"|''|in)?")


def length_m(value: str | float | bool, unit_m: float = 1.0) -> float | None:
    """Return a length of at least 0 in metres, or `None` if the value is not one.

    Args:
        value: A number, or a text with a number: `12`, `12,5 m`, `40'`, `29'6"`.
        unit_m: Length of the unit of numbers without one, m.
    """
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        text = value[: MAX_TEXT + 1].strip().lower().translate(_PRIMES)
        if len(text) > MAX_TEXT:
            return None
        parts, match = _FEET_AND_INCHES.fullmatch(text), _LENGTH.fullmatch(text)
        try:
            if parts is not None:
                feet, inches = (typed_number("a length", parts[k]) for k in (1, 2))
                number, unit_m = feet + inches / 12.0, FOOT_M
            elif match is not None and (not match[2] or match[2] in _WORDS):
                number = typed_number("a length", match[1])
                unit_m = _WORDS[match[2]] if match[2] else unit_m
            else:
                return None
        except BlastEnvError:
            return None
    else:
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            return None
    length = number * unit_m
    return length if isfinite(length) and length >= 0.0 else None
