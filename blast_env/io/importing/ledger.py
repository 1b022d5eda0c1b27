"""The ledger of an import: what became of every object of a map or drawing."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from blast_env.errors import BlastEnvError, quoted, shortened
from blast_env.files import write_atomically

MOST_LETTERS: Final = 300
"""Most letters of a line where people read it."""

_MOST_NAME: Final = 32  # letters, where a line has many objects
_MOST_CUT_LINES: Final = 12
_MOST_NAMED: Final = 50


class Fate(StrEnum):
    """The fate of an object in an import, or a remark on one."""

    READ = "read"
    MERGED = "merged"
    CUT = "cut"
    CLOSED = "closed"
    NOTED = "noted"
    GUESSED = "guessed"
    LEFT_OUT = "left out"
    PASSED = "not of the site"


CHANGES: Final = (
    *(Fate.MERGED, Fate.CUT, Fate.CLOSED, Fate.NOTED),
    *(Fate.GUESSED, Fate.LEFT_OUT),
)
"""The entries that change the site or say how it lies, which are notes of an import."""

STRICT: Final = (Fate.GUESSED, Fate.LEFT_OUT)
"""The fates that `--strict` refuses."""

FATES: Final = (Fate.READ, Fate.MERGED, Fate.LEFT_OUT, Fate.PASSED)
"""The fates, of which each object of a file has one; the others are remarks in addition."""


@dataclass(frozen=True)
class LedgerEntry:
    """A line of the ledger.

    Attributes:
        fate: What was done.
        kind: The kind of the object, or the reason.
        place: The object's place in the file: `way 4711`.
        name: Its name in the file.
        detail: The value guessed, or the object that it was merged with.
        position: A place in it, in the coordinates of the file.
    """

    fate: Fate
    kind: str
    place: str
    name: str = ""
    detail: str = ""
    position: tuple[float, float] | None = None

    @property
    def words(self) -> str:
        """The object with its name and detail, for texts."""
        name = f" {quoted(self.name, _MOST_NAME)}" if self.name else ""
        return f"{self.place}{name}: {self.detail}" if self.detail else f"{self.place}{name}"


@dataclass
class Ledger:
    """The entries of an import; see `Fate`.

    Every object of a file has one entry of `FATES`, and maybe remarks: cut, closed, noted,
    guessed.

    Attributes:
        entries: All entries, in the order of the fates done.
    """

    entries: list[LedgerEntry] = field(default_factory=list)

    def add(self, fate: Fate, kind: str, place: str, name: str = "", detail: str = "") -> None:
        """Add an entry."""
        self.entries.append(LedgerEntry(fate, kind, place, name, detail))

    def of(self, *fates: Fate) -> tuple[LedgerEntry, ...]:
        """Return the entries of some fates."""
        return tuple(entry for entry in self.entries if entry.fate in fates)

    @property
    def objects(self) -> int:
        """Number of the objects of the file."""
        return len(self.of(*FATES))

    def save(self, path: Path) -> Path:
        """Write all entries as JSON, or as text for other suffixes; return the path.

        Raises:
            BlastEnvError: If the file cannot be written.
        """
        is_json = path.suffix.lower() == ".json"
        lines = "".join(f"{line}\n" for line in self.lines(tuple(Fate)))
        text = json.dumps(self.record, indent=1) if is_json else lines
        with write_atomically(path) as target:
            target.write_text(text, encoding="utf-8")
        return path

    def lines(self, fates: Sequence[Fate], most: int | None = None) -> tuple[str, ...]:
        """Return a line for each kind of entries, by fate.

        Args:
            fates: The fates, in their order.
            most: Most letters of a line, which names as many objects as it has room for.
        """
        found = []
        for kind, entries in self._grouped(fates).items():
            count = len(entries) if most is None else min(len(entries), _MOST_NAMED)
            line = _line(kind, entries, count)
            while most is not None and len(line) > most and count:
                count -= 1
                line = _line(kind, entries, count)
            found.append(line if most is None else shortened(line, most))
        return tuple(found)

    @property
    def record(self) -> dict[str, Any]:
        """The entries for JSON, by fate and kind."""
        record: dict[str, dict[str, list[dict[str, Any]]]] = {str(fate): {} for fate in Fate}
        for (fate, kind), entries in self._grouped(tuple(Fate)).items():
            record[fate][kind] = [
                {
                    key: value
                    for key in ("place", "name", "detail", "position")
                    if (value := getattr(entry, key))
                }
                for entry in entries
            ]
        return record

    def check_strict(self, path: object) -> None:
        """Refuse an import that guessed something or left something out.

        Raises:
            BlastEnvError: If it did; the message has all kinds.
        """
        lines = self.lines(STRICT, MOST_LETTERS)
        if lines:
            more = f"\n  and {len(lines) - _MOST_CUT_LINES} more kinds" * (
                len(lines) > _MOST_CUT_LINES
            )
            listed = "".join(f"\n  {line}" for line in lines[:_MOST_CUT_LINES])
            raise BlastEnvError(
                f"{path}: --strict allows no guess and no omission, but there are:{listed}{more}"
            )

    def _grouped(self, fates: Sequence[Fate]) -> dict[tuple[Fate, str], list[LedgerEntry]]:
        groups: dict[tuple[Fate, str], list[LedgerEntry]] = {}
        for fate in fates:
            for entry in self.of(fate):
                groups.setdefault((fate, entry.kind), []).append(entry)
        return groups


def _line(kind: tuple[Fate, str], entries: Sequence[LedgerEntry], count: int) -> str:
    """Return a line on the entries of a kind with the first of its objects."""
    shown = [entry.words for entry in entries[:count]]
    more = [f"and {len(entries) - len(shown)} more"] if len(entries) > len(shown) else []
    return f"{kind[0]}: {kind[1]}: {len(entries)} ({', '.join([*shown, *more])})"
