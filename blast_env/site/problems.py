"""Problems of a scenario file, with messages that name key, value and bound."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from blast_env.errors import (
    BlastEnvError,
    KeyParts,
    alternatives,
    key_path,
    suggestion,
    type_word,
    value_text,
)
from blast_env.geometry import Rectangle


def extent(rectangle: Rectangle) -> str:
    """Return the text of a rectangle's extent."""
    left, bottom, right, top = rectangle
    return f"x {left:g} to {right:g} m, y {bottom:g} to {top:g} m"


MAX_PROBLEMS: Final = 20
"""Most problems with messages; further ones are only counted, to save time."""


@dataclass(frozen=True)
class Problem:
    """A problem of a scenario.

    Attributes:
        key: Path of the key, e.g. `structures[1].rows`; a place such as `line 3, column 5` if the
            text could not be read; empty for the file as a whole.
        message: The problem, with the value and its bound.
    """

    key: str
    message: str

    def __str__(self) -> str:
        return f"{self.key}: {self.message}" if self.key else self.message

    def below(self, parts: KeyParts) -> "Problem":
        """Return the problem with `parts` put before its key."""
        above = key_path(parts)
        joint = "." if above and self.key and not self.key.startswith("[") else ""
        return Problem(f"{above}{joint}{self.key}", self.message)


class ScenarioError(BlastEnvError):
    """An invalid scenario; the message has one line per problem.

    Args:
        source: The file, or another name of the scenario's source.
        problems: All problems; repeated ones count once.

    Attributes:
        source: As given.
        problems: The first `MAX_PROBLEMS` of them, and one with the number of the others.
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        found = tuple(dict.fromkeys(problems))
        more = len(found) - MAX_PROBLEMS
        rest = (Problem("", f"{more} more problem{'s' if more > 1 else ''}"),) if more > 0 else ()
        self.problems = found[:MAX_PROBLEMS] + rest
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))

    def __reduce__(self) -> tuple[type["ScenarioError"], tuple[str, tuple[Problem, ...]]]:
        return type(self), (self.source, self.problems)


def unknown_key(parts: KeyParts, known: Iterable[str]) -> Problem:
    """Return the problem of a key that does not exist, with the nearest one that does."""
    names = list(known)
    nearest = suggestion(str(parts[-1]), names) or f"; known: {', '.join(names)}"
    return Problem(key_path(parts), f"unknown key{nearest}")


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message for a name that does not exist, with the nearest one that does."""
    names = sorted(known)
    nearest = suggestion(name, names) or f"; known: {', '.join(names)}"
    return f"is {value_text(name)}, there is no such {kind}{nearest}"


def problems_from(
    error: ValidationError, model: type[BaseModel], prefix: KeyParts = ()
) -> tuple[Problem, ...]:
    """Return the problems of a pydantic error.

    Args:
        error: The error of `model`.
        model: The validated model.
        prefix: Keys of the validated value in the file.
    """
    details = error.errors(include_url=False)
    translated = [each for detail in details[:MAX_PROBLEMS] for each in _translated(detail, model)]
    # The others are only counted, and need no message.
    counted = [Problem(key_path(detail["loc"]), detail["msg"]) for detail in details[MAX_PROBLEMS:]]
    return tuple(problem.below(prefix) for problem in (*translated, *counted))


def _translated(detail: ErrorDetails, model: type[BaseModel]) -> Iterator[Problem]:
    """Yield the problems of one entry of a pydantic error."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        parts, annotation = _followed(model, detail["loc"])
        yield from _kind_problems(parts, annotation, value, context["discriminator"].strip("'"))
        return
    if kind == "extra_forbidden":
        parts, annotation = _followed(model, detail["loc"][:-1])
        yield unknown_key((*parts, detail["loc"][-1]), _options(annotation)[0].model_fields)
        return
    if kind == "invalid_key":
        yield Problem("", f"has the key {value_text(detail['input'])}, keys must be strings")
        return
    parts, annotation = _followed(model, detail["loc"])
    if kind == "value_error" and isinstance(cause := context["error"], ScenarioError):
        yield from (problem.below(parts) for problem in cause.problems)
    # Pydantic counts only the valid items of an array; the others have their own errors.
    elif kind != "too_short" or len(value) < context["min_length"]:
        yield Problem(key_path(parts), _sentence(detail, annotation))


def _sentence(detail: ErrorDetails, annotation: object) -> str:
    """Return the message for an error about one value."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == "missing":
        return "missing"
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f"is {value_text(value)}, must be {words} {context[key]:.10g}"
    if kind in _LENGTHS:
        key, what, words = _LENGTHS[kind]
        return f"has {len(value)} {what}, must have {words} {context[key]}"
    if kind == "literal_error":
        known = get_args(_options(annotation)[0])
        nearest = suggestion(value, known) if isinstance(value, str) else ""
        return f"is {value_text(value)}, must be {alternatives(known)}{nearest}"
    if kind == "value_error":
        return f"is {value_text(value)}, {context['error']}"
    if kind not in _TYPES:
        return f"is {value_text(value)}: {detail['msg']}"
    if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        return f"is {value_text(value)}, which is too large"
    if kind == "tuple_type" and isinstance(value, Mapping):
        return "is a table, must be an array (for a list of tables, write [[...]])"
    return f"is {type_word(value)}, must be {_TYPES[kind]}"


