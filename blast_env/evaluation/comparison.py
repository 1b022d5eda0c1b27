"""Comparison of loads with and without a barrier on the same threats.

A reduction is NaN where the load without a barrier is 0. A comparison of layouts is refused for a
case in which no threat causes a load without a barrier (`check_something_arrives`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import LoadCaseSet, check_distinct
from blast_env.evaluation.engines.contract import BlastLoads, Engine
from blast_env.evaluation.evaluator import BlastEvaluator, Evaluators
from blast_env.evaluation.grid_error import GridError, grid_error
from blast_env.geometry import Element, Layout
from blast_env.layout import check_layout
from blast_env.provenance import versions
from blast_env.response.buildings import LevelOfProtection
from blast_env.runner import share_of
from blast_env.site import Scenario
from blast_env.site.scene import Charge
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


@dataclass(frozen=True)
class Assessment:
    """The loads on the protected structures with one layout.

    Each load is the mean over the realisations of a charge, combined over the charges by the risk
    measure.

    Attributes:
        impulse_pa_s: Weighted sum of the impulses per area of the protected buildings, Pa*s.
        impulse_sim: Weighted sum of the impulses of the protected structures, simulation units;
            `None` of an engine without particles.
        peak_pa: The largest overpressure on the walls of these structures, Pa; NaN for particles.
        load: The objective value: Pa s for impulses, Pa for peaks, dimensionless for both, for a
            response and with a target.
        in_range: Whether all the blasts are in the range of the calibration.
        level: The lowest level of protection under any threat; `None` unless the objective is a
            response.
    """

    impulse_pa_s: float
    impulse_sim: float | None
    peak_pa: float
    load: float
    in_range: bool
    level: LevelOfProtection | None = None

    @classmethod
    def of(cls, case: LoadCaseSet, layout: Sequence[Element], loads: Sequence[BlastLoads]) -> Self:
        """Return the assessment of a layout from its loads, one per threat of the case."""
        combined, counts = case.combined, case.scenario.objective
        sums = [s for each in loads if (s := each.protected_impulse_sim) is not None]
        return cls(
            impulse_pa_s=combined([each.protected_impulse_pa_s for each in loads]),
            impulse_sim=combined(sums) if len(sums) == len(loads) else None,
            peak_pa=combined([each.protected_peak_pa for each in loads]),
            load=case.objective_value([each.load(counts) for each in loads], layout),
            level=min(each.level for each in loads) if counts.kind == "response" else None,
            in_range=all(each.in_range for each in loads),
        )

    @property
    def impulse_psi_s(self) -> float:
        """The impulse in the paper's unit, psi*s."""
        return self.impulse_pa_s / PA_PER_PSI

    def reduction_from(self, unprotected: "Assessment") -> float:
        """Return the relative reduction of `load` from no barrier; NaN if that load is 0."""
        return reductions(self.load, unprotected.load).item()


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Layouts, one per case, compared with no barrier on the same threats.

    The reduction of a case is 1 - load with the barrier / load without it, each combined over the
    threats by the risk measure of the case. Several cases have equal weights, and intervals are
    those of the mean over cases. With a single case they are over its threats, and there is none
    if its risk measure is not the mean, or its objective has a target. Intervals are 95 %
    confidence intervals; they do not include the error of the model.

    Attributes:
        cases: The cases, all with the same number of threats.
        layouts: One per case.
        loads: Loads on the protected structures with the layouts, in the unit of the objective
            (cases, threats); see `BlastLoads.load`.
        unprotected: The same without a barrier (cases, threats).
        within: Whether each blast is in the range of the calibration (cases, threats).
        cvar_level: Level of `cvar`: 0.8 is the mean of the worst 20 %.
        grid_error: Error of the cells, from the threat with the largest load behind a layout;
            `None` without one.

    Raises:
        BlastEnvError: If no load reaches the protected structures of a case without a barrier.
    """

    cases: tuple[LoadCaseSet, ...]
    layouts: tuple[Layout, ...]
    loads: FloatArray
    unprotected: FloatArray
    within: BoolArray
    cvar_level: float = CVAR_LEVEL
    grid_error: GridError | None = None

    def __post_init__(self) -> None:
        check_cvar_level(self.cvar_level)
        check_something_arrives(self.cases, self.unprotected)

    @property
    def has_one_case(self) -> bool:
        """Whether there is a single case, so that intervals and the worst are over its threats."""
        return len(self.cases) == 1

    @property
    def in_range(self) -> bool:
        """Whether all blasts are in the range of the calibration."""
        return bool(self.within.all())

    @property
    def _is_mean(self) -> bool:
        """Whether the objective is the mean load over the charges, without a target."""
        return self.cases[0].is_mean and self.cases[0].scenario.objective.target is None

    @cached_property
    def case_reductions(self) -> FloatArray:
        """The reduction in each case (cases,)."""
        unprotected = self._of_cases(self.unprotected, [()] * len(self.cases))
        return reductions(self._of_cases(self.loads, self.layouts), unprotected)

    @cached_property
    def reduction(self) -> Estimate:
        """The mean reduction with its 95 % interval."""
        if self.has_one_case and self._is_mean:
            return reduction_estimate(self.loads[0], self.unprotected[0])
        if self.has_one_case:
            return Estimate(float(self.case_reductions[0]), np.nan, np.nan)
        value, low, high = mean_estimate(self.case_reductions)
        return Estimate(value, low, min(high, 1.0))  # no reduction is above 1

    def difference(self, other: "Evaluation") -> Estimate:
        """Return the difference in mean reduction from another, with its paired interval.

        Args:
            other: Other layouts on the same cases.
        """
        if self.has_one_case and self._is_mean:
            # The reduction of the load without a barrier if it fell by the difference of loads.
            unprotected = self.unprotected[0]
            left = unprotected + self.loads[0] - other.loads[0]
            return reduction_estimate(left, unprotected)
        return mean_estimate(self.case_reductions - other.case_reductions)

    @property
    def mean(self) -> Estimate:
        """Mean load with the layouts, in the unit of the objective."""
        return mean_estimate(self._samples(self.loads))

    @property
    def unprotected_mean(self) -> Estimate:
        """Mean load without a barrier, over the same samples."""
        return mean_estimate(self._samples(self.unprotected))

    @property
    def reduction_error(self) -> float:
        """Error of the cells of the reduction, as under the worst threat; NaN without one."""
        return np.nan if self.grid_error is None else self.grid_error.reduction

    @property
    def objective_error(self) -> float:
        """Error of the cells of the objective of the first case, as `mean_error`."""
        error, case = self.grid_error, self.cases[0]
        if error is None:
            return np.nan
        share = error.of_load(
            lambda each: case.objective_value([error.objective(each)], self.layouts[0])
        )
        return share * case.objective_value(self.loads[0], self.layouts[0])

    @property
    def mean_error(self) -> float:
        """Error of the cells of `mean`, the share as under the worst threat; NaN without one."""
        error = self.grid_error
        return np.nan if error is None else self.mean.value * error.of_load(error.objective)

    @property
    def unprotected_mean_error(self) -> float:
        """The same without a barrier."""
        error = self.grid_error
        if error is None:
            return np.nan
        return self.unprotected_mean.value * error.of_unprotected(error.objective)

    @property
    def cvar(self) -> float:
        """Mean load of the worst cases (of the worst threats of a single case)."""
        return conditional_value_at_risk(self._samples(self.loads), self.cvar_level)

    @property
    def unprotected_cvar(self) -> float:
        """The same without a barrier."""
        return conditional_value_at_risk(self._samples(self.unprotected), self.cvar_level)

    def _samples(self, loads: FloatArray) -> FloatArray:
        """Return the samples of means and tails: the cases, or the threats of a single one."""
        combined = [case.combined(row) for case, row in zip(self.cases, loads, strict=True)]
        samples: FloatArray = loads[0] if self.has_one_case else np.array(combined)
        return samples

    def _of_cases(self, loads: FloatArray, layouts: Sequence[Layout]) -> FloatArray:
        """Return the objective values of layouts in each case (cases,)."""
        rows = zip(self.cases, loads, layouts, strict=True)
        return np.array([case.objective_value(row, layout) for case, row, layout in rows])


def compare(
    evaluators: Evaluators,
    cases: Sequence[LoadCaseSet],
    layouts: Sequence[Sequence[Element]],
    processes: int = 1,
    *,
    coarser: Evaluators | None = None,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Compare layouts with no barrier, each on the threats of its case.

    Args:
        evaluators: Run and cache the blasts.
        cases: At least one, all with the same number of threats.
        layouts: One per case: (row, column) of the cells that hold a module, in any order.
        processes: Number of worker processes; it changes only the time.
        coarser: `evaluators.coarser()`, for the error of the cells; there is none without it.
        cvar_level: The CVaR is the mean of the worst share 1 - `cvar_level`.
        progress: Called with the finished share of the blasts.

    Raises:
        LayoutError: If a layout does not fit the build zone of its case.
        CalibrationError: If a scenario names no calibration, or one that was made with other
            parameters or another engine.
        BlastEnvError: If there are no cases, a threat is repeated, `processes` or `cvar_level` is
            out of bounds, or no load arrives in a case even without a barrier.
    """
    check_cvar_level(cvar_level)
    if not cases:
        raise BlastEnvError("cases: there are none, must be at least one")
    cells = [
        tuple(check_layout(case.scenario, layout))
        for case, layout in zip(cases, layouts, strict=True)
    ]
    blasts = list(loads_of_both(evaluators.of, cases, cells, processes, progress))
    loads = _counted(cases, [protected for protected, _ in blasts])
    error = None
    if coarser is not None:
        number, worst = (int(each) for each in np.unravel_index(loads.argmax(), loads.shape))
        case, (protected, unprotected) = cases[number], blasts[number]
        fine = protected[worst], unprotected[worst]
        threat, there = case.threats[worst], coarser.of(case.scenario)
        error = grid_error(there, case, cells[number], threat, fine, processes)
    return Evaluation(
        cases=tuple(cases),
        layouts=tuple(cells),
        loads=loads,
        unprotected=_counted(cases, [unprotected for _, unprotected in blasts]),
        within=np.array([[load.in_range for load in protected] for protected, _ in blasts]),
        cvar_level=cvar_level,
        grid_error=error,
    )


