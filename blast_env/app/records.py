"""The record of a blast, and the table that compares layouts."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from math import nan
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from blast_env.documents import check_values, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation.answers import AnswerTable
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.engines.contract import (
    CALIBRATED_ENGINES,
    BlastLoads,
    StructureLoad,
    on_buildings,
)
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.grid_error import CellErrors, points
from blast_env.evaluation.standing import worst_standing
from blast_env.files import write_atomically
from blast_env.gas.settings import UNIFORM
from blast_env.geometry import Layout
from blast_env.layout.placement import load_relevant
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.scene import Charge
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
FILM: Final = "film.json"
MOST_BYTES: Final = 50_000_000
"""Largest size of a file of the work folder."""

FRAME: Final = "{:03}.jpg"


class Kept(BaseModel):
    """Base of the records in files: frozen; missing numbers are NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")


AnyKept = TypeVar("AnyKept", bound=Kept)


class EngineRecord(Kept):
    """The engine of a blast.

    Attributes:
        name: `event` (particles) or `gas`.
        cell_m: Side of the cells of gas dynamics.
        cells: Uniform cells, or the name of those that grow; see `GasSettings`.
    """

    name: str = "event"
    cell_m: float | None = None
    cells: str = UNIFORM

    @property
    def is_first_look(self) -> bool:
        """Whether this is a calibrated (particle) engine."""
        return self.name in CALIBRATED_ENGINES

    @property
    def label(self) -> str:
        """The engine in words, to stand beside each of its numbers."""
        if self.is_first_look:
            return "particles (first look)"
        return f"{self.name}, {self.gas.cell_words}"

    @property
    def gas(self) -> GasEngine:
        """Gas dynamics with its cells."""
        return GasEngine(cells=self.cells).configured(cell_m=self.cell_m)

    @property
    def coarser(self) -> "EngineRecord | None":
        """Gas dynamics with cells twice as large; `None` if there are none, as with particles."""
        engine = None if self.is_first_look else self.gas.coarser
        if engine is None:
            return None
        return EngineRecord(name=self.name, cell_m=engine.cell_m, cells=engine.cells)

    @classmethod
    def final(cls, scenario: Scenario) -> Self:
        """Return gas dynamics with the cells of final statements on a site."""
        engine = GasEngine().final([scenario])
        cell_m = None if engine.is_growing else engine.cell_m
        return cls(name=engine.name, cell_m=cell_m, cells=engine.cells)

    @property
    def found(self) -> Engine:
        """The engine itself."""
        return find_engine(self.name, self.cell_m) if self.is_first_look else self.gas


class Wave(Kept):
    """The history of a gauge.

    Attributes:
        gauge: Its name.
        peak_kpa: Largest overpressure.
        impulse_pa_s: Peak specific impulse.
        time_ms: Times of the thinned history.
        overpressure_kpa: Overpressure at these times.
    """

    gauge: str
    peak_kpa: float
    impulse_pa_s: float
    time_ms: tuple[float, ...]
    overpressure_kpa: tuple[float, ...]


class DesignSettings(Kept):
    """The settings of a design's page, which its history does not have.

    Attributes:
        engine: The engine.
        threats: Names of the chosen threats.
        view: The view opened last.
    """

    engine: EngineRecord
    threats: tuple[str, ...] = ()
    view: str = "Plan"


class Picture(Kept):
    """A picture of a blast: its file and its label."""

    file: str
    label: str


class BlastRecord(Kept):
    """The record of a blast.

    Attributes:
        key: Its key, see `blast_key`.
        threat: Name of the threat.
        engine: The engine.
        layout: The layout.
        loads: Loads on the structures, with particles means over the seeds; none are not known.
        intervals: Ends of the 95 % intervals of particles, Pa s, by structure; empty for all
            protected ones together.
        notes: Notes on the blast.
        unchecked: Pairs of a building and a reason to distrust the verdict on it: loads by gas, or
            walls that stand in no bay.
        pictures: Pictures beside the film.
        waves: Histories of the gauges.
        seconds: Duration of the run, s.
        repeat: The data to run it again: scenario hash, charge, versions.
    """

    key: str
    threat: str
    engine: EngineRecord
    layout: tuple[tuple[Any, ...], ...]
    loads: tuple[StructureLoad, ...]
    intervals: dict[str, tuple[float, float]] = {}
    notes: tuple[str, ...] = ()
    unchecked: tuple[tuple[str, str], ...]
    pictures: tuple[Picture, ...] = ()
    waves: tuple[Wave, ...] = ()
    seconds: float
    repeat: dict[str, Any]


