"""The part of sections in hashes, marked on their fields."""

import json
from collections.abc import Collection, Mapping
from enum import Enum
from hashlib import sha256
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo


class HashMark(Enum):
    """Mark of a field in its annotation; fields without one count in all hashes."""

    NEVER = "no result depends on it"
    IF_SET = "left out where it has its default value"
    IF_RESPONSE = "counts where the objective is the response of facades"
    OF_PLACES = "counts for the meaning of a layout: shape and place of a structure"
    NOT_OF_PLACES = "does not count for the meaning of a layout"


def fields_with(model: type[BaseModel], mark: HashMark) -> set[str]:
    """Return the names of the fields of a model with a mark."""
    return {name for name, field in model.model_fields.items() if mark in _marks(field)}


def hashed_content(section: BaseModel, *left_out: HashMark) -> dict[str, Any]:
    """Return the content of a section that counts in a hash, as plain JSON values.

    Args:
        section: The section, with its subsections.
        left_out: Marks of fields that do not count, beside `NEVER` and defaults of `IF_SET`.
    """
    return _counted(section, section.model_dump(mode="json"), {HashMark.NEVER, *left_out})


def digest_of(content: Mapping[str, Any]) -> str:
    """Return SHA-256 of plain JSON values; the order of keys and the sign of 0 do not count."""
    text = json.dumps(_without_negative_zero(content), sort_keys=True, allow_nan=False)
    return sha256(text.encode()).hexdigest()


def _marks(field: FieldInfo) -> set[HashMark]:
    return {mark for mark in field.metadata if isinstance(mark, HashMark)}


def _counted(section: BaseModel, dump: Any, left_out: Collection[HashMark]) -> dict[str, Any]:
    """Return the entries of a dump that count; sparse sections have no entry for some fields."""
    counted = {}
    for name, field in type(section).model_fields.items():
        # A default that is left out keeps the hashes of scenarios older than the field.
        marks, value = _marks(field), getattr(section, name)
        is_default = value == field.get_default(call_default_factory=True)
        if name in dump and not (
            marks.intersection(left_out) or (HashMark.IF_SET in marks and is_default)
        ):
            counted[name] = _of_value(value, dump[name], left_out)
    return counted


def _of_value(value: Any, dump: Any, left_out: Collection[HashMark]) -> Any:
    if isinstance(value, BaseModel):
        return _counted(value, dump, left_out)
    if isinstance(value, Mapping):
        return {key: _of_value(value[key], dump[key], left_out) for key in value}
    if isinstance(value, tuple):
        return [_of_value(*pair, left_out) for pair in zip(value, dump, strict=True)]
    return dump


def _without_negative_zero(value: Any) -> Any:
    """Return nested values with every -0.0 replaced by 0.0, which is the same place on a site."""
    if isinstance(value, dict):
        return {key: _without_negative_zero(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_negative_zero(item) for item in value]
    return value + 0.0 if isinstance(value, float) else value
