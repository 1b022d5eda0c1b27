"""Layout files: a layout, its scenario and its provenance."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from blast_env.documents import MAX_BYTES, DocumentError, parse_json, read_text
from blast_env.errors import LayoutError, key_path, suggestion, type_word, value_text
from blast_env.files import write_atomically
from blast_env.geometry import Element, Layout, Measure, Piece, Removal, standing
from blast_env.layout.placement import check_layout
from blast_env.site.catalogue import cell_from
from blast_env.site.models import AnyScenario, Scenario, find_scenario
from blast_env.values import path_of

VERSION: Final = 1
"""The version of the file format."""

_MEASURES: Final[Mapping[str, type[Measure]]] = MappingProxyType(
    {"hardening": Measure, "taken_away": Removal}
)
"""The keys of the names of the measures, beside pieces."""

_OTHER_KEYS: Final = ("scenario", "site_hash", "provenance", "version")
_PIECE_KEYS: Final[Mapping[str, type]] = MappingProxyType(
    {"item": str, "row": int, "column": int, "turned": bool}
)
_KIND_WORDS: Final[Mapping[type, str]] = MappingProxyType(
    {str: "a string", int: "a whole number", bool: "true or false"}
)
_HASH_DIGITS: Final = 12  # in messages


@dataclass(frozen=True)
class LayoutFile:
    """The content of a layout file.

    Attributes:
        layout: (row, column) of each module, or the pieces, in the order of the file.
        scenario: Name of the layout's scenario; `None` if the file has none.
        site_hash: Hash of its zone, catalogue and structures, 64 hexadecimal digits; `None` if
            the file has none.
        provenance: Origin of the layout, in values that JSON can hold (method, command, seed,
            versions, blasts).
    """

    layout: Layout
    scenario: str | None = None
    site_hash: str | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> "LayoutFile":
        """Read a file: a list of cells, or a table with a list of cells or pieces.

        Whether the layout fits a scenario is checked by `layout_for`.

        Raises:
            LayoutError: If the file cannot be read or has another form.
        """
        try:
            content = parse_json(read_text(path_of(path)))
        except DocumentError as error:
            raise LayoutError(f"{path}: {error}") from error
        return _parse(content, str(path))

    @classmethod
    def of(
        cls,
        scenario: AnyScenario,
        layout: Sequence[Element],
        provenance: Mapping[str, Any] | None = None,
    ) -> "LayoutFile":
        """Return the file of a layout for a scenario.

        Args:
            scenario: The scenario, or its bundled name or path.
            layout: (row, column) of each module, or pieces.
            provenance: Origin of the layout.

        Raises:
            LayoutError: If the layout does not fit the scenario.
        """
        found = find_scenario(scenario)
        return cls(
            layout=check_layout(found, layout),
            scenario=found.name,
            site_hash=found.site_hash,
            provenance=dict(provenance or {}),
        )

    def layout_for(self, scenario: AnyScenario) -> Layout:
        """Return the layout after checking it for a scenario.

        A file without a hash is accepted for any scenario that its layout fits.

        Args:
            scenario: The scenario, or its bundled name or path.

        Raises:
            LayoutError: If the file is for another site or another state of it, or if an element
                is off the grid, not available, repeated or beyond the stock.
        """
        found = find_scenario(scenario)
        if self.site_hash not in (None, found.site_hash):
            raise LayoutError(self._mismatch(found))
        return check_layout(found, self.layout)

    def save(self, path: str | Path) -> Path:
        """Write the file; an existing one is replaced as a whole.

        Returns:
            The path.

        Raises:
            LayoutError: If the file could not be read back: JSON cannot hold the provenance, or
                it would be too large.
            BlastEnvError: If it cannot be written there.
        """
        text = f"{self._text(path)}\n"
        try:
            _parse(parse_json(text), str(path))
        except DocumentError as error:
            raise LayoutError(f"{path}: {error}") from error
        content = text.encode()
        if len(content) > MAX_BYTES:
            raise LayoutError(
                f"{path}: would have {len(content)} bytes, must have at most {MAX_BYTES}:"
                " shorten the provenance"
            )
        with write_atomically(path) as temporary:
            temporary.write_bytes(content)
        return path_of(path)

    def _text(self, path: str | Path) -> str:
        """Return the file as JSON, with all cells on one line, or one line per piece."""
        pieces = [element for element in standing(self.layout) if isinstance(element, Piece)]
        measures = {
            key: [element.item for element in self.layout if type(element) is kind]
            for key, kind in _MEASURES.items()
        }
        if pieces or any(measures.values()):
            lines = ",\n".join(f"    {json.dumps(_piece_table(piece))}" for piece in pieces)
            layout = f'  "pieces": [\n{lines}\n  ]'
            for key in filter(measures.get, measures):
                layout += f',\n  "{key}": {json.dumps(measures[key])}'
        else:
            layout = f'  "cells": {json.dumps([list(cell) for cell in self.layout])}'
        keys: dict[str, Any] = {"scenario": self.scenario, "site_hash": self.site_hash}
        given = {name: value for name, value in keys.items() if value is not None}
        if self.provenance:
            given["provenance"] = dict(self.provenance)
        try:
            rest = json.dumps(given, indent=2, allow_nan=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise LayoutError(f"{path}: provenance: JSON cannot hold it: {error}") from error
        return f'{{\n  "version": {VERSION},\n{layout}' + (f",{rest[1:]}" if given else "\n}")

    def _mismatch(self, scenario: Scenario) -> str:
        """Return the message of a layout for another scenario, with a remedy."""
        hashes = (self.site_hash or "", scenario.site_hash)
        saved, asked = (f"hash {item[:_HASH_DIGITS]}" for item in hashes)
        name = "a scenario without a name" if self.scenario is None else value_text(self.scenario)
        changed = ""
        if self.scenario == scenario.name:
            changed = f" (zone, catalogue or structures of {name} have changed since)"
        return (
            f"the layout was saved for {name} ({saved}), not for {scenario.name!r} ({asked})"
            f"{changed}: load the scenario that it is for, or save its cells anew for this one"
            " (blast_env.write_layout)"
        )


def load_layout(path: str | Path, scenario: AnyScenario | None = None) -> Layout:
    """Return the layout of a layout file.

    The file is `[[row, column], ...]`, or a table with `cells`, or `pieces` and measures, and
    optionally scenario and provenance; see `LayoutFile`.

    Args:
        path: The file.
        scenario: The scenario of the layout, or its bundled name or path. Without it, only the
            form of the file is checked; `check_layout` checks the layout later.

    Raises:
        LayoutError: If the file cannot be read or has another form, or if the layout is not one
            for the scenario; the message names the file, the cell or piece and the reason.
    """
    file = LayoutFile.load(path)
    if scenario is None:
        return file.layout
    try:
        return file.layout_for(scenario)
    except LayoutError as error:
        raise LayoutError(f"{path}: {error}") from error


def write_layout(
    path: str | Path,
    scenario: AnyScenario,
    layout: Sequence[Element],
    provenance: Mapping[str, Any] | None = None,
) -> Path:
    """Write a layout for a scenario to a file that `load_layout` reads.

    Args:
        path: The file; an existing one is replaced as a whole.
        scenario: The scenario of the layout, or its bundled name or path.
        layout: (row, column) of each module, or pieces.
        provenance: Origin of the layout, e.g. method, command, seed, versions, blasts.

    Returns:
        The path.

    Raises:
        LayoutError: If the layout does not fit the scenario, or JSON cannot hold the provenance.
        BlastEnvError: If the file cannot be written.
    """
    return LayoutFile.of(scenario, layout, provenance).save(path)


def _parse(content: Any, source: str) -> LayoutFile:
    """Return the content of a file; `source` is its name, for errors."""
    # A plain list of cells says nothing of its site.
    if not isinstance(content, dict):
        return LayoutFile(_cells(content, source, ""))
    version = content.get("version", VERSION)
    if type(version) is not int or version != VERSION:
        raise LayoutError(
            f"{source}: version: is {type_word(version)}, must be {VERSION}, the version of this"
            " release"
        )
    key = "pieces" if "pieces" in content else "cells"
    measures = _MEASURES if key == "pieces" else ()
    _check_keys(content, (key, *measures, *_OTHER_KEYS), f"{source}: ")
    if key not in content:
        raise LayoutError(f"{source}: cells or pieces: missing")
    name, site_hash = content.get("scenario"), content.get("site_hash")
    if name is not None and not isinstance(name, str):
        raise LayoutError(f"{source}: scenario: is {type_word(name)}, must be a string")
    if site_hash is not None and not _is_hash(site_hash):
        raise LayoutError(
            f"{source}: site_hash: is {type_word(site_hash)}, must be 64 hexadecimal digits"
        )
    if name is not None and site_hash is None:
        raise LayoutError(
            f"{source}: site_hash: missing, but the scenario is {value_text(name)}:"
            " without it nothing can be checked"
        )
    provenance = content.get("provenance", {})
    if not isinstance(provenance, dict):
        raise LayoutError(f"{source}: provenance: is {type_word(provenance)}, must be a table")
    read = _cells if key == "cells" else _pieces
    layout = read(content[key], source, key)
    for name_key, kind in _MEASURES.items():
        layout += _measures(content.get(name_key, []), f"{source}: {name_key}", kind)
    return LayoutFile(layout, name, site_hash, provenance)


def _measures(listed: Any, where: str, kind: type[Measure]) -> Layout:
    """Return the measures of a list of names; `where` begins the message of an error."""
    if not isinstance(listed, list):
        raise LayoutError(f"{where}: is {type_word(listed)}, must be a list of names")
    for index, name in enumerate(listed):
        if not isinstance(name, str):
            raise LayoutError(f"{where}[{index}]: is {type_word(name)}, must be a string")
    return tuple(map(kind.named, listed))


def _check_keys(table: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Refuse an unknown key; `where` begins the message (`LayoutError`)."""
    for key in table:
        if key not in known:
            raise LayoutError(
                f"{where}{key_path([key])}: unknown key{suggestion(key, known)};"
                f" known: {', '.join(known)}"
            )


