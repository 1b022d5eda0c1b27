"""What cells of several sizes change, and what they cost, against uniform ones."""

from dataclasses import dataclass
from time import process_time

from blast_env.engines.gas import GasBlast, GasEngine
from blast_env.geometry import Layout
from blast_env.scenario import Scenario
from studies.gas.loads import protected_impulse_pa_s


@dataclass(frozen=True)
class CellChoice:
    """A blast with one choice of cells.

    Attributes:
        cells: The choice.
        impulse_pa_s: Impulse on the protected structures.
        peak_pa: Largest overpressure on their walls that count.
        cell_updates: Cells moved on; a step counts as two.
        cpu_s: CPU time.
    """

    cells: str
    impulse_pa_s: float
    peak_pa: float
    cell_updates: int
    cpu_s: float


def cell_choice(scenario: Scenario, layout: Layout, engine: GasEngine) -> CellChoice:
    """Run a blast with a choice of cells."""
    began = process_time()
    result = GasBlast(scenario, layout, 0, engine).run()
    cpu_s = process_time() - began
    table = result.structures
    return CellChoice(
        engine.words.split(", ")[1],
        protected_impulse_pa_s(result),
        float(table[table["protected"]]["peak_pa"].max()),
        result.run.solver.cell_updates,
        cpu_s,
    )
