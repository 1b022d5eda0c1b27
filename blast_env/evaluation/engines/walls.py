"""The complete record of a blast of gas dynamics: loads by building and wall, bays, pieces.

The peak to compare with a limit is chosen here: cells clip peaks, and clipping must not keep a
limit. On a face in sight of the charge, the larger of the peak on its cells and Kingery and
Bulmash's reflected peak counts: that at normal incidence or at the angle of the face, whichever is
larger, for the height of the charge (`blast_env.curves.over_ground`). On other faces, the peak on
the cells is multiplied by the possible clipping (`peak_factor`), up to the curve, since an obstacle
adds nothing to the wave in the open. If the cells alone exceed the curve, as between walls, it is
no bound.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import nan
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.curves import Ways, in_the_open, normally_reflected
from blast_env.evaluation.engines.gas_validation import bay_places
from blast_env.evaluation.record import (
    BlastDetails,
    BlastLoads,
    BlastRecord,
    BuildingLoad,
    StructureLoad,
    WallLoad,
    WallsWithoutVerdict,
)
from blast_env.evaluation.validation import NOT_KNOWN, Validation
from blast_env.gas.probes import ARRIVAL_PA
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.gas.solver import Gas
from blast_env.gas.tables import means_by_wall
from blast_env.geometry import WALLS, WallName
from blast_env.response.facade import peak_factor
from blast_env.results import ScaledImpulse
from blast_env.site import AnyStructure
from blast_env.site.blast_site import BlastSite, in_sight
from blast_env.site.structures import buildings_of
from blast_env.statistics import counted_parts

if TYPE_CHECKING:  # a third of a second to import
    import pandas as pd


class PeakSource(StrEnum):
    """The sources of a peak, in the words of a report."""

    GAS = "gas"
    CURVE = "Kingery-Bulmash reflected"
    EXTRAPOLATED = "gas, extrapolated from the cells"


@dataclass(frozen=True)
class PeakWeight:
    """The peak on a building to compare with limits."""

    pa: float
    source: PeakSource


def counted_peak(site: BlastSite, cell_m: float, faces: pd.DataFrame) -> PeakWeight:
    """Return the largest of the counted peaks on faces of cells, of `GasResult.on_walls`."""
    charge = site.charge
    points_m = faces[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)
    outward = np.zeros((len(faces), 3))
    outward[:, :2] = faces[["outward_x", "outward_y"]]
    seen = in_sight(site, points_m, outward)
    _, tnt_kg, height_m = charge
    ways = Ways.between((*charge.position_m, height_m), points_m, outward, seen)
    gas_pa = faces["peak_pa"].to_numpy(dtype=np.float64)
    curve_pa = normally_reflected("overpressure", ways.away_m, tnt_kg, height_m)
    curve_pa = np.maximum(curve_pa, in_the_open("overpressure", ways, tnt_kg, height_m))
    grown_pa = peak_factor(cell_m, charge.tnt_kg) * gas_pa
    bounded = gas_pa <= curve_pa
    hidden_pa = np.where(bounded, np.minimum(grown_pa, curve_pa), grown_pa)
    counted_pa = np.where(seen, np.maximum(gas_pa, curve_pa), hidden_pa)
    which = int(counted_pa.argmax())
    source = PeakSource.GAS if seen[which] else PeakSource.EXTRAPOLATED
    if bounded[which] and counted_pa[which] == curve_pa[which]:
        source = PeakSource.CURVE
    return PeakWeight(float(counted_pa[which]), source)


NO_AIR: Final = "no air touches its assessed walls: it has no load"
"""Note on a building that other structures or pieces hide."""

_DOUBLED: Final = (
    "peaks on bays farther than {:g} m from the charge are those of cells larger than {:g} m, and"
    " may be too low: take uniform cells"
)
"""Doubt about the peaks of cells that grow."""

_BREACH: Final = "so close that walls may be breached: the response covers bending only"


class WallHistories:
    """Recorder of the mean overpressure on every wall of every building.

    Args:
        buildings: The structures of each building, by its name.
        site: Their site.
    """

    def __init__(self, buildings: Mapping[str, Sequence[AnyStructure]], site: BlastSite) -> None:
        self._buildings, self._site = buildings, site
        self._members: dict[tuple[str, WallName], _Members] | None = None
        self._times: list[float] = []
        self._means: list[list[float]] = []

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step; its pressures are means over it."""
        if self._members is None:
            self._members = self._walls(solver)
        pressure = solver.wall_overpressure_pa()
        self._times.append(solver.time_s - 0.5 * step_s)
        self._means.append(
            [float((share * pressure[own]).mean()) for own, share in self._members.values()]
        )

    @property
    def time_s(self) -> FloatArray:
        """Middles of the steps (steps,)."""
        return np.array(self._times)

    def of(self, building: str, wall: WallName) -> FloatArray | None:
        """Return the mean overpressure on a wall, Pa (steps,); `None` for one without air."""
        keys = list(self._members or ())
        if (building, wall) not in keys:
            return None
        return np.array(self._means)[:, keys.index((building, wall))]

    def _walls(self, solver: Gas) -> dict[tuple[str, WallName], "_Members"]:
        from blast_env.gas.engine import face_table_of  # Numba takes half a second

        table = face_table_of(solver.grid, self._site)
        names = [structure.name for structure in self._site.structures]
        members = {}
        for building, structures in self._buildings.items():
            for index, wall in enumerate(WALLS):
                parts = [
                    names.index(structure.name)
                    for structure in structures
                    if wall in structure.faces and structure.name in names
                ]
                chosen = np.flatnonzero(np.isin(table.structure, parts) & (table.face == index))
                if len(chosen):
                    share = table.share[chosen]
                    members[building, wall] = _Members(chosen, share / share.mean())
        return members