def _pieces(listed: Any, source: str, place: str) -> Layout:
    """Return the pieces of a list; `place` is its key, for errors."""
    if not isinstance(listed, list):
        raise LayoutError(f"{source}: {place}: is {type_word(listed)}, must be a list of tables")
    return tuple(_piece(name, f"{source}: {place}[{i}]") for i, name in enumerate(listed))


def _piece(table: Any, where: str) -> Piece:
    """Return the piece of a table; `where` begins the message of an error."""
    if not isinstance(table, dict):
        raise LayoutError(f"{where}: is {type_word(table)}, must be a table")
    _check_keys(table, tuple(_PIECE_KEYS), f"{where}: ")
    given = {"turned": False, **table}
    for key, kind in _PIECE_KEYS.items():
        if key not in given:
            raise LayoutError(f"{where}: {key}: missing")
        if type(given[key]) is not kind:
            raise LayoutError(
                f"{where}: {key}: is {type_word(given[key])}, must be {_KIND_WORDS[kind]}"
            )
    return Piece(given["row"], given["column"], given["item"], given["turned"])


def _piece_table(piece: Piece) -> dict[str, Any]:
    """Return a piece in the form of a file."""
    table = {key: getattr(piece, key) for key in _PIECE_KEYS}
    return table if piece.turned else {key: table[key] for key in ("item", "row", "column")}


def _cells(listed: Any, source: str, place: str) -> Layout:
    """Return the cells of a list; `place` is its key, for errors."""
    if not isinstance(listed, list):
        what = f"{place}: " if place else ""
        message = f"is {type_word(listed)}, must be a list of [row, column] pairs"
        raise LayoutError(f"{source}: {what}{message}")
    return tuple(cell_from(item, f"{source}: {place}[{i}]") for i, item in enumerate(listed))


def _is_hash(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch("[0-9a-f]{64}", value) is not None
