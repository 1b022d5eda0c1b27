"""Layouts compared with no barrier: loads, reductions, tables and plain data.

A reduction is NaN where the load without a barrier is 0. A comparison of layouts is refused for a
case in which no threat causes a load without a barrier (`check_something_arrives`).
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, check_something_arrives
from blast_env.evaluation.engines.bays import VALIDATION_COLUMNS
from blast_env.evaluation.engines.contract import Engine
from blast_env.evaluation.questions.grid_error import GridError, impulse_of
from blast_env.evaluation.record import BlastLoads, BlastRecord, StructureLoad, on_buildings
from blast_env.evaluation.validation import Validation, worst_validation
from blast_env.files import write_text
from blast_env.geometry import Layout
from blast_env.layout.build_site import build_site
from blast_env.provenance import versions
from blast_env.site import ObjectiveSection, Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.structures import without_facade
from blast_env.statistics import (
    CVAR_LEVEL,
    Estimate,
    check_cvar_level,
    conditional_value_at_risk,
    mean_estimate,
    reduction_estimate,
    reductions,
)
from blast_env.tables import Column, number_or_none, table_of, table_records
from blast_env.vehicles.worst_places import stand_off_m

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


CHARGE_COLUMNS: Final = (
    Column("charge_x_m", "m", "centre of the charge, from the left border"),
    Column("charge_y_m", "m", "centre of the charge, from the lower border"),
    Column("charge_height_m", "m", "height of its centre; 0: it lies on the ground"),
    Column("tnt_kg", "kg", "TNT-equivalent mass of the charge"),
)

STRUCTURE_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("protected", "", "whether its load counts"),
    Column("weight", "", "its weight among the protected structures"),
    Column("impulse_pa_s", "Pa s", "calibrated impulse per area with the barrier"),
    Column("unprotected_impulse_pa_s", "Pa s", "calibrated impulse per area without it"),
    Column("reduction", "", "of the calibrated impulse"),
    Column("reduction_low", "", "lower end of its 95 % confidence interval"),
    Column("reduction_high", "", "upper end of its 95 % confidence interval"),
    Column("reduction_error", "", "grid error of the reduction; particles have none"),
    Column("impulse_error_pa_s", "Pa s", "grid error of the impulse with the barrier"),
    Column("unprotected_impulse_error_pa_s", "Pa s", "the same without it"),
    Column(
        "peak_pa", "Pa", "largest overpressure on its walls with the barrier, mean over threats"
    ),
    Column("unprotected_peak_pa", "Pa", "the same without it; particles have none"),
    Column("threats_in_range", "", "threats in the checked or calibrated range on both sides"),
    *VALIDATION_COLUMNS,
)


THREAT_COLUMNS: Final = (
    Column("seed", "", "seed of fan and air"),
    *CHARGE_COLUMNS,
    Column("impulse_pa_s", "Pa s", "protected structures, with the barrier"),
    Column("unprotected_impulse_pa_s", "Pa s", "protected structures, without it"),
    Column("peak_pa", "Pa", "largest overpressure on them, with the barrier"),
    Column("unprotected_peak_pa", "Pa", "the same without it; particles have none"),
    Column("load", "", "load in the scenario's objective, with the barrier"),
    Column("unprotected_load", "", "the same without it"),
    Column("reduction", "", "of that load"),
    Column("in_range", "", "whether it is in the checked or calibrated range on both sides"),
    Column("stand_off_m", "m", "from the charge to the nearest protected wall, with the barrier"),
    Column("unprotected_stand_off_m", "m", "the same without it: less only for a vehicle"),
)


def _structure_row(
    blasts: Blasts, load_of: Callable[[BlastRecord], StructureLoad], error: GridError | None
) -> dict[str, object]:
    """Return the row of one structure or building, whose load in a blast is given."""
    # The first layout is the empty site, the last one that in question.
    sides = [[load_of(part) for part in own] for own in blasts.records.values()]
    without, loads = sides[0], sides[-1]
    first, worst = loads[0], _worst_of_both(loads, without)

    def impulse_of(record: BlastRecord) -> float:
        return load_of(record).impulse_pa_s

    # 1. The reduction: of the means over the threats, with its interval over them.
    impulses = [np.array([load.impulse_pa_s for load in own]) for own in (loads, without)]
    reduction = reduction_estimate(*impulses)
    # 2. The grid error, of the worst threat; that of loads as shares.
    errors, of_reduction = (np.nan, np.nan), np.nan
    if error is not None:
        errors = error.of_load(impulse_of), error.of_unprotected(impulse_of)
        of_reduction = error.of_reduction(impulse_of)
    row: dict[str, object] = {
        "structure": first.name,
        "protected": first.protected,
        "weight": first.weight,
        "reduction": reduction.value,
        "reduction_low": reduction.low,
        "reduction_high": reduction.high,
        "reduction_error": of_reduction,
        "threats_in_range": sum(
            one.in_range and other.in_range for one, other in zip(loads, without, strict=True)
        ),
        "validation": worst.status.label,
        "reason": worst.reason,
    }
    # 3. Both sides: the shares of the error now times the mean loads.
    both = zip(("", "unprotected_"), (loads, without), impulses, errors, strict=True)
    for side, own, impulse, off in both:
        mean_pa_s = float(impulse.mean())
        peaks = [np.nan if load.peak_pa is None else load.peak_pa for load in own]
        row[f"{side}impulse_pa_s"] = mean_pa_s
        row[f"{side}impulse_error_pa_s"] = off * mean_pa_s
        row[f"{side}peak_pa"] = float(np.mean(peaks))
    return row


def _worst_of_both(loads: Sequence[StructureLoad], without: Sequence[StructureLoad]) -> Validation:
    """Return the worst validation status of a structure's loads with a barrier and without one.

    A reduction rests on both. A vehicle may be nearer without a barrier.
    """
    own, bare = (worst_validation(load.validation for load in side) for side in (loads, without))
    return own if own.status >= bare.status else bare._replace(reason=f"{_BARE}{bare.reason}")


_BARE: Final = "without a barrier, "


def charge_values(charge: Charge) -> dict[str, object]:
    """Return the values of `CHARGE_COLUMNS`."""
    # In the order of the columns.
    values = (*charge.position_m, charge.height_m, charge.tnt_kg)
    return {column.name: value for column, value in zip(CHARGE_COLUMNS, values, strict=True)}


@dataclass(frozen=True)
class ThreatOutcome:
    """Loads under one threat; impulses are those of `BlastLoads.protected_impulse_pa_s`.

    Attributes:
        threat: The threat.
        charge: Its charge, at its place with the barrier.
        stand_off_m: Distance of the charge from the nearest protected wall.
        unprotected_stand_off_m: The same without the barrier; smaller for a vehicle only.
        impulse_pa_s: Impulse on the protected structures with the barrier, Pa*s.
        unprotected_impulse_pa_s: The same without it, Pa*s.
        peak_pa: Largest overpressure on their walls with the barrier, Pa; NaN for particles.
        unprotected_peak_pa: The same without it, Pa.
        load: Load of the protected structures with the barrier, in the unit of the objective.
        unprotected_load: The same without it.
        in_range: Whether the threat is in the checked or calibrated range with the barrier and
            without it.
    """

    threat: LoadCase
    charge: Charge
    stand_off_m: float
    unprotected_stand_off_m: float
    impulse_pa_s: float
    unprotected_impulse_pa_s: float
    peak_pa: float
    unprotected_peak_pa: float
    load: float
    unprotected_load: float
    in_range: bool

    @classmethod
    def of(cls, blasts: Blasts, number: int, objective: ObjectiveSection | None = None) -> Self:
        """Return the outcome of one threat, by its number, with the layout in question.

        Loads are those of an objective, that of the site unless given.
        """
        scenario, counts = blasts.scenario, objective or blasts.scenario.objective
        charge, elsewhere = (blasts.charge(side, number) for side in _sides(blasts))
        loads, unprotected = (blasts.records[side][number].loads for side in _sides(blasts))
        return cls(
            threat=blasts.threats[number],
            charge=charge,
            stand_off_m=stand_off_m(scenario.loaded_walls, charge.position_m),
            unprotected_stand_off_m=stand_off_m(scenario.loaded_walls, elsewhere.position_m),
            impulse_pa_s=loads.protected_impulse_pa_s,
            unprotected_impulse_pa_s=unprotected.protected_impulse_pa_s,
            peak_pa=loads.protected_peak_pa,
            unprotected_peak_pa=unprotected.protected_peak_pa,
            load=loads.load(counts),
            unprotected_load=unprotected.load(counts),
            in_range=loads.in_range and unprotected.in_range,
        )

    @property
    def reduction(self) -> float:
        """Relative reduction of the load; NaN if the load without a barrier is 0."""
        return reductions(self.load, self.unprotected_load).item()


def _sides(blasts: Blasts) -> tuple[str, str]:
    """Return the names of the layout in question and of no barrier."""
    return blasts.judged, blasts.unprotected


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Layouts, one per case, compared with no barrier on the same threats.

    The reduction of a case is 1 - load with the barrier / load without it, each combined over the
    threats by the risk measure of the case. Several cases have equal weights, and intervals are
    those of the mean over cases. With a single case they are over its threats, and there is none
    if its risk measure is not the mean, or its objective has a target. Intervals are 95 %
    confidence intervals; they do not include the error of the model.

    Impulses are weighted sums of impulses per area of the protected buildings. Means, tails,
    outcomes, tables and records are those of the first case.

    Attributes:
        every: The blasts of each case, with the layout last, all with the same number of threats.
        cvar_level: Level of `cvar`: 0.8 is the mean of the worst 20 %.

    Raises:
        BlastEnvError: If no load reaches the protected structures of a case without a barrier.
    """

    every: tuple[Blasts, ...]
    cvar_level: float = CVAR_LEVEL

    def __post_init__(self) -> None:
        check_cvar_level(self.cvar_level)
        # Whether air touches a wall is the same under all threats.
        first = (part.records[part.unprotected][0].loads for part in self.every)
        without_load = [loads.without_load for loads in first]
        check_something_arrives(self.cases, self.unprotected, without_load)

    @property
    def cases(self) -> tuple[LoadCaseSet, ...]:
        """The cases."""
        return tuple(part.case for part in self.every)

    @property
    def layouts(self) -> tuple[Layout, ...]:
        """The layout of each case."""
        return tuple(part.layouts[part.judged] for part in self.every)

    @property
    def blasts(self) -> Blasts:
        """The blasts of the first case."""
        return self.every[0]

    @property
    def engine(self) -> Engine:
        """The engine."""
        return self.blasts.engine

    @cached_property
    def grid_error(self) -> GridError | None:
        """Grid error, from the threat with the largest load; `None` without one."""
        found = (GridError.of(part) for part in self.every)
        return next((own for own in found if own is not None), None)

    @property
    def _has_one_case(self) -> bool:
        """Whether there is a single case, so that intervals are over its threats."""
        return len(self.every) == 1

    @cached_property
    def loads(self) -> FloatArray:
        """Loads on the protected structures in the unit of the objective (cases, threats)."""
        return np.array([part.loads(part.judged) for part in self.every])

    @cached_property
    def unprotected(self) -> FloatArray:
        """The same without a barrier (cases, threats)."""
        return np.array([part.loads(part.unprotected) for part in self.every])

    @property
    def in_range(self) -> bool:
        """Whether all blasts are in the checked or calibrated range."""
        sides = (part.records[name] for part in self.every for name in _sides(part))
        return all(record.loads.in_range for side in sides for record in side)

    @property
    def _is_mean(self) -> bool:
        """Whether the objective is the mean load over the charges, without a target."""
        return self.cases[0].is_mean and self.cases[0].scenario.objective.target is None

    @cached_property
    def case_reductions(self) -> FloatArray:
        """The reduction in each case (cases,)."""
        # Without a barrier nothing is bought, and no cost counts.
        unprotected = self._of_cases(self.unprotected, [()] * len(self.cases))
        return reductions(self._of_cases(self.loads, self.layouts), unprotected)

    @cached_property
    def reduction(self) -> Estimate:
        """The mean reduction with its 95 % interval."""
        # One case: its threats are the sample, as pairs with and without the barrier. Several
        # cases: each has one reduction, and the cases are the sample.
        if self._has_one_case and self._is_mean:
            return reduction_estimate(self.loads[0], self.unprotected[0])
        if self._has_one_case:
            return Estimate(float(self.case_reductions[0]), np.nan, np.nan)
        value, low, high = mean_estimate(self.case_reductions)
        return Estimate(value, low, min(high, 1.0))  # no reduction is above 1

    def difference(self, other: "Evaluation") -> Estimate:
        """Return the difference in mean reduction from another, with its paired interval.

        The other one has other layouts on the same cases.
        """
        if self._has_one_case and self._is_mean:
            # The reduction of the load without a barrier if it fell by the difference of loads.
            unprotected = self.unprotected[0]
            left = unprotected + self.loads[0] - other.loads[0]
            return reduction_estimate(left, unprotected)
        return mean_estimate(self.case_reductions - other.case_reductions)

    @property
    def mean(self) -> Estimate:
        """Mean load with the layout, in the unit of the objective."""
        return mean_estimate(self.loads[0])

    @property
    def unprotected_mean(self) -> Estimate:
        """Mean load without a barrier."""
        return mean_estimate(self.unprotected[0])

    @property
    def reduction_error(self) -> float:
        """Grid error of the reduction, as under the worst threat; NaN without one."""
        if self.grid_error is None:
            return np.nan
        # A number of one blast as the objective values it: the error of a mean is that of its worst
        # part.
        own = next(part for part in self.every if part.coarse is not None)

        def value_of(record: BlastRecord, layout: Layout = ()) -> float:
            return own.case.objective_value([own.objective_of(record)], layout)

        return self.grid_error.of_reduction(
            partial(value_of, layout=self.grid_error.layout), value_of
        )

    @property
    def objective_error(self) -> float:
        """Grid error of the objective of the first case, as `mean_error`."""

        def share(error: GridError) -> float:
            return error.of_load(
                lambda own: self.case.objective_value([self.blasts.objective_of(own)], self.layout)
            )

        return self._error(self.load, share)

    @property
    def mean_error(self) -> float:
        """Grid error of `mean`, the share as under the worst threat; NaN without one."""
        return self._error(self.mean.value, lambda error: error.of_load(self.blasts.objective_of))

    @property
    def unprotected_mean_error(self) -> float:
        """The same without a barrier."""
        mean = self.unprotected_mean.value
        return self._error(mean, lambda error: error.of_unprotected(self.blasts.objective_of))

    def _error(self, value: float, share: Callable[[GridError], float]) -> float:
        return np.nan if self.grid_error is None else share(self.grid_error) * value

    @property
    def cvar(self) -> float:
        """Mean load of the worst threats."""
        return conditional_value_at_risk(self.loads[0], self.cvar_level)

    @property
    def unprotected_cvar(self) -> float:
        """The same without a barrier."""
        return conditional_value_at_risk(self.unprotected[0], self.cvar_level)

    def _of_cases(self, loads: FloatArray, layouts: Sequence[Layout]) -> FloatArray:
        """Return the objective values of layouts in each case (cases,)."""
        rows = zip(self.cases, loads, layouts, strict=True)
        return np.array([case.objective_value(row, layout) for case, row, layout in rows])

    @property
    def case(self) -> LoadCaseSet:
        """The scenario and the threats."""
        return self.cases[0]

    @property
    def calibration(self) -> str:
        """Name of the calibration; `"none"` for gas dynamics."""
        found = self.engine.calibration(self.scenario)
        return "none" if found is None else found.name

    @property
    def layout(self) -> Layout:
        """The layout's cells."""
        return self.layouts[0]

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.case.scenario

    @property
    def threats(self) -> tuple[LoadCase, ...]:
        """The threats of the case."""
        return self.case.threats

    @cached_property
    def outcomes(self) -> tuple[ThreatOutcome, ...]:
        """The loads under each threat."""
        return tuple(ThreatOutcome.of(self.blasts, k) for k in range(len(self.threats)))

    @property
    def load(self) -> float:
        """The objective value over all threats with the barrier, in the objective's unit."""
        return self.case.objective_value(self.loads[0], self.layout)

    @property
    def unprotected_load(self) -> float:
        """The same without the barrier."""
        return self.case.objective_value(self.unprotected[0])

    @property
    def mean_reduction(self) -> float:
        """The value of `reduction`: 0 for an unchanged load, 1 for none."""
        return self.reduction.value

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % confidence interval of `mean_reduction`; NaN with a single threat."""
        return self.reduction.low, self.reduction.high

    @property
    def impulse_pa_s(self) -> Estimate:
        """Mean impulse with the barrier, Pa*s, for any objective."""
        return mean_estimate(self.blasts.values(self.blasts.judged, impulse_of))

    @property
    def unprotected_impulse_pa_s(self) -> Estimate:
        """Mean impulse without the barrier, Pa*s."""
        return mean_estimate(self.blasts.values(self.blasts.unprotected, impulse_of))

    @cached_property
    def worst(self) -> ThreatOutcome:
        """The threat that governs with the barrier; see `Blasts.worst`."""
        return self.outcomes[self.blasts.worst()]

    @cached_property
    def table(self) -> "pd.DataFrame":
        """One row per structure; see `STRUCTURE_COLUMNS`."""
        return self._by_name(lambda loads: loads.structures)

    @cached_property
    def building_table(self) -> "pd.DataFrame":
        """One row per building, with the columns of `table`.

        Impulses are means over the area of the protected parts, as in rewards; the peak is the
        largest of the parts.
        """
        return self._by_name(lambda loads: on_buildings(loads.structures))

    def _by_name(self, loads_of: Callable[[BlastLoads], Sequence[StructureLoad]]) -> "pd.DataFrame":
        """Return one row per load in the result of `loads_of` that the layout leaves."""

        def load_of(record: BlastRecord, name: str) -> StructureLoad:
            return next(load for load in loads_of(record.loads) if load.name == name)

        left = loads_of(self.blasts.records[self.blasts.judged][0].loads)
        rows = [
            _structure_row(self.blasts, partial(load_of, name=load.name), self.grid_error)
            for load in left
        ]
        return table_of(rows, STRUCTURE_COLUMNS)

    @cached_property
    def module_table(self) -> "pd.DataFrame":
        """One row per module of the structures that the layout leaves, in the scene's order.

        The columns are `module_id`, `structure`, `x_m`, `y_m`, the load on the module with the
        barrier and without (for particles `impulse_sim`, the sum of m |v|; for gas `impulse_n_s`,
        the momentum on its walls), and its `reduction`; NaN of an engine without loads on modules.
        """
        from blast_env.particles.objects import obstacle_of
        from blast_env.particles.tables import module_table

        # Means over the threats, module by module, in the order of the scene.
        threat = self.threats[0]
        scene = build_site(self.scenario, (), threat.seed, threat.charge)
        first = self.blasts.records[self.blasts.judged][0].loads
        name = "impulse_sim" if first.has_particles else "impulse_n_s"
        impulse, without = (
            np.mean(
                [getattr(record.loads, f"module_{name}") for record in self.blasts.records[side]],
                axis=0,
            )
            for side in _sides(self.blasts)
        )
        left = {structure.name for structure in self.scenario.structures_with(self.layout)}
        structures = [own for own in scene.structures if own.name in left]
        if not len(without):  # an engine without loads on modules
            impulse = without = np.full(sum(len(own.filled) for own in structures), np.nan)
        elif len(structures) < len(scene.structures):
            is_left = [own.name in left for own in scene.structures for _ in own.filled]
            without = without[is_left]
        values = {
            name: impulse,
            f"unprotected_{name}": without,
            "reduction": reductions(impulse, without),
        }
        names = ["module_id", "structure", "x_m", "y_m", *values]
        obstacles = [obstacle_of(structure) for structure in structures]
        return module_table(obstacles).assign(**values)[names]

    @cached_property
    def threat_table(self) -> "pd.DataFrame":
        """One row per threat; see `THREAT_COLUMNS`."""
        rows = [
            {"seed": outcome.threat.seed, **charge_values(outcome.charge), **vars(outcome)}
            | {"reduction": outcome.reduction}
            for outcome in self.outcomes
        ]
        return table_of(rows, THREAT_COLUMNS)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """The caveats of the engine, and the threats outside its checked or calibrated range."""
        charge = self.worst.threat.charge
        notes = [
            *self.engine.caveats(self.scenario),
            *self.engine.doubts(self.scenario, self.layout, charge),
        ]
        if self.scenario.objective.is_response:
            notes += (
                f"{name}: protected, but without a facade: its response counts as 0"
                for name in without_facade(self.scenario.structures)
            )
            notes += (
                f"{name}: no bay of its facade has a load: its response counts as 0"
                for name in self._without_bays
            )
        notes += self._outside
        own = (record.loads.structures for record in self.blasts.records[self.blasts.judged])
        for of_structure in zip(*own, strict=True):
            worst = max(of_structure, key=attrgetter("unloaded_m2"))
            if words := worst.unloaded_words:
                notes.append(f"{worst.name}: {words}")
        return tuple(notes)

    @property
    def _outside(self) -> Iterator[str]:
        """The structures with threats outside the range, with or without the barrier."""
        checked = self.engine.validated_range
        if self.engine.needs_calibration:
            checked = f"the range of calibration {self.calibration!r}"
        of_threats = [
            [{load.name: load for load in record.loads.structures} for record in pair]
            for pair in self.blasts.pairs(self.blasts.judged)
        ]
        for name in of_threats[0][0]:
            pairs = [(own[name], bare[name]) for own, bare in of_threats]
            outside = [pair for pair in pairs if not all(load.in_range for load in pair)]
            if outside:
                own, bare = (dict.fromkeys(load.notes) for load in outside[0])
                why = [*own, *(f"{_BARE}{note}" for note in bare if note not in own)]
                yield (
                    f"{name}: {len(outside)} of {len(self.threats)} threats are outside {checked}, "
                    f"e.g. {'; '.join(why)}"
                )

    @property
    def _without_bays(self) -> tuple[str, ...]:
        """The protected parts of buildings whose facade has no bay with a load behind the layout.

        A building that pieces hide has no load at all, and no response.
        """
        loads = self.blasts.records[self.blasts.judged][0].loads
        loaded = {bay.structure for bay in loads.bays}
        own = (part for part in self.scenario.structures if part.protected and part.facade)
        own = (part for part in own if part.building_name not in loads.without_load)
        return tuple(part.name for part in own if part.name not in loaded)

    def to_dict(self) -> dict[str, Any]:
        """Return the inputs, the versions, the results and the tables as plain data.

        The same arguments and versions give the same data; NaN becomes `None`.
        """
        objective, threats = self.scenario.objective, table_records(self.threat_table)
        return {
            "schema_version": SCHEMA_VERSION,
            "engine": self.engine.name,
            "versions": versions(self.engine.version),
            "result": {
                "reduction": estimate_record(self.reduction),
                "load": estimate_record(self.mean),
                "unprotected_load": estimate_record(self.unprotected_mean),
                "unit": objective.unit,
                "cvar_level": self.cvar_level,
                "cvar": number_or_none(self.cvar),
                "unprotected_cvar": number_or_none(self.unprotected_cvar),
                "grid_error": self._grid_error_record(),
                "in_range": self.in_range,
                "objective": {
                    **objective.model_dump(mode="json", exclude_none=True),
                    "load": number_or_none(self.load),
                    "unprotected_load": number_or_none(self.unprotected_load),
                },
                "impulse_pa_s": estimate_record(self.impulse_pa_s),
                "unprotected_impulse_pa_s": estimate_record(self.unprotected_impulse_pa_s),
                "worst": threats[self.outcomes.index(self.worst)],
            },
            "scenario": self.scenario.model_dump(mode="json", exclude_none=True),
            "scenario_hash": self.scenario.content_hash,
            "layout": [list(cell) for cell in self.layout],
            "calibration": self.calibration,
            "notes": list(self.notes),
            "threats": threats,
            "structures": table_records(self.table),
            "buildings": table_records(self.building_table),
            "modules": table_records(self.module_table),
        }

    def _grid_error_record(self) -> dict[str, Any] | None:
        """Return the grid errors as JSON-compatible data; `None` without any."""
        error = self.grid_error
        if error is None:
            return None
        return {
            "engine": self.engine.words,
            "coarser": error.coarser.words,
            "worst_seed": error.threat.seed,
            "reduction": number_or_none(self.reduction_error),
            "load": number_or_none(self.mean_error),
            "unprotected_load": number_or_none(self.unprotected_mean_error),
        }

    def to_json(self, path: str | Path) -> Path:
        """Write `to_dict` to a file, whole or not at all; return its path."""
        return write_text(path, json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n")


SCHEMA_VERSION: Final = 3
"""Version of the file written by `Evaluation.to_json`."""


def estimate_record(estimate: Estimate) -> dict[str, float | None]:
    """Return an estimate with its interval as JSON-compatible data."""
    value, low, high = map(number_or_none, estimate)
    return {"value": value, "ci95_low": low, "ci95_high": high}
