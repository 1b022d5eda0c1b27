"""Checks of plain values from the user: numbers and paths."""

import os
import re
from collections.abc import Sequence
from html import escape
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, value_text

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

Numbers = Union[Sequence[float], NDArray[Any], "pd.Series"]
"""Several numbers; a single number is a float."""

MOST_SEED: Final = 2**63 - 1
"""The largest seed: tables and files keep it in 64 bits."""

STEERING: Final = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u206f\ud800-\udfff]"
)
"""Characters that control a terminal or a page, change the direction of a line, or are
surrogates."""


def plain_text(text: str) -> str:
    """Return a text for readers; tabs and line feeds are allowed."""
    wrong = STEERING.search(text)
    if wrong is not None:
        raise ValueError(f"must not have the character {wrong[0]!r}")
    return text


def printable(text: str) -> str:
    """Return a text from elsewhere for a terminal, with control characters escaped."""
    return STEERING.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def printable_line(text: str) -> str:
    """Return a text from elsewhere for one line of a terminal: ends of lines are escaped, too."""
    return printable(text).replace("\t", r"\t").replace("\n", r"\n")


_MARKUP: Final = re.compile(r"[\\`\[\]{}$]")


def markup_text(text: str) -> str:
    """Return a text from elsewhere for a line of Markdown or HTML, with all markup escaped.

    Emphasis, which does no harm, is left.
    """
    plain = _MARKUP.sub(lambda match: f"\\{match[0]}", printable_line(text))
    return escape(plain, quote=False)


_PLAIN: Final = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_DECIMAL_COMMA: Final = re.compile(r"([+-]?[0-9]+),([0-9]+)")
_THOUSANDS: Final = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")

_MOST_PATH: Final = 4096
"""Most characters of a path; no system takes more."""


def letters(number: int) -> str:
    """Return A to Z for 0 to 25, then AA, AB and so on."""
    # Bijective base 26: there is no letter for 0, so that Z is followed by AA.
    before, last = divmod(number, 26)
    return (letters(before - 1) if before else "") + chr(ord("A") + last)


def whole_number(name: str, value: Any, least: int, most: int) -> int:
    """Return a count as a plain integer.

    Args:
        name: Name of the count, for the error.
        least: Lower bound, inclusive.
        most: Upper bound, inclusive.
    """
    is_integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_integer or not least <= value <= most:
        raise BlastEnvError(
            f"{name} is {value_text(value)}, must be an integer from {least} to {most}"
        )
    return int(value)


def checked_seed(value: Any, name: str = "seed") -> int:
    """Return a seed as a plain integer."""
    return whole_number(name, value, 0, MOST_SEED)


def generator(seed: Any) -> np.random.Generator:
    """Return the random generator of a seed."""
    return np.random.default_rng(checked_seed(seed))


def finite_number(name: str, value: Any) -> float:
    """Return a number as a plain float."""
    if isinstance(value, bool | str):
        raise BlastEnvError(f"{name} is {value_text(value)}, must be a number")
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise BlastEnvError(f"{name} is {value_text(value)}, must be a number") from None
    except OverflowError:  # an integer of hundreds of digits
        number = float("inf")
    if not isfinite(number):
        raise BlastEnvError(f"{name} is {value_text(value)}, must be a finite number")
    return number


def number_pair(name: str, value: Any) -> tuple[float, float]:
    """Return two finite numbers (x, y)."""
    is_listed = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    parts = list(value) if is_listed else []
    try:
        x, y = (finite_number(name, part) for part in parts)
    except ValueError:
        shown = f"({', '.join(map(value_text, parts[:3]))})" if is_listed else value_text(value)
        raise BlastEnvError(f"{name} is {shown}, must be a pair of finite numbers (x, y)") from None
    return x, y


def real_number(name: str, value: Any, least: float, most: float) -> float:
    """Return a number as a plain float."""
    number = finite_number(name, value)
    if not least <= number <= most:
        raise BlastEnvError(f"{name} is {number:g}, must be a number from {least:g} to {most:g}")
    return number


def is_plain_number(text: str) -> bool:
    """Whether a text is a number in the notation of files and options.

    Python accepts more: `1_000`, `nan`, `inf`, digits of other scripts, surrounding spaces.
    """
    return _PLAIN.fullmatch(text) is not None


def plain_number(name: str, text: str) -> float:
    """Return the number of a text: digits, one point, an exponent."""
    if not is_plain_number(text):
        raise BlastEnvError(f"{name} is {value_text(text)}, must be a number such as 1000 or 0.5")
    return finite_number(name, float(text))


def typed_number(name: str, text: str, unit: str = "") -> float:
    """Return the number in a text typed by a user, with a decimal point or a decimal comma.

    Args:
        name: The quantity, for the error.
        text: The text; the unit may follow the number.
        unit: Its unit, such as `kg TNT`, of which the first word is enough.
    """
    number = text.strip()
    for known in filter(None, (unit, unit.partition(" ")[0])):
        number = number.removesuffix(known).rstrip()
    if _THOUSANDS.fullmatch(number):
        plain, decimals = number.replace(",", ""), number.replace(",", ".")
        raise BlastEnvError(
            f"{name} is {value_text(text)}, which may be {plain} or {decimals}: write one of these"
        )
    number = _DECIMAL_COMMA.sub(r"\1.\2", number)
    if not is_plain_number(number):
        in_unit = f" in {unit}" if unit else ""
        raise BlastEnvError(
            f"{name} is {value_text(text)}, must be a number{in_unit} such as 1000 or 0.5"
        )
    return finite_number(name, float(number))


def path_of(value: Any) -> Path:
    """Return the path of a file or folder."""
    if not isinstance(value, str | os.PathLike):
        raise BlastEnvError(f"path is {value_text(value)}, must be a path")
    text = os.fspath(value)
    if not isinstance(text, str) or "\0" in text:
        raise BlastEnvError(f"path is {value_text(text)}, must be a text without null characters")
    if len(text) > _MOST_PATH:
        raise BlastEnvError(
            f"path is {value_text(text)} of {len(text)} characters, must have at most {_MOST_PATH}"
        )
    return Path(text)


def checked_array(
    name: str,
    values: ArrayLike,
    *,
    least: float | None = None,
    above: float | None = None,
    dimensions: int | None = None,
) -> FloatArray:
    """Return numbers as an array of floats.

    Args:
        name: Name of the numbers for the message.
        values: A number or an array of them.
        least: Inclusive lower bound.
        above: Exclusive lower bound.
        dimensions: Required number of dimensions; `None` for any.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise BlastEnvError(f"{name} must be made of numbers: {error}") from error
    if dimensions is not None and array.ndim != dimensions:
        raise BlastEnvError(f"{name} has {array.ndim} dimensions, must have {dimensions}")
    checks: list[tuple[NDArray[np.bool_], str]] = [(~np.isfinite(array), "a finite number")]
    if least is not None:
        checks.append((array < least, f"at least {least:g}"))
    if above is not None:
        checks.append((array <= above, f"above {above:g}"))
    for bad, bound in checks:
        if bad.any():
            place, value = first_bad(name, array, bad)
            raise BlastEnvError(f"{place} is {value:g}, must be {bound}")
    return array


def first_bad(name: str, array: FloatArray, bad: NDArray[np.bool_]) -> tuple[str, float]:
    """Return the place and the value of the first bad number."""
    index = np.argwhere(bad)[0].tolist()
    place = f"{name}[{', '.join(map(str, index))}]" if index else name
    return place, float(array[tuple(index)])


def count_of(noun: str, count: int) -> str:
    """Return a count with its noun: `1 load limit`, `2 load limits`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
