"""Layout files: the cells of a layout, the scenario that they are for, and where they came from."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from blast_env.documents import MAX_BYTES, DocumentError, parse_json, read_text
from blast_env.errors import LayoutError, suggestion
from blast_env.files import write_atomically
from blast_env.geometry import Cell
from blast_env.scenario.models import Scenario
from blast_env.scenario.placement import cell_from, check_layout
from blast_env.scenario.problems import key_path, type_word, value_text

_KEYS: Final = ("cells", "scenario", "scenario_hash", "provenance")
_HASH_DIGITS: Final = 12  # in messages


@dataclass(frozen=True)
class LayoutFile:
    """What a layout file says.

    Attributes:
        cells: (row, column) of each module, in the order of the file.
        scenario: Name of the scenario that the layout is for; None if the file does not say.
        scenario_hash: Its content hash, 64 hexadecimal digits; None if the file does not say.
        provenance: How the layout was made: anything that JSON can hold (method, command, seed,
            versions, blasts).
    """

    cells: tuple[Cell, ...]
    scenario: str | None = None
    scenario_hash: str | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> "LayoutFile":
        """Read a file: a list of cells, or a table with the keys of this class.

        Whether the cells fit a scenario is for `cells_for` to say.

        Raises:
            LayoutError: If the file cannot be read or is anything else.
        """
        try:
            content = parse_json(read_text(Path(path)))
        except DocumentError as error:
            raise LayoutError(f"{path}: {error}") from error
        return _parse(content, str(path))

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        layout: Sequence[Cell],
        provenance: Mapping[str, Any] | None = None,
    ) -> "LayoutFile":
        """Return the file of a layout for a scenario.

        Raises:
            LayoutError: If the layout does not fit the scenario.
        """
        return cls(
            cells=check_layout(scenario, layout),
            scenario=scenario.name,
            scenario_hash=scenario.content_hash,
            provenance=dict(provenance or {}),
        )

    def cells_for(self, scenario: Scenario) -> tuple[Cell, ...]:
        """Return the cells, if they are a layout for this scenario.

        A file without a hash is taken for any scenario that its cells fit.

        Raises:
            LayoutError: If the file is for another scenario or another state of it, or if a cell
                is off the grid, not available, repeated or beyond the stock.
        """
        if self.scenario_hash not in (None, scenario.content_hash):
            raise LayoutError(self._mismatch(scenario))
        return check_layout(scenario, self.cells)

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
        return Path(path)

    def _text(self, path: str | Path) -> str:
        """Return the file as JSON, the cells on one line."""
        cells = json.dumps([list(cell) for cell in self.cells])
        keys: dict[str, Any] = {"scenario": self.scenario, "scenario_hash": self.scenario_hash}
        given = {name: value for name, value in keys.items() if value is not None}
        if self.provenance:
            given["provenance"] = dict(self.provenance)
        try:
            rest = json.dumps(given, indent=2, allow_nan=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise LayoutError(f"{path}: provenance: JSON cannot hold it: {error}") from error
        return f'{{\n  "cells": {cells}' + (f",{rest[1:]}" if given else "\n}")

    def _mismatch(self, scenario: Scenario) -> str:
        """Say that the layout is for another scenario, and what can be done."""
        hashes = (self.scenario_hash or "", scenario.content_hash)
        saved, asked = (f"hash {each[:_HASH_DIGITS]}" for each in hashes)
        name = "a scenario without a name" if self.scenario is None else repr(self.scenario)
        changed = f" ({name} has changed since)" if self.scenario == scenario.name else ""
        return (
            f"the layout was saved for {name} ({saved}), not for {scenario.name!r} ({asked})"
            f"{changed}: load the scenario that it is for, or save its cells anew for this one"
            " (blast_env.write_layout)"
        )


def load_layout(path: str | Path, scenario: Scenario | None = None) -> tuple[Cell, ...]:
    """Return the cells of a layout file.

    The file is `[[row, column], ...]`, or a table with `cells` and, if it says so, the scenario
    that they are for and how they were made; see `LayoutFile`.

    Args:
        path: The file.
        scenario: The scenario that the layout must be for. Without it, only the form of the file
            is checked; `check_layout` checks the cells later.

    Raises:
        LayoutError: If the file cannot be read or is anything else, or if the layout is not one
            for the scenario; the message names the file, the cell and the reason.
    """
    file = LayoutFile.load(path)
    if scenario is None:
        return file.cells
    try:
        return file.cells_for(scenario)
    except LayoutError as error:
        raise LayoutError(f"{path}: {error}") from error


def write_layout(
    path: str | Path,
    scenario: Scenario,
    layout: Sequence[Cell],
    provenance: Mapping[str, Any] | None = None,
) -> Path:
    """Write a layout for a scenario to a file that `load_layout` reads.

    Args:
        path: The file; an existing one is replaced as a whole.
        scenario: The scenario that the layout is for.
        layout: (row, column) of each module.
        provenance: How the layout was made, e.g. method, command, seed, versions, blasts.

    Returns:
        The path.

    Raises:
        LayoutError: If the layout does not fit the scenario, or JSON cannot hold the provenance.
        BlastEnvError: If the file cannot be written.
    """
    return LayoutFile.of(scenario, layout, provenance).save(path)


def _parse(content: Any, source: str) -> LayoutFile:
    """Return what a file says; `source` is its name, for errors."""
    if not isinstance(content, dict):
        return LayoutFile(_cells(content, source, ""))
    for key in content:
        if key not in _KEYS:
            known = ", ".join(_KEYS)
            raise LayoutError(
                f"{source}: {key_path([key])}: unknown key{suggestion(key, _KEYS)}; known: {known}"
            )
    if "cells" not in content:
        raise LayoutError(f"{source}: cells: missing")
    name, scenario_hash = content.get("scenario"), content.get("scenario_hash")
    if name is not None and not isinstance(name, str):
        raise LayoutError(f"{source}: scenario: is {type_word(name)}, must be a string")
    if scenario_hash is not None and not _is_hash(scenario_hash):
        raise LayoutError(
            f"{source}: scenario_hash: is {type_word(scenario_hash)}, must be 64 hexadecimal digits"
        )
    if name is not None and scenario_hash is None:
        raise LayoutError(
            f"{source}: scenario_hash: missing, but the scenario is {value_text(name)}:"
            " without it nothing can be checked"
        )
    provenance = content.get("provenance", {})
    if not isinstance(provenance, dict):
        raise LayoutError(f"{source}: provenance: is {type_word(provenance)}, must be a table")
    cells = _cells(content["cells"], source, "cells")
    return LayoutFile(cells, name, scenario_hash, provenance)


def _cells(listed: Any, source: str, place: str) -> tuple[Cell, ...]:
    """Return the cells of a list; `place` is the key that it stands at."""
    if not isinstance(listed, list):
        what = f"{place}: " if place else ""
        message = f"is {type_word(listed)}, must be a list of [row, column] pairs"
        raise LayoutError(f"{source}: {what}{message}")
    return tuple(cell_from(item, f"{source}: {place}[{i}]") for i, item in enumerate(listed))


def _is_hash(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch("[0-9a-f]{64}", value) is not None
