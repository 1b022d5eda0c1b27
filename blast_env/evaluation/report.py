"""Full comparison of a layout with no barrier by structure, module and threat."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, draw_threats, in_turn
from blast_env.evaluation.comparison import (
    CHARGE_COLUMNS,
    Evaluation,
    charge_values,
    estimate_record,
    grid_error_record,
    loads_of_both,
)
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.engines.contract import (
    SIM_NAMES,
    BlastLoads,
    ParticleLoad,
    StructureLoad,
    on_buildings,
)
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.grid_error import GridError, LoadOf, final_engine, grid_error
from blast_env.evaluation.standing import STANDING_COLUMNS, worst_standing
from blast_env.evaluation.store import BlastStore
from blast_env.files import write_atomically
from blast_env.geometry import Element, Layout
from blast_env.layout import check_layout
from blast_env.layout.build_scene import build_site
from blast_env.provenance import versions
from blast_env.site import AnyScenario, Scenario, find_scenario
from blast_env.site.scene import Charge
from blast_env.site.worst_places import stand_off_m
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
from blast_env.units import PA_PER_PSI

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

STRUCTURE_COLUMNS: Final = (
    Column("structure", "", "name of the structure"),
    Column("protected", "", "whether its load counts"),
    Column("weight", "", "its weight among the protected structures"),
    Column("impulse_pa_s", "Pa s", "calibrated impulse per area with the barrier"),
    Column("unprotected_impulse_pa_s", "Pa s", "calibrated impulse per area without it"),
    Column("reduction", "", "of the calibrated impulse"),
    Column("reduction_low", "", "lower end of its 95 % confidence interval"),
    Column("reduction_high", "", "upper end of its 95 % confidence interval"),
    Column("reduction_error", "", "error of the cells of the reduction; particles have none"),
    Column("impulse_error_pa_s", "Pa s", "error of the cells of the impulse with the barrier"),
    Column("unprotected_impulse_error_pa_s", "Pa s", "the same without it"),
    Column("impulse_psi_s", "psi s", "calibrated impulse per area with the barrier"),
    Column("unprotected_impulse_psi_s", "psi s", "calibrated impulse per area without it"),
    Column("impulse_sim", "sim", "sum of m |v| with the barrier"),
    Column("unprotected_impulse_sim", "sim", "sum of m |v| without it"),
    Column("transferred_impulse_sim", "sim", "momentum really transferred with the barrier"),
    Column("unprotected_transferred_impulse_sim", "sim", "momentum transferred without it"),
    Column(
        "peak_pa", "Pa", "largest overpressure on its walls with the barrier, mean over threats"
    ),
    Column("unprotected_peak_pa", "Pa", "the same without it; particles have none"),
    Column("threats_in_range", "", "threats that the calibration was made for"),
    *STANDING_COLUMNS,
)

_OF_PARTICLES: Final = (*SIM_NAMES, *(f"unprotected_{name}" for name in SIM_NAMES))
"""Columns that only particle engines have."""


def module_columns(has_particles: bool) -> tuple[Column, ...]:
    """Return the columns of `LayoutEvaluation.module_table`, which end with loads and reduction."""
    unit, words = ("sim", "sum of m |v|") if has_particles else ("n_s", "momentum on its walls")
    shown = "sim" if has_particles else "N s"
    return (
        Column("module_id", "", "name of the module, made from its centre in metres"),
        Column("structure", "", "structure that the module is part of"),
        Column("x_m", "m", "centre, from the left border"),
        Column("y_m", "m", "centre, from the lower border"),
        Column(f"impulse_{unit}", shown, f"{words} with the barrier"),
        Column(f"unprotected_impulse_{unit}", shown, f"{words} without it"),
        Column("reduction", "", f"of the {words}"),
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
    Column("in_range", "", "whether the calibration was made for this threat"),
    Column("stand_off_m", "m", "from the charge to the nearest protected wall, with the barrier"),
    Column("unprotected_stand_off_m", "m", "the same without it: less only for a vehicle"),
)


def _structure_row(
    loads: Sequence[StructureLoad],
    without: Sequence[StructureLoad],
    error: GridError | None,
    impulse_of: LoadOf,
) -> dict[str, object]:
    first = loads[0]
    pa_s, bare_pa_s = (np.array([load.impulse_pa_s for load in each]) for each in (loads, without))
    reduction = reduction_estimate(pa_s, bare_pa_s)
    stood = worst_standing(load.stood for load in loads)
    row: dict[str, object] = {
        "structure": first.name,
        "protected": first.protected,
        "weight": first.weight,
        "reduction": reduction.value,
        "reduction_low": reduction.low,
        "reduction_high": reduction.high,
        "threats_in_range": sum(load.in_range for load in loads),
        "standing": stood.standing.label,
        "reason": stood.reason,
    }
    sums = SIM_NAMES if isinstance(first, ParticleLoad) else ()
    for name in ("impulse_pa_s", *sums):
        for column, each in ((name, loads), (f"unprotected_{name}", without)):
            row[column] = float(np.mean([getattr(load, name) for load in each]))
    off, walled_off, bare_off = np.nan, np.nan, np.nan
    if error is not None:
        off = error.of_reduction(impulse_of)
        walled_off, bare_off = error.of_load(impulse_of), error.of_unprotected(impulse_of)
    row["reduction_error"] = off
    row["impulse_error_pa_s"] = walled_off * float(pa_s.mean())
    row["unprotected_impulse_error_pa_s"] = bare_off * float(bare_pa_s.mean())
    row["impulse_psi_s"] = float(pa_s.mean()) / PA_PER_PSI
    row["unprotected_impulse_psi_s"] = float(bare_pa_s.mean()) / PA_PER_PSI
    for column, each in (("peak_pa", loads), ("unprotected_peak_pa", without)):
        peaks = [np.nan if load.peak_pa is None else load.peak_pa for load in each]
        row[column] = float(np.mean(peaks))
    return row


SCHEMA_VERSION: Final = 1
"""Version of the file written by `LayoutEvaluation.to_json`."""


def _result(evaluation: "LayoutEvaluation") -> dict[str, Any]:
    return {
        "reduction": estimate_record(evaluation.reduction),
        "impulse_pa_s": estimate_record(evaluation.impulse_pa_s),
        "impulse_psi_s": estimate_record(evaluation.impulse_pa_s.scaled(1.0 / PA_PER_PSI)),
        "unprotected_impulse_pa_s": estimate_record(evaluation.unprotected_impulse_pa_s),
        "unprotected_impulse_psi_s": estimate_record(
            evaluation.unprotected_impulse_pa_s.scaled(1.0 / PA_PER_PSI)
        ),
        "cvar_level": evaluation.cvar_level,
        "cvar_pa_s": evaluation.cvar_pa_s,
        "cvar_psi_s": evaluation.cvar_pa_s / PA_PER_PSI,
        "unprotected_cvar_pa_s": evaluation.unprotected_cvar_pa_s,
        "unprotected_cvar_psi_s": evaluation.unprotected_cvar_pa_s / PA_PER_PSI,
        "objective": {
            **evaluation.scenario.objective.model_dump(mode="json", exclude_none=True),
            "unit": evaluation.scenario.objective.unit,
            "load": evaluation.load,
            "unprotected_load": evaluation.unprotected_load,
        },
        "worst": _worst(evaluation.worst),
        "grid_error": grid_error_record(evaluation, evaluation.engine),
        "in_range": evaluation.in_range,
    }


def _worst(outcome: "ThreatOutcome") -> dict[str, Any]:
    return {
        "seed": outcome.threat.seed,
        "charge_position_m": list(outcome.charge.position_m),
        "charge_height_m": outcome.charge.height_m,
        "tnt_kg": outcome.charge.tnt_kg,
        "impulse_pa_s": outcome.impulse_pa_s,
        "unprotected_impulse_pa_s": outcome.unprotected_impulse_pa_s,
        "load": outcome.load,
        "unprotected_load": outcome.unprotected_load,
        "reduction": number_or_none(outcome.reduction),
        "in_range": outcome.in_range,
    }


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
        in_range: Whether the threat is in the range of the calibration.
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
    def of(
        cls,
        scenario: AnyScenario,
        layout: Layout,
        threat: LoadCase,
        loads: BlastLoads,
        unprotected: BlastLoads,
    ) -> Self:
        """Return the outcome of a threat from its loads with a layout and without a barrier."""
        scenario = find_scenario(scenario)
        charge, elsewhere = (threat.charge_against(scenario, each) for each in (layout, ()))
        return cls(
            threat=threat,
            charge=charge,
            stand_off_m=stand_off_m(scenario.structures, charge.position_m),
            unprotected_stand_off_m=stand_off_m(scenario.structures, elsewhere.position_m),
            impulse_pa_s=loads.protected_impulse_pa_s,
            unprotected_impulse_pa_s=unprotected.protected_impulse_pa_s,
            peak_pa=loads.protected_peak_pa,
            unprotected_peak_pa=unprotected.protected_peak_pa,
            load=loads.load(scenario.objective),
            unprotected_load=unprotected.load(scenario.objective),
            in_range=loads.in_range,
        )

    @property
    def reduction(self) -> float:
        """Relative reduction of the load; NaN if the load without a barrier is 0."""
        return reductions(self.load, self.unprotected_load).item()


@dataclass(frozen=True, eq=False, kw_only=True)
class LayoutEvaluation(Evaluation):
    """A layout compared with no barrier on the threats of one case, with all loads.

    Impulses are those of `BlastLoads.protected_impulse_pa_s`, weighted sums of impulses per area of
    the protected buildings. Reductions are of the load in the scenario's objective, by default
    that impulse. Intervals are 95 % confidence intervals of the mean over all threats of the
    scenario; they do not include the error of the model.

    Attributes:
        blasts: Loads with the layout, whose cells are sorted, one per threat.
        unprotected_blasts: Loads without any barrier, one per threat.
        calibration: Name of the calibration; `"none"` for gas dynamics.
        engine: The engine.

    Raises:
        BlastEnvError: If no load reaches the protected structures without a barrier.
    """

    blasts: tuple[BlastLoads, ...]
    unprotected_blasts: tuple[BlastLoads, ...]
    calibration: str
    engine: Engine

    @property
    def case(self) -> LoadCaseSet:
        """The scenario and the threats."""
        return self.cases[0]

    @property
    def layout(self) -> Layout:
        """The layout's cells, sorted."""
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
        of = partial(ThreatOutcome.of, self.scenario, self.layout)
        return tuple(map(of, self.threats, self.blasts, self.unprotected_blasts))

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
        return mean_estimate(_impulses_pa_s(self.blasts))

    @property
    def unprotected_impulse_pa_s(self) -> Estimate:
        """Mean impulse without the barrier, Pa*s."""
        return mean_estimate(_impulses_pa_s(self.unprotected_blasts))

    @cached_property
    def worst(self) -> ThreatOutcome:
        """The threat with the largest load behind the barrier."""
        return max(self.outcomes, key=lambda outcome: outcome.load)

    @property
    def cvar_pa_s(self) -> float:
        """Mean impulse of the worst threats with the barrier, Pa*s; see `cvar_level`."""
        return conditional_value_at_risk(_impulses_pa_s(self.blasts), self.cvar_level)

    @property
    def unprotected_cvar_pa_s(self) -> float:
        """Mean impulse of the worst threats without the barrier, Pa*s."""
        return conditional_value_at_risk(_impulses_pa_s(self.unprotected_blasts), self.cvar_level)

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
        """Return one row per load in the result of `loads_of`."""
        loads, without = (
            zip(*map(loads_of, blasts), strict=True)
            for blasts in (self.blasts, self.unprotected_blasts)
        )

        def impulse_of(blast: BlastLoads, number: int) -> float:
            return loads_of(blast)[number].impulse_pa_s

        rows = [
            _structure_row(*both, self.grid_error, partial(impulse_of, number=number))
            for number, both in enumerate(zip(loads, without, strict=True))
        ]
        absent = () if self.blasts[0].has_particles else _OF_PARTICLES
        return table_of(rows, [each for each in STRUCTURE_COLUMNS if each.name not in absent])

    @cached_property
    def module_table(self) -> "pd.DataFrame":
        """One row per module of the structures, in the scene's order; see `module_columns`."""
        from blast_env.particles.tables import module_table

        threat = self.threats[0]
        scene = build_site(self.scenario, (), threat.seed, threat.charge)
        impulse, without = (
            np.mean([load.module_impulse for load in loads], axis=0)
            for loads in (self.blasts, self.unprotected_blasts)
        )
        names = [column.name for column in module_columns(self.blasts[0].has_particles)]
        values = dict(
            zip(names[-3:], (impulse, without, reductions(impulse, without)), strict=True)
        )
        return module_table(scene.obstacles()).assign(**values)[names]

    @cached_property
    def threat_table(self) -> "pd.DataFrame":
        """One row per threat; see `THREAT_COLUMNS`."""
        rows = [
            {"seed": each.threat.seed, **charge_values(each.charge), **vars(each)}
            | {"reduction": each.reduction}
            for each in self.outcomes
        ]
        return table_of(rows, THREAT_COLUMNS)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """The caveats of the engine, and the threats outside its checked or calibrated range."""
        notes = [self.engine.caveat] if self.engine.caveat else []
        notes += [] if self.engine.knows_heights else self.scenario.height_notes
        checked = self.engine.validated_range
        if self.engine.needs_calibration:
            checked = f"the range of calibration {self.calibration!r}"
        for of_structure in zip(*(load.structures for load in self.blasts), strict=True):
            outside = [load for load in of_structure if not load.in_range]
            if outside:
                notes.append(
                    f"{outside[0].name}: {len(outside)} of {len(self.threats)} threats are outside "
                    f"{checked}, e.g. {'; '.join(outside[0].notes)}"
                )
        return tuple(notes)

    def to_dict(self) -> dict[str, Any]:
        """Return the inputs, the versions and the results as plain data.

        The same arguments and versions give the same data; NaN becomes `None`.
        """
        scenario = self.scenario
        return {
            "schema_version": SCHEMA_VERSION,
            "scenario": scenario.model_dump(mode="json", exclude_none=True),
            "scenario_hash": scenario.content_hash,
            "layout": [list(cell) for cell in self.layout],
            "engine": self.engine.name,
            "calibration": self.calibration,
            "versions": versions(self.engine.version),
            "result": _result(self),
            "notes": list(self.notes),
            "threats": table_records(self.threat_table),
            "structures": table_records(self.table),
            "buildings": table_records(self.building_table),
            "modules": table_records(self.module_table),
        }

    def to_json(self, path: str | Path) -> Path:
        """Write `to_dict` to a file.

        Returns:
            The path.

        Raises:
            BlastEnvError: If it cannot be written there; nothing is left behind then.
        """
        text = json.dumps(self.to_dict(), indent=2, allow_nan=False)
        with write_atomically(path) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
        return Path(path)