class _Members(NamedTuple):
    """The faces of a wall, and their weights in its mean, 1 on average."""

    faces: NDArray[np.int64]
    share: FloatArray


class GasOutcome(Protocol):
    """What a record takes from the result of a blast of gas dynamics."""

    @property
    def blast(self) -> Any:
        """The blast."""

    @property
    def run(self) -> Any:
        """The run, at its end."""

    @property
    def bay_loads(self) -> Any:
        """Histories of the bays of facades."""

    @property
    def on_walls(self) -> "pd.DataFrame":
        """One row per cell face."""

    @property
    def buildings(self) -> "pd.DataFrame":
        """One row per building."""

    @property
    def pieces(self) -> "pd.DataFrame":
        """One row per barrier piece."""

    @property
    def unjudged(self) -> tuple[WallsWithoutVerdict, ...]:
        """Counted walls in no bay."""

    @property
    def structure_loads(self) -> tuple[StructureLoad, ...]:
        """The loads on all structures."""

    @property
    def stepped_notes(self) -> tuple[str, ...]:
        """Notes on peaks on oblique walls."""

    @property
    def gauge_notes(self) -> tuple[str, ...]:
        """Notes on gauges."""

    @property
    def digest(self) -> str:
        """Digest of the whole outcome."""

    def loads(self) -> BlastLoads:
        """Return the loads on all structures."""

    def impulse(self, structure: str) -> ScaledImpulse:
        """Return the impulse on a structure."""

    def validation(self, names: Collection[str]) -> Validation:
        """Return the validation status of the load on structures."""


def record_of(result: GasOutcome, histories: WallHistories) -> BlastRecord:
    """Return the complete record of a finished blast, whose walls were recorded."""
    loads = _building_loads(result, histories)
    details = BlastDetails(
        peak_factor=peak_factor(result.run.grid.cell_m, result.run.site.charge.tnt_kg),
        known=result.bay_loads.known(result.run) if result.bay_loads.bays else {},
        buildings=loads,
        walls=dict(_wall_loads(result)),
        unchecked=tuple(_unchecked(result)),
        unjudged=result.unjudged,
        notes=tuple(dict.fromkeys(_notes(result, loads))),
        digest=result.digest,
    )
    record = BlastRecord(result.loads(), details, pieces=result.pieces)
    if result.bay_loads.bays:
        bays = tuple(bay.bay.name for bay in result.bay_loads.bays)
        time_s, pressure_pa = result.bay_loads.histories
        record = replace(record, bays=bays, time_s=time_s, pressure_pa=pressure_pa)
    return record


def _building_loads(result: GasOutcome, histories: WallHistories) -> dict[str, BuildingLoad]:
    """Return the load on every building with a counted wall in the air, by name."""
    rows = result.buildings.set_index("building").to_dict("index")
    return {
        name: _building_load(result, name, structures, rows[name], histories)
        for name, structures in _remaining(result).items()
        if rows[name]["most_loaded_face"]
    }


def _remaining(result: GasOutcome) -> dict[str, list[AnyStructure]]:
    """Return the structures of each building, without those that the layout takes away."""
    blast = result.blast
    return buildings_of(blast.scenario.structures_with(blast.layout))


