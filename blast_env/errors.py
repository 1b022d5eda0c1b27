"""Errors that a user can cause, whose messages name the remedy; formatting of values in them."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date, datetime, time
from difflib import get_close_matches
from typing import Final

import numpy as np


class BlastEnvError(ValueError):
    """Base class: an input of the user is not usable."""


class BlastEnvWarning(UserWarning):
    """Base class: a note to the user on a result or a file; commands print it as one line."""


class LayoutError(BlastEnvError):
    """A cell cannot take a module: because of site, modules, stock, budget or access way."""


class MissingExtraError(BlastEnvError):
    """A function needs a package of an optional extra that is not installed."""


class UnknownNameError(BlastEnvError):
    """A name (preset, engine, structure, bundled scenario) that does not exist.

    Args:
        kind: Kind of the named thing, e.g. `"preset"`.
        name: The name given.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        names = sorted(known)
        super().__init__(
            f"no {kind} {value_text(name)}{suggestion(name, names)}; known: {', '.join(names)}"
        )
        self._arguments = (kind, name, names)

    def __reduce__(self) -> tuple[type["UnknownNameError"], tuple[str, object, list[str]]]:
        return type(self), self._arguments


class UnknownArgumentError(BlastEnvError, TypeError):
    """A keyword argument that does not exist.

    It is a `TypeError` with the wording of Python, which other libraries look for. A message alone
    constructs it, because Gymnasium raises it anew; `of` adds the nearest argument.
    """

    @classmethod
    def of(cls, function: str, name: str, known: Iterable[str]) -> "UnknownArgumentError":
        """Return the error.

        Args:
            function: Name of the function called.
            name: The argument given.
            known: The arguments that exist.
        """
        names = sorted(known)
        return cls(
            f"{function}() got an unexpected keyword argument {value_text(name)}"
            f"{suggestion(name, names)}; known: {', '.join(names)}"
        )


@contextmanager
def import_extra(extra: str, what: str) -> Iterator[None]:
    """Import packages of an optional extra in this block.

    Args:
        extra: Name of the extra, or names with commas.
        what: The feature that needs it, e.g. `"genetic search"`.

    Raises:
        MissingExtraError: If a package is not installed; the message has the command to install it.
    """
    try:
        yield
    except ImportError as error:
        missing = error.name or str(error)
        if missing.startswith(("blast_env", "blast_agents")):
            raise  # no extra would help
        raise MissingExtraError(
            f"no {what} without {missing!r}: pip install blast-env[{extra}]"
        ) from error


def suggestion(name: object, known: Iterable[str]) -> str:
    """Return `", did you mean 'x'?"` for the nearest known name, or an empty string."""
    if not isinstance(name, str) or len(name) > MAX_TEXT:  # longer ones take long to compare
        return ""
    nearest = get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f", did you mean {nearest[0]!r}?" if nearest else ""


MAX_TEXT: Final = 80
"""Most characters of a value, a key or a name of a file in a message; longer ones are cut."""

_MOST_REASON: Final = 300
_PLAIN_WORD: Final = re.compile(r"[\w$-]+")
_LONG_WORD: Final = re.compile(rf"\S{{{MAX_TEXT + 1},}}")


def shortened(text: str, length: int = MAX_TEXT) -> str:
    """Return the text, its end replaced by dots if it is too long."""
    return text if len(text) <= length else text[: length - 3] + "..."


def quoted(text: str, length: int = MAX_TEXT) -> str:
    """Return a text of a user or a file in quotes, with all but printable characters escaped.

    With quotes and escapes it has at most `length` characters; the end is replaced by dots if it is
    longer.
    """
    shown, kept = repr(shortened(text, length)), min(len(text), length)
    while len(shown) > length:
        kept -= 1
        shown = repr(text[:kept] + "...")
    return shown


def named(text: str) -> str:
    """Return a name of a file, such as a layer or a tag: a single word as it is, others quoted."""
    return text if len(text) <= MAX_TEXT and _PLAIN_WORD.fullmatch(text) else quoted(text)


def reason_of(error: BaseException) -> str:
    """Return the message of another library's exception as one line of at most 300 characters.

    Such messages may hold texts of a file, so no word of it is longer than a quoted text.
    """
    words = " ".join(str(error)[: 10 * _MOST_REASON].split()) or type(error).__name__
    return shortened(_LONG_WORD.sub(lambda match: shortened(match[0]), words), _MOST_REASON)


KeyParts = tuple[str | int, ...]


def key_path(parts: Sequence[str | int]) -> str:
    """Return keys and indices as one path: `structures[1].rows`."""
    text = ""
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            is_plain = len(part) <= MAX_TEXT and re.fullmatch(r"[A-Za-z0-9_-]+", part)
            text += ("." if text else "") + (part if is_plain else quoted(part))
    return text


def value_text(value: object) -> str:
    """Return a value as in a file, shortened; a number of NumPy as the number."""
    if isinstance(value, np.generic):
        return value_text(value.item())
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        # Python refuses to print integers of more than a few thousand digits.
        digits = value.bit_length() * math.log10(2.0)
        return f"an integer of about {digits:.0f} digits" if digits > MAX_TEXT else f"{value}"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return type_word(value)


def type_word(value: object) -> str:
    """Return a value and its type: `'ten' (a string)`; only the type of containers."""
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
