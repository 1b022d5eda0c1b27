"""Loads by building and wall, with their durations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.gas import GasBlast, GasResult
from blast_env.evaluation.standing import NOT_KNOWN, ReasonedStanding
from blast_env.gas.grid import GasGrid
from blast_env.gas.probes import ARRIVAL_PA
from blast_env.gas.solver import Gas, Recorder
from blast_env.geometry import Rectangle, WallName
from blast_env.report.peaks import CountedPeak, counted_peak
from blast_env.site import AnyStructure, Scenario
from blast_env.site.blast_site import WALLS, BlastSite
from blast_env.site.structures import buildings_of
from blast_env.statistics import counted_parts


@dataclass(frozen=True)
class ReportedBuilding:
    """A building: one structure, or several that form it.

    Attributes:
        name: Its name.
        structures: The structures.
    """

    name: str
    structures: tuple[AnyStructure, ...]

    @property
    def protected(self) -> bool:
        """Whether its load counts."""
        return any(each.protected for each in self.structures)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its structures."""
        return tuple(each.name for each in self.structures)

    @property
    def height_m(self) -> float | None:
        """Its height; `None` for as high as the air."""
        heights = [each.height_m for each in self.structures]
        known = [height_m for height_m in heights if height_m is not None]
        return max(known) if len(known) == len(heights) else None

    @property
    def bounds_m(self) -> Rectangle:
        """The rectangle around it."""
        return Rectangle.around([each.rectangle_m for each in self.structures])


def targets_of(scenario: Scenario) -> tuple[ReportedBuilding, ...]:
    """Return the buildings of a scenario, protected ones first."""
    together = buildings_of(scenario.structures)
    targets = [ReportedBuilding(name, tuple(parts)) for name, parts in together.items()]
    return tuple(sorted(targets, key=lambda each: not each.protected))


class WallHistories:
    """Recorder of the mean overpressure on every wall of every building.

    Args:
        targets: The buildings.
        site: Their site.
    """

    def __init__(self, targets: Sequence[ReportedBuilding], site: BlastSite) -> None:
        self._targets, self._site = tuple(targets), site
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

    def of(self, target: str, wall: WallName) -> FloatArray | None:
        """Return the mean overpressure on a wall, Pa (steps,); `None` for one without air."""
        keys = list(self._members or ())
        if (target, wall) not in keys:
            return None
        return np.array(self._means)[:, keys.index((target, wall))]

    def _walls(self, solver: Gas) -> dict[tuple[str, WallName], "_Members"]:
        from blast_env.gas.engine import face_table_of  # Numba takes half a second

        table = face_table_of(solver.grid, self._site)
        names = [each.name for each in self._site.structures]
        members = {}
        for target in self._targets:
            for index, wall in enumerate(WALLS):
                parts = [
                    names.index(each.name)
                    for each in target.structures
                    if wall in each.faces and each.name in names
                ]
                chosen = np.flatnonzero(np.isin(table.structure, parts) & (table.face == index))
                if len(chosen):
                    share = table.share[chosen]
                    members[target.name, wall] = _Members(chosen, share / share.mean())
        return members


class _Members(NamedTuple):
    """The faces of a wall, and their weights in its mean, 1 on average."""

    faces: NDArray[np.int64]
    share: FloatArray


@dataclass(frozen=True)
class TargetLoad:
    """The load on a building, over its counted walls.

    Attributes:
        impulse_pa_s: Peak specific impulse, mean over the area of the walls.
        peak_pa: Largest overpressure on a face of a cell.
        counted: The peak to compare with limits.
        arrival_s: Arrival of the wave; NaN if none arrives.
        wall: The wall with the largest impulse.
        wall_impulse_pa_s: Impulse on it, mean.
        duration_s: Duration of the first positive phase of the mean overpressure on it; NaN if no
            wave arrives or the run ends before.
        known: Whether these impulses were known when the run ended.
        flagged: Whether there is a note on them.
        stood: Standing of the mean impulse.
    """

    impulse_pa_s: float
    peak_pa: float
    counted: CountedPeak
    arrival_s: float
    wall: WallName
    wall_impulse_pa_s: float
    duration_s: float
    known: bool
    flagged: bool
    stood: ReasonedStanding


@dataclass(frozen=True, eq=False)
class MeasuredBlast:
    """A blast with the loads on buildings.

    Attributes:
        result: The blast.
        histories: Mean overpressures on walls.
        targets: The buildings.
    """

    result: GasResult
    histories: WallHistories
    targets: tuple[ReportedBuilding, ...]

    @cached_property
    def loads(self) -> dict[str, TargetLoad]:
        """The load on every building with a wall in the air, by name."""
        rows = self.result.buildings.set_index("building").to_dict("index")
        return {
            each.name: self._load(each, rows[each.name])
            for each in self.targets
            if rows[each.name]["most_loaded_face"]
        }

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes on loads outside the validated range of the engine, and on loads not captured.

        The checked range counts for protected buildings alone, capture for all.
        """
        names = (name for each in self.targets if each.protected for name in each.names)
        notes = [note for name in names for note in self.result.impulse(name).notes]
        late = [name for name, load in self.loads.items() if not load.known]
        notes += [f"{name}: {NOT_KNOWN}" for name in late]
        notes += (*self.result.stepped_notes, *self.result.moved_gauges)
        return tuple(dict.fromkeys(notes))

    def _load(self, target: ReportedBuilding, row: Mapping[Any, Any]) -> TargetLoad:
        """Return the load on a building from its row in the table of buildings."""
        faces, wall = self.result.on_walls, row["most_loaded_face"]
        counting = [
            (faces["structure"] == each.name) & faces["face"].isin(each.faces)
            for each in counted_parts(target.structures)
        ]
        walls = faces[np.logical_or.reduce(counting)]
        pressure = self.histories.of(target.name, wall)
        in_range = all(self.result.impulse(name).in_range for name in target.names)
        return TargetLoad(
            impulse_pa_s=row["impulse_pa_s"],
            peak_pa=row["peak_pa"],
            counted=counted_peak(self.result.run.site, self.result.run.grid.cell_m, walls),
            arrival_s=row["arrival_s"],
            wall=wall,
            wall_impulse_pa_s=row["most_loaded_pa_s"],
            duration_s=nan if pressure is None else first_phase_s(self.histories.time_s, pressure),
            known=row["known"],
            flagged=not (row["known"] and in_range),
            stood=self.result.standing(target.names),
        )


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


def measure(
    blast: GasBlast,
    targets: Sequence[ReportedBuilding],
    progress: Callable[[float], None] | None = None,
) -> MeasuredBlast:
    """Run a blast and return the loads on buildings."""
    histories = WallHistories(targets, blast.site)
    from blast_env.gas.probes import GroundMap  # Numba takes half a second to import

    def recorders(grid: GasGrid) -> tuple[Recorder, ...]:
        return (histories, GroundMap(grid))

    return MeasuredBlast(blast.run(progress, recorders), histories, tuple(targets))
