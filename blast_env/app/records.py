"""What is kept of a blast, and the table in which layouts stand beside each other."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict

from blast_env.documents import read_text
from blast_env.engines import Engine, find_engine
from blast_env.engines.contract import CALIBRATED_ENGINES
from blast_env.engines.gas import GasEngine
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.geometry import Layout
from blast_env.physics.gas.settings import UNIFORM
from blast_env.physics.scene import Charge
from blast_env.scenario import ObjectiveSection, Scenario
from blast_env.scenario.placement import met_by_blasts
from blast_env.statistics import reductions
from blast_env.units import PA_PER_KPA

RECORD: Final = "record.json"
"""Name of the file in the folder of a blast; it is there when all of it is."""

_DASH: Final = "\N{EN DASH}"
_TOGETHER: Final = "all protected"
FILM: Final = "film.json"
MOST_BYTES: Final = 50_000_000
"""Most that a file of the work folder may have."""

FRAME: Final = "{:03}.jpg"


class Kept(BaseModel):
    """Base of what is kept in files: frozen, numbers that do not exist are NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")


AnyKept = TypeVar("AnyKept", bound=Kept)


class EngineRecord(Kept):
    """The engine of a blast.

    Attributes:
        name: `event` (particles) or `gas`.
        cell_m: Side of the cells of gas dynamics.
        cells: Whether they grow, see `GasSettings`.
    """

    name: str = "event"
    cell_m: float | None = None
    cells: str = UNIFORM

    @property
    def is_first_look(self) -> bool:
        """Whether it is quick and has noise, and a calibration turns what it says into loads."""
        return self.name in CALIBRATED_ENGINES

    @property
    def label(self) -> str:
        """The engine in words, for people who have to know what a number rests on."""
        if self.is_first_look:
            return "particles (first look)"
        return f"{self.name}, {self.gas.cell_words}"

    @property
    def gas(self) -> GasEngine:
        """Gas dynamics with its cells."""
        return GasEngine(cells=self.cells).configured(cell_m=self.cell_m)

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
        low_pa_s: Lower end of its 95 % interval; NaN where there is no noise.
        high_pa_s: Upper end.
        peak_kpa: Largest overpressure, kPa; NaN with particles.
    """

    structure: str
    protected: bool
    impulse_pa_s: float
    low_pa_s: float = nan
    high_pa_s: float = nan
    peak_kpa: float = nan


class Wave(Kept):
    """What a gauge recorded.

    Attributes:
        gauge: Its name.
        peak_kpa: Largest overpressure.
        impulse_pa_s: Of all positive phases.
        time_ms: Times, a thinned history.
        overpressure_kpa: Overpressure then.
    """

    gauge: str
    peak_kpa: float
    impulse_pa_s: float
    time_ms: tuple[float, ...]
    overpressure_kpa: tuple[float, ...]


class Picture(Kept):
    """A picture of a blast: its file, and what it shows."""

    file: str
    label: str


class Verdict(Kept):
    """What a blast does to a building with a facade.

    Attributes:
        building: Its name.
        level: Level of protection that it reaches, from 0, below standards, to 4, high.
        level_on_cells: The same by the clipped peaks on the cells alone.
        panes: Panes that it has.
        broken: Panes that are expected to break.
        condition: Performance condition of its worst pane, GSA.
        damage: Damage of its worst wall panel; empty where it has none.
        total_damage: Damage of all its components, added up.
        impulse_pa_s: Mean impulse on its bays.
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


class BlastRecord(Kept):
    """What is kept of a blast.

    Attributes:
        key: What it is found by, see `blast_key`.
        threat: Name of the threat.
        engine: The engine.
        layout: The layout.
        loads: All structures; the first one is of all protected ones together.
        buildings: Buildings of several structures, where their mean is known.
        notes: What there is to say about it.
        unchecked: A building and why a verdict on it is to be distrusted, one each: loads by gas,
            or walls that stand in no bay.
        pictures: Pictures beside the film.
        waves: Histories of the gauges.
        seconds: How long it took.
        repeat: All that is needed to run it again.
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


class Film(Kept):
    """The frames of a film: how many there are, and when each is.

    Attributes:
        count: Frames that are there.
        time_ms: Simulated time of every frame, also of those to come.
    """

    count: int
    time_ms: tuple[float, ...]


def write_kept(record: Kept, path: Path) -> None:
    """Write a record; the file is there as a whole or not at all.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    with write_atomically(path) as temporary:
        temporary.write_text(record.model_dump_json(), encoding="utf-8")


def read_kept(kind: type[AnyKept], path: Path) -> AnyKept | None:
    """Return a record of a file, or `None` if it is not there or damaged."""
    try:
        return kind.model_validate_json(read_text(path, MOST_BYTES))
    except ValueError:
        return None


def read_record(folder: Path) -> BlastRecord | None:
    """Return the record of a blast, or `None` if it is not there or damaged."""
    return read_kept(BlastRecord, folder / RECORD)


def frames_in(folder: Path) -> int:
    """Return how many frames of the film of a blast are there."""
    film = read_kept(Film, folder / FILM)
    return 0 if film is None else film.count