def check_something_arrives(cases: Sequence[LoadCaseSet], unprotected: FloatArray) -> None:
    """Refuse a case in which there is nothing to reduce.

    Args:
        cases: The cases.
        unprotected: Load on the protected structures without a barrier (cases, threats).

    Raises:
        BlastEnvError: If it is 0 under every threat of a case, which the message names.
    """
    for case, mean in zip(cases, np.atleast_2d(unprotected).mean(axis=1), strict=True):
        if not mean > 0.0:
            raise BlastEnvError(
                f"{case.name or case.scenario.name}: nothing arrives at the protected structures "
                f"without a barrier ({len(case.threats)} threats): there is nothing to reduce"
            )


def loads_of_both(
    evaluator_of: Callable[[Scenario], BlastEvaluator],
    cases: Sequence[LoadCaseSet],
    layouts: Sequence[Layout],
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[tuple[BlastLoads, ...], tuple[BlastLoads, ...]]]:
    """Yield the loads with the layout of each case and those without a barrier, one per threat.

    Consecutive cases on one scenario run together.

    Raises:
        BlastEnvError: If a threat is repeated, or `processes` is below 1.
    """
    done = 0
    for _, group in groupby(zip(cases, layouts, strict=True), lambda each: id(each[0].scenario)):
        together = list(group)
        for case, _ in together:
            check_distinct(case.threats)
        pairs = [
            (cells, threat)
            for case, layout in together
            for threat in case.threats
            for cells in (layout, ())
        ]
        known_charge = share_of(progress, done, len(cases), len(together))
        evaluator = evaluator_of(together[0][0].scenario)
        loads = iter(evaluator.loads_of_many(pairs, processes, known_charge))
        for case, _ in together:
            own = list(islice(loads, 2 * len(case.threats)))
            yield tuple(own[0::2]), tuple(own[1::2])
        done += len(together)


