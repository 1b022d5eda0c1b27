"""The error of the cells: Roache's grid convergence index of loads and reductions.

Final statements run on fine cells, and once more, for the worst charge, on cells twice as large.
The index of a number f of both runs is

    GCI = F |f_fine - f_coarse| / (r^p - 1)

with the ratio r of the sizes of the cells, the order p of the method and a factor of safety F
(Roache 1994, 1998). Roache takes F = 1.25 where three sizes show the order, and F = 3 where two
sizes leave it assumed. Here there are two sizes, so F = 3; docs/engineers/gas.md has the order
assumed, and measures how often the index covers the numbers on still smaller cells.

The index is absolute: that of a load is a load, that of a reduction a share. It bounds neither the
error of the model nor the spread of charges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan
from typing import Final, TypeAlias

from blast_env.errors import BlastEnvError
from blast_env.evaluation.answers import percent, points, with_errors, worse
from blast_env.evaluation.cases import LoadCase, LoadCaseSet
from blast_env.evaluation.engines.contract import BlastLoads, Engine
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.geometry import Layout
from blast_env.statistics import reductions

ORDER: Final = 2.0
"""Assumed order of convergence: that of the method in smooth flow."""

FACTOR: Final = 3.0
"""Factor of safety with two sizes of cells."""

RATIO: Final = 2.0
"""Ratio of the sizes of the cells of an engine and of its `Engine.coarser`."""

LoadOf: TypeAlias = Callable[[BlastLoads], float]
"""Selects a number from the loads of a blast: that of a building, or the objective."""


def convergence_index(
    fine: float,
    coarse: float,
    ratio: float = RATIO,
    order: float = ORDER,
    factor: float = FACTOR,
) -> float:
    """Return Roache's grid convergence index of a number on the fine cells, in its unit.

    `ratio` is the side of the coarse cells over that of the fine ones.

    Raises:
        BlastEnvError: If `ratio` is not above 1, or `order` or `factor` is not above 0.
    """
    for name, value, least in (("ratio", ratio, 1.0), ("order", order, 0.0), ("factor", factor, 0)):
        if not value > least:
            raise BlastEnvError(f"{name} is {value:g}, must be above {least:g}")
    return float(factor * abs(fine - coarse) / (ratio**order - 1.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class CellErrors:
    """The loads of one charge with two sizes of cells, and the error of numbers made of them.

    Attributes:
        fine: Loads with the layout and without a barrier on the fine cells.
        coarse: The same on the coarse ones.
    """

    fine: tuple[BlastLoads, BlastLoads]
    coarse: tuple[BlastLoads, BlastLoads]

    def of_reduction(self, load_of: LoadOf, bare_of: LoadOf | None = None) -> float:
        """Return the error of the reduction of a load, as an absolute share; NaN without one.

        `bare_of` selects the load without a barrier, if it is another.
        """
        fine, coarse = (
            reductions(load_of(protected), (bare_of or load_of)(unprotected)).item()
            for protected, unprotected in (self.fine, self.coarse)
        )
        return convergence_index(fine, coarse)

    def of_load(self, load_of: LoadOf) -> float:
        """Return the error of a load with the layout as a share of it; NaN of no load."""
        return self._share(0, load_of)

    def of_unprotected(self, load_of: LoadOf) -> float:
        """Return the error of a load without a barrier as a share of it; NaN of no load."""
        return self._share(1, load_of)

    def _share(self, number: int, load_of: LoadOf) -> float:
        fine, coarse = load_of(self.fine[number]), load_of(self.coarse[number])
        return convergence_index(fine, coarse) / fine if fine > 0.0 else nan


@dataclass(frozen=True, eq=False, kw_only=True)
class GridError(CellErrors):
    """The error of the cells for a layout under one charge of a case.

    Attributes:
        case: The scenario and the objective.
        layout: The layout.
        threat: The charge.
        coarser: The engine with the coarse cells.
    """

    case: LoadCaseSet
    layout: Layout
    threat: LoadCase
    coarser: Engine

    @property
    def reduction(self) -> float:
        """Error of the reduction in the objective, as an absolute share; NaN without one."""
        case = self.case
        return self.of_reduction(
            lambda loads: case.objective_value([self.objective(loads)], self.layout),
            lambda loads: case.objective_value([self.objective(loads)]),
        )

    def objective(self, loads: BlastLoads) -> float:
        """Return the load in the unit of the objective."""
        return loads.load(self.case.scenario.objective)

    @property
    def words(self) -> str:
        """The coarse cells and the formula, for a line below a result."""
        return (
            f"(cells): grid convergence index against {self.coarser.words}, under the worst charge"
            f" (factor {FACTOR:g}, order {ORDER:g})"
        )

    @property
    def impulse_words(self) -> str:
        """The impulse on the protected structures, its reduction, and the errors of both."""

        def impulse_of(loads: BlastLoads) -> float:
            return loads.protected_impulse_pa_s

        def text(number: int, share: float) -> str:
            pa_s = impulse_of(self.fine[number])
            return with_errors(f"{pa_s:,.0f} Pa s", "" if isnan(share) else f"{share * pa_s:,.0f}")

        protected = text(0, self.of_load(impulse_of))
        words = "impulse on the protected structures under the worst charge"
        if not self.layout:
            return f"{words}: {protected}"
        gone = reductions(*map(impulse_of, self.fine)).item()
        share = with_errors(percent(gone), points(self.of_reduction(impulse_of)))
        return (
            f"{words}: {text(1, self.of_unprotected(impulse_of))} without barrier, "
            f"{protected} with, reduction {share}{worse(gone)}"
        )


def grid_error(
    coarser: BlastEvaluator | None,
    case: LoadCaseSet,
    layout: Layout,
    threat: LoadCase,
    fine: tuple[BlastLoads, BlastLoads],
    processes: int = 1,
) -> GridError | None:
    """Return the error of the cells for a layout under a charge; `None` without coarser cells.

    `coarser` runs the two blasts with the coarse cells. By convention the charge is the one with
    the largest load behind the layout; `fine` has its loads with the layout and without a barrier.
    """
    if coarser is None:
        return None
    protected, unprotected = coarser.loads_of_many([(layout, threat), ((), threat)], processes)
    return GridError(
        case=case,
        layout=layout,
        threat=threat,
        coarser=coarser.engine,
        fine=fine,
        coarse=(protected, unprotected),
    )
