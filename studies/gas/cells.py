"""Effect of cell size on the reductions of layouts and on their order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np
from scipy.stats import spearmanr

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas.settings import CELLS
from blast_env.geometry import Layout
from blast_env.runner import run_all
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.statistics import reductions
from studies.gas.loads import impulse_until, protected_impulse_pa_s


@dataclass(frozen=True, eq=False)
class CellLoads:
    """Loads of layouts with one choice of cells.

    Attributes:
        cells: The choice, for display.
        unprotected_pa_s: Impulse without a barrier.
        impulse_pa_s: Impulse with each layout (layouts,).
        cpu_s: Mean CPU time of a blast.
    """

    cells: str
    unprotected_pa_s: float
    impulse_pa_s: FloatArray
    cpu_s: float

    @property
    def reduction(self) -> FloatArray:
        """Relative reduction of the impulse by each layout (layouts,)."""
        without = np.full_like(self.impulse_pa_s, self.unprotected_pa_s)
        return reductions(self.impulse_pa_s, without)


@dataclass(frozen=True)
class CellDifference:
    """Differences between loads with coarse and with fine cells.

    Attributes:
        impulse: Mean of coarse over fine impulse minus 1, over the layouts and no barrier.
        reduction: Mean difference of the reductions, coarse minus fine.
        largest: Difference of the reductions with the largest magnitude.
        rank: Rank correlation of the impulses of the layouts; NaN for fewer than 3 layouts.
    """

    impulse: float
    reduction: float
    largest: float
    rank: float


def cell_loads(
    scenario: Scenario,
    layouts: Sequence[Layout],
    charge: Charge,
    engine: GasEngine,
    until_s: float | None = None,
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> CellLoads:
    """Run one blast without a barrier and one with each layout.

    Args:
        scenario: The scenario.
        layouts: The layouts.
        charge: The charge.
        engine: The engine with the choice of cells.
        until_s: Time at which loads are read; the end of the run unless given.
        processes: Number of worker processes.
        progress: Called with the finished share of the blasts.
    """
    run = partial(_load, scenario, charge, engine, until_s)
    loads, times_s = np.array(run_all(run, [(), *layouts], processes, progress)).T
    return CellLoads(engine.cell_words, float(loads[0]), loads[1:], float(times_s.mean()))


def _load(
    scenario: Scenario, charge: Charge, engine: GasEngine, until_s: float | None, layout: Layout
) -> tuple[float, float]:
    start, blast = process_time(), GasBlast(scenario, layout, 0, engine, charge)
    if until_s is None:
        impulse = protected_impulse_pa_s(blast.run())
    else:
        impulse = impulse_until(blast, until_s)
    return impulse, process_time() - start


def engine_with(choice: str) -> GasEngine:
    """Return the engine with a named choice of cells, or with cells of one side in m."""
    return GasEngine.with_cells(choice if choice in CELLS else float(choice))


def difference(coarse: CellLoads, fine: CellLoads) -> CellDifference:
    """Return the differences between two choices on their common layouts, the first ones."""
    count = min(len(coarse.impulse_pa_s), len(fine.impulse_pa_s))
    one, other = coarse.impulse_pa_s[:count], fine.impulse_pa_s[:count]
    off = np.append(one / other, coarse.unprotected_pa_s / fine.unprotected_pa_s) - 1.0
    apart = coarse.reduction[:count] - fine.reduction[:count]
    return CellDifference(
        impulse=float(off.mean()),
        reduction=float(apart.mean()),
        largest=float(apart[np.abs(apart).argmax()]),
        rank=float(spearmanr(one, other).statistic) if count > 2 else np.nan,
    )