def _counted(cases: Sequence[LoadCaseSet], loads: Sequence[Sequence[BlastLoads]]) -> FloatArray:
    return np.array(
        [
            [each.load(case.scenario.objective) for each in of_case]
            for case, of_case in zip(cases, loads, strict=True)
        ]
    )


CHARGE_COLUMNS: Final = (
    Column("charge_x_m", "m", "centre of the charge, from the left border"),
    Column("charge_y_m", "m", "centre of the charge, from the lower border"),
    Column("charge_height_m", "m", "height of its centre; 0: it lies on the ground"),
    Column("tnt_kg", "kg", "TNT-equivalent mass of the charge"),
)

CASE_COLUMNS: Final = (
    Column("scenario", "", "name of the scenario"),
    Column("seed", "", "seed of the first threat's fan and air; the charge is that threat's"),
    *CHARGE_COLUMNS,
    Column("modules", "", "modules, or pieces, of the layout"),
    Column("load", "", "protected structures, with the layout, over the threats"),
    Column("unprotected_load", "", "the same without a barrier"),
    Column("unit", "", "of that load; empty where impulse and peak count together"),
    Column("reduction", "", "of that load"),
    Column("in_range", "", "whether the calibration was made for every threat"),
)


def charge_values(charge: Charge) -> dict[str, object]:
    """Return the values of `CHARGE_COLUMNS`."""
    values = (*charge.position_m, charge.height_m, charge.tnt_kg)
    return {column.name: value for column, value in zip(CHARGE_COLUMNS, values, strict=True)}


