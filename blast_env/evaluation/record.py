"""The record of a blast: the numbers that every question is answered from, its key, its codec.

Every engine gives loads. Gas dynamics adds the loads on buildings and walls, the histories of the
bays of facades, and the movements of barrier pieces: a complete record. The record stores; whether
a level is reached, or how likely a house is damaged, is a question
(`blast_env.evaluation.questions`).
"""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from hashlib import sha256
from itertools import accumulate
from math import isnan
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.validation import UNSTATED, Validation, worst_validation
from blast_env.geometry import Layout, WallName
from blast_env.response.levels import BayDamage, LevelOfProtection, level_of, worst
from blast_env.site import AnyScenario, AnyStructure, ObjectiveSection, Scenario, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.facade import BayComponents, named_bays
from blast_env.site.structures import StructureSection
from blast_env.statistics import counted_parts, mean_over_area

if TYPE_CHECKING:  # pandas takes a third of a second to import
    import pandas as pd


_in_range: Final = attrgetter("in_range")


@dataclass(frozen=True, slots=True)
class StructureLoad:
    """The load on one structure.

    Attributes:
        name: Name of the structure.
        protected: Whether its load counts.
        weight: Its weight among the protected structures.
        impulse_pa_s: Impulse per area, calibrated where the engine needs that, Pa*s; for gas
            dynamics the peak specific impulse, averaged over the counted walls.
        peak_pa: Largest overpressure on its walls, Pa; NaN if no air touches them, `None` for
            particles, which have none.
        peak_weight: Weight of the peak among the protected structures.
        in_range: Whether this distance and charge lie in the range of the calibration.
        notes: Reasons if they do not, one sentence each.
        building: The building that it is part of; its own name if it is a building by itself.
        area_m2: Area of the counted walls, 0 if the load on them is not known; `None` where the
            engine has no areas.
        response: Response of its bays in the objective; `None` unless the objective is a response.
        worst_damage: The largest damage of its bays, for the same objective; NaN, as the response,
            if no air touches the building.
        validation: Validation status of the load, with its reason.
        impulse_sim: Sum of m |v| over the collisions, simulation units; `None` without particles.
        unloaded_m2: Area of its counted walls without a load, since pieces fill the gap before
            them; `area_m2` and the means leave it out.
    """

    name: str
    protected: bool
    weight: float
    impulse_pa_s: float
    peak_pa: float | None
    peak_weight: float
    in_range: bool
    notes: tuple[str, ...]
    building: str
    area_m2: float | None = None
    response: float | None = None
    worst_damage: float | None = None
    validation: Validation = UNSTATED
    impulse_sim: float | None = None
    unloaded_m2: float = 0.0

    @property
    def unloaded_words(self) -> str:
        """A sentence on walls without a load behind pieces; empty without any."""
        if not self.unloaded_m2:
            return ""
        of_m2 = self.unloaded_m2 + (self.area_m2 or 0.0)
        return (
            f"{self.unloaded_m2:.1f} of {of_m2:.1f} m2 of its assessed walls have no load, since"
            " pieces fill the gap before them"
        )

    @classmethod
    def on(
        cls,
        structure: StructureSection,
        impulse_pa_s: float,
        peak_pa: float | None = None,
        in_range: bool = False,
        **others: Any,
    ) -> Self:
        """Return the load on a structure of a scenario; `others` are further attributes."""
        return cls(
            name=structure.name,
            protected=structure.protected,
            weight=structure.weight,
            impulse_pa_s=impulse_pa_s,
            peak_pa=peak_pa,
            peak_weight=structure.counted_peak_weight,
            in_range=in_range,
            building=structure.building_name,
            **({"notes": ()} | others),
        )

    def with_load(self, impulse_pa_s: float, peak_pa: float | None) -> Self:
        """Return the same with another impulse and peak."""
        return type(self)(  # `dataclasses.replace` takes four times as long
            *(self.name, self.protected, self.weight, impulse_pa_s, peak_pa, self.peak_weight),
            *(self.in_range, self.notes, self.building, self.area_m2, self.response),
            *(self.worst_damage, self.validation, self.impulse_sim, self.unloaded_m2),
        )


def on_buildings(loads: Sequence[StructureLoad]) -> tuple[StructureLoad, ...]:
    """Combine the loads on structures into loads on buildings.

    Impulses are means over the area of the counted walls. Where the engine has no areas, the
    weights of the structures replace them.
    """
    if [load.building for load in loads] == [load.name for load in loads]:  # the usual case
        return tuple(loads)
    parts: dict[str, list[StructureLoad]] = {}
    for load in loads:
        parts.setdefault(load.building, []).append(load)
    found = []
    for name, own in parts.items():
        # A building of one part is that part under its own name.
        if len(own) > 1:
            found.append(_on_building(name, own))
        else:
            found.append(own[0] if own[0].name == name else replace(own[0], name=name))
    return tuple(found)


