"""Records of surveys, and the changes from one to another."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from blast_env.errors import BlastEnvError, reason_of, shortened
from blast_env.files import write_atomically
from studies.real_files.survey import Survey

Record = Mapping[str, Any]

_WORDS = 100


def record_of(found: Survey) -> Record:
    """Return a survey as plain data: its refusal, or the sums of its ledger and its buildings."""
    sums = {f"{fate}: {kind}": count for (fate, kind), count in sorted(found.sums.items())}
    return {"refusal": found.refusal, "sums": sums, "buildings": found.buildings}


def save(records: Mapping[str, Record], path: Path) -> None:
    """Write the records of files by their names."""
    with write_atomically(path) as target:
        target.write_text(json.dumps(records, indent=1, sort_keys=True), encoding="utf-8")


def load(path: Path) -> Mapping[str, Record]:
    """Return the records of a file.

    Raises:
        BlastEnvError: If it cannot be read, or has none.
    """
    try:
        records = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BlastEnvError(f"{path}: cannot be read as records: {reason_of(error)}") from error
    if not isinstance(records, dict):
        raise BlastEnvError(f"{path}: has no records of files")
    return records


def changes(before: Mapping[str, Record], after: Mapping[str, Record]) -> Iterator[str]:
    """Yield a line for each change of a file from one run to another."""
    for name in sorted(before.keys() | after.keys()):
        if name not in before or name not in after:
            yield f"{name}: {'new' if name in after else 'gone'}"
            continue
        old, new = before[name], after[name]
        if old["refusal"] != new["refusal"]:
            words = (shortened(value["refusal"], _WORDS) or "imported" for value in (old, new))
            yield f"{name}: {' -> '.join(words)}"
        yield from (f"{name}: {item}" for item in _of_sums(old["sums"], new["sums"]))
        yield from (f"{name}: {solid}" for solid in _of_solids(old["buildings"], new["buildings"]))


def _of_sums(old: Mapping[str, int], new: Mapping[str, int]) -> Iterator[str]:
    for kind in sorted(old.keys() | new.keys()):
        if old.get(kind, 0) != new.get(kind, 0):
            yield f"{kind}: {old.get(kind, 0)} -> {new.get(kind, 0)}"


def _of_solids(
    old: Mapping[str, Sequence[float]], new: Mapping[str, Sequence[float]]
) -> Iterator[str]:
    for place in sorted(old.keys() | new.keys()):
        words = [_solid(value.get(place)) for value in (old, new)]
        if words[0] != words[1]:
            yield f"{place}: {' -> '.join(words)}"


def _solid(given: Sequence[float] | None) -> str:
    """Return area, base and height of a building for people."""
    if given is None:
        return "no building"
    area_m2, base_m, height_m = given
    return f"{area_m2:.0f} m2, {base_m:g} to {height_m:g} m"
