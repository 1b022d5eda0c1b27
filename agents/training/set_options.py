"""Options `key=value` of a command line: names checked, values read as YAML."""

from collections.abc import Mapping, Sequence
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from blast_env.errors import BlastEnvError, UnknownNameError


def parse_options(options: Sequence[str], known: Sequence[str]) -> dict[str, Any]:
    """Return the values of options.

    Args:
        options: `"key=value"` each; values are read as YAML.
        known: The keys that there are.

    Raises:
        UnknownNameError: If there is no such key; the message names the nearest one.
        BlastEnvError: If an option has no `=`, or its value is not YAML.
    """
    values = {}
    for option in options:
        key, separator, text = option.partition("=")
        if not separator:
            raise BlastEnvError(f"--set {option}: must be key=value")
        if key not in known:
            raise UnknownNameError("setting", key, known)
        values[key] = _value(option, text)
    return values


def with_changes(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with changes in their places; `"group.key"` is for a mapping within."""
    result = dict(values)
    for key, value in changes.items():
        group, _, name = key.rpartition(".")
        if group:
            result[group] = {**result.get(group, {}), name: value}
        else:
            result[name] = value
    return result


def described(error: ValidationError, place: str) -> str:
    """Return what is wrong with values, a clause each: where, what it is, and the bound."""
    clauses = []
    for each in error.errors():
        where = ".".join(str(part) for part in each["loc"])
        what = each["msg"].removeprefix("Value error, ")
        clauses.append(f"{where} is {each['input']!r}: {what}" if where else what)
    return f"{place}: {'; '.join(clauses)}"


def option_names(model: type[BaseModel]) -> list[str]:
    """Return the keys for the fields of a model, `"group.key"` for those of a model within."""
    names = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            names += [f"{name}.{each}" for each in inner.model_fields]
        else:
            names.append(name)
    return names


def _value(option: str, text: str) -> Any:
    """Return a value; `3e-4` is a number, though YAML wants `3.0e-4`."""
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise BlastEnvError(f"--set {option}: the value is not YAML") from error
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value