class CoarseLoads(Kept):
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


class Film(Kept):
    """The frames of a film: their number and their times.

    Attributes:
        count: Number of frames written so far.
        time_ms: Simulated time of every frame, also of those to come.
    """

    count: int
    time_ms: tuple[float, ...]


def write_kept(record: Kept, path: Path) -> None:
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


def frames_in(folder: Path) -> int:
    """Return the number of frames written of the film of a blast."""
    film = read_kept(Film, folder / FILM)
    return 0 if film is None else film.count


def blast_key(scenario: Scenario, layout: Layout, charge: Charge, engine: EngineRecord) -> str:
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
        engine.name,
        engine.gas.smallest_m if engine.cells == UNIFORM else engine.cells,
    )
    return sha256(repr(depends).encode()).hexdigest()[:24]


def comparison(
    records: Sequence[tuple[str, float, BlastRecord]],
    without: Mapping[str, BlastRecord],
    scenario: Scenario,
    coarse: Mapping[str, CoarseLoads] = MappingProxyType({}),
) -> AnswerTable:
    """Return the comparison of layouts, one row per layout, threat and structure.

    With several threats, the last rows hold the load by the site's objective over all of them, for
    each layout blasted under all.

    Args:
        records: Name, cost and blast of each layout.
        without: The blast without a barrier, by the name of the threat.
        scenario: The site.
        coarse: Loads on the coarser cells, by the key of the blast.
    """
    objective = scenario.objective
    errors = _errors(records, without, objective, coarse)
    rows: list[tuple[str, ...]] = []
    for name, cost, record in records:
        unprotected, error = without.get(record.threat), errors.get(name)
        for title, names in _shown(record):
            load_of, impulse_of = partial(_load, objective, names), partial(_impulse, names)
            loads = blast_loads(record)
            load, impulse_pa_s, share, off = load_of(loads), impulse_of(loads), nan, nan
            if unprotected is not None and unprotected.loads and record.layout:
                share = reductions(load, load_of(blast_loads(unprotected))).item()
                off = nan if error is None else error.of_reduction(load_of)
            impulse_off = nan if error is None else error.of_load(impulse_of)
            load_off = nan if error is None else error.of_load(load_of)
            low_high = record.intervals.get(title)
            rows.append(
                (
                    name,
                    record.threat,
                    scenario.title_of(title) if title else TOGETHER,
                    _number(impulse_pa_s)
                    + _interval(low_high)
                    + _error(impulse_off * impulse_pa_s),
                    _number(only(loads, names).protected_peak_pa / PA_PER_KPA),
                    load_text(objective, load) + _error(load_off * load),
                    _percent(share, off),
                    f"{cost:,.10g}",
                    record.engine.label,
                    _standing(loads, names),
                )
            )
    rows += _all_threats(records, objective, errors)
    headers = [*_HEADERS]
    headers[_LOAD] += objective.noun + (f" ({objective.unit})" if objective.unit else "")
    if scenario.build_zone is not None and scenario.zone.currency:
        headers[_COST] += f" ({scenario.zone.currency})"
    table = [tuple(headers), *rows]
    if objective.quantity == "impulse":  # it is the load
        table = [row[:_LOAD] + row[_LOAD + 1 :] for row in table]
    return AnswerTable.of("", table[0], table[1:], 3)


def _load(objective: ObjectiveSection, names: tuple[str, ...], loads: BlastLoads) -> float:
    return only(loads, names).load(objective)


def _impulse(names: tuple[str, ...], loads: BlastLoads) -> float:
    """Return the impulse on a building, Pa s; without names that of all protected ones."""
    found = only(loads, names)
    if not names:
        return found.protected_impulse_pa_s
    return on_buildings(found.structures)[0].impulse_pa_s


