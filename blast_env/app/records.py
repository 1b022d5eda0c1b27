"""What is kept of a blast, and the table in which layouts stand beside each other."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, ConfigDict

from blast_env.documents import read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.geometry import Layout
from blast_env.physics.scene import Charge
from blast_env.statistics import reductions

RECORD: Final = "record.json"
"""Name of the file in the folder of a blast; it is there when all of it is."""

FILM: Final = "film.json"
MOST_BYTES: Final = 50_000_000
"""Most that a file of the work folder may have."""

FRAME: Final = "{:03}.jpg"


class Kept(BaseModel):
    """Base of what is kept in files: frozen, numbers that do not exist are NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="constants")


class Engine(Kept):
    """The engine of a blast.

    Attributes:
        name: `event` (particles) or `gas`.
        cell_m: Side of the cells of gas dynamics.
    """

    name: str = "event"
    cell_m: float | None = None

    @property
    def is_gas(self) -> bool:
        """Whether it is gas dynamics."""
        return self.name == "gas"

    @property
    def label(self) -> str:
        """The engine in words, for people who have to know what a number rests on."""
        if self.is_gas:
            return f"gas, cells of {self.cell_m or 0.5:g} m"
        return "particles (first look)"


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


class BlastRecord(Kept):
    """What is kept of a blast.

    Attributes:
        key: What it is found by, see `blast_key`.
        threat: Name of the threat.
        engine: The engine.
        layout: The layout.
        loads: All structures; the first one is of all protected ones together.
        notes: What there is to say about it.
        pictures: Pictures beside the film.
        waves: Histories of the gauges.
        seconds: How long it took.
        repeat: All that is needed to run it again.
    """

    key: str
    threat: str
    engine: Engine
    layout: tuple[tuple[Any, ...], ...]
    loads: tuple[Load, ...]
    notes: tuple[str, ...] = ()
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


def read_record(folder: Path) -> BlastRecord | None:
    """Return the record of a blast, or `None` if it is not there or damaged."""
    try:
        return BlastRecord.model_validate_json(read_text(folder / RECORD, MOST_BYTES))
    except ValueError:
        return None


def read_film(folder: Path) -> Film | None:
    """Return what there is of the film of a blast, or `None` if nothing is."""
    try:
        return Film.model_validate_json(read_text(folder / FILM, MOST_BYTES))
    except ValueError:
        return None


def blast_key(scenario_hash: str, layout: Layout, charge: Charge, engine: Engine) -> str:
    """Return by what a blast is found again: all that its result depends on."""
    depends = (
        scenario_hash,
        sorted(map(tuple, layout)),
        tuple(charge),
        engine.name,
        engine.cell_m or 0.5,
    )
    return sha256(repr(depends).encode()).hexdigest()[:24]


class Row(Kept):
    """A row of the comparison.

    Attributes:
        layout: Name of the layout, or "no barrier".
        threat: Name of the threat.
        structure: Name of the structure, or "all protected".
        impulse: Impulse in Pa s, with its interval where there is one.
        peak: Peak in kPa.
        cost: Cost of the layout.
        reduction: Reduction against no barrier under the same threat.
        engine: The engine in words.
    """

    layout: str
    threat: str
    structure: str
    impulse: str
    peak: str
    cost: str
    reduction: str
    engine: str


def comparison(
    records: Sequence[tuple[str, float, BlastRecord]], bare: Mapping[str, BlastRecord]
) -> list[Row]:
    """Return the comparison of layouts, threat by threat and structure by structure.

    Args:
        records: Name, cost and blast of each layout.
        bare: The blast without a barrier, by the name of the threat.
    """
    rows = []
    for name, cost, record in records:
        unprotected = {load.structure: load for load in _loads_of(bare.get(record.threat))}
        for load in record.loads:
            without = unprotected.get(load.structure)
            share = nan
            if without is not None and record.layout:
                share = reductions(load.impulse_pa_s, without.impulse_pa_s).item()
            rows.append(
                Row(
                    layout=name,
                    threat=record.threat,
                    structure=load.structure or "all protected",
                    impulse=_impulse_text(load),
                    peak=_number(load.peak_kpa),
                    cost=f"{cost:g}",
                    reduction=_percent(share),
                    engine=record.engine.label,
                )
            )
    return rows


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
        return "\N{EN DASH}"
    return f"{float(f'{value:.3g}'):,g}"


def _percent(share: float) -> str:
    if share != share:
        return "\N{EN DASH}"
    return f"{100.0 * share:.1f} %".replace("-", "\N{MINUS SIGN}")


def check_key(key: str) -> str:
    """Return the name of a folder that came from outside, if it is one.

    Raises:
        BlastEnvError: If it could lead anywhere else.
    """
    if not key or not all(each.isascii() and (each.isalnum() or each in "-_") for each in key):
        raise BlastEnvError(f"{key!r} is no name of a design or a blast")
    return key