def _on_building(name: str, parts: Sequence[StructureLoad]) -> StructureLoad:
    # Impulses are means over the area, peaks the largest, and notes those of the worst part. A part
    # among others that no air touches has no load of its own.
    counted = counted_parts(parts)
    counted = [part for part in counted if part.area_m2 != 0.0] or counted
    areas_m2 = [part.area_m2 for part in counted if part.area_m2 is not None]
    weights = [part.weight for part in counted]
    is_known = len(areas_m2) == len(counted)
    peaks_pa = [part.peak_pa for part in counted if part.peak_pa is not None]
    impulses_pa_s = np.array([part.impulse_pa_s for part in counted])
    hit = [part.impulse_sim for part in parts if part.impulse_sim is not None]
    return replace(
        counted[0],
        name=name,
        weight=sum(part.weight for part in counted_parts(parts)),
        impulse_pa_s=mean_over_area(impulses_pa_s, np.array(areas_m2 if is_known else weights)),
        peak_pa=max(peaks_pa, default=None),
        in_range=all(part.in_range for part in counted),
        area_m2=sum(areas_m2) if is_known else None,
        validation=worst_validation(part.validation for part in counted),
        impulse_sim=sum(hit) if hit else None,
        unloaded_m2=sum(part.unloaded_m2 for part in parts),
    )


@cache
def _nothing() -> NDArray[np.float64]:
    """Return an array without numbers, read-only: to make one takes as long as to keep loads."""
    nothing = np.zeros(0)
    nothing.flags.writeable = False
    return nothing