_BOUNDS: Final[Mapping[str, tuple[str, str]]] = {
    "greater_than_equal": ("ge", "at least"),
    "greater_than": ("gt", "greater than"),
    "less_than_equal": ("le", "at most"),
    "less_than": ("lt", "less than"),
}

_LENGTHS: Final[Mapping[str, tuple[str, str, str]]] = {
    "too_short": ("min_length", "values", "at least"),
    "too_long": ("max_length", "values", "at most"),
    "string_too_short": ("min_length", "characters", "at least"),
    "string_too_long": ("max_length", "characters", "at most"),
}

_TYPES: Final[Mapping[str, str]] = {
    "bool_type": "true or false",
    "dict_type": "a table",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_from_float": "a whole number",
    "int_type": "a whole number",
    "model_attributes_type": "a table",
    "model_type": "a table",
    "string_type": "a string",
    "string_unicode": "a string of valid characters",
    "tuple_type": "an array",
}


def _kind_problems(
    parts: KeyParts, annotation: object, value: Mapping[str, Any], kind_key: str
) -> Iterator[Problem]:
    """Yield the problems of a table whose kind is missing or unknown.

    Pydantic does not examine such a table further; this does if the kind can be guessed.
    """
    models = {_tag(option, kind_key): option for option in _options(annotation)}
    key, misspelt = kind_key, get_close_matches(kind_key, value, n=1)
    if kind_key in value:
        given = value[kind_key]
        nearest = suggestion(given, models) if isinstance(given, str) else ""
        message = f"is {value_text(given)}, must be {alternatives(models)}{nearest}"
        yield Problem(key_path((*parts, kind_key)), message)
    else:
        yield Problem(key_path((*parts, kind_key)), f"missing, must be {alternatives(models)}")
        if misspelt:
            key = misspelt[0]
            yield unknown_key((*parts, key), [kind_key])
    given = value.get(key)
    guess = get_close_matches(given, models, n=1) if isinstance(given, str) else []
    if guess:
        rest = {name: item for name, item in value.items() if name != key}
        try:
            models[guess[0]].model_validate({**rest, kind_key: guess[0]})
        except ValidationError as error:
            yield from problems_from(error, models[guess[0]], parts)


_OF_A_KEY: Final = "[key]"
"""Pydantic's location suffix for a key that is itself invalid."""


def _followed(model: type[BaseModel], location: KeyParts) -> tuple[KeyParts, Any]:
    """Return the keys of a pydantic location, without union tags, and the annotation there."""
    parts: list[str | int] = []
    annotation: Any = model
    for part in location:
        if part == _OF_A_KEY:
            break
        options = _options(annotation)
        if len(options) > 1:
            annotation = next(option for option in options if _has_tag(option, part))
            continue
        parts.append(part)
        arguments = get_args(options[0])
        if isinstance(part, int):
            annotation = arguments[0]
        elif arguments:
            annotation = arguments[1]
        else:
            field = options[0].model_fields.get(part)
            annotation = None if field is None else field.annotation
    return tuple(parts), annotation


def _options(annotation: Any) -> tuple[Any, ...]:
    """Return the members of a union without `None`, or the single type."""
    if hasattr(annotation, "__metadata__"):
        return _options(annotation.__origin__)
    if get_origin(annotation) in (Union, UnionType):
        members = (member for member in get_args(annotation) if member is not type(None))
        return tuple(option for member in members for option in _options(member))
    return (annotation,)


def _tag(model: type[BaseModel], kind_key: str) -> str:
    """Return the value of a model's `kind`."""
    return str(get_args(model.model_fields[kind_key].annotation)[0])


def _has_tag(model: type[BaseModel], tag: str | int) -> bool:
    """Return whether one of the model's literal fields has this value."""
    return any(
        get_origin(field.annotation) is Literal and tag in get_args(field.annotation)
        for field in model.model_fields.values()
    )