def blast_key(scenario: Scenario, layout: Layout, charge: Charge, engine: EngineRecord) -> str:
    """Return by what a blast is found again: all that its loads and histories depend on.

    Measures that harden facades are left out, and so is what stands in bays: no load depends on it.
    """
    divided = [
        (each.name, each.facade.storey_m, each.facade.bay_m)
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
        threat: Name of the threat, or what all of them together come to.
        structure: Name of the structure, or "all protected".
        impulse: Impulse in Pa s, with its interval where there is one.
        peak: Peak in kPa.
        load: What the site's objective counts, in its unit.
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
    """A row of the table of buildings: a layout under a threat, or the worst of all threats.

    Attributes:
        layout: Name of the layout, or "no barrier".
        threat: Name of the threat, or "worst of" so many.
        building: Name of the building.
        level: Level of protection that it reaches.
        panes: How many panes are expected to break, of how many.
        condition: Performance condition of the worst pane, GSA.
        damage: Damage of the worst wall panel.
        flags: Why the loads that this rests on are to be distrusted; a dash where they are not.
    """

    layout: str
    threat: str
    building: str
    level: str
    panes: str
    condition: str
    damage: str
    flags: str


@dataclass(frozen=True)
class LoadJudge:
    """Says what counts of the loads on a site, as rewards, searches and reports do.

    Attributes:
        scenario: The site, with its objective and the weights of its structures.
    """

    scenario: Scenario

    @property
    def objective(self) -> ObjectiveSection:
        """What the site's layouts are to lower."""
        return self.scenario.objective

    def counted(self, record: BlastRecord, load: Load) -> float:
        """Return the load that counts of a structure, or of all protected ones, in its unit.

        NaN where a peak counts and the engine knows none.
        """
        if not load.structure:
            own = {each.name for each in self.scenario.structures if each.protected}
            return sum(self.counted(record, each) for each in record.loads if each.structure in own)
        structure = next(each for each in self.scenario.structures if each.name == load.structure)
        peak_pa = PA_PER_KPA * load.peak_kpa if self.objective.needs_peaks else 0.0
        return self.objective.load(
            load.impulse_pa_s, peak_pa, structure.weight, structure.counted_peak_weight
        )

    def together(self, record: BlastRecord) -> float:
        """Return the load that counts of all protected structures."""
        return self.counted(record, record.loads[0])

    def text(self, load: float) -> str:
        """Return a load that counts, with its unit; a dash for one that does not exist."""
        return _DASH if load != load else self.objective.text(load)


def comparison(
    records: Sequence[tuple[str, float, BlastRecord]],
    bare: Mapping[str, BlastRecord],
    scenario: Scenario,
) -> list[Row]:
    """Return the comparison of layouts, threat by threat and structure by structure.

    Where there are several threats, rows at the end have the load that the site's objective makes
    of all of them, for each layout that was blasted under all.

    Args:
        records: Name, cost and blast of each layout.
        bare: The blast without a barrier, by the name of the threat.
        scenario: The site.
    """
    judge = LoadJudge(scenario)
    rows = []
    for name, cost, record in records:
        unprotected = bare.get(record.threat)
        without = {each.structure: each for each in _loads_of(unprotected)}
        for load, parts in _shown(record, scenario):
            counted, share = sum(judge.counted(record, each) for each in parts), nan
            if unprotected is not None and without and record.layout:
                bare_parts = [without[each.structure] for each in parts]
                bare_load = sum(judge.counted(unprotected, each) for each in bare_parts)
                share = reductions(counted, bare_load).item()
            rows.append(
                Row(
                    layout=name,
                    threat=record.threat,
                    structure=load.structure or _TOGETHER,
                    impulse=_impulse_text(load),
                    peak=_number(load.peak_kpa),
                    load=judge.text(counted),
                    cost=f"{cost:g}",
                    reduction=_percent(share),
                    engine=record.engine.label,
                )
            )
    return rows + list(_all_threats(records, judge))


def _shown(record: BlastRecord, scenario: Scenario) -> Iterator[tuple[Load, tuple[Load, ...]]]:
    """Yield the loads that have a row, with those of their parts: a building is one of them."""
    known = {each.structure: each for each in record.buildings}
    names = scenario.building_names
    together: dict[str, list[Load]] = {}
    for load in record.loads:
        building = names.get(load.structure, load.structure)
        together.setdefault(building if building in known else load.structure, []).append(load)
    for name, parts in together.items():
        yield known.get(name, parts[0]), tuple(parts)


def _all_threats(
    records: Sequence[tuple[str, float, BlastRecord]], judge: LoadJudge
) -> Iterator[Row]:
    """Yield what the loads of all threats come to, for layouts that met all of them."""
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
        cost, last = own[-1]
        without = next((loads[each] for each in whole if not whole[each][-1][1].layout), nan)
        share = reductions(loads[name], without).item() if last.layout else nan
        yield Row(
            layout=name,
            threat=f"all {len(threats)}: {judge.objective.charges}",
            structure=_TOGETHER,
            impulse=_number(loads[name]) if judge.objective.quantity == "impulse" else _DASH,
            peak=_DASH,
            load=judge.text(loads[name]),
            cost=f"{cost:g}",
            reduction=_percent(share),
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
    """Return three digits of a number, a dash for one that does not exist."""
    if value != value:
        return _DASH
    return f"{float(f'{value:.3g}'):,g}"


def _percent(share: float) -> str:
    if share != share:
        return _DASH
    return f"{100.0 * share:.1f} %".replace("-", "\N{MINUS SIGN}")


def check_key(key: str) -> str:
    """Return the name of a folder that came from outside, if it is one.

    Raises:
        BlastEnvError: If it could lead anywhere else.
    """
    if re.fullmatch(r"[A-Za-z0-9_-]{1,100}", key) is None:  # longer ones are no names of folders
        raise BlastEnvError(f"{key[:100]!r} is no name of a design or a blast")
    return key
