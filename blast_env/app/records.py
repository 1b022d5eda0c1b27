"""The record of a blast, and the table that compares layouts."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from blast_env.documents import check_values, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation.answers import AnswerTable, percent, points
from blast_env.evaluation.engines.contract import BlastLoads, StructureLoad, on_buildings
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.grid_error import CellErrors, LoadOf
from blast_env.evaluation.standing import worst_standing
from blast_env.files import write_atomically
from blast_env.gas.settings import Cells
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.blast_site import Charge
from blast_env.statistics import counted_parts, reductions
from blast_env.units import PA_PER_KPA

RECORD: Final = "record.json"
"""Name of the file in the folder of a blast; written last, it marks a complete blast."""

COARSE: Final = "coarse.json"
"""Name of the file with its loads on coarser cells, if it is that of the worst charge."""

_PLUS_MINUS: Final = "\N{PLUS-MINUS SIGN}"
_DASH: Final = "\N{EN DASH}"
TOGETHER: Final = "all protected"
_HEADERS: Final = (
    *("layout", "threat", "structure", "impulse (Pa\N{NO-BREAK SPACE}s)", "peak (kPa)", "counts: "),
    *("reduction", "cost", "engine", "standing of the load"),
)
_LOAD, _COST = _HEADERS.index("counts: "), _HEADERS.index("cost")
MOST_BYTES: Final = 50_000_000
"""Largest size of a file of the work folder."""


class StoredRecord(BaseModel):
    """Base of the records in files: frozen; missing numbers are NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")


AnyKept = TypeVar("AnyKept", bound=StoredRecord)


class DesignSettings(StoredRecord):
    """The settings of a design's page, which its history does not have.

    Attributes:
        cells: The cells of new blasts.
        threats: Names of the chosen threats.
        view: The view opened last.
    """

    cells: Cells
    threats: tuple[str, ...] = ()
    view: str = "Plan"


class Picture(StoredRecord):
    """A picture of a blast: its file and its label."""

    file: str
    label: str


class BlastRecord(StoredRecord):
    """The record of a blast.

    Attributes:
        key: Its key, see `blast_key`.
        threat: Name of the threat.
        cells: The cells.
        layout: The layout.
        loads: Loads on the structures.
        notes: Notes on the blast.
        unchecked: Pairs of a building and a reason to distrust the verdict on it: loads by gas, or
            walls that stand in no bay.
        pictures: Its pictures.
        seconds: Duration of the run, s.
        repeat: The data to run it again: scenario hash, charge, versions.
    """

    key: str
    threat: str
    cells: Cells
    layout: tuple[tuple[Any, ...], ...]
    loads: tuple[StructureLoad, ...]
    notes: tuple[str, ...] = ()
    unchecked: tuple[tuple[str, str], ...]
    pictures: tuple[Picture, ...] = ()
    seconds: float
    repeat: dict[str, Any]


class CoarseLoads(StoredRecord):
    """The loads of a blast with cells twice as large, for the error of the cells.

    Attributes:
        loads: Same as those of `BlastRecord`.
    """

    loads: tuple[StructureLoad, ...]


def blast_loads(record: BlastRecord | CoarseLoads) -> BlastLoads:
    """Return the loads of a blast on structures, without those on modules."""
    return BlastLoads(record.loads, np.zeros(0))


def only(loads: BlastLoads, names: Collection[str]) -> BlastLoads:
    """Return the loads on some structures as if they alone counted.

    Args:
        loads: The loads of a blast.
        names: Names of the structures, of which the protected ones count, or else all. Without any,
            all protected structures of the site count.
    """
    if not names:
        return loads
    parts = counted_parts([each for each in loads.structures if each.name in names])
    return replace(loads, structures=tuple(replace(each, protected=True) for each in parts))


