"""Effect of growing cells on the loads on each wall of a large site, and their cost."""

from dataclasses import dataclass, replace
from time import process_time
from typing import Final

import numpy as np
import pandas as pd

from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas.settings import CELLS
from blast_env.geometry import Layout
from blast_env.site import Scenario
from studies.gas.loads import protected_impulse_pa_s

OFF_COLUMNS: Final = ("impulse_pa_s", "peak_pa")
_SMALL_LOAD: Final = 0.05


@dataclass(frozen=True, eq=False)
class CellChoice:
    """A blast with one choice of cells.

    Attributes:
        cells: The choice, for display.
        impulse_pa_s: Mean impulse on the protected structures, by weight.
        walls: Impulse and largest overpressure on each wall and roof of the protected structures.
        updates: Number of cell updates, two per step.
        cpu_s: CPU time.
    """

    cells: str
    impulse_pa_s: float
    walls: pd.DataFrame
    updates: int
    cpu_s: float

    def off_percent(self, other: "CellChoice", column: str) -> tuple[float, float]:
        """Return the mean and the largest difference from another choice over the walls, %.

        Only walls with more than 5 % of the largest impulse are included.
        """
        impulse = other.walls["impulse_pa_s"]
        counting = np.asarray(impulse > _SMALL_LOAD * impulse.max())
        off = 100.0 * (self.walls[column] / other.walls[column] - 1.0)[counting].abs()
        return float(off.mean()), float(off.max())


def engine_with(choice: str, until_s: float | None = None) -> GasEngine:
    """Return the engine with a named choice of cells, or with cells of one side in m."""
    until = "structures" if until_s is None else until_s
    cells = choice if choice in CELLS else float(choice)
    return replace(GasEngine.with_cells(cells), until=until)


def cell_choice(scenario: Scenario, layout: Layout, engine: GasEngine) -> CellChoice:
    """Run a blast with a choice of cells."""
    began = process_time()
    result = GasBlast(scenario, layout, 0, engine).run()
    cpu_s = process_time() - began
    protected = [each.name for each in scenario.structures if each.protected]
    walls = result.walls[result.walls["structure"].isin(protected)]
    walls = walls.set_index(["structure", "face"])[[*OFF_COLUMNS]]
    return CellChoice(
        engine.cell_words,
        protected_impulse_pa_s(result),
        walls,
        result.run.solver.cell_updates,
        cpu_s,
    )
