"""The one comparison: what the blast does with a barrier and without it, on the same threats.

One rule for nothing: where nothing arrives without a barrier there is no reduction (NaN), and a
comparison that is to say how good layouts are is refused for a case in which nothing arrives at all
(`check_something_arrives`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.engines.contract import BlastLoads, Engine
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import Case, check_distinct
from blast_env.evaluation.evaluator import BlastEvaluator, Evaluators
from blast_env.geometry import Element, Layout
from blast_env.physics.scene import Charge
from blast_env.provenance import versions
from blast_env.response.buildings import LevelOfProtection
from blast_env.runner import share_of
from blast_env.scenario import check_layout
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
    """The load on the protected structures with one layout.

    Each is the mean over the realisations of a charge, then by the risk measure over the charges.

    Attributes:
        impulse_pa_s: Impulses per area of the protected structures, by weight, added up, Pa*s.
        impulse_sim: The same in simulation units.
        peak_pa: The largest overpressure on their walls, Pa; NaN for particles.
        load: What the scenario's objective counts, in its unit: Pa s for impulses, Pa for peaks,
            without a unit for both.
        in_range: Whether the calibration was made for every one of the blasts.
        level: Where the response of facades counts: the level of protection under every charge.
    """

    impulse_pa_s: float
    impulse_sim: float
    peak_pa: float
    load: float
    in_range: bool
    level: LevelOfProtection | None = None

    @property
    def impulse_psi_s(self) -> float:
        """The impulse in the paper's unit, psi*s."""
        return self.impulse_pa_s / PA_PER_PSI

    def reduction_from(self, unprotected: "Assessment") -> float:
        """Return by which share what counts is below that without a barrier; NaN if that is 0."""
        return reductions(self.load, unprotected.load).item()