def case_table(comparison: Evaluation) -> "pd.DataFrame":
    """Return one row per case; see `CASE_COLUMNS`."""
    rows = []
    for index, (case, layout) in enumerate(zip(comparison.cases, comparison.layouts, strict=True)):
        threat = case.threats[0]
        rows.append(
            {
                "scenario": case.scenario.name,
                "seed": threat.seed,
                **charge_values(threat.charge_against(case.scenario, layout)),
                "modules": len(layout),
                "load": case.objective_value(comparison.loads[index], layout),
                "unprotected_load": case.objective_value(comparison.unprotected[index]),
                "unit": case.scenario.objective.unit,
                "reduction": float(comparison.case_reductions[index]),
                "in_range": bool(comparison.within[index].all()),
            }
        )
    return table_of(rows, CASE_COLUMNS)


def comparison_record(comparison: Evaluation, engine: Engine) -> dict[str, Any]:
    """Return a comparison as JSON-compatible data; NaN becomes `None`."""
    cases = [
        {
            **row,
            "scenario_hash": case.scenario.content_hash,
            "calibration": case.scenario.calibration,
            "layout": [list(cell) for cell in layout],
        }
        for row, case, layout in zip(
            table_records(case_table(comparison)), comparison.cases, comparison.layouts, strict=True
        )
    ]
    return {
        "engine": engine.name,
        "versions": versions(engine.version),
        "result": {
            "grid_error": grid_error_record(comparison, engine),
            "reduction": estimate_record(comparison.reduction),
            "load": estimate_record(comparison.mean),
            "unprotected_load": estimate_record(comparison.unprotected_mean),
            "unit": comparison.cases[0].scenario.objective.unit,
            "cvar_level": comparison.cvar_level,
            "cvar": comparison.cvar,
            "unprotected_cvar": comparison.unprotected_cvar,
        },
        "cases": cases,
    }


def grid_error_record(comparison: Evaluation, engine: Engine) -> dict[str, Any] | None:
    """Return the errors of the cells as JSON-compatible data; `None` without any."""
    error = comparison.grid_error
    if error is None:
        return None
    return {
        "engine": engine.words,
        "coarser": error.coarser.words,
        "worst_seed": error.threat.seed,
        "reduction": number_or_none(comparison.reduction_error),
        "load": number_or_none(comparison.mean_error),
        "unprotected_load": number_or_none(comparison.unprotected_mean_error),
    }


def estimate_record(estimate: Estimate) -> dict[str, float | None]:
    """Return an estimate with its interval as JSON-compatible data."""
    value, low, high = map(number_or_none, estimate)
    return {"value": value, "ci95_low": low, "ci95_high": high}
