"""How keys and values are written in messages: on one line, and never long."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import date, datetime, time
from typing import Final

from blast_env.geometry import Rectangle

MAX_TEXT: Final = 60
"""Characters after which a value or a key is cut."""


def shortened(text: str, length: int = MAX_TEXT) -> str:
    """Return the text, its end replaced by dots if it is too long."""
    return text if len(text) <= length else text[: length - 3] + "..."


def key_path(parts: Sequence[str | int]) -> str:
    """Return keys and indices as they would be read aloud: `structures[1].rows`."""
    text = ""
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            key = part if re.fullmatch(r"[A-Za-z0-9_-]+", part) else _quoted(part)
            text += ("." if text else "") + shortened(key)
    return text


def value_text(value: object) -> str:
    """Return a value as a file would have it, shortened."""
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        # Python refuses to write out integers of more than some thousand digits.
        digits = value.bit_length() * math.log10(2.0)
        return f"an integer of about {digits:.0f} digits" if digits > MAX_TEXT else f"{value}"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return type_word(value)


def type_word(value: object) -> str:
    """Return a value and its type: `'ten' (a string)`; only the type for what has parts."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "an array"
    if value is None:
        return "nothing"
    words = {
        bool: "a truth value",
        str: "a string",
        datetime: "a date",
        date: "a date",
        time: "a time",
    }
    if type(value) in words:
        return f"{value_text(value)} ({words[type(value)]})"
    if isinstance(value, int | float):
        return value_text(value)
    return f"a {type(value).__name__}"


def alternatives(values: Iterable[object]) -> str:
    """Return `'a', 'b' or 'c'`."""
    texts = [value_text(value) for value in values]
    return " or ".join(filter(None, (", ".join(texts[:-1]), texts[-1])))


def extent(rectangle: Rectangle) -> str:
    """Return the extent of a rectangle in words."""
    left, bottom, right, top = rectangle
    return f"x {left:g} to {right:g} m, y {bottom:g} to {top:g} m"


def _quoted(text: str) -> str:
    """Return the text in quotes, with all but printable characters escaped."""
    return repr(shortened(text))