@dataclass(frozen=True, eq=False)
class Objective:
    """What layouts are worth on a case, each worked out once.

    Attributes:
        evaluator: Runs the blasts and remembers them; it has the scenario.
        case: The threats, and how they become one number.
    """

    evaluator: BlastEvaluator
    case: Case
    _assessed: dict[Layout, Assessment] = field(default_factory=dict, init=False)

    def assess(self, layout: Sequence[Element]) -> Assessment:
        """Return what a layout is worth; a blast for each threat, unless known.

        Args:
            layout: (row, column) of the cells that hold a module, in any order.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        key = tuple(sorted(layout))
        if key not in self._assessed:
            loads, combined = self.loads(layout), self.case.combined
            counts = self.case.scenario.objective
            self._assessed[key] = Assessment(
                impulse_pa_s=combined([each.protected_impulse_pa_s for each in loads]),
                impulse_sim=combined([each.protected_impulse_sim for each in loads]),
                peak_pa=combined([each.protected_peak_pa for each in loads]),
                load=self.case.counted([each.load(counts) for each in loads], layout),
                level=min(each.level for each in loads) if counts.kind == "response" else None,
                in_range=all(each.in_range for each in loads),
            )
        return self._assessed[key]

    def paid(self, layout: Sequence[Element]) -> float:
        """Return what a layout is worth as rewards are paid: in psi s, psi, or without a unit."""
        return self.case.scenario.objective.paid(self.assess(layout).load)

    def loads(self, layout: Sequence[Element]) -> list[BlastLoads]:
        """Return the loads with a layout, one a threat of the case.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        pairs = [(layout, threat) for threat in self.case.threats]
        return self.evaluator.loads_of_many(pairs)

    def counted_loads(self, layout: Sequence[Element]) -> tuple[float, ...]:
        """Return the load that counts with a layout, in the objective's unit, one a threat."""
        counts = self.case.scenario.objective
        return tuple(each.load(counts) for each in self.loads(layout))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Layouts, one a case, against no barrier on the same threats.

    Where there are several cases, each counts alike: a case's reduction is 1 - load with the
    barrier / without it, each as the case combines its threats (the mean, unless the scenario's
    objective says otherwise), and the intervals are those of the mean over cases. With a single
    case they are those over its threats, and there is none for CVaR and worst. Intervals are 95 %
    confidence intervals; they say nothing about how right the model is.

    Attributes:
        cases: The cases; each has as many threats.
        layouts: One a case.
        loads: On the protected structures with the layouts, in the unit of the objective
            (cases, threats); see `BlastLoads.load`.
        unprotected: The same without a barrier (cases, threats).
        in_range: Whether the calibration was made for it (cases, threats); all, unless given.
        cvar_level: Level of `cvar`: 0.8 is the mean of the worst 20 %.

    Raises:
        BlastEnvError: If nothing arrives at the protected structures of a case without a barrier.
    """

    cases: tuple[Case, ...]
    layouts: tuple[Layout, ...]
    loads: FloatArray
    unprotected: FloatArray
    in_range: BoolArray
    cvar_level: float = CVAR_LEVEL

    def __post_init__(self) -> None:
        check_cvar_level(self.cvar_level)
        check_something_arrives(self.cases, self.unprotected)

    @property
    def has_one_case(self) -> bool:
        """Whether there is but one case, so that intervals and worst are over its threats."""
        return len(self.cases) == 1

    @property
    def _is_mean(self) -> bool:
        """Whether a layout is worth the mean over the charges, and its cost does not count."""
        return self.cases[0].is_mean and self.cases[0].scenario.objective.target is None

    @cached_property
    def case_reductions(self) -> FloatArray:
        """The reduction in each case (cases,)."""
        bare = self._of_cases(self.unprotected, [()] * len(self.cases))
        return reductions(self._of_cases(self.loads, self.layouts), bare)

    @cached_property
    def reduction(self) -> Estimate:
        """The mean reduction with its 95 % interval."""
        if self.has_one_case and self._is_mean:
            return reduction_estimate(self.loads[0], self.unprotected[0])
        if self.has_one_case:
            return Estimate(float(self.case_reductions[0]), np.nan, np.nan)
        value, low, high = mean_estimate(self.case_reductions)
        return Estimate(value, low, min(high, 1.0))  # no reduction is above 1

    def difference(self, other: "Comparison") -> Estimate:
        """Return by how much the mean reduction is above another's, with its paired interval.

        Args:
            other: Other layouts on the same cases.
        """
        if self.has_one_case and self._is_mean:
            # As a reduction: of what is left if all that this takes off more is taken off.
            bare = self.unprotected[0]
            left = bare + self.loads[0] - other.loads[0]
            return reduction_estimate(left, bare)
        return mean_estimate(self.case_reductions - other.case_reductions)

    @property
    def worst_reduction(self) -> float:
        """The least reduction in any case; with a single one, under any threat.

        Threats that do nothing without a barrier are left out.
        """
        if not self.has_one_case:
            return float(self.case_reductions.min())
        return float(np.nanmin(reductions(self.loads[0], self.unprotected[0])))

    @property
    def mean(self) -> Estimate:
        """Mean load with the layouts, in the unit of the objective."""
        return mean_estimate(self._samples(self.loads))

    @property
    def unprotected_mean(self) -> Estimate:
        """Mean load without a barrier, over the same samples."""
        return mean_estimate(self._samples(self.unprotected))

    @property
    def cvar(self) -> float:
        """Mean load of the worst cases (threats of a single one) with the layouts."""
        return conditional_value_at_risk(self._samples(self.loads), self.cvar_level)

    @property
    def unprotected_cvar(self) -> float:
        """The same without a barrier."""
        return conditional_value_at_risk(self._samples(self.unprotected), self.cvar_level)

    def _samples(self, loads: FloatArray) -> FloatArray:
        """Return what means and tails are over: the cases, or the threats of a single one."""
        combined = [case.combined(row) for case, row in zip(self.cases, loads, strict=True)]
        samples: FloatArray = loads[0] if self.has_one_case else np.array(combined)
        return samples

    def _of_cases(self, loads: FloatArray, layouts: Sequence[Layout]) -> FloatArray:
        """Return what layouts are worth in each case (cases,)."""
        rows = zip(self.cases, loads, layouts, strict=True)
        return np.array([case.counted(row, layout) for case, row, layout in rows])


def compare(
    evaluators: Evaluators,
    cases: Sequence[Case],
    layouts: Sequence[Sequence[Element]],
    processes: int = 1,
    *,
    cvar_level: float = CVAR_LEVEL,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Hold layouts against no barrier, each on the threats of its case.

    Args:
        evaluators: Run the blasts and remember them.
        cases: At least one; each has as many threats.
        layouts: One a case: (row, column) of the cells that hold a module, in any order.
        processes: Worker processes; they change nothing but the time.
        cvar_level: The worst share 1 - `cvar_level` makes the CVaR.
        progress: Called with the share of the blasts that is done.

    Raises:
        LayoutError: If a layout does not fit the build zone of its case.
        CalibrationError: If a scenario names no calibration, or one that was made with other
            parameters or another engine.
        BlastEnvError: If there are no cases, a threat is there twice, `processes` or `cvar_level`
            is out of bounds, or nothing arrives in a case even without a barrier.
    """
    check_cvar_level(cvar_level)
    if not cases:
        raise BlastEnvError("cases: there are none, must be at least one")
    cells = [
        tuple(check_layout(case.scenario, layout))
        for case, layout in zip(cases, layouts, strict=True)
    ]
    blasts = list(_both(evaluators, cases, cells, processes, progress))
    return Comparison(
        cases=tuple(cases),
        layouts=tuple(cells),
        loads=_counted(cases, [protected for protected, _ in blasts]),
        unprotected=_counted(cases, [bare for _, bare in blasts]),
        in_range=np.array([[load.in_range for load in protected] for protected, _ in blasts]),
        cvar_level=cvar_level,
    )


