"""Versions of the file format: newer keys, and the lowest version that holds a scenario."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

from pydantic import BaseModel

from blast_env.errors import KeyParts, key_path
from blast_env.scenario.problems import Problem

SCHEMA_VERSION: Final = 2
"""The newest version of the file format; this release reads all of them."""

FIRST_VERSION: Final = 1
"""The first version, without heights: every wall is as high as the air."""

NEW_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "": ("gauges", "objective", "georeference", "components"),
    "site": ("air_height_m",),
    "charge": ("height_m",),
    "structures": (
        *("height_m", "base_m", "carries", "faces", "building", "peak_weight", "facade"),
    ),
    "objective": ("kind", "measure", "target"),
    "build_zone": ("height_m", "items", "hardening", "removable"),
    "build_zone.access_way": ("gate",),
}
"""Keys that version 2 added, by section; their defaults have the meaning of version 1."""

NEW_KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "charge": ("vehicle",),
    "structures": ("round",),
}
"""Kinds of sections that version 2 added."""

MAX_ITEMS: Final = 100
"""Most items of an array that are examined; longer arrays are errors anyway."""


def check_version(version: int) -> int:
    """Refuse a file of another version of the format."""
    if not FIRST_VERSION <= version <= SCHEMA_VERSION:
        raise ValueError(
            f"must be {FIRST_VERSION} or {SCHEMA_VERSION}, the versions that this release reads"
        )
    return version


def version_problems(content: Any) -> Iterator[Problem]:
    """Yield the problems of keys and kinds that the version of a file does not have.

    Args:
        content: The parsed file, valid or not, or the scenario made from it.
    """
    version = _item(content, "schema_version")
    if isinstance(version, bool) or version != FIRST_VERSION:
        return
    for parts, table, keys in _tables(content):
        given = _given(table)
        for key in keys:
            if key in given:
                yield Problem(
                    key_path((*parts, key)),
                    f"schema_version {SCHEMA_VERSION} has this key, the file has schema_version"
                    f" {FIRST_VERSION}",
                )
    for parts, kind in _new_kinds(content):
        yield Problem(
            key_path((*parts, "kind")),
            f"schema_version {SCHEMA_VERSION} has the kind {kind!r}, the file has schema_version"
            f" {FIRST_VERSION}",
        )


def unused_new_keys(scenario: BaseModel) -> Iterator[KeyParts]:
    """Yield the newer keys of a scenario that have their default values."""
    for parts, table, keys in _tables(scenario):
        if isinstance(table, BaseModel):
            for key in keys:
                if _is_unused(table, key):
                    yield (*parts, key)


def lowest_version(scenario: BaseModel) -> int:
    """Return the lowest version of the format that holds a scenario."""
    for _, table, keys in _tables(scenario):
        if isinstance(table, BaseModel) and not all(_is_unused(table, key) for key in keys):
            return SCHEMA_VERSION
    return SCHEMA_VERSION if any(_new_kinds(scenario)) else FIRST_VERSION


def _is_unused(table: BaseModel, key: str) -> bool:
    default = type(table).model_fields[key].get_default(call_default_factory=True)
    return bool(getattr(table, key) == default)


def _tables(content: Any) -> Iterator[tuple[KeyParts, Any, tuple[str, ...]]]:
    """Yield (path of a table with newer keys, the table, the keys)."""
    for name, keys in NEW_KEYS.items():
        path = tuple(name.split(".")) if name else ()
        section = content
        for key in path:
            section = _item(section, key)
        if isinstance(section, list | tuple):
            for index, item in enumerate(section[:MAX_ITEMS]):
                yield (*path, index), item, keys
        else:
            yield path, section, keys


def _new_kinds(content: Any) -> Iterator[tuple[KeyParts, str]]:
    """Yield (path of a section of a newer kind, the kind)."""
    for name, kinds in NEW_KINDS.items():
        section = _item(content, name)
        if isinstance(section, list | tuple):
            for index, item in enumerate(section[:MAX_ITEMS]):
                if _item(item, "kind") in kinds:
                    yield (name, index), _item(item, "kind")


def _item(table: Any, key: str) -> Any:
    """Return the value of a table's key; `None` if it is not a table, or has no such key."""
    return table.get(key) if isinstance(table, Mapping) else getattr(table, key, None)


def _given(table: Any) -> Collection[str]:
    """Return the keys that were given."""
    if isinstance(table, Mapping):
        return table.keys()
    return table.model_fields_set if isinstance(table, BaseModel) else ()