def _standing(loads: BlastLoads, names: tuple[str, ...]) -> str:
    return worst_standing(each.stood for each in only(loads, names).protected).words


def load_text(objective: ObjectiveSection, load: float) -> str:
    """Return a load with its unit; a dash for NaN."""
    return _DASH if load != load else objective.text(load)


def _errors(
    records: Sequence[tuple[str, float, BlastRecord]],
    without: Mapping[str, BlastRecord],
    objective: ObjectiveSection,
    coarse: Mapping[str, CoarseLoads],
) -> dict[str, CellErrors]:
    """Return the errors of the cells by the name of the layout, from its largest load."""
    found: dict[str, CellErrors] = {}
    for name, _, record in sorted(records, key=lambda each: -worst_first(objective, each[2])):
        unprotected = without.get(record.threat)
        if unprotected is None or name in found:
            continue
        if record.key in coarse and unprotected.key in coarse:
            found[name] = CellErrors(
                fine=(blast_loads(record), blast_loads(unprotected)),
                coarse=(blast_loads(coarse[record.key]), blast_loads(coarse[unprotected.key])),
            )
    return found


def worst_first(objective: ObjectiveSection, record: BlastRecord) -> float:
    """Return the load by which the worst charge of a layout is chosen."""
    if not record.loads:
        return nan
    loads = blast_loads(record)
    return loads.protected_impulse_pa_s if objective.is_response else loads.load(objective)


def _shown(record: BlastRecord) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name of each row of a blast, and the structures whose loads it has.

    The first is for all protected structures. A building has one row if the areas of its parts are
    known.
    """
    if not record.loads:
        return
    yield "", ()
    parts: dict[str, list[str]] = {}
    for each in record.loads:
        parts.setdefault(each.name if each.area_m2 is None else each.building, []).append(each.name)
    for name, own in parts.items():
        yield name if len(own) > 1 else own[0], tuple(own)


def _all_threats(
    records: Sequence[tuple[str, float, BlastRecord]],
    objective: ObjectiveSection,
    errors: Mapping[str, CellErrors],
) -> Iterator[tuple[str, ...]]:
    """Yield the load over all threats, one row per layout blasted under all of them."""
    threats = dict.fromkeys(record.threat for _, _, record in records)
    if len(threats) < 2:
        return
    found: dict[str, list[tuple[float, BlastRecord]]] = {}
    for name, cost, record in records:
        if record.loads:
            found.setdefault(name, []).append((cost, record))
    whole = {name: own for name, own in found.items() if len(own) == len(threats)}
    load_of = partial(_load, objective, ())
    loads = {
        name: objective.risk(np.array([load_of(blast_loads(record)) for _, record in own]))
        for name, own in whole.items()
    }
    for name, own in whole.items():
        (cost, last), error = own[-1], errors.get(name)
        load_off, off = nan, nan
        if error is not None:
            load_off = error.of_load(load_of) * loads[name]
            off = error.of_reduction(load_of)
        without = next((loads[each] for each in whole if not whole[each][-1][1].layout), nan)
        share = reductions(loads[name], without).item() if last.layout else nan
        impulse = _number(loads[name]) + _error(load_off)
        yield (
            name,
            f"all {len(threats)}: {objective.charges}",
            TOGETHER,
            impulse if objective.quantity == "impulse" else _DASH,
            _DASH,
            load_text(objective, loads[name]) + _error(load_off),
            _percent(share, off),
            f"{cost:,.10g}",
            last.engine.label,
            worst_standing(
                load.stood for _, each in own for load in only(blast_loads(each), ()).protected
            ).words,
        )


def _interval(low_high: tuple[float, float] | None) -> str:
    return "" if low_high is None else f" ({_number(low_high[0])} to {_number(low_high[1])})"


def _number(value: float) -> str:
    """Return a number with three digits; a dash for NaN."""
    if value != value:
        return _DASH
    return f"{float(f'{value:.3g}'):,g}"


def _percent(share: float, error: float = nan) -> str:
    """Return a share in per cent, with its error of the cells in points, if there is one."""
    if share != share:
        return _DASH
    text = f"{100.0 * share:.1f} %".replace("-", "\N{MINUS SIGN}")
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
