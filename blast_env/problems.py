"""Problems of a scenario file, with messages that name key, value and bound."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Any, Final, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from blast_env.errors import BlastEnvError, KeyParts, alternatives, key_path, suggestion, value_text
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
        found: All of them.
        problems: The first `MAX_PROBLEMS` of them, and one with the number of the others.
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.found = tuple(dict.fromkeys(problems))
        more = len(self.found) - MAX_PROBLEMS
        rest = (Problem("", f"{more} more problem{'s' if more > 1 else ''}"),) if more > 0 else ()
        self.problems = self.found[:MAX_PROBLEMS] + rest
        super().__init__("\n".join(f"{source}: {problem}" for problem in self.problems))

    def __reduce__(self) -> tuple[type["ScenarioError"], tuple[str, tuple[Problem, ...]]]:
        return type(self), (self.source, self.found)


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
    translated = [
        problem for detail in details[:MAX_PROBLEMS] for problem in _translated(detail, model)
    ]
    # The others are only counted, and need no message.
    counted = [Problem(key_path(detail["loc"]), detail["msg"]) for detail in details[MAX_PROBLEMS:]]
    return tuple(problem.below(prefix) for problem in (*translated, *counted))


def _translated(detail: ErrorDetails, model: type[BaseModel]) -> Iterator[Problem]:
    """Yield the problems of one entry of a pydantic error, in its words."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == "extra_forbidden":
        parts, annotation = _followed(model, detail["loc"][:-1])
        yield unknown_key((*parts, detail["loc"][-1]), _options(annotation)[0].model_fields)
        return
    if kind == "invalid_key":
        yield Problem("", f"has the key {value_text(value)}: {detail['msg']}")
        return
    parts, annotation = _followed(model, detail["loc"])
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        key = context["discriminator"].strip("'")
        tags = [
            str(get_args(option.model_fields[key].annotation)[0]) for option in _options(annotation)
        ]
        words = f"{detail['msg']}{suggestion(value.get(key), tags)}"
        if key not in value:
            words = f"missing, must be {alternatives(tags)}"
            for misspelt in get_close_matches(key, value, n=1):
                yield unknown_key((*parts, misspelt), [key])
        yield Problem(key_path((*parts, key)), words)
    elif kind == "value_error" and isinstance(cause := context["error"], ScenarioError):
        yield from (problem.below(parts) for problem in cause.found)
    elif kind == "value_error":
        yield Problem(key_path(parts), f"is {value_text(value)}, {context['error']}")
    elif kind == "missing":
        yield Problem(key_path(parts), "missing")
    # Pydantic counts only the valid items of an array; the others have their own errors.
    elif kind != "too_short" or len(value) < context["min_length"]:
        known = get_args(_options(annotation)[0]) if kind == "literal_error" else ()
        text = f"is {value_text(value)}: {detail['msg']}{suggestion(value, known)}"
        yield Problem(key_path(parts), text)


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


def _has_tag(model: type[BaseModel], tag: str | int) -> bool:
    """Return whether one of the model's literal fields has this value."""
    return any(
        get_origin(field.annotation) is Literal and tag in get_args(field.annotation)
        for field in model.model_fields.values()
    )
