"""The record of a blast, and the table that compares layouts."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from math import nan
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from blast_env.documents import check_values, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.engines.contract import (
    CALIBRATED_ENGINES,
    BlastLoads,
    StructureLoad,
    counted_parts,
)
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.grid_error import convergence_index, points
from blast_env.files import write_atomically
from blast_env.gas.settings import UNIFORM
from blast_env.geometry import Layout
from blast_env.layout.placement import met_by_blasts
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.scene import Charge
from blast_env.statistics import reductions
from blast_env.units import PA_PER_KPA

RECORD: Final = "record.json"
"""Name of the file in the folder of a blast; written last, it marks a complete blast."""

COARSE: Final = "coarse.json"
"""Name of the file with its loads on coarser cells, if it is that of the worst charge."""

_PLUS_MINUS: Final = "\N{PLUS-MINUS SIGN}"
_DASH: Final = "\N{EN DASH}"
TOGETHER: Final = "all protected"
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


class Load(Kept):
    """The load on one structure.

    Attributes:
        structure: Its name; empty for all protected ones together, by weight.
        protected: Whether its load counts.
        impulse_pa_s: Impulse, Pa s: with particles the mean over the seeds.
        low_pa_s: Lower end of its 95 % interval; NaN without noise.
        high_pa_s: Upper end.
        peak_kpa: Largest overpressure, kPa; NaN with particles.
        area_m2: Area of the walls that count; `None` with particles.
    """

    structure: str
    protected: bool
    impulse_pa_s: float
    low_pa_s: float = nan
    high_pa_s: float = nan
    peak_kpa: float = nan
    area_m2: float | None = None


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


class BuildingVerdict(Kept):
    """The response of a building with a facade to a blast.

    Attributes:
        building: Its name.
        level: Level of protection that it reaches, from 0, below standards, to 4, high.
        level_on_cells: The same by the clipped peaks on the cells alone.
        panes: Number of its panes.
        broken: Expected number of broken panes.
        condition: Performance condition of its worst pane, GSA, and its rating, ISO 16933.
        damage: Damage of its worst wall panel; empty where it has none.
        total_damage: Damage of all its components, added up.
        impulse_pa_s: Mean impulse on its bays.
        likely: Probability of the level or a higher one.
        standing: Standing of the load that decides, with its reason.
    """

    building: str
    level: int
    level_on_cells: int
    panes: int
    broken: float
    condition: str
    damage: str
    total_damage: float
    impulse_pa_s: float
    likely: float
    standing: str


class BlastRecord(Kept):
    """The record of a blast.

    Attributes:
        key: Its key, see `blast_key`.
        threat: Name of the threat.
        engine: The engine.
        layout: The layout.
        loads: Loads on the structures; the first is that on all protected ones together.
        buildings: Loads on the buildings of several structures, where their mean is known.
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
    loads: tuple[Load, ...]
    buildings: tuple[Load, ...] = ()
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
        buildings: Same as those of `BlastRecord`.
    """

    loads: tuple[Load, ...]
    buildings: tuple[Load, ...] = ()


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
        sorted(map(tuple, met_by_blasts(layout))),
        tuple(charge),
        engine.name,
        engine.gas.smallest_m if engine.cells == UNIFORM else engine.cells,
    )
    return sha256(repr(depends).encode()).hexdigest()[:24]


class Row(Kept):
    """A row of the comparison.

    Attributes:
        layout: Name of the layout, or "no barrier".
        threat: Name of the threat, or "all" of so many.
        structure: Name of the structure, or "all protected".
        impulse: Impulse in Pa s, with its interval where there is one.
        peak: Peak in kPa.
        load: Load by the site's objective, with its unit.
        cost: Cost of the layout.
        reduction: Reduction of the load that counts, against no barrier under the same threat.
        engine: The engine in words.
    """

    layout: str
    threat: str
    structure: str
    impulse: str
    peak: str
    load: str
    cost: str
    reduction: str
    engine: str


class VerdictRow(Kept):
    """A row of the table of buildings: a layout under one threat, or under the worst of them.

    Attributes:
        layout: Name of the layout, or "no barrier".
        threat: Name of the threat, or "worst of" so many.
        building: Name of the building.
        level: Level of protection that it reaches.
        likely: Probability of that level or a higher one; a dash below all of them.
        panes: Expected number of broken panes, and the number of panes.
        condition: Performance condition of the worst pane, GSA, and its rating, ISO 16933.
        damage: Damage of the worst wall panel.
        standing: Standing of the load that decides, with its reason.
        flags: Reasons to distrust its loads; a dash if there are none.
    """

    layout: str
    threat: str
    building: str
    level: str
    likely: str
    panes: str
    condition: str
    damage: str
    standing: str
    flags: str


@dataclass(frozen=True)
class LoadJudge:
    """Counts the loads on a site by its objective, as rewards, searches and reports do.

    Attributes:
        scenario: The site, with its objective and the weights of its structures.
    """

    scenario: Scenario

    @property
    def objective(self) -> ObjectiveSection:
        """The objective of the site."""
        return self.scenario.objective

    def counted(self, record: BlastRecord, loads: Iterable[Load]) -> float:
        """Return the load that counts of some structures together, in its unit.

        NaN where a peak counts and the engine knows none.

        Args:
            record: The blast.
            loads: Loads on structures: of them, the protected ones count, or else all; or the load
                on all protected ones together.
        """
        chosen = {each.structure for each in loads}
        every = {each.structure: each for each in record.loads}
        parts = [
            StructureLoad.on(
                each,
                load.impulse_pa_s,
                PA_PER_KPA * load.peak_kpa if self.objective.needs_peaks else 0.0,
                area_m2=load.area_m2,
            )
            for each in self.scenario.structures
            if (each.name in chosen or "" in chosen) and (load := every.get(each.name)) is not None
        ]
        counted = [replace(each, protected=True) for each in counted_parts(parts)]
        return BlastLoads(tuple(counted), np.zeros(0)).load(self.objective)

    def together(self, record: BlastRecord) -> float:
        """Return the load that counts of all protected structures."""
        return self.counted(record, record.loads[:1])

    def text(self, load: float) -> str:
        """Return a counted load with its unit; a dash for NaN."""
        return _DASH if load != load else self.objective.text(load)


@dataclass(frozen=True)
class CellErrors:
    """The errors of the cells of a layout, from the blasts of its worst charge.

    Attributes:
        judge: Counts the loads.
        walled: The blast with the layout, and its loads on the coarser cells.
        bare: The same without a barrier, under the same charge.
    """

    judge: LoadJudge
    walled: tuple[BlastRecord, CoarseLoads]
    bare: tuple[BlastRecord, CoarseLoads]

    def of_impulse(self, name: str) -> float:
        """Return the error of the impulse on a structure or building, as a share of it."""
        fine, coarse = (
            next(
                each.impulse_pa_s for each in (*own.buildings, *own.loads) if each.structure == name
            )
            for own in self.walled
        )
        return convergence_index(fine, coarse) / fine if fine > 0.0 else nan

    def of_load(self, parts: Iterable[Load]) -> float:
        """Return the error of the load that counts of some structures, as a share of it."""
        fine, coarse = (self._counted(self.walled, parts)[index] for index in (0, 1))
        return convergence_index(fine, coarse) / fine if fine > 0.0 else nan

    def of_reduction(self, parts: Iterable[Load]) -> float:
        """Return the error of its reduction, an absolute share."""
        both = (self._counted(each, parts) for each in (self.walled, self.bare))
        fine, coarse = (reductions(*pair).item() for pair in zip(*both, strict=True))
        return convergence_index(fine, coarse)

    def _counted(
        self, blast: tuple[BlastRecord, CoarseLoads], parts: Iterable[Load]
    ) -> tuple[float, float]:
        record, coarse = blast
        other = record.model_copy(update={"loads": coarse.loads})
        return self.judge.counted(record, parts), self.judge.counted(other, parts)


def comparison(
    records: Sequence[tuple[str, float, BlastRecord]],
    bare: Mapping[str, BlastRecord],
    scenario: Scenario,
    coarse: Mapping[str, CoarseLoads] = MappingProxyType({}),
) -> list[Row]:
    """Return the comparison of layouts, one row per layout, threat and structure.

    With several threats, the last rows hold the load by the site's objective over all of them, for
    each layout blasted under all.

    Args:
        records: Name, cost and blast of each layout.
        bare: The blast without a barrier, by the name of the threat.
        scenario: The site.
        coarse: Loads on the coarser cells, by the key of the blast.
    """
    judge = LoadJudge(scenario)
    errors = _errors(records, bare, judge, coarse)
    rows = []
    for name, cost, record in records:
        unprotected, error = bare.get(record.threat), errors.get(name)
        without = {each.structure: each for each in _loads_of(unprotected)}
        for load, parts in _shown(record, scenario):
            counted, share, off = judge.counted(record, parts), nan, nan
            if unprotected is not None and without and record.layout:
                bare_parts = [without[each.structure] for each in parts]
                bare_load = judge.counted(unprotected, bare_parts)
                share = reductions(counted, bare_load).item()
                off = nan if error is None else error.of_reduction(parts)
            impulse_off = nan if error is None else error.of_impulse(load.structure)
            load_off = nan if error is None else error.of_load(parts)
            rows.append(
                Row(
                    layout=name,
                    threat=record.threat,
                    structure=scenario.title_of(load.structure) if load.structure else TOGETHER,
                    impulse=_impulse_text(load) + _error(impulse_off * load.impulse_pa_s),
                    peak=_number(load.peak_kpa),
                    load=judge.text(counted) + _error(load_off * counted),
                    cost=f"{cost:g}",
                    reduction=_percent(share, off),
                    engine=record.engine.label,
                )
            )
    return rows + list(_all_threats(records, judge, errors))


def _errors(
    records: Sequence[tuple[str, float, BlastRecord]],
    bare: Mapping[str, BlastRecord],
    judge: LoadJudge,
    coarse: Mapping[str, CoarseLoads],
) -> dict[str, CellErrors]:
    """Return the errors of the cells by the name of the layout, from its largest load."""
    found: dict[str, CellErrors] = {}
    for name, _, record in sorted(records, key=lambda each: -worst_first(judge, each[2])):
        unprotected = bare.get(record.threat)
        if unprotected is None or name in found:
            continue
        if record.key in coarse and unprotected.key in coarse:
            pairs = ((each, coarse[each.key]) for each in (record, unprotected))
            found[name] = CellErrors(judge, *pairs)
    return found


def worst_first(judge: LoadJudge, record: BlastRecord) -> float:
    """Return the load by which the worst charge of a layout is chosen."""
    if not record.loads:
        return nan
    return record.loads[0].impulse_pa_s if judge.objective.is_response else judge.together(record)


def _shown(record: BlastRecord, scenario: Scenario) -> Iterator[tuple[Load, tuple[Load, ...]]]:
    """Yield each load that has a row, with those of its parts; a building has one row."""
    known = {each.structure: each for each in record.buildings}
    names = scenario.building_names
    together: dict[str, list[Load]] = {}
    for load in record.loads:
        building = names.get(load.structure, load.structure)
        together.setdefault(building if building in known else load.structure, []).append(load)
    for name, parts in together.items():
        yield known.get(name, parts[0]), tuple(parts)


def _all_threats(
    records: Sequence[tuple[str, float, BlastRecord]],
    judge: LoadJudge,
    errors: Mapping[str, CellErrors],
) -> Iterator[Row]:
    """Yield the load over all threats, one row per layout blasted under all of them."""
    threats = dict.fromkeys(record.threat for _, _, record in records)
    if len(threats) < 2:
        return
    found: dict[str, list[tuple[float, BlastRecord]]] = {}
    for name, cost, record in records:
        if record.loads:
            found.setdefault(name, []).append((cost, record))
    whole = {name: own for name, own in found.items() if len(own) == len(threats)}
    loads = {
        name: judge.objective.risk(np.array([judge.together(record) for _, record in own]))
        for name, own in whole.items()
    }
    for name, own in whole.items():
        (cost, last), error = own[-1], errors.get(name)
        load_off, off = nan, nan
        if error is not None:
            load_off = error.of_load(last.loads[:1]) * loads[name]
            off = error.of_reduction(last.loads[:1])
        without = next((loads[each] for each in whole if not whole[each][-1][1].layout), nan)
        share = reductions(loads[name], without).item() if last.layout else nan
        yield Row(
            layout=name,
            threat=f"all {len(threats)}: {judge.objective.charges}",
            structure=TOGETHER,
            impulse=(
                _number(loads[name]) + _error(load_off)
                if judge.objective.quantity == "impulse"
                else _DASH
            ),
            peak=_DASH,
            load=judge.text(loads[name]) + _error(load_off),
            cost=f"{cost:g}",
            reduction=_percent(share, off),
            engine=last.engine.label,
        )


def _loads_of(record: BlastRecord | None) -> tuple[Load, ...]:
    return () if record is None else record.loads


def _impulse_text(load: Load) -> str:
    text = _number(load.impulse_pa_s)
    if load.low_pa_s == load.low_pa_s:
        text += f" ({_number(load.low_pa_s)} to {_number(load.high_pa_s)})"
    return text


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