@dataclass(frozen=True, eq=False)
class BlastLoads:
    """The loads of one blast on all structures, without the barrier.

    Attributes:
        structures: One load per structure, in the order of the scene.
        module_impulse_n_s: Momentum on the walls of the structures' modules, N s, in the order
            of the scene (modules,); empty for particles, and for engines without loads on modules.
        bays: Damage of the bays of facades with each of their possible components; empty unless
            the objective is a response.
        module_impulse_sim: Sum of m |v| on each module, simulation units (modules,); empty without
            particles.
    """

    structures: tuple[StructureLoad, ...]
    module_impulse_n_s: NDArray[np.float64] = field(default_factory=_nothing)
    bays: tuple[BayDamage, ...] = ()
    module_impulse_sim: NDArray[np.float64] = field(default_factory=_nothing)

    def with_facades(
        self, named: Collection[BayComponents], objective: ObjectiveSection
    ) -> "BlastLoads":
        """Return the loads with the response of given facades, without another blast.

        That of a structure of which no air touches a bay is 0, or NaN, as its load, if no air
        touches the building; so is the damage.

        Raises:
            BlastEnvError: If the bays were not recorded.
        """
        if not self.bays and not self._hides({own.bay.structure for own in named}):
            raise BlastEnvError("the engine records no bays, but objective.kind is 'response'")
        glazed, hidden = {own.bay.structure for own in named}, self.without_load
        responded = []
        for load in self.structures:
            own = [bay for bay in self.bays if bay.structure == load.name]
            response, most = structure_response(own, named, objective)
            if load.name in glazed and load.building in hidden:
                response = most = np.nan
            responded.append(replace(load, response=response, worst_damage=most))
        return replace(self, structures=tuple(responded))

    def _hides(self, names: Collection[str]) -> bool:
        """Return whether no air touches the assessed walls of some structures."""
        own = [load for load in self.structures if load.name in names]
        return bool(own) and all(load.area_m2 == 0.0 for load in own)

    @property
    def has_particles(self) -> bool:
        """Whether these are loads by a particle engine."""
        return any(load.impulse_sim is not None for load in self.structures)

    @property
    def level(self) -> LevelOfProtection:
        """The level of protection of the facades of the protected structures.

        It is the lowest where one is not known, since no air touches a building.
        """
        damages = [load.worst_damage or 0.0 for load in self.protected]
        if any(map(isnan, damages)):
            return LevelOfProtection.BELOW_STANDARDS
        return level_of(worst(damages))

    def are_for(self, scenario: AnyScenario) -> bool:
        """Return whether these can be the loads of a scenario.

        They must be finite, one per structure and module, with its bays where it needs them. Walls
        that no air touches have none, and neither have structures that a layout takes away.
        """
        found, names = find_scenario(scenario), [load.name for load in self.structures]
        removable = () if found.build_zone is None else found.build_zone.removable
        may_go = frozenset[str]().union(*[removal.structures for removal in removable])
        left = [own for own in found.structures if own.name in names or own.name not in may_go]
        modules = sum(structure.modules for structure in left)
        impulses = [load.impulse_pa_s for load in self.structures if load.area_m2 != 0.0]
        on_modules = self.module_impulse_sim if self.has_particles else self.module_impulse_n_s
        return (
            names == [structure.name for structure in left]
            and (on_modules.shape == (modules,) or not (len(on_modules) or self.has_particles))
            and bool(np.isfinite(impulses).all() and np.isfinite(on_modules).all())
            and self._has_bays_of(found)
        )

    def _has_bays_of(self, scenario: Scenario) -> bool:
        """Return whether the bays and components are the scenario's, and the damage is finite."""
        if not scenario.objective.is_response:
            return not self.bays
        known = {
            alternative.name: {*alternative.glazing, *alternative.wall}
            for alternative in scenario.alternatives
        }
        if not self.bays:
            return self._hides({own.bay.structure for own in scenario.named_bays()})
        return all(
            known.get(bay.name) == set(bay.damage)
            and np.isfinite([*bay.damage.values(), bay.area_m2, bay.glazed_m2]).all()
            for bay in self.bays
        )

    @cached_property
    def protected(self) -> tuple[StructureLoad, ...]:
        """The loads on the protected structures."""
        return tuple([load for load in self.structures if load.protected])

    @cached_property
    def _buildings(self) -> tuple[StructureLoad, ...]:
        """The loads on the protected buildings."""
        return on_buildings(self.protected)

    @property
    def without_load(self) -> tuple[str, ...]:
        """The protected buildings without a load: no air touches their assessed walls."""
        return tuple(load.name for load in self._buildings if load.area_m2 == 0.0)

    @property
    def protected_impulse_pa_s(self) -> float:
        """Weighted sum of the impulses of the protected buildings, Pa*s."""
        return sum([building.weight * building.impulse_pa_s for building in self._buildings])

    @property
    def protected_impulse_sim(self) -> float | None:
        """Weighted sum of the impulses of the protected structures, simulation units.

        `None` of an engine without particles.
        """
        sims = [x.weight * x.impulse_sim for x in self.protected if x.impulse_sim is not None]
        return sum(sims) if sims else None

    @property
    def protected_peak_pa(self) -> float:
        """The largest overpressure on any wall of a protected building, Pa.

        NaN for particles, and if no air touches the walls of one of them, as of the impulse.
        """
        peaks = [load.peak_pa for load in self._buildings]
        if None in peaks or self.without_load:
            return np.nan
        return max([peak for peak in peaks if peak is not None], default=0.0)

    def load(self, objective: ObjectiveSection) -> float:
        """Return the load of the protected structures that an objective selects, in its unit."""
        # A building without a load has no peak either. A part of another one counts as 0.
        if objective.quantity == "peak" and self.without_load:
            return np.nan
        impulse_pa_s = {building.name: building.impulse_pa_s for building in self._buildings}
        return sum(
            [
                objective.load(
                    impulse_pa_s[load.building],
                    0.0 if load.area_m2 == 0.0 else load.peak_pa or 0.0,
                    load.weight,
                    load.peak_weight,
                    load.response,
                )
                for load in self.protected
            ]
        )

    @property
    def in_range(self) -> bool:
        """Whether the load on every protected structure is in the range of the calibration."""
        return all(map(_in_range, self.protected))


def structure_response(
    bays: Collection[BayDamage], named: Collection[BayComponents], objective: ObjectiveSection
) -> tuple[float, float]:
    """Return the response of one structure in the objective, and the largest damage of its bays.

    `bays` has their damage with each of their possible components, `named` the components of all
    bays.
    """
    # The damage of all possible components is known: those that stand in the bays count.
    chosen = {item.bay.name: item for item in named}
    is_glazing = objective.measure == "glazing"
    damage, area_m2 = [], []
    for item in bays:
        bay = chosen[item.name]
        names = (bay.glazing,) if is_glazing else (bay.glazing, bay.wall)
        damage.append(worst(item.damage[name] for name in names if name is not None))
        area_m2.append(item.glazed_m2 if is_glazing else item.area_m2)
    return objective.response(np.array(damage), np.array(area_m2)), worst(damage)