def _impulses_pa_s(loads: Sequence[BlastLoads]) -> FloatArray:
    return np.array([load.protected_impulse_pa_s for load in loads])


def evaluate_layout(
    scenario: AnyScenario,
    layout: Sequence[Element],
    seeds: Iterable[int] = range(16),
    processes: int = 1,
    engine: str | Engine = JUDGE,
    *,
    threats: Iterable[LoadCase] | None = None,
    cvar_level: float = CVAR_LEVEL,
    cache: str | Path | BlastStore | None = None,
    progress: Callable[[float], None] | None = None,
    cell_m: float | None = None,
    cells: str | None = None,
) -> LayoutEvaluation:
    """Estimate the load reduction of a layout on the protected structures, with its uncertainty.

    Every seed draws a threat from the scenario; fixed charges come in turn, each once before any
    repeats. The layout and the empty site are under the same threats. Use seeds other than those of
    the layout's search, on which it is overrated.

    Args:
        scenario: The scenario, or its bundled name or path; for the particle engines it must name
            a calibration.
        layout: (row, column) of the build-zone cells that hold a barrier module, in any order.
        seeds: At least one, without repetition; 16 or more for a useful interval.
        processes: Number of worker processes; it changes only the time.
        engine: Name of an engine, or an engine, which keeps its cells; gas dynamics by default.
            There, a seed only draws the charge, a charge has one realisation, and no calibration
            is needed. The worst threat runs on cells twice as large as well, for their error.
        threats: Used instead of threats drawn with `seeds`.
        cvar_level: The CVaR is the mean of the worst share 1 - `cvar_level` of the threats.
        cache: Folder or store of earlier blasts; see `BlastEvaluator`.
        progress: Called with the finished share of the blasts.
        cell_m: Side of the cells of gas dynamics, 0.25 m unless given.
        cells: Growth of these cells with the blast; see `GasSettings`. On sites wider than 40 m
            they grow from 0.25 m unless one of the two is given.

    Raises:
        LayoutError: If the layout does not fit the build zone.
        CalibrationError: If the scenario names no calibration, or one that was made with other
            parameters or another engine.
        UnknownNameError: If there is no such engine.
        ScenarioError: If a threat's charge is not clear of a structure or the border.
        BlastEnvError: If there are no seeds or threats, one is repeated or a seed is negative, if
            `processes` or `cvar_level` is out of bounds, or if no load reaches the protected
            structures even without a barrier.
    """
    found = find_scenario(scenario)
    judge = final_engine(engine, [found], cell_m, cells=cells)
    evaluator = BlastEvaluator(found, judge, cache=cache)
    drawn = in_turn(found, draw_threats(found, seeds)) if threats is None else tuple(threats)
    return evaluate_against(
        evaluator,
        layout,
        drawn,
        processes,
        coarser=evaluator.coarser(),
        cvar_level=cvar_level,
        progress=progress,
    )