def write_kept(record: StoredRecord, path: Path) -> None:
    """Write a record, the whole file or none.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    with write_atomically(path) as temporary:
        temporary.write_text(record.model_dump_json(), encoding="utf-8")


def read_kept(kind: type[AnyKept], path: Path) -> AnyKept | None:
    """Return the record in a file, or `None` if it is missing or damaged."""
    try:
        return kind.model_validate_json(check_values(read_text(path, MOST_BYTES)))
    except ValueError:
        return None


def read_record(folder: Path) -> BlastRecord | None:
    """Return the record of a blast, or `None` if it is missing or damaged."""
    return read_kept(BlastRecord, folder / RECORD)


def blast_key(scenario: Scenario, layout: Layout, charge: Charge, cells: Cells) -> str:
    """Return the key of a blast: the digest of all that its loads and histories depend on.

    Hardening measures and the panes and walls in the bays are left out: no load depends on them.
    """
    divided = [
        (each.name, each.facade.storey_m, each.facade.storeys, each.facade.bay_m)
        for each in scenario.structures
        if each.facade is not None
    ]
    depends = (
        scenario.content_hash,
        divided,
        sorted(map(tuple, load_relevant(layout))),
        tuple(charge),
        cells,
    )
    return sha256(repr(depends).encode()).hexdigest()[:24]


@dataclass(frozen=True)
class BlastedLayout:
    """A layout with its blasts.

    Attributes:
        name: Its name.
        cost: Its cost.
        records: Its blasts by threat, not all of which need be there.
        coarse: Loads on the coarser cells, by the key of the blast.
    """

    name: str
    cost: float
    records: Mapping[str, BlastRecord]
    coarse: Mapping[str, CoarseLoads] = field(default_factory=dict)

    def errors(self, bare: "BlastedLayout", objective: ObjectiveSection) -> CellErrors | None:
        """Return the error of the cells, from the largest load that has both sizes."""
        worst = sorted(self.records.values(), key=lambda each: -worst_first(objective, each))
        for record in worst:
            other = bare.records.get(record.threat)
            if other is not None and record.key in self.coarse and other.key in bare.coarse:
                return CellErrors(
                    fine=(blast_loads(record), blast_loads(other)),
                    coarse=(
                        blast_loads(self.coarse[record.key]),
                        blast_loads(bare.coarse[other.key]),
                    ),
                )
        return None


def comparison(
    layouts: Sequence[BlastedLayout], threats: Sequence[str], scenario: Scenario
) -> AnswerTable:
    """Return the comparison of layouts, one row per layout, threat and building.

    With several threats, the last rows hold the loads by the site's objective over all of them, for
    each layout blasted under all.

    Args:
        layouts: The layouts, no barrier first.
        threats: Names of the threats.
        scenario: The site.
    """
    objective = scenario.objective
    rows = []
    for threat in threats:
        for each in layouts:
            if threat in each.records:
                for title, names in _shown(each.records[threat]):
                    words = threat, scenario.title_of(title) if title else TOGETHER
                    rows.append(_row(each, layouts[0], [threat], words, names, objective))
    if len(threats) > 1:
        words = f"all {len(threats)}: {objective.charges}", TOGETHER
        rows += [
            _row(each, layouts[0], threats, words, (), objective)
            for each in layouts
            if all(threat in each.records for threat in threats)
        ]
    headers = [*_HEADERS]
    headers[_LOAD] += objective.noun + (f" ({objective.unit})" if objective.unit else "")
    if scenario.build_zone is not None and scenario.zone.currency:
        headers[_COST] += f" ({scenario.zone.currency})"
    table = [tuple(headers), *rows]
    if objective.quantity == "impulse":  # it is the load
        table = [row[:_LOAD] + row[_LOAD + 1 :] for row in table]
    return AnswerTable.of("", table[0], table[1:], 3)


def _row(
    layout: BlastedLayout,
    bare: BlastedLayout,
    threats: Sequence[str],
    words: tuple[str, str],
    names: tuple[str, ...],
    objective: ObjectiveSection,
) -> tuple[str, ...]:
    """Return the row of a layout: loads on some structures over some threats."""

    def load_of(loads: BlastLoads) -> float:
        return only(loads, names).load(objective)

    def impulse_of(loads: BlastLoads) -> float:
        found = only(loads, names)
        if not names:
            return found.protected_impulse_pa_s
        return on_buildings(found.structures)[0].impulse_pa_s

    def over_all(side: BlastedLayout, number_of: LoadOf) -> float:
        found = [number_of(blast_loads(side.records[each])) for each in threats]
        return float(objective.risk(np.array(found)))

    records = [layout.records[each] for each in threats]
    parts = [only(blast_loads(each), names) for each in records]
    load, impulse_pa_s = over_all(layout, load_of), over_all(layout, impulse_of)
    error = layout.errors(bare, objective)
    impulse_off = load_off = share = off = nan
    if error is not None:
        impulse_off, load_off = error.of_load(impulse_of), error.of_load(load_of)
    if records[0].layout and all(each in bare.records for each in threats):
        share = reductions(load, over_all(bare, load_of)).item()
        off = nan if error is None else error.of_reduction(load_of)
    return (
        layout.name,
        *words,
        _number(impulse_pa_s) + _error(impulse_off * impulse_pa_s),
        _number(max(each.protected_peak_pa for each in parts) / PA_PER_KPA),
        load_text(objective, load) + _error(load_off * load),
        _percent(share, off),
        f"{layout.cost:,.10g}",
        GasEngine.with_cells(records[0].cells).words,
        worst_standing(load.stood for each in parts for load in each.protected).words,
    )


def load_text(objective: ObjectiveSection, load: float) -> str:
    """Return a load with its unit; a dash for NaN."""
    return _DASH if load != load else objective.text(load)


def worst_first(objective: ObjectiveSection, record: BlastRecord) -> float:
    """Return the load by which the worst charge of a layout is chosen."""
    loads = blast_loads(record)
    return loads.protected_impulse_pa_s if objective.is_response else loads.load(objective)


def _shown(record: BlastRecord) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name of each row of a blast, and the structures whose loads it has.

    The first is for all protected structures, the others are the buildings.
    """
    yield "", ()
    parts: dict[str, list[str]] = {}
    for each in record.loads:
        parts.setdefault(each.building, []).append(each.name)
    for name, own in parts.items():
        yield name if len(own) > 1 else own[0], tuple(own)


def _number(value: float) -> str:
    """Return a number with three digits; a dash for NaN."""
    if value != value:
        return _DASH
    return f"{float(f'{value:.3g}'):,g}"


def _percent(share: float, error: float = nan) -> str:
    """Return a share in per cent, with its error of the cells in points, if there is one."""
    if share != share:
        return _DASH
    text = percent(share).replace("-", "\N{MINUS SIGN}")
    return text if error != error else f"{text} {_PLUS_MINUS} {points(error)}"


def _error(error: float) -> str:
    """Return an error of the cells with its sign, with two digits; empty for NaN."""
    if error != error:
        return ""
    return f" {_PLUS_MINUS} {float(f'{error:.2g}'):,g}"


def check_key(key: str) -> str:
    """Return the name of a folder from outside, once it is checked.

    Raises:
        BlastEnvError: If it is not 1 to 100 letters, digits, `_` or `-`, and could lead elsewhere.
    """
    if re.fullmatch(r"[A-Za-z0-9_-]{1,100}", key) is None:  # longer ones are no names of folders
        raise BlastEnvError(f"{key[:100]!r} is no name of a design or a blast")
    return key
