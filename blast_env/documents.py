"""Reading text files that people write or edit: small, not deep, and without surprises."""

import csv
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from io import StringIO
from operator import methodcaller
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import TypeAdapter, ValidationError

from blast_env.errors import BlastEnvError, key_path, shortened, value_text
from blast_env.files import read_regular

MAX_BYTES: Final = 1_000_000
"""Larger files are refused: their name was probably given by mistake."""

MAX_DEPTH: Final = 50
"""Most nested brackets, and parts of a dotted key. The time of parsers grows with the square of
the depth, or they fail with obscure errors."""

MOST_DEEP_PARTS: Final = 10_000
"""Most third and further parts of all dotted keys together: each may create a table."""

MOST_VALUES: Final = 3_000_000
"""Most commas and opening brackets of a JSON file: empty tables take some hundred bytes each."""

MAX_DIGITS: Final = 1000
"""Most digits of an integer."""

MOST_CLAUSES: Final = 10
"""Most problems that one message names; the others are counted."""

_GROUPED: Final = re.compile(r"[+-]?[0-9]+(_[0-9]+)+(\.[0-9_]*)?")
"""A number with underscores, which only Python reads."""

_SHOWN: Final = 60
"""Most characters of a text from a file in a message."""

T = TypeVar("T")


class DocumentError(BlastEnvError):
    """A text that cannot be read.

    Args:
        place: The place, e.g. `line 3, column 5`; empty for the whole text.
        message: The fault.

    Attributes:
        place: As given.
        message: As given.
    """

    def __init__(self, place: str, message: str) -> None:
        self.place, self.message = place, message
        super().__init__(f"{place}: {message}" if place else message)

    def __reduce__(self) -> tuple[type["DocumentError"], tuple[str, str]]:
        return type(self), (self.place, self.message)


def read_text(path: Path, most_bytes: int = MAX_BYTES) -> str:
    """Return the text of a UTF-8 file; a byte order mark is dropped.

    Args:
        most_bytes: Largest size of the file.
    """
    try:
        content = read_regular(path, most_bytes)
    except BlastEnvError as error:
        raise DocumentError("", str(error)) from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise DocumentError(f"line {line}", f"is not UTF-8 text: byte 0x{byte:02x}") from error


_TOML_TOKEN: Final = re.compile(
    r"""(?P<comment>\#[^\n]*+)
      | (?P<text>\"{3}(?:[^"\\]|\\.|"(?!""))*+(?:\"{3})? | '{3}.*?(?:'{3}|\Z))
      | (?P<key>"(?:[^"\\\n]|\\.)*+"? | '[^'\n]*+'? | [A-Za-z0-9_-]++)
      | (?P<dot>\.) | (?P<space>[ \t]++) | (?P<open>[\[{]) | (?P<close>[\]}])
      | (?P<other>[^\#"'A-Za-z0-9_.\[\]{}\ \t-]++ | .)""",
    re.VERBOSE | re.DOTALL,
)
"""A text without an end is a token, too: searching for the end from each quote takes for ever."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML file from its text."""
    _check_toml_depth(text)
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise _toml_error(str(error), text) from error


def _check_toml_depth(text: str) -> None:
    """Refuse deep brackets and keys of many parts, for which the parser takes for ever."""
    depth, parts, deep_parts, after_dot = 0, 0, 0, False
    for token in _TOML_TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "space":
            continue
        if kind == "open":
            depth += 1
        elif kind == "close":
            depth = max(depth - 1, 0)
        if kind == "key":
            parts = parts + 1 if after_dot else 1
            deep_parts += parts > 2
        after_dot = kind == "dot" and parts > 0
        if kind not in ("key", "dot"):
            parts = 0
        if max(depth, parts) > MAX_DEPTH:
            line = text.count("\n", 0, token.start()) + 1
            raise DocumentError(
                f"line {line}", f"is nested too deeply: more than {MAX_DEPTH} levels"
            )
    if deep_parts > MOST_DEEP_PARTS:
        message = f"dotted keys have {deep_parts} parts after their second ones, must have at most"
        raise DocumentError("", f"{message} {MOST_DEEP_PARTS}")


def _toml_error(message: str, text: str) -> DocumentError:
    match = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message, re.S)
    if match is None:
        # The only error without a place: an integer too long for Python to read.
        digits = re.search(r"[0-9_]{1000,}", text)
        number = text.count("\n", 0, digits.start() if digits else len(text)) + 1
        return DocumentError(
            f"line {number}", f"is not usable: {shortened(message.split(';')[0], 200)}"
        )
    what, line, column = match.groups()
    if line is None:
        lines = text.split("\n")
        line, column = str(len(lines)), str(len(lines[-1]) + 1)
    return DocumentError(f"line {line}, column {column}", f"is not TOML: {shortened(what, 200)}")