def loads_of_both(
    evaluator: BlastEvaluator,
    case: Case,
    layout: Sequence[Element],
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> tuple[tuple[BlastLoads, ...], tuple[BlastLoads, ...]]:
    """Return the loads with a layout and without a barrier, one a threat of the case each.

    Raises:
        BlastEnvError: As for `compare`.
    """
    check_distinct(case.threats)
    pairs = [(each, threat) for threat in case.threats for each in (layout, ())]
    loads = evaluator.loads_of_many(pairs, processes, progress)
    return tuple(loads[0::2]), tuple(loads[1::2])


def check_something_arrives(cases: Sequence[Case], unprotected: FloatArray) -> None:
    """Refuse a case in which there is nothing to reduce.

    Args:
        cases: The cases.
        unprotected: Load on the protected structures without a barrier (cases, threats).

    Raises:
        BlastEnvError: If it is 0 under every threat of a case; the message says of which.
    """
    for case, mean in zip(cases, np.atleast_2d(unprotected).mean(axis=1), strict=True):
        if not mean > 0.0:
            raise BlastEnvError(
                f"{case.name or case.scenario.name}: nothing arrives at the protected structures "
                f"without a barrier ({len(case.threats)} threats): there is nothing to reduce"
            )


def _both(
    evaluators: Evaluators,
    cases: Sequence[Case],
    layouts: Sequence[Layout],
    processes: int,
    progress: Callable[[float], None] | None,
) -> Iterator[tuple[tuple[BlastLoads, ...], tuple[BlastLoads, ...]]]:
    """Yield the loads with and without the layout of each case.

    The blasts of cases that follow each other on one scenario are run together.
    """
    done = 0
    for _, group in groupby(zip(cases, layouts, strict=True), lambda each: id(each[0].scenario)):
        together = list(group)
        pairs = [
            (cells, threat)
            for case, layout in together
            for threat in case.threats
            for cells in (layout, ())
        ]
        tell = share_of(progress, done, len(cases), len(together))
        evaluator = evaluators.of(together[0][0].scenario)
        loads = iter(evaluator.loads_of_many(pairs, processes, tell))
        for case, _ in together:
            check_distinct(case.threats)
            own = list(islice(loads, 2 * len(case.threats)))
            yield tuple(own[0::2]), tuple(own[1::2])
        done += len(together)


def _counted(cases: Sequence[Case], loads: Sequence[Sequence[BlastLoads]]) -> FloatArray:
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


def case_table(comparison: Comparison) -> "pd.DataFrame":
    """Return one row a case; see `CASE_COLUMNS`."""
    rows = []
    for index, (case, layout) in enumerate(zip(comparison.cases, comparison.layouts, strict=True)):
        threat = case.threats[0]
        rows.append(
            {
                "scenario": case.scenario.name,
                "seed": threat.seed,
                **charge_values(threat.charge_against(case.scenario, layout)),
                "modules": len(layout),
                "load": case.counted(comparison.loads[index], layout),
                "unprotected_load": case.counted(comparison.unprotected[index]),
                "unit": case.scenario.objective.unit,
                "reduction": float(comparison.case_reductions[index]),
                "in_range": bool(comparison.in_range[index].all()),
            }
        )
    return table_of(rows, CASE_COLUMNS)


def comparison_record(comparison: Comparison, engine: Engine) -> dict[str, Any]:
    """Return a comparison as what JSON knows; NaN is `None`."""
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


def estimate_record(estimate: Estimate) -> dict[str, float | None]:
    """Return an estimate with its interval as what JSON knows."""
    value, low, high = map(number_or_none, estimate)
    return {"value": value, "ci95_low": low, "ci95_high": high}