class BlastKey(NamedTuple):
    """All inputs that determine the record of a blast.

    Attributes:
        scenario_hash: Content hash of the scenario without its budget, on which no load depends.
        layout: The layout's cells, sorted.
        charge: The charge at its place.
        seed: Seed of fan and air.
        engine: The engine with its version; see `engine_text`.
        calibration: Digest of the calibration, for the loads in psi*s.
        code: Version of the package; see `provenance.code_version`.
        parts: Digest of the parts of the site that change no load, but what else a record has; see
            `parts_digest`.
    """

    scenario_hash: str
    layout: Layout
    charge: Charge
    seed: int
    engine: str
    calibration: str
    code: str
    parts: str = ""

    @property
    def text(self) -> str:
        """The key as text, by which a store has the record."""
        return json.dumps(self)

    @property
    def digest(self) -> str:
        """A short digest, as a name of a folder."""
        return sha256(self.text.encode()).hexdigest()[:24]


KEY: Final = TypeAdapter(BlastKey)
"""Reads a key from its text."""


def parts_digest(scenario: Scenario, response_s: float = 0.0) -> str:
    """Return the digest of what a record depends on beside its loads; empty for a plain site.

    These are the buildings of structures, the bays of facades, the masses of barrier items, and how
    long histories go on. The panes and walls in the bays are no other part of it, nor are measures
    that replace them: their response is computed from the histories.

    Args:
        scenario: The site.
        response_s: See `Engine.response_s`.
    """
    # Masses decide which pieces fall in a blast; names, divisions and bays of facades decide what
    # is recorded.
    zone = scenario.build_zone
    items = [] if zone is None else [item.model_dump(mode="json") for item in zone.items]
    structures = [
        (structure.name, structure.building_name, _division(structure))
        for structure in scenario.structures
        if structure.building_name != structure.name or structure.facade is not None
    ]
    if not (items or structures):
        return ""
    # A slower component needs longer histories, and a longer run may find larger loads.
    longer = (response_s,) if response_s else ()
    return sha256(json.dumps((items, structures, *longer)).encode()).hexdigest()


def _division(structure: AnyStructure) -> tuple[object, ...] | None:
    facade = structure.facade
    if facade is None:
        return None
    sizes = facade.storey_m, facade.storeys, facade.bay_m
    # A polygon has no bay where nothing stands; all bays of a rectangle have a component.
    if structure.footprint is None:
        return sizes
    return *sizes, [own.bay.name for own in named_bays(structure)]


class WallsWithoutVerdict(NamedTuple):
    """Counted walls of a building with a facade that lie in no bay: no verdict covers them.

    Attributes:
        area_m2: Area of these walls that touches air or pieces, m2.
        of_m2: Area of all counted walls of the building that touches air or pieces, m2; 0 if none
            does, so that the building has no verdict at all.
        structures: The parts of the building with such walls.
    """

    building: str
    area_m2: float
    of_m2: float
    structures: tuple[str, ...]

    @property
    def words(self) -> str:
        """A sentence that states the area and the parts."""
        parts = ", ".join(self.structures)
        if not self.of_m2:
            return f"no air touches its assessed walls ({parts}): no verdict covers it"
        return (
            f"{self.area_m2:.1f} of {self.of_m2:.1f} m2 of its walls stand in no bay ({parts}): "
            "no verdict covers them"
        )


@dataclass(frozen=True)
class BuildingLoad:
    """The load on a building, over its counted walls, and that on its most loaded wall.

    Attributes:
        impulse_pa_s: Peak specific impulse, mean over the area of the walls.
        peak_pa: Largest overpressure on a face of a cell.
        counted_pa: The peak to compare with limits; see `blast_env.evaluation.engines.walls`.
        counted_by: Its source.
        arrival_s: Arrival of the wave; NaN if none arrives.
        wall: The wall with the largest impulse.
        wall_impulse_pa_s: Impulse on it, mean.
        duration_s: Duration of the first positive phase of the mean overpressure on it; NaN if no
            wave arrives or the run ends before.
        known: Whether these impulses were known when the run ended.
        flagged: Whether there is a note on them.
        validation: Validation status of the mean impulse.
    """

    impulse_pa_s: float
    peak_pa: float
    counted_pa: float
    counted_by: str
    arrival_s: float
    wall: WallName
    wall_impulse_pa_s: float
    duration_s: float
    known: bool
    flagged: bool
    validation: Validation


class WallLoad(NamedTuple):
    """The mean load on the most loaded wall of a building, whether or not its walls count.

    Attributes:
        peak_pa: Peak overpressure, reflected, mean over the wall.
        impulse_pa_s: Impulse, reflected, mean over the wall.
    """

    wall: WallName
    peak_pa: float
    impulse_pa_s: float