def _building_load(
    result: GasOutcome,
    name: str,
    structures: Sequence[AnyStructure],
    row: Mapping[Any, Any],
    histories: WallHistories,
) -> BuildingLoad:
    """Return the load on a building from its row in the table of buildings."""
    # The mean is over all counted walls, the history that of the most loaded one.
    faces, wall = result.on_walls, row["most_loaded_face"]
    counting = [
        (faces["structure"] == counted_part.name) & faces["face"].isin(counted_part.faces)
        for counted_part in counted_parts(structures)
    ]
    walls = faces[np.logical_or.reduce(counting)]
    pressure = histories.of(name, wall)
    names = [structure.name for structure in structures]
    in_range = all(result.impulse(name).in_range for name in names)
    counted = counted_peak(result.run.site, result.run.grid.cell_m, walls)
    return BuildingLoad(
        impulse_pa_s=row["impulse_pa_s"],
        peak_pa=row["peak_pa"],
        counted_pa=counted.pa,
        counted_by=counted.source.value,
        arrival_s=row["arrival_s"],
        wall=wall,
        wall_impulse_pa_s=row["most_loaded_pa_s"],
        duration_s=nan if pressure is None else first_phase_s(histories.time_s, pressure),
        known=row["known"],
        flagged=not (row["known"] and in_range),
        validation=result.validation(names),
    )


def _wall_loads(result: GasOutcome) -> Iterator[tuple[str, WallLoad]]:
    """Yield the name of each building, and the mean load on its most loaded wall."""
    faces = result.on_walls
    walls = faces[faces["face"].isin(WALLS)]
    for building, parts in _remaining(result).items():
        own = walls[walls["structure"].isin([part.name for part in parts])]
        if len(own):
            impulses, peaks = (means_by_wall(own, name) for name in ("impulse_pa_s", "peak_pa"))
            wall: Any = impulses.idxmax()
            yield building, WallLoad(wall, float(peaks[wall]), float(impulses[wall]))


def _notes(result: GasOutcome, loads: Mapping[str, BuildingLoad]) -> Iterator[str]:
    """Yield notes on loads outside the validated range of the engine, and on loads not captured.

    The checked range counts for protected buildings alone, capture for all.
    """
    for parts in _remaining(result).values():
        if any(part.protected for part in parts):
            for part in parts:
                yield from result.impulse(part.name).notes
    yield from (f"{name}: {NOT_KNOWN}" for name, load in loads.items() if not load.known)
    yield from (f"{name}: {NO_AIR}" for name in _remaining(result) if name not in loads)
    yield from (
        f"{load.name}: {words}" for load in result.structure_loads if (words := load.unloaded_words)
    )
    yield from result.stepped_notes
    yield from result.gauge_notes


def _unchecked(result: GasOutcome) -> Iterator[tuple[str, str]]:
    """Yield each building with doubtful loads, and the reasons.

    The loads are outside the validated range of the engine or the response, or not known.
    """
    names = result.blast.scenario.building_names
    reasons: dict[str, dict[str, None]] = {}
    for outline in result.run.site.structures:
        if not outline.is_barrier:
            name = names.get(outline.name, outline.name)
            own = reasons.setdefault(name, {})
            own.update(dict.fromkeys(result.impulse(outline.name).notes))
            if result.run.site.scaled_distance(outline) < CHECKED_SCALED_DISTANCE[0]:
                own[_BREACH] = None
            own.update(dict.fromkeys(_doubled_words(result, outline.name)))
    yield from ((building, "; ".join(own)) for building, own in reasons.items() if own)


def _doubled_words(result: GasOutcome, structure: str) -> Iterator[str]:
    """Yield that the wave comes to bays of a structure on cells that have doubled, if it does.

    Peaks are sharpened by the smallest cells (`peak_factor`), which is too little there.
    """
    doubled_m, site = result.run.settings.doubled_m, result.run.site
    bays = [own.bay for own in result.bay_loads.bays if own.bay.structure == structure]
    if doubled_m and bay_places(site, bays).distance_m.max(initial=0.0) > doubled_m[0]:
        yield _DOUBLED.format(doubled_m[0], result.run.grid.cell_m)


def first_phase_s(time_s: FloatArray, overpressure_pa: FloatArray) -> float:
    """Return the duration of the first positive phase that reaches 1 kPa, s.

    The phase starts at the last value of at most 0 before 1 kPa. NaN if there is none, or it does
    not end.
    """
    arrived = np.flatnonzero(overpressure_pa >= ARRIVAL_PA)
    if len(arrived) == 0:
        return nan
    before = np.flatnonzero(overpressure_pa[: arrived[0]] <= 0.0)
    after = np.flatnonzero(overpressure_pa[arrived[0] :] <= 0.0)
    if len(after) == 0:
        return nan
    first = before[-1] if len(before) else 0
    end = int(arrived[0] + after[0])
    # From the last positive value to the first that is not, in a straight line to 0.
    high, low = overpressure_pa[end - 1], overpressure_pa[end]
    end_s = time_s[end - 1] + high / (high - low) * (time_s[end] - time_s[end - 1])
    return float(end_s - time_s[first])