def evaluate_against(
    evaluator: BlastEvaluator,
    layout: Sequence[Element],
    threats: Sequence[LoadCase],
    processes: int = 1,
    *,
    coarser: BlastEvaluator | None = None,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] | None = None,
) -> LayoutEvaluation:
    """Evaluate a layout as in `evaluate_layout`, with the cached blasts of an evaluator.

    For several layouts on the same threats, the empty site is simulated only once.

    Args:
        evaluator: Runs and caches the blasts.
        layout: Same as for `evaluate_layout`.
        threats: At least one, without repetition.
        processes: Same as for `evaluate_layout`.
        coarser: `evaluator.coarser()`, for the error of the cells; there is none without it.
        cvar_level: Same as for `evaluate_layout`.
        progress: Same as for `evaluate_layout`.

    Raises:
        BlastEnvError: Same as for `evaluate_layout`.
    """
    check_cvar_level(cvar_level)
    scenario = evaluator.scenario
    cells = tuple(sorted(check_layout(scenario, layout)))
    case = LoadCaseSet(scenario, tuple(threats))
    ((loads, unprotected),) = loads_of_both(
        lambda _: evaluator, [case], [cells], processes, progress
    )
    counts = scenario.objective
    evaluation = LayoutEvaluation(
        cases=(case,),
        layouts=(cells,),
        loads=np.array([[load.load(counts) for load in loads]]),
        unprotected=np.array([[load.load(counts) for load in unprotected]]),
        within=np.array([[load.in_range for load in loads]]),
        cvar_level=cvar_level,
        blasts=loads,
        unprotected_blasts=unprotected,
        calibration=evaluator.calibration_name,
        engine=evaluator.engine,
    )
    worst = evaluation.outcomes.index(evaluation.worst)
    fine = loads[worst], unprotected[worst]
    error = grid_error(coarser, case, cells, threats[worst], fine, processes)
    return replace(evaluation, grid_error=error)