@dataclass(frozen=True)
class BlastDetails:
    """What a complete record has beside the loads and the histories.

    Attributes:
        peak_factor: Factor on peaks that corrects their clipping by the cells.
        known: Whether the load on each bay was known when the run ended, by bay.
        buildings: The load on each building with a counted wall in the air, by name.
        walls: The load on the most loaded wall of each building, by name.
        unchecked: A building and the reason to distrust its loads, for each with such a reason.
        unjudged: Walls of buildings with a facade that no verdict covers.
        notes: Notes on loads, gauges and oblique walls.
        digest: Digest of the whole outcome.
    """

    __pydantic_config__: ClassVar = ConfigDict(ser_json_inf_nan="constants")

    peak_factor: float
    known: dict[str, bool]
    buildings: dict[str, BuildingLoad]
    walls: dict[str, WallLoad]
    unchecked: tuple[tuple[str, str], ...]
    unjudged: tuple[WallsWithoutVerdict, ...]
    notes: tuple[str, ...]
    digest: str


@dataclass(frozen=True, eq=False)
class BlastRecord:
    """The record of a blast.

    Attributes:
        loads: Loads on the structures.
        details: What a complete record has beside; `None` of engines that give loads alone.
        bays: Names of the bays of facades, in the order of the histories.
        time_s: Times of the histories (times,).
        pressure_pa: Mean overpressures on the bays (bays, times).
        pieces: Barrier pieces, one row each; see `engines.pieces.PIECE_COLUMNS`. `None` without
            details.
        taken_away: Pieces that overturned in an earlier run of the blast and were removed for this
            one; not stored.
    """

    loads: BlastLoads
    details: BlastDetails | None = None
    bays: tuple[str, ...] = ()
    time_s: FloatArray = field(default_factory=_nothing)
    pressure_pa: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    pieces: "pd.DataFrame | None" = None
    taken_away: Layout = ()

    @property
    def complete(self) -> BlastDetails:
        """The details."""
        if self.details is None:
            raise BlastEnvError("the engine records no walls and bays: must be 'gas'")
        return self.details

    def encoded(self) -> bytes:
        """Return the record as bytes: a line of JSON, then the arrays."""
        # A line of JSON with all that has a name, then the arrays, which JSON would triple.
        pieces = None if self.pieces is None else self.pieces.to_dict("split", index=False)
        header = _Header(
            structures=self.loads.structures,
            damage=self.loads.bays,
            modules_n_s=len(self.loads.module_impulse_n_s),
            modules_sim=len(self.loads.module_impulse_sim),
            details=self.details,
            bays=self.bays,
            times=len(self.time_s),
            pieces=json.dumps(pieces),  # NaN for numbers that they lack
        )
        arrays = (
            self.loads.module_impulse_n_s.astype("<f8"),
            self.loads.module_impulse_sim.astype("<f8"),
            self.time_s.astype("<f8"),
            self.pressure_pa.astype("<f4"),  # as they were recorded
        )
        return b"\n".join(
            (_HEADER.dump_json(header), b"".join(array.tobytes() for array in arrays))
        )

    @classmethod
    def decoded(cls, content: bytes) -> Self:
        """Return the record of its bytes."""
        line, _, arrays = content.partition(b"\n")
        header = _HEADER.validate_json(line)
        # The arrays follow each other without a mark: the header has their sizes.
        sizes = header.modules_n_s, header.modules_sim, header.times
        ends = [8 * end for end in accumulate(sizes)]
        on_walls, of_particles, time_s, pressure_pa = (
            np.frombuffer(part, dtype=kind).astype(np.float64)
            for part, kind in (
                (arrays[: ends[0]], "<f8"),
                (arrays[ends[0] : ends[1]], "<f8"),
                (arrays[ends[1] : ends[2]], "<f8"),
                (arrays[ends[2] :], "<f4"),
            )
        )
        pieces = json.loads(header.pieces)
        if pieces is not None:
            import pandas as pd

            pieces = pd.DataFrame(pieces["data"], columns=pieces["columns"])
        return cls(
            BlastLoads(header.structures, on_walls, header.damage, of_particles),
            header.details,
            header.bays,
            time_s,
            pressure_pa.reshape(len(header.bays), header.times),
            pieces,
        )


@dataclass(frozen=True)
class _Header:
    """The part of a record that is no array, and the sizes of the arrays."""

    __pydantic_config__: ClassVar = ConfigDict(ser_json_inf_nan="constants")

    structures: tuple[StructureLoad, ...]
    damage: tuple[BayDamage, ...]
    modules_n_s: int
    modules_sim: int
    details: BlastDetails | None
    bays: tuple[str, ...]
    times: int
    pieces: str


_HEADER: Final = TypeAdapter(_Header)