_JSON_TOKEN: Final = re.compile(r'"(?:[^"\\]|\\.)*+"?|([\[{])|([\]}])', re.DOTALL)


def parse_json(text: str) -> Any:
    """Return the content of a JSON file from its text."""
    check_values(text)
    depth = 0
    # Before the parser: it recurses, and fails without a place.
    for token in _JSON_TOKEN.finditer(text):
        depth = max(depth + (token[1] is not None) - (token[2] is not None), 0)
        if depth > MAX_DEPTH:
            line = text.count("\n", 0, token.start()) + 1
            message = f"is nested too deeply: more than {MAX_DEPTH} levels"
            raise DocumentError(f"line {line}", message)
    try:
        return json.loads(
            text, object_pairs_hook=_unique_keys, parse_int=_integer, parse_constant=_no_number
        )
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise DocumentError(place, f"is not JSON: {error.msg}") from error
    except RecursionError as error:  # brackets that do not match
        raise DocumentError("", "is nested too deeply") from error


def check_values(text: str) -> str:
    """Return the text of a JSON file after a check of the number of its values."""
    values = text.count(",") + text.count("[") + text.count("{")
    if values > MOST_VALUES:
        message = f"has {values:,} commas and opening brackets, must have at most {MOST_VALUES:,}"
        raise DocumentError("", message)
    return text


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    # Python would keep the last of equal keys in silence.
    content = dict(pairs)
    if len(content) < len(pairs):
        raise DocumentError("", "a key occurs twice")
    return content


def _integer(digits: str) -> int:
    """Read an integer; refuse one so long that Python would refuse it without a place."""
    if len(digits) > MAX_DIGITS:
        shown = shortened(digits, _SHOWN)
        raise DocumentError("", f"{shown} has {len(digits)} digits, which is too large")
    return int(digits)


def _no_number(name: str) -> float:
    raise DocumentError("", f"{name} is not a number of JSON")


@lru_cache(maxsize=64)
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def checked_as(kind: type[T], content: Any) -> T:
    """Return the content of a JSON or TOML file as an object of a type.

    Nothing is converted: neither texts nor truth values are numbers, nor is 1.0 an integer.

    Args:
        kind: The type: a model, a dataclass, or any other type that pydantic knows.
        content: The parsed content of a file.
    """
    # In JSON, lists may be tuples and texts may be members of an enumeration, however strict.
    text = json.dumps(content, default=_no_json)
    return _checked(kind, methodcaller("validate_json", text, strict=True))


def _no_json(value: Any) -> Any:
    raise DocumentError("", f"{value_text(value)} is neither text nor number")


def _checked(kind: type[T], check: Callable[[TypeAdapter[Any]], Any]) -> T:
    hashable: Any = kind
    try:
        found: T = check(_adapter(hashable))
    except ValidationError as error:
        raise DocumentError("", described(error)) from error
    return found


def described(error: ValidationError) -> str:
    """Return one clause per fault: the key, its value and the bound."""
    details = error.errors(include_url=False)
    clauses = []
    for detail in details[:MOST_CLAUSES]:
        where = key_path([part if isinstance(part, int) else str(part) for part in detail["loc"]])
        what = shortened(detail["msg"].removeprefix("Value error, "), 500)
        if detail["type"] == "missing":
            clauses.append(f"{where} is missing")
        else:
            clauses.append(f"{where} is {value_text(detail['input'])}: {what}" if where else what)
    if len(details) > MOST_CLAUSES:
        clauses.append(f"{len(details) - MOST_CLAUSES} more problems")
    return "; ".join(clauses)


def parse_csv(text: str, kind: type[T]) -> Iterator[T]:
    """Yield the rows of a table, whose first line has the names of its columns.

    Args:
        text: The text; its last line has an end.
        kind: The type of a row, by the names of the columns; cells are texts, read as numbers
            where the type has numbers.
    """
    if not text:
        raise DocumentError("", "is empty, must have a line with the names of columns")
    if not text.endswith("\n"):
        raise DocumentError(f"line {text.count(chr(10)) + 1}", "has no end: was it cut short?")
    reader = csv.reader(StringIO(text, newline=""), strict=True)
    try:
        names = next(reader, [])
        for cells in _full_rows(reader, len(names)):
            row = dict(zip(names, cells, strict=True))
            yield _checked(kind, methodcaller("validate_python", row))
    except csv.Error as error:
        raise DocumentError(f"line {reader.line_num}", f"is no row of a table: {error}") from error
    except DocumentError as error:
        raise DocumentError(f"line {reader.line_num}", error.message) from error


def _full_rows(rows: Iterable[list[str]], columns: int) -> Iterator[list[str]]:
    for row in rows:
        if len(row) != columns:
            raise DocumentError("", f"has {len(row)} cells, must have {columns}")
        for text in filter(_GROUPED.fullmatch, row):
            raise DocumentError("", f"{value_text(text)} is no number such as 1000 or 0.5")
        yield row
